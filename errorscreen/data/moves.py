"""Clear moves of a signal, and the start of the event, from measured signals alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter1d, median_filter, minimum_filter1d

from errorscreen.data.signals import MIN_QUIET, scatter
from errorscreen.exceptions import InputError

_Array = NDArray[np.float64]
#: The quiet band has the half width of so many standard deviations of the noise, and of this part of the channel's
#: largest excursion, so that drift, rounding and the precursors of a filter do not count.
_SIGMAS, _FRACTION = 6.0, 0.05
#: Most bands that are drawn, each from more of the readings before the move.
_ROUNDS = 5
#: A move is clear from this part of the largest excursion on: what moves less before is the noise of the grid.
CLEAR = 0.2
#: Readings in a row that must lie outside the band, so that a single spike does not count.
_PERSIST = 3
#: s in which a sudden move is made: a step behind the filter of a phasor
_SUDDEN = 0.1
#: A move stands out where the range of the readings is so many times that of as long a time before.
_STANDS_OUT = 3.0
#: What leaves the band so many times that before a sudden move is another one, and too small to be clear.
_ONE_MOVE = 5
#: Part of the most sudden move of a channel below which a move is slow, as a ramp of its set-point.
_SLOW = 0.03


def detect_event(
    time: ArrayLike, channels: Mapping[str, ArrayLike], *, least: float = 0.0, where: str | None = None
) -> float:
    """Find the instant at which the first channel leaves its quiet band for a clear move.

    The band lies about the initial median. Its half width is the largest of six standard deviations of the noise, 5 %
    of the channel's largest excursion, and `least`. Three readings in a row must lie outside. A move is clear where it
    reaches 20 % of the largest excursion; smaller ones before it are taken for noise of the grid.

    A channel that oscillates or drifts before the event leaves its band early. Such a move is passed over where a
    sudden one follows that stands out; see `event_move`.

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
    found = {name: event_move(*measured(t, x), least=least) for name, x in arrays.items()}
    voting = voters(found)
    onsets = {name: float(measured(t, arrays[name])[0][move.onset]) for name, move in voting.items()}
    moving = min(onsets, key=lambda name: onsets[name], default=None)
    if moving is None:
        moving = next((name for name, x in arrays.items() if _moves_at_once(x, least)), None)
    elif voting[moving].stands_out or _rests(*measured(t, arrays[moving]), voting[moving].onset):
        return onsets[moving]
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
    outside = distance > max(least, _SIGMAS * _noise(x), CLEAR * _largest(distance))
    return bool((np.convolve(outside[: 2 * MIN_QUIET + 3], np.ones(3), mode="valid") == 3).any())


def _noise(x: _Array) -> float:
    """Standard deviation of noise, as differences of neighbours show it."""
    steps = np.diff(x)
    return 1.4826 * float(np.median(np.abs(steps, out=steps), overwrite_input=True)) / float(np.sqrt(2.0))


def _rests(t: _Array, x: _Array, first: int) -> bool:
    """Whether the readings before `first` start inside the band and drift by less than a tenth of the event."""
    if first < 2:
        return False
    head = x[:first]
    sigma = 1.4826 * float(np.median(np.abs(np.diff(head, 2)))) / np.sqrt(6.0) if first > 2 else 0.0
    drift = abs(float(np.polyfit(t[:first], head, 1)[0])) * float(t[first - 1] - t[0])
    excursion = _largest(np.abs(x - np.median(head)))
    return drift - 3 * sigma * float(np.sqrt(12 / first)) < 0.1 * excursion  # less the drift of mere noise


class Move(NamedTuple):
    """Indices of a clear move: where it begins to leave the quiet band, and where it is clear; and whether it stands
    out of what the signal did before.
    """

    onset: int
    clear: int
    stands_out: bool = False


def measured(time: _Array, values: _Array) -> tuple[_Array, _Array]:
    """Instants and readings without gaps; the same arrays where there are none."""
    known = np.isfinite(values)
    return (time, values) if known.all() else (time[known], values[known])


def voters(moves: Mapping[str, Move | None]) -> dict[str, Move]:
    """Moves of those channels that tell when an event begins: those that stand out, or all where none does."""
    found = {name: move for name, move in moves.items() if move is not None}
    return {name: move for name, move in found.items() if move.stands_out} or found


def event_move(time: ArrayLike, values: ArrayLike, *, least: float = 0.0) -> Move | None:
    """Clear move that begins the event of readings without gaps, None if there is none.

    It is the first one, see `first_move`, but for a ramp or an oscillation before the event. These are passed over
    where a sudden move follows: by 20 % of the largest excursion, and by three times the largest range before, within
    0.1 s or five samples. A ramp is a move below 3 % of the most sudden one. An oscillation does not stand out: the
    range within the time of its move is less than three times that of the readings before.

    Examples
    --------
    >>> t = np.arange(1000) / 50
    >>> swings = 0.1 * np.sin(np.pi * t)
    >>> event_move(t, swings - 0.3 * (t >= 15) * (t < 15.1))
    Move(onset=750, clear=750, stands_out=True)
    """
    t, x = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    length = max(MIN_QUIET, round(_SUDDEN / float(np.median(np.diff(t))))) if len(t) > 1 else 0
    if len(x) < 2 * length + MIN_QUIET:
        return first_move(t, x, least=least)
    move = first_move(t, x, least=least)
    ranges, size = _ranges(x, length)
    sudden = _sudden_move(x, ranges, length, max(least, CLEAR * size))
    if move is None or (sudden is not None and sudden.onset < move.onset - length):
        return sudden
    if sudden is not None and sudden.onset <= move.onset:
        return move._replace(stands_out=True)
    if sudden is None or move.clear + length < sudden.onset:
        own, end = max(length, move.clear - move.onset), move.clear
    elif sudden.onset - move.onset > _ONE_MOVE * length:
        return sudden
    else:  # they are one, and the first of it perhaps what the signal did before
        own, end = length, sudden.onset - length - 1
    around = slice(max(0, move.onset - own), end + 1)
    held = ranges if own == length else _ranges(x, own)[0]
    before = held[: max(0, around.start - own)]  # it may have begun within the band
    stands_out = _stands_out(before, held[around])
    if sudden is None:
        return move._replace(stands_out=stands_out)
    slow = _most(ranges[around]) < _SLOW * _most(ranges)
    return sudden if slow or not stands_out else move._replace(stands_out=True)


def _ranges(x: _Array, length: int) -> tuple[_Array, float]:
    """Range of the readings k to k + `length`, for each k, and that of all of them, without wild ones."""
    plain = median_filter(x, 2 * _PERSIST - 1)
    size = min(length + 1, len(x))
    shift = -(size // 2)
    ranges = maximum_filter1d(plain, size, origin=shift)
    ranges -= minimum_filter1d(plain, size, origin=shift)
    return ranges[: len(x) - size + 1], float(np.ptp(plain))


def _most(ranges: _Array) -> float:
    return float(ranges.max(initial=0.0))


def _stands_out(before: _Array, around: _Array) -> bool:
    """Whether ranges are several times those before, of which there must be enough."""
    return len(before) >= MIN_QUIET and _most(around) >= _STANDS_OUT * _most(before)


def _sudden_move(x: _Array, ranges: _Array, length: int, least: float) -> Move | None:
    """First move by `least` and by several times the largest range before, within the length of the ranges."""
    first = 2 * length  # the ranges before do not overlap with it
    before = np.maximum.accumulate(ranges[:-first])
    least = max(least, _SIGMAS * _noise(x))
    enough = (ranges[first:] >= least) & (before <= ranges[first:] / _STANDS_OUT)
    if not enough.any():
        return None
    k = int(np.argmax(enough))
    # the median lies back by up to 1.5 lengths, and the signal may go on as before
    band, k = max(_FRACTION / CLEAR * least, 1.5 * float(before[k])), first + k
    distance = np.abs(x[k : k + length + _PERSIST] - float(np.median(x[k - length : k + 1])))
    onset, clear = _first_run(distance > max(band, _SIGMAS * _noise(x))), _first_run(distance > least)
    clear = k + (length if clear is None else clear)
    begin = clear if onset is None else k + onset
    return Move(begin, max(begin, clear), True)


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
        largest = _largest(distance)
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


def _largest(distance: _Array) -> float:
    """Largest distance that readings keep `_PERSIST` times in a row, so that a wild one does not count."""
    return float(minimum_filter1d(distance, _PERSIST).max())


def _first_run(mask: NDArray[np.bool_]) -> int | None:
    """Index at which a mask first holds `_PERSIST` times in a row, None if it never does."""
    if len(mask) < _PERSIST:
        return None
    runs = np.convolve(mask, np.ones(_PERSIST, dtype=int), mode="valid") == _PERSIST
    return int(np.argmax(runs)) if runs.any() else None
