"""Bounded, damped Gauss-Newton search from several starts at once."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular

from errorscreen._runtime.sampling import generator
from errorscreen.calibration.quadratic import damped_minima

#: damping values of one batch, relative to the last one that worked
_DAMPINGS = 10.0 ** np.arange(-3, 4)
_FIRST_DAMPING, _LARGEST_DAMPING, _SMALLEST_DAMPING = 0.1, 1e6, 1e-9
#: keeps the normal matrix of an undamped step positive definite in floating point
_JITTER = 1e-12
#: a decrease below this share of the tolerance is no progress
_NO_PROGRESS = 1e-2
#: share of the χ² beyond noise that counts as one standard deviation of one parameter, where it is larger
_BEYOND = 0.1
#: steps along the prior: shares that are tried, most steps, and inverse weight of the residuals in them
_SHARES, _PRIOR_STEPS, _PRIOR_WEIGHT = (1.0, 0.5, 0.25, 0.125), 3, 100.0

_Array = NDArray[np.float64]


@dataclass
class Track:
    """One start and its current point u (k,), with residuals (N,), objective `cost`, and Jacobian (N, k) unless u is
    newer. `latest` is the last Jacobian, `damping` the last value that worked, `promise` the decrease of the objective
    that the undamped linear model promised. The state is ``"active"``, ``"converged"``, ``"kink"`` (no step lowers the
    objective by enough, though less than one standard deviation is promised, as where a limiter begins to act) or
    ``"stalled"`` (more is promised).
    """

    u: _Array
    residuals: _Array
    cost: float
    jacobian: _Array | None = None
    latest: _Array | None = None
    central: bool = False
    damping: float = _FIRST_DAMPING
    promise: float = np.inf
    state: str = "active"


class BoundedSearch:
    r"""Minimise :math:`\sum z_i(u)^2 + \sum (u_j / s)^2` inside bounds, from several starts in lockstep.

    Each iteration evaluates two batches for all starts together: the differences of the residuals z, and one trial
    point for each of seven damping values. A step is the exact minimiser of the damped linear model inside the bounds
    (`damped_minima`); a clipped Levenberg–Marquardt step would get stuck as soon as a bound is active. `tilt` adds a
    linear term to the objective.

    Differences are one-sided until they lead no further, and central from there on: where a limiter begins to act, the
    slope of one side promises a descent that no step keeps, or hides one on the other side. NaN residuals mark a failed
    evaluation: a trial point that is not taken, or a side of a central difference that is not used.

    Parameters
    ----------
    residuals : callable
        (n, k) → (n, N).
    lower, upper : array-like of shape (k,)
    prior : float
        Standard deviation s of the Gaussian prior of each u around 0.
    tol : float
        Converged where the undamped step inside the bounds promises to lower the objective by less than
        ``tol * max(1, χ²/N, (χ² - N) / 10)``. If only noise is left, a decrease by 1 is one standard deviation of one
        parameter; residuals beyond noise are smooth, and it is larger then (`noise_inflation`).
    step : float
        Step of the differences in u.
    central : bool
        Whether differences become central at the end.

    Attributes
    ----------
    tracks : list of Track
    slope : ndarray of shape (k,)
        Of the linear function of u that `tilt` subtracts.

    Examples
    --------
    >>> search = BoundedSearch(lambda u: 10 * (u - 0.2), [-1.0], [1.0], prior=10.0, tol=1e-6, step=1e-4)
    >>> search.begin([[0.9], [-0.9]])
    >>> while search.iterate():
    ...     pass
    >>> search.best.u.round(3)
    array([0.2])
    """

    def __init__(
        self,
        residuals: Callable[[_Array], _Array],
        lower: ArrayLike,
        upper: ArrayLike,
        *,
        prior: float,
        tol: float,
        step: float,
        central: bool = True,
    ) -> None:
        self._residuals = residuals
        self._lower, self._upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        self._prior, self._tol, self._step, self._central = prior, tol, step, central
        self.slope = np.zeros(len(self._lower))
        self.tracks: list[Track] = []

    def begin(self, starts: ArrayLike) -> None:
        """Evaluate starts (s, k) and add those that do not fail to the tracks."""
        u = np.clip(np.atleast_2d(np.asarray(starts, dtype=float)), self._lower, self._upper)
        z = self._residuals(u)
        costs = self._costs(u, z)
        self.tracks += [Track(u[i], z[i], float(costs[i])) for i in np.flatnonzero(np.isfinite(costs))]

    def alone(self, track: Track) -> BoundedSearch:
        """Return another search of the same objective, with one track."""
        other = copy(self)
        other.tracks = [track]
        return other

    @property
    def untilted(self) -> float:
        """Objective of the best track without the linear term of `tilt`."""
        return float(self.best.cost + self.best.u @ self.slope)

    def tilt(self, slope: ArrayLike) -> None:
        """Subtract a linear function of u with this slope (k,) from the objective."""
        self.slope = np.asarray(slope, dtype=float)
        for track in self.tracks:
            track.cost = float(self._costs(track.u, track.residuals))

    @property
    def best(self) -> Track:
        """The track with the lowest objective."""
        return min(self.tracks, key=lambda track: track.cost)

    def iterate(self) -> bool:
        """Move every active track once; return whether any is still active."""
        active = self._active()
        self._differentiate(active)
        going_on = []
        for track in active:
            A, g = self.normal_equations(track)
            track.promise = self._promise(track, A, g)
            if track.promise < self._enough(track):
                self._stop(track, "converged")
            else:
                going_on.append((track, A, g))
        if going_on:
            self._try_steps(going_on)
        return bool(self._active())

    def undamped(self, track: Track) -> Track | None:
        """A track at the minimum of the linear model inside the bounds, whether the objective falls there or not; None
        where that promises too little, or fails.
        """
        self.differentiate([track])
        A, g = self.normal_equations(track)
        promise = self._promise(track, A, g)
        if promise < self._enough(track):
            return None
        u = np.clip(track.u + self._minima(track, A, g, [0.0])[0], self._lower, self._upper)
        z = self._residuals(u[None])[0]
        cost = float(self._costs(u, z))
        return (
            replace(track, u=u, residuals=z.copy(), cost=cost, jacobian=None, promise=promise)
            if np.isfinite(cost)
            else None
        )

    def differentiate(self, tracks: list[Track]) -> None:
        """Give each track a Jacobian by central differences."""
        for track in tracks:
            if not track.central:
                track.central, track.jacobian = True, None
        self._differentiate(tracks)

    def follow_prior(self, track: Track) -> None:
        """Move a track towards the prior's mean in directions that hardly change its residuals; its state stays.
        Where limiters act, or more than noise is left, a search ends anywhere on a ridge: a dead band of which one side
        acted keeps the start's value on the other.
        """
        for _ in range(_PRIOR_STEPS):
            self.differentiate([track])
            A, _ = self.normal_equations(track, 1.0 / _PRIOR_WEIGHT)
            step = self._minima(track, A, track.u / self._prior**2, [0.0])[0]
            moved = np.clip(track.u + np.outer(_SHARES, step), self._lower, self._upper)
            wanted = (track.u @ track.u - moved[0] @ moved[0]) / self._prior**2
            if wanted < self._tol:
                break
            z = self._residuals(moved)
            costs = self._costs(moved, z)
            told = (z**2).sum(axis=1) - track.residuals @ track.residuals
            costs[~(told < self._enough(track))] = np.inf
            best = int(costs.argmin())
            if not track.cost - costs[best] > self._tol:
                break
            track.u, track.residuals, track.cost = moved[best], z[best].copy(), float(costs[best])
            track.jacobian = None
        self.differentiate([track])

    def _differentiate(self, tracks: list[Track]) -> None:
        """Give each track a Jacobian if it has none; all differences are one batch."""
        tracks = [track for track in tracks if track.jacobian is None]
        if not tracks:
            return
        ends = [self._ends(track) for track in tracks]
        z = self._residuals(np.concatenate([_moved(t.u, end) for t, end in zip(tracks, ends, strict=True)]))
        batches = np.split(z, np.cumsum([end.size for end in ends])[:-1])
        for track, end, batch in zip(tracks, ends, batches, strict=True):
            values = batch.reshape(*end.shape, -1)
            failed = np.asarray(np.isnan(values).any(axis=-1))
            end = np.where(failed, track.u, end)
            values = np.where(failed[..., None], track.residuals, values)
            # the other end of a one-sided difference is the track itself
            other, there = (end[1], values[1]) if track.central else (track.u, track.residuals)
            width = end[0] - other
            track.jacobian = track.latest = (
                (values[0] - there) / np.where(width != 0, width, 1.0)[:, None]
            ).T

    def _ends(self, track: Track) -> _Array:
        """Values of each parameter at which residuals are needed, (2, k) or (1, k)."""
        if track.central:
            return np.clip([track.u + self._step, track.u - self._step], self._lower, self._upper)
        inwards = np.where(track.u <= 0.5 * (self._lower + self._upper), self._step, -self._step)
        return np.clip([track.u + inwards], self._lower, self._upper)

    def _stop(self, track: Track, state: str) -> None:
        """End a track, or continue with central differences after one-sided ones."""
        if track.central or not self._central:
            track.state = state
        else:
            track.central, track.jacobian = True, None
            track.damping = min(track.damping, _FIRST_DAMPING)

    def normal_equations(self, track: Track, inflation: float = 1.0) -> tuple[_Array, _Array]:
        """Half the Gauss-Newton Hessian (k, k) and half the gradient (k,); for `inflation` see `noise_inflation`."""
        assert track.jacobian is not None
        J = track.jacobian
        A = J.T @ J / inflation + np.eye(len(track.u)) / self._prior**2
        g = (J.T @ track.residuals - 0.5 * self.slope) / inflation + track.u / self._prior**2
        return A, g

    def scattered(self, track: Track, widths: ArrayLike, random_state: Any = None) -> _Array:
        """Points (n, k) around a track, inside the bounds, by `widths` (n,) standard deviations of its linear model."""
        assert track.latest is not None
        w = np.asarray(widths, dtype=float)[:, None]
        # not from J'J: where a model nearly diverges, rounding leaves it indefinite
        factor = np.linalg.qr(np.vstack([track.latest, np.eye(len(track.u)) / self._prior]), mode="r")
        draws = generator(random_state).standard_normal((len(w), len(track.u)))
        return np.clip(track.u + w * solve_triangular(factor, draws.T).T, self._lower, self._upper)

    def _active(self) -> list[Track]:
        return [track for track in self.tracks if track.state == "active"]

    def _costs(self, u: _Array, z: _Array) -> _Array:
        return np.asarray((z**2).sum(axis=-1) + ((u / self._prior) ** 2).sum(axis=-1) - u @ self.slope)

    def _unit(self, track: Track) -> float:
        """Decrease of the objective that is one standard deviation of one parameter."""
        return max(1.0, float(np.mean(track.residuals**2)))

    def _enough(self, track: Track, share: float = 1.0) -> float:
        """Smallest decrease of the objective that counts, see `tol`."""
        beyond = _BEYOND * float(track.residuals @ track.residuals - len(track.residuals))
        return self._tol * max(share * self._unit(track), beyond)

    def promise(self, track: Track) -> float:
        """Decrease of the objective that the undamped linear model promises."""
        return self._promise(track, *self.normal_equations(track))

    def _promise(self, track: Track, A: _Array, g: _Array) -> float:
        d = self._minima(track, A, g, [0.0])[0]
        return float(-(2 * g @ d + d @ A @ d))

    def _minima(self, track: Track, A: _Array, g: _Array, dampings: ArrayLike) -> _Array:
        """Minimisers (n, k) of the damped linear model inside the bounds, for damping values (n,)."""
        scale = np.sqrt(np.diag(A))
        A, g = A / np.outer(scale, scale), g / scale
        low, high = (self._lower - track.u) * scale, (self._upper - track.u) * scale
        return damped_minima(A, g, low, high, np.asarray(dampings, dtype=float) + _JITTER) / scale

    def _try_steps(self, systems: list[tuple[Track, _Array, _Array]]) -> None:
        """Evaluate all damping values of all tracks in one batch, and take the best of each track."""
        tracks = [track for track, *_ in systems]
        dampings = np.array([track.damping * _DAMPINGS for track in tracks])
        steps = np.array([self._minima(*system, d) for system, d in zip(systems, dampings, strict=True)])
        trials = np.clip(np.array([t.u for t in tracks])[:, None] + steps, self._lower, self._upper)
        z = self._residuals(trials.reshape(-1, trials.shape[-1])).reshape(*trials.shape[:2], -1)
        for track, damping, trial, values in zip(tracks, dampings, trials, z, strict=True):
            costs = self._costs(trial, values)
            costs[np.isnan(costs)] = np.inf
            best = int(np.argmin(costs))
            gain = track.cost - costs[best]
            if gain > 0:
                track.u, track.residuals, track.cost = trial[best], values[best].copy(), float(costs[best])
                track.jacobian = None
                track.damping = max(damping[best], _SMALLEST_DAMPING)
            elif track.damping < _LARGEST_DAMPING:
                track.damping *= _DAMPINGS[-1] / _DAMPINGS[0] * 10  # the next seven lie above all of these
                continue
            if gain < self._enough(track, _NO_PROGRESS):
                self._stop(track, "kink" if track.promise < self._unit(track) else "stalled")


def _moved(u: _Array, ends: _Array) -> _Array:
    """Points (s * k, k) with one parameter at a time at its end (s, k)."""
    points = np.tile(u, (*ends.shape, 1))
    diagonal = np.arange(len(u))
    points[:, diagonal, diagonal] = ends
    return points.reshape(-1, len(u))
