"""Intervals of what a response does not react to where it is: thresholds, known as far as nothing would change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.hypotheses import PRIOR, Hypothesis
from errorscreen.discovery.ranking import Cause, half_width, stamped
from errorscreen.discovery.signatures import objectives, projected

#: causes that are less probable are not looked at closely
_PROBABLE = 0.05
#: the linear model says nothing of a parameter whose standard deviation is at least this share of the prior's
_FLAT = 0.7
#: values tried at once on each side, and how often what lies between the last good and the first bad one is divided
_POINTS, _ROUNDS = 12, 4
#: steps in which the other parameters follow
_FOLLOWED = 2

_Array = NDArray[np.float64]


def with_profiles(causes: Sequence[Cause], hypotheses: Sequence[Hypothesis]) -> tuple[list[Cause], int]:
    r"""Causes with profiled intervals for thresholds, timers and whatever the linear model says nothing of.

    A recording in which a voltage of 326 V does nothing and one of 321 V trips tells of the threshold that it lies
    between them; the derivative is zero anywhere there. Such a parameter is moved away from its value, the others
    follow as the linear model says, and the interval goes on as long as the objective is

    .. math:: F(\theta_j) \le F(\hat\theta) + w^2

    with w the half width in standard deviations (profile likelihood: Venzon and Moolgavkar, Applied Statistics 37,
    1988). It ends at the prior's interval at the latest.

    Parameters
    ----------
    causes : sequence of Cause
    hypotheses : sequence of Hypothesis
        Those that the causes stand for. Causes that are improbable are left as they are.

    Returns
    -------
    causes : list of Cause
    n_simulations : int
    """
    by_name = {h.name: h for h in hypotheses}
    found, count = [], 0
    for cause in causes:
        if cause.parameters and cause.probability >= _PROBABLE:
            hypothesis = by_name[cause.name]
            parameters = dict(cause.parameters)
            for name in _in_question(hypothesis, cause):
                low, high, used = profile(hypothesis, name, half_width(hypothesis, cause.exact))
                parameters[name] = stamped(hypothesis, name, (parameters[name][0], low, high))
                count += used
            cause = replace(cause, parameters=parameters)
        found.append(cause)
    return found, count


def profile(hypothesis: Hypothesis, name: str, width: float) -> tuple[float, float, int]:
    """Lower and upper end of the profile interval of one parameter, and the simulations that it took.

    Parameters
    ----------
    hypothesis : Hypothesis
    name : str
        Of a parameter that was fitted, and does not lie at a bound.
    width : float
        Half width in standard deviations.
    """
    problem = FitProblem(hypothesis.simulator, list(hypothesis.observations), hypothesis.names)
    u, j = hypothesis.u, hypothesis.names.index(name)
    others = np.flatnonzero(hypothesis.free & (np.arange(len(u)) != j))
    J, slope = hypothesis.jacobian[:, others], hypothesis.slope
    # the others stay where they are, or go with it as far as they were fitted together
    alone = np.eye(len(u))[j]
    together = hypothesis.covariance[:, j] / hypothesis.covariance[j, j]
    bounds = np.clip([u[j] - width * PRIOR, u[j] + width * PRIOR], *problem.scaled_bounds[:, j])
    # the right values are where the tilted objective is lowest
    lowest = float(objectives(problem, u[None])[0] - u @ slope)
    ends = []
    for outside in bounds:
        inside = u
        for _ in range(_ROUNDS):
            moves = np.linspace(0.0, outside - inside[j], _POINTS + 1)[1:]
            (first, at), (second, there) = [
                _followed(problem, inside + np.outer(moves, way), J, others, slope)
                for way in (alone, together)
            ]
            objective = np.minimum(first, second)
            rows = np.where((first <= second)[:, None], at, there)
            worse = np.flatnonzero(objective > lowest + width**2)
            good = worse[0] if len(worse) else _POINTS
            inside = rows[good - 1] if good else inside
            if good == _POINTS:
                break
            outside = rows[good, j]
        ends.append(inside[j])
    low, high = problem.space.nominal[j] + problem.space.scales[j] * np.array(ends)
    return float(low), float(high), problem.n_simulations


def _followed(
    problem: FitProblem, rows: _Array, J: _Array, others: NDArray[np.int64], slope: _Array
) -> tuple[_Array, _Array]:
    """Tilted objectives at rows (n, k) and the rows after others have followed: simulated, not as the model says."""
    lower, upper = problem.scaled_bounds
    rows = np.clip(rows, lower, upper)

    def tilted(rows: _Array) -> _Array:
        return np.nan_to_num(objectives(problem, rows) - rows @ slope, nan=np.inf)

    best, lowest = rows, tilted(rows)
    for _ in range(_FOLLOWED):
        predicted, steps = projected(problem, rows, J, others)
        rows = rows.copy()
        rows[:, others] += np.where(np.isfinite(predicted)[:, None], steps, 0.0)
        rows = np.clip(rows, lower, upper)
        objective = tilted(rows)
        better = objective < lowest
        lowest, best = np.minimum(lowest, objective), np.where(better[:, None], rows, best)
    return lowest, best


def _in_question(hypothesis: Hypothesis, cause: Cause) -> list[str]:
    """Parameters of a cause inside their bounds: those of effects with many minima, others if nothing is known."""
    found = []
    for effect in hypothesis.effects:
        for name in map(effect.local, (p.name for p in effect.parameters)):
            if name in cause.parameters:
                j = hypothesis.names.index(name)
                flat = hypothesis.covariance[j, j] >= (_FLAT * PRIOR) ** 2
                if hypothesis.free[j] and (flat or effect.minima > 1):
                    found.append(name)
    return found
