"""Starts that may lead out of a local minimum, which looks exactly like a missing effect, and fits from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import differential_evolution

from errorscreen._runtime.sampling import generator
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.hypotheses import CORNER, SLICE, Hypothesis, JointFit
from errorscreen.discovery.starts.signatures import SPREADS, objectives, projected, spread_over
from errorscreen.effects.base import Effect

#: values of one parameter in a scan of its range
_LINE = 48
#: further values on both sides of the fitted one, as shares of the range: a fit may have stopped beside a cliff
_BESIDE = np.geomspace(1e-4, 0.1, 8)
#: values of all parameters of an effect with many minima that are tried together, for each of `SPREADS`
_CLOUD = 48
#: successive halving: starts that are kept, and iterations of each; and starts that are fitted to the end
_HALVING, _FOLLOWED = ((16, 3), (8, 6)), 3
#: widths of the starts around a stalled fit in standard deviations
_AROUND = np.repeat((3.0, 1.0, 0.3, 0.1), 6)
#: rounds of such starts, all of which must lead no lower
_ROUNDS = 2
#: individuals for each parameter, and generations, of a global search
_CROWD, _GENERATIONS = 16, 80
#: shares of its range by which a parameter is moved off an edge
_OFF = (-0.01, -0.003, 0.003, 0.01)
#: the search for the other parameters there: individuals, their spread in shares of the ranges, and generations
_EDGE_CROWD, _EDGE_SPREADS, _EDGE_GENERATIONS = 32, (0.3, 0.1, 0.03, 0.01), 24

_Array = NDArray[np.float64]


def scan_effect_parameters(
    hypothesis: Hypothesis, problem: FitProblem, random_state: Any = 0, step: float | None = None
) -> list[_Array]:
    """Starts (k,) that promise a lower objective than a fit, the lowest first.
    Each parameter of an effect moves through its range alone, those of an effect with many minima also together; the
    others follow by (D2). A fit finds only the nearest minimum of timers, instants and frequencies.
    """
    rough = problem.with_step(step)
    least = hypothesis.objective if step is None else float(objectives(rough, hypothesis.u[None])[0])
    space, u = problem.space, hypothesis.u
    lines = spread_over(space, 0, np.repeat((np.arange(_LINE) + 0.5)[:, None] / _LINE, len(space), axis=1))
    rng = generator(random_state)
    lower, upper = problem.scaled_bounds
    trials: list[tuple[_Array, NDArray[np.int64]]] = []
    for effect in hypothesis.effects:
        names = [effect.local(p.name) for p in effect.parameters]
        own = [problem.names.index(name) for name in names if name in problem.names]
        for j in own:
            beside = (upper - lower)[j] * np.concatenate([-_BESIDE, _BESIDE])
            values = np.concatenate([lines[:, j], np.clip(u[j] + beside, lower[j], upper[j])])
            trials.append((_moved(u, [j], values[:, None]), np.array([j])))
        if effect.minima > 1:
            cloud = np.repeat(SPREADS, _CLOUD)[:, None] * (upper - lower)[own]
            cloud = np.clip(u[own] + cloud * rng.standard_normal(cloud.shape), lower[own], upper[own])
            trials.append((_moved(u, own, cloud), np.array(own)))
    found: list[tuple[float, _Array]] = []
    for rows, moved in trials:
        others = np.flatnonzero(hypothesis.free & ~np.isin(np.arange(len(u)), moved))
        objective, steps = projected(rough, rows, hypothesis.jacobian[:, others], others)
        best = int(np.argmin(objective))
        if objective[best] < least:
            start = rows[best].copy()
            start[others] += steps[best]
            found.append((float(objective[best]), start))
    return [start for _, start in sorted(found, key=lambda item: item[0])]


def fit_from_starts(
    hypothesis: Hypothesis, problem: FitProblem, starts: ArrayLike, worth: float, step: float | None = None
) -> Hypothesis | None:
    """Fit of a hypothesis from other starts (s, k); None if its objective is not lower by `worth`."""
    fit = fit_with_halving(hypothesis.effects, problem, starts, step).pursue(hypothesis.objective).exact()
    return fit.hypothesis() if fit.objective <= hypothesis.objective - worth else None


def fit_with_halving(
    effects: Sequence[Effect], problem: FitProblem, starts: ArrayLike, step: float | None = None
) -> JointFit:
    """Fit from starts (s, k) by successive halving; for `step` and errors see `JointFit`."""
    fit = JointFit(effects, problem, starts, step=step)
    for kept, iterations in _HALVING:
        fit.keep(kept).run(iterations)
    return fit.keep(_FOLLOWED)


def restart_from_neighbours(
    hypothesis: Hypothesis, problem: FitProblem, least: float, random_state: Any = 0
) -> Hypothesis:
    """Fit of a hypothesis from its own point and from starts that scatter around it, (D6).
    A search may stall where a limiter begins to act: the linear model of one side promises a descent that no step
    keeps. The state is ``"corner"`` if it stalls again, and two rounds of starts lower the objective by less than
    `least`.
    """
    fit = JointFit(hypothesis.effects, problem, hypothesis.u)
    before, rng = fit.objective, generator(random_state)
    fit.run(SLICE)
    for _ in range(_ROUNDS):
        around = fit.scattered(_AROUND, rng)[0]
        starts = np.vstack([fit.reached, around])
        fit = fit_with_halving(hypothesis.effects, problem, starts).pursue(before)
        found = fit.hypothesis()
        if found.at_rest or before - fit.objective >= least:
            return found
    return replace(found, state=CORNER) if found.state == "stalled" else found


def search_all_ranges(problem: FitProblem, random_state: Any = 0) -> _Array:
    """Deviations (k,) at the lowest objective that differential evolution finds (Storn and Price, J. Global
    Optimization 11, 1997), for few parameters with many narrow minima: thresholds and timers that act again and again.
    """
    moved = np.arange(len(problem.names))
    rng = generator(random_state)
    return _evolved(problem, np.zeros(len(moved)), moved, rng, popsize=_CROWD, maxiter=_GENERATIONS)[1]


def move_off_edge(hypothesis: Hypothesis, problem: FitProblem, random_state: Any = 0) -> _Array:
    """Points (s, k) beside a fit, the lowest first, with the most sharply determined parameter of an effect moved.
    A threshold on the very edge of acting makes up for a wrong timer. So it is moved off, and differential evolution
    searches the other parameters of the effects with many minima (at least one); those of the model stay.
    """
    rng = generator(random_state)
    names = [e.local(p.name) for e in hypothesis.effects if e.minima > 1 for p in e.parameters]
    own = np.flatnonzero(np.isin(problem.names, names))
    lower, upper = problem.scaled_bounds
    known = np.linalg.norm(hypothesis.jacobian[:, own], axis=0) * (upper - lower)[own]
    sharpest = own[np.argmax(known)]
    others = own[own != sharpest]
    spread = np.resize(_EDGE_SPREADS, _EDGE_CROWD)[:, None] * (upper - lower)[others]
    found: list[tuple[float, _Array]] = []
    for share in _OFF:
        u = hypothesis.u.copy()
        u[sharpest] += share * (upper - lower)[sharpest]
        u = np.clip(u, lower, upper)
        crowd = np.clip(u[others] + spread * rng.standard_normal(spread.shape), lower[others], upper[others])
        found.append(_evolved(problem, u, others, rng, init=crowd, maxiter=_EDGE_GENERATIONS, tol=0.0))
    return np.array([u for _, u in sorted(found, key=lambda item: item[0])])


def _evolved(
    problem: FitProblem, u: _Array, moved: NDArray[np.int64], rng: np.random.Generator, **options: Any
) -> tuple[float, _Array]:
    """Lowest objective, and the point (k,), that differential evolution of some parameters finds."""
    found = differential_evolution(
        lambda columns: np.nan_to_num(objectives(problem, _moved(u, moved, columns.T)), nan=np.inf),
        problem.scaled_bounds[:, moved].T, polish=False, vectorized=True, updating="deferred", rng=rng, **options,
    )  # fmt: skip
    return float(found.fun), _moved(u, moved, found.x[None])[0]


def _moved(u: _Array, columns: list[int] | NDArray[np.int64], values: _Array) -> _Array:
    """Copies (n, k) of a point with other values (n, d) in some columns."""
    rows = np.tile(u, (len(values), 1))
    rows[:, columns] = values
    return rows
