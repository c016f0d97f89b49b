r"""The disturbances of a record one by one: the parts between quiet ones.

The range of a signal within a moving span is its activity. It does not depend on the level, so a new operating point is
as quiet as the old one. A disturbance begins where the activity of a channel is several times that of the quiet record,
and ends where all channels have been quiet for some seconds again. Fault, clearing, the swings that follow and an
oscillation that dies out are one disturbance therefore.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from errorscreen.data.moves import detect_event
from errorscreen.data.observations import Observation
from errorscreen.data.preparation import LEAST_MOVE
from errorscreen.data.resampling import check_holes
from errorscreen.data.signals import quantisation_step
from errorscreen.events import Playback
from errorscreen.exceptions import InputError

_Array = NDArray[np.float64]
#: s of the moving span: it holds a good part of a swing, and so does not see its crest as a rest
_SPAN = 1.0
#: parts of the span, and the least number of readings in it
_PARTS, _LEAST_READINGS = 8, 8
#: s of rest that end a disturbance: more than half a period of the slowest swings between areas, 0.1 Hz
REST = 5.0
#: part of the record that is quieter than the rest counts as quiet: a file of events is mostly quiet
_QUIET = 0.2
#: multiples of the quiet activity from which a disturbance begins, and under which it has ended
_BEGINS, _ENDS = 5.0, 2.5
#: the same as parts of the largest activity of the channel
_BEGINS_OF_LARGEST, _ENDS_OF_LARGEST = 0.1, 0.05
#: and as multiples of the resolution: a reading at rest may flip up and down by one step
_BEGINS_OF_FLIPS, _ENDS_OF_FLIPS = 2.5, 2.0
#: largest part of the largest activity that the resolution of a meter may be
_FLIPS = 0.25
#: s and least number of readings before a disturbance that its instant is looked for in
_BEFORE, _READINGS_BEFORE = 2.0, 20


@dataclass(frozen=True)
class Disturbance:
    """A disturbance of a record.

    Parameters
    ----------
    time : float
        Instant at which it begins, in seconds.
    end : float
        Instant from which the record is quiet again, or its end.
    channel : str
        The one with the largest excursion.
    size : float
        Its largest distance from the level before, in its unit.
    """

    time: float
    end: float
    channel: str
    size: float


def find_disturbances(
    time: _Array, channels: Mapping[str, _Array], *, least: float = LEAST_MOVE
) -> list[Disturbance]:
    """Find the disturbances of a record.

    Parameters
    ----------
    time : ndarray of shape (L,)
        Seconds, increasing.
    channels : mapping of str to ndarray of shape (L,)
        Readings with NaN for gaps; V, P and Q are looked at where there is one of them, else all.
    least : float
        Smaller moves are none, in the unit of the channels.

    Returns
    -------
    list of Disturbance
        In their order. Those smaller than a tenth of the largest one in every channel are left out.

    Raises
    ------
    InputError
        If the record is nearly all holes, as where one stamp lies far from the others.

    Examples
    --------
    >>> t = np.arange(0, 60, 0.02)
    >>> P = 0.8 - 0.3 * (t >= 10) * np.exp(-np.maximum(t - 10, 0)) - 0.1 * (t >= 40)
    >>> [(one.time, round(one.size, 3)) for one in find_disturbances(t, {"P": P})]
    [(10.0, 0.3), (40.0, 0.1)]
    """
    watched = {name: v for name, v in channels.items() if name in ("V", "P", "Q")} or channels
    signals = {}
    for name, values in watched.items():
        if np.isfinite(values).sum() >= 2 * _LEAST_READINGS:
            signals[name] = values
    merged = _merged([span for values in signals.values() for span in _active(time, values, least)])
    ends = [float(time[0]), *(end for _, end in merged)]
    before = max(_BEFORE, _READINGS_BEFORE * float(np.median(np.diff(time))))
    found = (
        _described(time, signals, max(former, begin - before), begin, min(end, float(time[-1])), least)
        for (begin, end), former in zip(merged, ends, strict=False)
    )
    return [one for one in found if one is not None]


def _active(time: _Array, values: _Array, least: float) -> list[tuple[float, float]]:
    """Parts of a record, as first and last instant, in which a signal moves."""
    known = np.isfinite(values)
    t, x, origin = time[known], values[known], float(time[0])
    part = max(_SPAN, _LEAST_READINGS * float(np.median(np.diff(t)))) / _PARTS
    check_holes(time, part, "disturbances")
    bins = ((t - origin) / part).astype(np.int64)
    starts = np.flatnonzero(np.diff(bins, prepend=-1))
    low = np.full(bins[-1] + 1, np.inf)
    high = np.full(bins[-1] + 1, -np.inf)
    low[bins[starts]], high[bins[starts]] = np.minimum.reduceat(x, starts), np.maximum.reduceat(x, starts)
    if len(low) < 2 * _PARTS:
        return []
    with np.errstate(invalid="ignore"):
        ranges = sliding_window_view(high, _PARTS).max(axis=1) - sliding_window_view(low, _PARTS).min(axis=1)
    ranges = np.where(np.isfinite(ranges), ranges, 0.0)
    quiet, largest, step = float(np.quantile(ranges, _QUIET)), float(ranges.max()), quantisation_step(x)
    # a signal of a few levels, as of a simulation, has no resolution
    flips = step if step < _FLIPS * largest else 0.0
    begins = max(_BEGINS * quiet, _BEGINS_OF_LARGEST * largest, _BEGINS_OF_FLIPS * flips, least)
    ends = max(_ENDS * quiet, _ENDS_OF_LARGEST * largest, _ENDS_OF_FLIPS * flips, 0.5 * least)
    moving = np.concatenate([[False], ranges > ends, [False]])
    edges = np.flatnonzero(np.diff(moving.astype(int)))
    found = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if ranges[first:last].max() > begins:
            # the move enters window `first` at its end, and leaves at its start
            begin = origin + part * (first + _PARTS - 1) if first else origin
            found.append((begin, max(begin, origin + part * last)))
    return found


def _merged(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Spans that lie less than `REST` apart as one, in their order."""
    found: list[tuple[float, float]] = []
    for begin, end in sorted(spans):
        if found and begin < found[-1][1] + REST:
            found[-1] = (found[-1][0], max(found[-1][1], end))
        else:
            found.append((begin, end))
    return found


def _described(
    time: _Array, channels: Mapping[str, _Array], start: float, begin: float, end: float, least: float
) -> Disturbance | None:
    """Instant, largest channel and size of a disturbance; None for one that began before the record."""
    inside = slice(*np.searchsorted(time, (start, end + _SPAN)))
    parts = {name: values[inside] for name, values in channels.items()}
    try:
        onset = detect_event(time[inside], parts, least=least)
    except InputError:
        if begin <= time[0]:
            return None
        onset = begin
    before = time[inside] < onset
    sizes = {}
    for name, values in parts.items():
        if np.isfinite(values[before]).any():
            sizes[name] = float(np.nanmax(np.abs(values - np.nanmedian(values[before]))))
    if not sizes:
        return None
    channel = max(sizes, key=lambda name: sizes[name])
    return Disturbance(float(onset), float(end), channel, sizes[channel])


def fault_end(observation: Observation) -> float | None:
    """Instant in s at which a fault ends: where what is injected has come back by half of its largest deviation.

    The voltage tells, or the power where that is imposed. None where neither comes back within a second, as after a
    step, and for an event that is no playback.
    """
    event, time = observation.event, observation.time
    if not isinstance(event, Playback):
        return None
    name = "P" if event.by_power else "V"
    deviation = np.abs(event.signals[name] - event.initial[name])
    near = (time >= event.start) & (time <= event.start + 1.0)
    if not near.any():
        return None
    worst = np.flatnonzero(near)[np.argmax(deviation[near])]
    back = np.flatnonzero(deviation[worst:] < 0.5 * deviation[worst])
    if len(back) and time[worst + back[0]] <= event.start + 1.0:
        return float(time[worst + back[0]])
    return None
