"""Noise, quantisation, held readings and the start of the event, from a measured signal alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.exceptions import InputError

_Array = NDArray[np.float64]
#: Least number of samples of a quiet part; fewer say nothing about scatter.
MIN_QUIET = 5
#: No instrument resolves less than this part of its largest reading (accuracy classes are 1e-3 and worse).
RESOLUTION = 1e-5
#: The quiet band has the half width of so many standard deviations of the noise, and of this part of the channel's
#: largest excursion (99th percentile), so that drift, rounding and the precursors of a filter do not count.
_SIGMAS, _FRACTION = 6.0, 0.05
#: Most bands that are drawn, each from more of the readings before the move.
_ROUNDS = 5
#: A move is clear from this part of the largest excursion on: what moves less before is the noise of the grid.
CLEAR = 0.2
#: Readings in a row that must lie outside the band, so that a single spike does not count.
_PERSIST = 3


def quantisation_step(values: ArrayLike) -> float:
    """Smallest distance between two different readings, 0 where all readings agree.

    Distances under 1e-9 of the largest reading are rounding of the arithmetic and do not count.

    Examples
    --------
    >>> quantisation_step([2.0, 2.5, 2.5, 4.0])
    0.5
    """
    readings = np.asarray(values, dtype=float)
    readings = np.unique(readings[np.isfinite(readings)])
    if len(readings) < 2:
        return 0.0
    gaps = np.diff(readings)
    gaps = gaps[gaps > 1e-9 * np.abs(readings).max()]
    return float(gaps.min()) if len(gaps) else 0.0


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
    t, x = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    part = (t >= quiet[0]) & (t <= quiet[1])
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
    return max(scatter(t[part], x[part]), noise_floor(x, step))


def hold_length(values: ArrayLike) -> int:
    """Number of samples over which a meter holds each reading; 1 where every sample is a new reading.

    A channel at rest also repeats its reading, so only the parts in which the signal clearly moves count.

    Examples
    --------
    >>> hold_length(np.repeat(np.sin(np.arange(40.0)), 3)), hold_length(np.sin(np.arange(40.0)))
    (3, 1)
    """
    x = np.asarray(values, dtype=float)
    x = x[np.isfinite(x)]
    if len(x) < 12:
        return 1
    starts = np.flatnonzero(np.r_[True, np.diff(x) != 0])
    lengths, jumps = np.diff(np.r_[starts, len(x)]), np.abs(np.diff(x[starts], prepend=x[0], append=x[-1]))
    clear = 10 * quantisation_step(x)
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


def detect_event(
    time: ArrayLike, channels: Mapping[str, ArrayLike], *, least: float = 0.0, where: str | None = None
) -> float:
    """Find the instant at which the first channel leaves its quiet band for a clear move.

    The band lies about the initial median. Its half width is the largest of six standard deviations of the noise, 5 %
    of the channel's largest excursion, and `least`. Three readings in a row must lie outside. A move is clear where it
    reaches 20 % of the largest excursion; smaller ones before it are taken for noise of the grid.

    Parameters
    ----------
    time : array-like of shape (L,)
        Seconds, increasing.
    channels : mapping of str to array-like of shape (L,)
        Readings with NaN for gaps.
    least : float
        Least half width of the band in the channels' unit.
    where : str, optional
        For the message.

    Returns
    -------
    float
        Time of the first reading outside, the earliest of all channels.

    Raises
    ------
    InputError
        If no channel leaves its band, or one moves from the first reading on.

    Examples
    --------
    >>> t = np.arange(100) / 50
    >>> detect_event(t, {"V": np.where(t < 1.0, 1.0, 0.7)})
    1.0
    """
    t = np.asarray(time, dtype=float)
    arrays = {name: np.asarray(values, dtype=float) for name, values in channels.items()}
    onsets: dict[str, tuple[float, bool]] = {}
    for name, x in arrays.items():
        keep = np.isfinite(x)
        move = first_move(t[keep], x[keep], least=least)
        if move is not None:
            onsets[name] = (float(t[keep][move.onset]), _rests(t[keep], x[keep], move.onset))
    if onsets:
        moving: str | None = min(onsets, key=lambda name: onsets[name][0])
        start, rests = onsets[str(moving)]
        if rests:
            return start
    else:
        moving = next((name for name, x in arrays.items() if _moves_at_once(x, least)), None)
    if moving:
        raise InputError(
            f"there is no quiet part: {moving!r} moves from its first reading on",
            where=where,
            allowed=f"at least {MIN_QUIET} readings before the event",
            remedy="Use a recording that starts before the event, or give event_time; or state the values before it: "
            "level",
        )
    raise InputError(
        f"no event was found: {', '.join(channels) or 'no channel'} never leaves its quiet band",
        where=where,
        remedy="Give event_time, or check that the recording starts before the event",
    )


def _moves_at_once(values: _Array, least: float) -> bool:
    """Whether the signal leaves its first three readings while the quiet band is still drawn from later ones.

    It must do so by a fifth of its largest excursion and six times the noise, which differences of neighbours show.
    """
    x = values[np.isfinite(values)]
    if len(x) < 2 * MIN_QUIET:
        return False
    distance = np.abs(x - np.median(x[:3]))
    sigma = 1.4826 * float(np.median(np.abs(np.diff(x)))) / np.sqrt(2.0)
    outside = distance > max(least, 6.0 * sigma, 0.2 * float(np.percentile(distance, 99)))
    return bool((np.convolve(outside[: 2 * MIN_QUIET + 3], np.ones(3), mode="valid") == 3).any())


def _rests(t: _Array, x: _Array, first: int) -> bool:
    """Whether the readings before `first` start inside the band and drift by less than a tenth of the event."""
    if first < 2:
        return False
    head = x[:first]
    sigma = 1.4826 * float(np.median(np.abs(np.diff(head, 2)))) / np.sqrt(6.0) if first > 2 else 0.0
    drift = abs(float(np.polyfit(t[:first], head, 1)[0])) * float(t[first - 1] - t[0])
    excursion = float(np.percentile(np.abs(x - np.median(head)), 99))
    return drift - 3 * sigma * float(np.sqrt(12 / first)) < 0.1 * excursion  # less the drift of mere noise


class Move(NamedTuple):
    """Indices of a clear move: where it begins to leave the quiet band, and where it is clear."""

    onset: int
    clear: int


def first_move(
    time: ArrayLike, values: ArrayLike, *, least: float = 0.0, clear: float = CLEAR
) -> Move | None:
    """First clear move of readings without gaps, None if there is none.

    A move is clear from a part `clear` of the largest excursion on; see `detect_event`.
    """
    t, x = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    if len(x) < 2 * MIN_QUIET:
        return None
    size = fewest = max(2 * MIN_QUIET, min(len(x) // 10, 20))
    move = None
    for _ in range(_ROUNDS):
        distance = np.abs(x - float(np.median(x[:size])))
        largest = float(np.percentile(distance, 99))
        band = max(_SIGMAS * scatter(t[:size], x[:size]), _FRACTION * largest, least)
        moved = _first_run(distance > max(band, clear * largest))
        if moved is None:  # with more readings there is no move; fewer say too little
            return move if size < fewest else None
        # it begins behind the last readings in a row that lie in the band
        inside = _first_run((distance <= band)[:moved][::-1])
        before, move = move, Move(0 if inside is None else moved - inside, moved)
        if move.onset == 0 or (before is not None and move.onset == before.onset):
            break
        size = min(2 * size, move.onset)  # a band from more readings
    return move


def _first_run(mask: NDArray[np.bool_]) -> int | None:
    """Index at which a mask first holds `_PERSIST` times in a row, None if it never does."""
    if len(mask) < _PERSIST:
        return None
    runs = np.convolve(mask, np.ones(_PERSIST, dtype=int), mode="valid") == _PERSIST
    return int(np.argmax(runs)) if runs.any() else None
