"""Noise, quantisation and held readings, from a measured signal alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.exceptions import InputError

_Array = NDArray[np.float64]
#: Least number of samples of a quiet part; fewer say nothing about scatter.
MIN_QUIET = 5
#: No instrument resolves less than this part of its largest reading (accuracy classes are 1e-3 and worse).
RESOLUTION = 1e-5
#: Distances under this part of the largest reading are rounding of the arithmetic.
_ROUNDING = 1e-9


def _measured(values: ArrayLike) -> _Array:
    """Readings without gaps; the same array where there are none."""
    x = np.asarray(values, dtype=float)
    known = np.isfinite(x)
    return x if known.all() else x[known]


def within(time: _Array, interval: tuple[float, float]) -> NDArray[np.bool_]:
    """Mask of the instants (L,) from the first to the last of an interval, both included.

    Examples
    --------
    >>> within(np.array([0.0, 1.0, 2.0]), (0.5, 2.0))
    array([False,  True,  True])
    """
    return (time >= interval[0]) & (time <= interval[1])


def quantisation_step(values: ArrayLike) -> float:
    """Smallest distance between two different readings, 0 where all readings agree.

    Distances under `_ROUNDING` of the largest reading do not count.

    Examples
    --------
    >>> quantisation_step([2.0, 2.5, 2.5, 4.0])
    0.5
    """
    readings = np.unique(_measured(values))
    if len(readings) < 2:
        return 0.0
    gaps = np.diff(readings)
    least = float(gaps.min(where=gaps > _ROUNDING * max(abs(readings[0]), abs(readings[-1])), initial=np.inf))
    return least if np.isfinite(least) else 0.0


def noise_floor(values: ArrayLike, step: float | None = None) -> float:
    r"""Least noise of a channel, in its unit: :math:`q/\sqrt{12}` of its quantisation step q.

    It is at least `RESOLUTION` of the largest reading, and so positive for every channel.

    Examples
    --------
    >>> round(noise_floor([0.0, 0.5, 1.0, 0.5]), 3)
    0.144
    """
    readings = np.asarray(values, dtype=float)
    largest = float(np.max(np.abs(readings), where=np.isfinite(readings), initial=0.0))
    step = quantisation_step(readings) if step is None else step
    # a channel of zeros has no size of its own; 1e-30 keeps the square of the noise a normal number
    return max(step / float(np.sqrt(12.0)), RESOLUTION * (largest if largest > 1e-30 else 1.0))


def scatter(time: ArrayLike, values: ArrayLike) -> float:
    """Standard deviation about a slow trend, in the unit of the values.

    The trend is a parabola (a line under 30 samples, a mean under 10). The second of two fits leaves out spikes,
    which lie more than five robust deviations and three quantisation steps off the first.

    Examples
    --------
    >>> t = np.arange(200) / 60
    >>> noise = np.random.default_rng(0).normal(0, 0.01, 200)
    >>> round(scatter(t, 1 + 0.3 * t + noise), 3)
    0.01
    """
    t, x = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    keep = np.isfinite(x)
    t, x = t[keep], x[keep]
    order = 2 if len(x) >= 30 else 1 if len(x) >= 10 else 0
    if len(x) <= order + 1:
        return 0.0
    basis = np.polynomial.legendre.legvander(np.interp(t, (t[0], t[-1]), (-1.0, 1.0)), order)
    residual = x - basis @ np.linalg.lstsq(basis, x, rcond=None)[0]
    robust = 1.4826 * float(np.median(np.abs(residual)))
    # most readings of a coarsely quantised channel agree, so its robust deviation is 0: steps are no spikes
    near = np.abs(residual) <= max(5 * robust, 3 * quantisation_step(x))
    if not near.all() and near.sum() > order + 1:
        coefficients = np.linalg.lstsq(basis[near], x[near], rcond=None)[0]
        residual = (x - basis @ coefficients)[near]
    return float(np.sqrt(np.sum(residual**2) / (len(residual) - order - 1)))


def correlation_time(*rows: ArrayLike) -> float:
    r"""Integrated autocorrelation time of noise in samples, at least 1, pooled over rows (L,) with zero mean.

    .. math:: \tau = 1 + 2 \sum_{l \ge 1} \rho_l

    summed up to the first correlation that is not positive. n samples tell as much as n / τ independent ones.
    """
    values = [np.nan_to_num(np.asarray(row, dtype=float)) for row in rows]
    longest = max(map(len, values), default=0)
    products = np.zeros(longest)
    for z in values:
        size = 2 ** int(np.ceil(np.log2(max(2 * len(z), 1))))  # zero padding keeps it from wrapping round
        products[: len(z)] += np.fft.irfft(np.abs(np.fft.rfft(z, size)) ** 2, size)[: len(z)]
    if longest < 2 or products[0] <= 0:
        return 1.0
    rho = products[1:] / products[0]
    ends = np.flatnonzero(rho <= 0)
    return float(1.0 + 2.0 * rho[: ends[0] if len(ends) else len(rho)].sum())


def estimate_noise(
    time: ArrayLike, values: ArrayLike, quiet: tuple[float, float], *, where: str | None = None
) -> float:
    """Standard deviation of the measurement noise, from the quiet part before the event.

    Parameters
    ----------
    time, values : array-like of shape (L,)
        Seconds, and readings with NaN for gaps.
    quiet : (float, float)
        First and last instant of the quiet part in seconds.
    where : str, optional
        For the message.

    Returns
    -------
    float
        `scatter` of the quiet part, but at least `noise_floor` of the channel: a held or rounded reading does not
        move but is not free of noise.

    Raises
    ------
    InputError
        If fewer than five readings lie in the quiet part.

    Examples
    --------
    >>> t = np.arange(100) / 50
    >>> x = np.where(t < 1.0, 0.8, 0.5)          # rounded to 0.1: no scatter at all before the event
    >>> round(estimate_noise(t, np.r_[x[:-1], 0.6], (0.0, 0.98)), 4)
    0.0289
    """
    return quiet_noise(time, values, quiet, where=where)[0]


def quiet_noise(
    time: ArrayLike, values: ArrayLike, quiet: tuple[float, float], *, where: str | None = None
) -> tuple[float, bool]:
    """As `estimate_noise`, and whether it is what the readings scatter by, and not the least noise of the channel."""
    t, x = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    part = within(t, quiet)
    count = int(np.isfinite(x[part]).sum())
    if count < MIN_QUIET:
        raise InputError(
            f"{count} readings in the quiet part from {quiet[0]:g} to {quiet[1]:g} s say nothing about noise",
            where=where,
            allowed=f"at least {MIN_QUIET} readings before the event",
            remedy="Use a recording that starts earlier, or give event_time and the noise of each channel",
        )
    # a quiet part of equal readings does not show the resolution, but the event does
    step = quantisation_step(x[part]) or quantisation_step(x)
    found, least = scatter(t[part], x[part]), noise_floor(x, step)
    return max(found, least), found >= least


def hold_length(values: ArrayLike) -> int:
    """Number of samples over which a meter holds each reading; 1 where every sample is a new reading.

    A channel at rest also repeats its reading, so only the parts in which the signal clearly moves count.

    Examples
    --------
    >>> hold_length(np.repeat(np.sin(np.arange(40.0)), 3)), hold_length(np.sin(np.arange(40.0)))
    (3, 1)
    """
    x = _measured(values)
    if len(x) < 12:
        return 1
    clear = max(10 * quantisation_step(x), _ROUNDING * float(np.abs(x).max()))
    starts = np.flatnonzero(np.r_[True, np.diff(x) != 0])
    jumps = np.abs(np.diff(x[starts], prepend=x[0], append=x[-1]))
    lengths = np.diff(starts, append=len(x))
    # only runs with a clear jump at both ends: the signal did not rest there
    moving = (jumps[:-1] > clear) & (jumps[1:] > clear)
    repeated = lengths[moving & (lengths > 1)]
    # a meter that is read slightly faster than it updates repeats only some readings
    if len(repeated) < max(3, 0.25 * moving.sum()):
        return 1
    return round(float(np.median(repeated)))


def drop_held(values: ArrayLike, hold: int) -> NDArray[np.float64]:
    """Replace stale repeats by NaN: every `hold`-th of each run of equal readings stays.

    Examples
    --------
    >>> drop_held([1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 3.0], 2)
    array([ 1., nan,  2., nan,  2., nan,  3.])
    """
    x = np.array(values, dtype=float)
    new = np.r_[True, np.diff(x) != 0]
    index = np.arange(len(x))
    since = index - np.maximum.accumulate(np.where(new, index, 0))
    x[since % hold != 0] = np.nan
    return x
