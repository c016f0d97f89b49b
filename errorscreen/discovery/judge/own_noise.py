"""Recordings with the noise that belongs to a model with its effects, and fits with it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.sampling import generator
from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.hypotheses import SLICE, SLICES, Hypothesis, JointFit
from errorscreen.discovery.starts.signatures import projected, spread_over
from errorscreen.exceptions import SimulationError
from errorscreen.simulators.base import Simulator

#: values drawn of the parameters of effects, from how many of which fits start
_DRAWS, _STARTS = 256, 15
#: starts that are kept, and iterations with so many
_HALVING = ((16, 3), (8, 6), (6, SLICE * SLICES))

_Array = NDArray[np.float64]


def own_noise(
    hypothesis: Hypothesis, simulator: Simulator, measured: Sequence[Observation]
) -> list[Observation]:
    """Recordings with the noise of injected signals as it passes through a hypothesis with its effects.
    `measured` has the noise that was estimated without effects; the simulator may have another step than the
    hypothesis.
    """
    before = simulator.parameters.nominal  # noise was estimated without effects
    before[[simulator.parameters.index(e.local(e.strength.name)) for e in hypothesis.effects]] = 0.0
    return [simulator.with_uncertainty(o, hypothesis.theta, before) for o in measured]


def refitted(
    hypothesis: Hypothesis, measured: Sequence[Observation], random_state: Any = 0
) -> tuple[Hypothesis, _Array, int]:
    """A hypothesis fitted with its own noise, the ends (s, k) of fits from other starts, and the number of simulations.
    An effect can have several minima that differ by less than noise, such as a dead band of which one edge is known. So
    fits also start at drawn values of its parameters where (D2) is lowest. The noise energy does not follow effects
    smoothly, so its slope along their parameters is left out. Where nothing can be fitted the hypothesis stays.
    """
    observations = own_noise(hypothesis, hypothesis.simulator, measured)
    problem = FitProblem(hypothesis.simulator, observations, hypothesis.names)
    own = np.isin(hypothesis.names, [e.local(p.name) for e in hypothesis.effects for p in e.parameters])
    rows = np.tile(hypothesis.u, (_DRAWS if own.any() else 1, 1))  # a switch has no values to draw
    shares = generator(random_state).random(rows.shape)
    rows[:, own] = spread_over(problem.space, 0, shares, hypothesis.effects)[:, own]
    rest = np.flatnonzero(~own)
    objective, steps = projected(problem, rows, hypothesis.jacobian[:, rest], rest)
    rows[:, rest] += steps
    best = np.argsort(objective, kind="stable")[:_STARTS]
    starts = rows[best[np.isfinite(objective[best])]]
    try:
        fit = JointFit(hypothesis.effects, problem, np.vstack([hypothesis.u, starts]))
        for kept, iterations in _HALVING:
            fit.keep(kept).run(iterations)
        return fit.hypothesis(~own), fit.reached, problem.n_simulations
    except SimulationError:
        return hypothesis, hypothesis.u[None], problem.n_simulations
