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
    """Observations of a hypothesis with the noise of injected signals as it passes through the model with its effects.

    A slow control of the reactive power with a large gain makes slow errors of the noise of the voltage, one with a lag
    less of it than the model without.

    Parameters
    ----------
    hypothesis : Hypothesis
    simulator : Simulator
        Of the hypothesis, perhaps with another step.
    measured : sequence of Observation
        With the noise that was estimated without effects, from which what passes less is subtracted: those of a
        hypothesis may have lost it already.
    """
    before = simulator.parameters.nominal  # noise was estimated without effects
    before[[simulator.parameters.index(e.local(e.strength.name)) for e in hypothesis.effects]] = 0.0
    return [simulator.with_uncertainty(o, hypothesis.theta, before) for o in measured]


def refitted(
    hypothesis: Hypothesis, measured: Sequence[Observation], random_state: Any = 0
) -> tuple[Hypothesis, _Array, int]:
    """Return a hypothesis fitted with the noise that belongs to it, and what else does nearly as well.

    Parameters of an effect can have several minima that differ by less than noise does: of a dead band only one edge
    may be known, of a rate limit that it is not reached. So fits also start at values of these parameters drawn all
    over their ranges, where the objective is lowest if the other parameters follow by the linear model, as in (D2).

    The energy of the noise that passes (`errorscreen.calibration.attenuation`) follows the model's parameters smoothly,
    but not those of an effect, a filter or the edge of a dead band, as far as their intervals reach. So its slope along
    these is left out.

    Parameters
    ----------
    hypothesis : Hypothesis
        Where it cannot be fitted it stays as it is.
    measured : sequence of Observation
        See `own_noise`.
    random_state : None, int, SeedSequence, Generator or RandomState

    Returns
    -------
    hypothesis : Hypothesis
    others : ndarray of shape (s, k)
        Where fits from other starts have ended, in units of the scales.
    n_simulations : int
    """
    observations = own_noise(hypothesis, hypothesis.simulator, measured)
    problem = FitProblem(hypothesis.simulator, observations, hypothesis.names)
    own = np.isin(hypothesis.names, [e.local(p.name) for e in hypothesis.effects for p in e.parameters])
    rows = np.tile(hypothesis.u, (_DRAWS, 1))
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
