"""Intervals of the parameters of effects: as far as others can follow without the recordings telling it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.threads import parallel_map
from errorscreen.calibration.intervals import posterior_covariance
from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.result import Estimate
from errorscreen.calibration.search import BoundedSearch
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.hypotheses import PRIOR, Hypothesis
from errorscreen.discovery.judge.acting import acting
from errorscreen.discovery.judge.own_noise import refitted
from errorscreen.discovery.judge.ranking import Cause, NamedEffect, half_width, stamped, titles
from errorscreen.discovery.starts.signatures import objectives

#: causes that are less probable are not looked at closely
_PROBABLE = 0.05
#: how often what lies between the last good and the first bad value is halved at most, to a hundredth of their
#: distance, and no further than to such a share of how far the parameter has gone
_HALVINGS, _RESOLVED = 7, 0.05
#: iterations in which the other parameters follow to a value, and how many times what one gained the others may gain
_FOLLOWED, _MORE = 6, 5.0
#: of their search, see `BoundedSearch`
_TOL, _STEP = 1e-2, 1e-4

_Array = NDArray[np.float64]


def with_profiles(
    causes: Sequence[Cause],
    hypotheses: Sequence[Hypothesis],
    measured: Sequence[Observation],
    random_state: int = 0,
) -> tuple[list[Cause], list[Hypothesis], int]:
    r"""Causes with final values and profiled intervals of their parameters; their last fits; the number of simulations.

    Probable causes are fitted once more with their own noise (`refitted`), and simulated without each of their effects
    to tell when it acts. Then each parameter is moved away from its value while all others are fitted again inside
    their bounds, as long as

    .. math:: F(\theta_j) \le F(\hat\theta) + w^2

    with w the half width in standard deviations (profile likelihood: Venzon and Moolgavkar, Applied Statistics 37,
    1988), at most to the prior's interval. Thresholds and timers have no slope that holds for long, so the linear model
    fails.
    """
    fits, told, count = {h.name: h for h in hypotheses}, [], 0
    for cause in causes:
        if cause.kind in ("effect", "measurement") and cause.probability >= _PROBABLE:
            fits[cause.name], others, used = refitted(fits[cause.name], measured, random_state)
            fit = fits[cause.name]
            parameters, more = _profiled(cause, fit, others)
            cause = replace(cause, parameters=parameters)
            named = tuple(NamedEffect.of(e, cause.values, acting(fit, e)) for e in fit.effects)
            cause = replace(cause, effects=named, title=titles(named))
            count += used + more + 2 * len(named) * len(fit.observations)
        told.append(cause)
    return told, list(fits.values()), count


def _profiled(cause: Cause, hypothesis: Hypothesis, others: _Array) -> tuple[tuple[Estimate, ...], int]:
    """Value and interval of each parameter of a cause, and the simulations that they took."""
    width = half_width(hypothesis, cause.exact)
    names = [p.name for p in cause.parameters]
    ends = parallel_map(
        [partial(profile, hypothesis, name, width, others) for name in names], hypothesis.simulator.threads
    )
    space = hypothesis.simulator.parameters
    values = dict(zip(space.names, hypothesis.theta.tolist(), strict=True))
    parameters = tuple(
        Estimate.of(space[name], *stamped(hypothesis, name, (values[name], low, high)))
        for name, (low, high, _) in zip(names, ends, strict=True)
    )
    return parameters, sum(used for *_, used in ends)


def profile(
    hypothesis: Hypothesis, name: str, width: float, others: ArrayLike = ()
) -> tuple[float, float, int]:
    """Ends of a parameter's profile interval for a half width in standard deviations, and the simulations that it took.
    The ends of other fits, `others` (s, k) in units of the scales, belong to the interval if they fit as well.
    """
    path = _Path(hypothesis, name, width, others)
    low, high = (path.end(sign) for sign in (-1.0, 1.0))
    own = hypothesis.simulator.parameters[name]
    scale = float(own.scale or 1.0)
    return own.nominal + scale * low, own.nominal + scale * high, path.problem.n_simulations


class _Path:
    """Fits in which one parameter is given, and all others follow."""

    def __init__(self, hypothesis: Hypothesis, name: str, width: float, others: ArrayLike) -> None:
        self.problem = FitProblem(hypothesis.simulator, list(hypothesis.observations), hypothesis.names)
        self._u, self._j, self._slope = hypothesis.u, hypothesis.names.index(name), hypothesis.slope
        self._others = np.flatnonzero(np.arange(len(self._u)) != self._j)
        covariance = posterior_covariance(hypothesis.jacobian, PRIOR)
        self._deviation = width * float(np.sqrt(covariance[self._j, self._j]))
        # the others stay where they are, or go with it as far as they were fitted together
        self._ways = np.eye(len(self._u))[self._j], covariance[:, self._j] / covariance[self._j, self._j]
        self._bounds = self.problem.scaled_bounds
        reach = width * PRIOR
        self._last = np.clip([self._u[self._j] - reach, self._u[self._j] + reach], *self._bounds[:, self._j])
        # the right values are where the tilted objective is lowest
        rows = np.vstack([self._u, *np.reshape(others, (-1, len(self._u)))])
        tilted = objectives(self.problem, rows) - rows @ self._slope
        self._limit = float(tilted[0]) + width**2
        self._good = rows[tilted <= self._limit]

    def end(self, sign: float) -> float:
        """How far the parameter can go, in multiples of its scale: ever faster, and then between good and bad."""
        last = self._last[int(sign > 0)]
        good, step = max(self._good, key=lambda row: float(sign * row[self._j])), sign * self._deviation
        while sign * good[self._j] < sign * last:
            aim = good[self._j] + step
            bad = last if sign * aim >= sign * last else aim
            row = self._followed(bad, good)
            if row is None:
                break
            good, step = row, 2.0 * step
        else:
            return float(last)
        for _ in range(_HALVINGS):
            if abs(bad - good[self._j]) < _RESOLVED * abs(good[self._j] - self._u[self._j]):
                break
            middle = 0.5 * (good[self._j] + bad)
            row = self._followed(middle, good)
            good, bad = (good, middle) if row is None else (row, bad)
        return float(good[self._j])

    def _followed(self, value: float, near: _Array) -> _Array | None:
        """The other parameters led from those of a near value to below the limit; None if that fails."""
        starts = [near + (value - near[self._j]) * way for way in self._ways]
        search = BoundedSearch(
            lambda v: self.problem.residuals(self.problem.values(np.insert(v, self._j, value, axis=1))),
            *self._bounds[:, self._others],
            prior=PRIOR,
            tol=_TOL,
            step=_STEP,
            central=False,
        )
        search.tilt(self._slope[self._others])
        search.begin(np.array(starts)[:, self._others])
        if not search.tracks:
            return None
        own = (value / PRIOR) ** 2 - value * self._slope[self._j]
        above, gained = search.best.cost + own - self._limit, np.inf
        for left in range(_FOLLOWED, 0, -1):
            if above <= 0 or above > _MORE * left * gained or not search.iterate():
                break
            before, above = above, search.best.cost + own - self._limit
            gained = before - above
        return np.insert(search.best.u, self._j, value) if above <= 0 else None
