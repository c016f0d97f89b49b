"""Ways out of a local minimum, which looks exactly like something that no one knows."""

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

#: values of one parameter that are tried in a search for a way out of a local minimum
_LINE = 48
#: and how far from where it is, on both sides, as shares of the range: a fit may have come to rest beside a cliff
_BESIDE = np.geomspace(1e-4, 0.1, 8)
#: values of all parameters of an effect with many minima that are tried together, for each of `SPREADS`
_CLOUD = 48
#: starts that are kept after so many iterations each, and those that are followed to the end
_HALVING, _FOLLOWED = ((16, 3), (8, 6)), 3
#: starts around a fit whose linear model promises more than steps keep, in standard deviations
_AROUND = np.repeat((3.0, 1.0, 0.3, 0.1), 6)
#: rounds of such starts, all of which must lead no lower
_QUIET = 2
#: individuals for each parameter, and generations, of a global search
_CROWD, _GENERATIONS = 16, 80
#: shares of its range by which a parameter is moved off an edge
_OFF = (-0.01, -0.003, 0.003, 0.01)
#: individuals that scatter around a fit by such shares of the ranges, and generations, of the search for the others
_BESIDE_CROWD, _BESIDE_SPREADS, _BESIDE_GENERATIONS = 32, (0.3, 0.1, 0.03, 0.01), 24

_Array = NDArray[np.float64]


def escapes(
    hypothesis: Hypothesis, problem: FitProblem, random_state: Any = 0, step: float | None = None
) -> list[_Array]:
    """Points from which a fit may reach a lower minimum, the most promising first.

    One parameter of an effect at a time is moved through its range, and the others follow by the linear model, as in
    (D2). What counts are timers, instants and frequencies: of these a fit finds the nearest minimum only. Those of an
    effect with many minima are also moved together, over ever smaller parts of their ranges.

    Parameters
    ----------
    hypothesis : Hypothesis
        Fitted.
    problem : FitProblem
        It was fitted to.
    random_state : None, int, SeedSequence, Generator or RandomState
    step : float, optional
        See `rough_step`.

    Returns
    -------
    list of ndarray of shape (k,)
        Only those that promise less than the hypothesis has reached.
    """
    rough = problem.with_step(step)
    least = hypothesis.objective if step is None else float(objectives(rough, hypothesis.u[None])[0])
    space, u = problem.space, hypothesis.u
    index = {name: j for j, name in enumerate(problem.names)}
    tried: list[tuple[_Array, NDArray[np.int64]]] = []
    lines = spread_over(space, 0, np.repeat((np.arange(_LINE) + 0.5)[:, None] / _LINE, len(space), axis=1))
    rng = generator(random_state)
    lower, upper = problem.scaled_bounds
    for effect in hypothesis.effects:
        own = [
            index[name] for name in map(effect.local, (p.name for p in effect.parameters)) if name in index
        ]
        for j in own:
            beside = (upper - lower)[j] * np.concatenate([-_BESIDE, _BESIDE])
            values = np.concatenate([lines[:, j], np.clip(u[j] + beside, lower[j], upper[j])])
            rows = np.tile(u, (len(values), 1))
            rows[:, j] = values
            tried.append((rows, np.array([j])))
        if effect.minima > 1:
            spread = np.repeat(SPREADS, _CLOUD)[:, None] * (upper - lower)[own]
            rows = np.tile(u, (len(spread), 1))
            rows[:, own] = np.clip(
                u[own] + spread * rng.standard_normal(spread.shape), lower[own], upper[own]
            )
            tried.append((rows, np.array(own)))
    found: list[tuple[float, _Array]] = []
    for rows, moved in tried:
        others = np.flatnonzero(hypothesis.free & ~np.isin(np.arange(len(u)), moved))
        objective, steps = projected(rough, rows, hypothesis.jacobian[:, others], others)
        best = int(np.argmin(objective))
        if objective[best] < least:
            start = rows[best].copy()
            start[others] += steps[best]
            found.append((float(objective[best]), start))
    return [start for _, start in sorted(found, key=lambda item: item[0])]


def followed(
    hypothesis: Hypothesis, problem: FitProblem, starts: ArrayLike, worth: float, step: float | None = None
) -> Hypothesis | None:
    """Fit of a hypothesis from other starts (s, k), of which fewer and fewer are kept.

    Parameters
    ----------
    hypothesis : Hypothesis
        Fitted.
    problem : FitProblem
        It was fitted to.
    starts : array-like of shape (s, k)
    worth : float
        By how much the objective must be lower; else the result is None.
    step : float, optional
        See `rough_step`.

    Raises
    ------
    SimulationError
        If none of the starts can be simulated.
    """
    fit = halved(hypothesis.effects, problem, starts, step).pursue(hypothesis.objective).exact()
    return fit.hypothesis() if fit.objective <= hypothesis.objective - worth else None


def halved(
    effects: Sequence[Effect], problem: FitProblem, starts: ArrayLike, step: float | None = None
) -> JointFit:
    """Fit from starts (s, k), of which fewer and fewer are kept; for `step` see `JointFit`.

    Raises
    ------
    SimulationError
        If none of the starts can be simulated.
    """
    fit = JointFit(effects, problem, starts, step=step)
    for kept, iterations in _HALVING:
        fit.keep(kept).run(iterations)
    return fit.keep(_FOLLOWED)


def rested(hypothesis: Hypothesis, problem: FitProblem, least: float, random_state: Any = 0) -> Hypothesis:
    """Fit of a hypothesis from where it is and from starts that scatter around it, (D6).

    Where limiters begin to act, the slopes on both sides differ, and the linear model of one side promises what no step
    keeps: a search stalls there, be it at a minimum or not. Starts around it see other sides.

    Parameters
    ----------
    hypothesis : Hypothesis
        Fitted.
    problem : FitProblem
        It was fitted to.
    least : float
        The smallest decrease of the objective that counts.
    random_state : None, int, SeedSequence, Generator or RandomState

    Returns
    -------
    Hypothesis
        ``"corner"`` is its state if the search stalled again, and no start of two rounds led lower by what counts.

    Raises
    ------
    SimulationError
        If it cannot be simulated.
    """
    fit = JointFit(hypothesis.effects, problem, hypothesis.u)
    before, rng = fit.objective, generator(random_state)
    fit.run(SLICE)
    for _ in range(_QUIET):
        around = fit.scattered(_AROUND, rng)[0]
        fit = halved(hypothesis.effects, problem, np.vstack([fit.reached, around])).pursue(before)
        found = fit.hypothesis()
        if found.at_rest or before - fit.objective >= least:
            return found
    return replace(found, state=CORNER) if found.state == "stalled" else found


def searched(problem: FitProblem, random_state: Any = 0) -> _Array:
    """Deviations (k,) at the lowest objective that differential evolution finds, in multiples of the scales.

    For few parameters, some of which are thresholds and timers that act again and again: there, all minima are narrow.
    (Storn and Price, J. Global Optimization 11, 1997.)

    Parameters
    ----------
    problem : FitProblem
    random_state : None, int, SeedSequence, Generator or RandomState
    """
    moved = np.arange(len(problem.names))
    return _evolved(
        problem, np.zeros(len(moved)), moved, generator(random_state), popsize=_CROWD, maxiter=_GENERATIONS
    )[1]


def off_the_edge(hypothesis: Hypothesis, problem: FitProblem, random_state: Any = 0) -> _Array:
    """Points (s, k) beside a fit, the lowest first, with the most sharply determined parameter of an effect moved.

    A threshold may have come to rest on the very edge at which something happens at all, where a millionth more or less
    changes when: this makes up for a wrong timer. So it is moved off the edge, and differential evolution searches the
    effects' other parameters there; those of the model stay.

    Parameters
    ----------
    hypothesis : Hypothesis
        Fitted; with at least one effect with many minima, whose parameters are searched.
    problem : FitProblem
        It was fitted to.
    random_state : None, int, SeedSequence, Generator or RandomState
    """
    rng = generator(random_state)
    names = [e.local(p.name) for e in hypothesis.effects if e.minima > 1 for p in e.parameters]
    own = np.flatnonzero(np.isin(problem.names, names))
    lower, upper = problem.scaled_bounds
    known = np.linalg.norm(hypothesis.jacobian[:, own], axis=0) * (upper - lower)[own]
    sharpest = own[np.argmax(known)]
    others = own[own != sharpest]
    spread = np.resize(_BESIDE_SPREADS, _BESIDE_CROWD)[:, None] * (upper - lower)[others]
    found: list[tuple[float, _Array]] = []
    for share in _OFF:
        u = hypothesis.u.copy()
        u[sharpest] += share * (upper - lower)[sharpest]
        u = np.clip(u, lower, upper)
        crowd = np.clip(u[others] + spread * rng.standard_normal(spread.shape), lower[others], upper[others])
        found.append(_evolved(problem, u, others, rng, init=crowd, maxiter=_BESIDE_GENERATIONS, tol=0.0))
    return np.array([u for _, u in sorted(found, key=lambda item: item[0])])


def _evolved(
    problem: FitProblem, u: _Array, moved: NDArray[np.int64], rng: np.random.Generator, **options: Any
) -> tuple[float, _Array]:
    """Lowest objective, and deviations (k,) there, that differential evolution of some parameters finds."""

    def rows(columns: _Array) -> _Array:
        u_ = np.tile(u, (columns.shape[1], 1))
        u_[:, moved] = columns.T
        return u_

    found = differential_evolution(
        lambda columns: np.nan_to_num(objectives(problem, rows(columns)), nan=np.inf),
        problem.scaled_bounds[:, moved].T, polish=False, vectorized=True, updating="deferred", rng=rng, **options,
    )  # fmt: skip
    return float(found.fun), rows(found.x[:, None])[0]
