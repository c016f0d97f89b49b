"""What a recording has to know before it can be used: its event, its quiet part, held readings, noise."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from math import comb

import numpy as np
from numpy.typing import NDArray

from errorscreen.data import signals
from errorscreen.exceptions import DataWarning, InputError, unknown_name

#: In pu: what moves less is no event.
LEAST_MOVE = 0.002
#: Part of a channel's largest excursion that it may move before a stated event.
CLEAR_MOVE = 0.2
#: Samples after the start of the event, below which there is no response to compare with.
MIN_AFTER = 5
#: In pu: what is plausible before an event.
PLAUSIBLE_V = (0.5, 1.5)


class Doubt(str):
    """An assumption about a recording that a wrong unit, base or sign would explain."""


def check_extras(
    values: Mapping[str, object], noise: Mapping[str, float], given: Mapping[str, float], where: str
) -> None:
    """Raise `InputError` where the noise of no channel is known, or a measured channel is also given."""
    for name in noise:
        if name not in values:
            raise unknown_name(name, values, kind="channel", where=f"{where}, noise")
    for name in given:
        if name in values:
            raise InputError(f"{name!r} is measured and given", where=where, allowed="one of them")


def in_window(
    time: NDArray[np.float64], start: float | None, stop: float | None, where: str
) -> NDArray[np.bool_]:
    """Which samples lie from `start` to `stop` seconds, both included; an end that is None is open.

    Examples
    --------
    >>> in_window(np.arange(5.0), 1.0, 3.0, "recording")
    array([False,  True,  True,  True, False])
    """
    first, last = float(time[0]), float(time[-1])
    start, stop = first if start is None else start, last if stop is None else stop
    keep = (time >= start) & (time <= stop)
    if keep.sum() < 2:
        raise InputError(
            f"the window from {start:g} to {stop:g} s holds {int(keep.sum())} samples",
            where=where,
            allowed=f"a window within {first:g} to {last:g} s",
        )
    return keep


def find_event(
    time: NDArray[np.float64],
    values: Mapping[str, NDArray[np.float64]],
    stated: float | None,
    notes: list[str],
    where: str,
) -> float:
    """The stated event time, or the one detected from V, P and Q (from all channels if there are none)."""
    if stated is not None:
        if not time[0] < stated <= time[-1]:
            raise InputError(
                f"event_time is {stated:g} s", where=where, allowed=f"{time[0]:g} to {time[-1]:g} s"
            )
        return float(stated)
    watched = {k: v for k, v in values.items() if k in ("V", "P", "Q")} or values
    start = signals.detect_event(time, watched, least=LEAST_MOVE, where=where)
    notes.append(
        f"The event was taken to begin at {start:g} s, where the first of {', '.join(watched)} leaves its "
        "quiet band."
    )
    return start


def quiet_part(time: NDArray[np.float64], start: float, where: str) -> tuple[float, float]:
    """All samples before the event but the last two, or the last twentieth: filters run ahead of it."""
    before = time[time < start]
    guard = max(2, int(np.ceil(0.05 * len(before))))
    if len(before) - guard < signals.MIN_QUIET:
        raise InputError(
            f"{len(before)} samples lie before the event at {start:g} s",
            where=where,
            allowed=f"at least {signals.MIN_QUIET + guard}",
            remedy="Use a recording that starts earlier, or correct event_time",
        )
    return float(before[0]), float(before[-1 - guard])


def check_rest(
    time: NDArray[np.float64],
    values: Mapping[str, NDArray[np.float64]],
    quiet: tuple[float, float],
    notes: list[str],
    where: str,
) -> None:
    """Refuse a quiet part in which a channel moves like in an event, and warn where it moves clearly.

    The event that would be detected if none was stated must not begin there. A small one may be a switching or ambient
    swing; one of `CLEAR_MOVE` of the channel's largest excursion is an event of its own.
    """
    for name in (k for k in ("V", "P", "Q") if k in values):
        keep = np.isfinite(values[name])
        t, x = time[keep], values[name][keep]
        first = signals.first_departure(t, x, least=LEAST_MOVE)
        part = t <= quiet[1]
        if first is None or not part[min(first + 2, len(part) - 1)]:
            continue
        distance = np.abs(x - np.median(x[: max(first, signals.MIN_QUIET)]))
        size = float(np.max(distance[part]) / np.max(distance))
        found = (
            f"{name} moves from {t[first]:g} s on by {size:.0%} of its largest excursion, before the event"
        )
        if size > CLEAR_MOVE:
            raise InputError(
                f"{found}, so there is no quiet part",
                where=where,
                allowed="an event_time at the first disturbance that is read",
                remedy="Correct event_time, or set t_start behind the earlier disturbance",
            )
        notes.append(f"{found}; noise and operating point are taken from there all the same.")
        warnings.warn(f"{where}: {notes[-1]}", DataWarning, stacklevel=3)


def check_response(time: NDArray[np.float64], start: float, where: str) -> None:
    """Refuse a recording that ends with its event: nothing could be compared."""
    after = int(np.sum(time >= start))
    if after < MIN_AFTER:
        raise InputError(
            f"{after} samples lie after the event at {start:g} s",
            where=where,
            allowed=f"at least {MIN_AFTER}",
            remedy="Use a recording or a window that ends later, or correct event_time",
        )


def treat_held(
    time: NDArray[np.float64], values: dict[str, NDArray[np.float64]], held: str, notes: list[str]
) -> dict[str, float]:
    """Replace stale repeats of held channels by NaN, in place, unless `held` is ``"keep"``.

    Returns
    -------
    dict of str to float
        Of each held channel for how many seconds the meter holds a reading.
    """
    ages = {}
    for name, array in values.items():
        hold = signals.hold_length(array)
        if hold == 1:
            continue
        ages[name] = hold * float(np.median(np.diff(time)))
        if held == "drop":
            values[name] = signals.drop_held(array, hold)
            treated = "stale repeats were dropped"
        else:
            treated = "the staircase was kept"
        notes.append(
            f"{name} repeats each reading about {hold} times; {treated}. A reading may be {ages[name]:.2g} s old."
        )
    return ages


def channel_noise(
    name: str,
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    quiet: tuple[float, float],
    known: Mapping[str, float],
    unit: str,
    notes: list[str],
    where: str,
) -> float:
    """The known noise of a channel, or the one estimated from the quiet part."""
    if name in known:
        notes.append(f"The noise of {name} was given as {known[name]:g}.")
        return float(known[name])
    noise = signals.estimate_noise(time, values, quiet, where=f"{where}, channel {name!r}")
    part = (time >= quiet[0]) & (time <= quiet[1])
    if signals.scatter(time[part], values[part]) < noise:
        notes.append(
            f"{name} scatters less before the event than it can resolve, so its noise was set to its "
            f"resolution, {noise:.2g} {unit}".rstrip()
            + "."
        )
    return noise


def noise_of_signal(
    name: str, time: NDArray[np.float64], values: NDArray[np.float64], start: float
) -> tuple[float, str]:
    r"""Noise of a channel of which only `start`, the end of its rest, is known, and how it was estimated.

    With at least `errorscreen.data.signals.MIN_QUIET` readings at rest, from their scatter.
    Else white noise of variance
    :math:`\sigma^2` has k-th differences of variance :math:`\binom{2k}{k}\sigma^2`, while a slow signal has none;
    the smallest estimate of the orders 2 to 8 counts.
    """
    known = np.isfinite(values)
    quiet = known & (time < start)
    if quiet.sum() >= signals.MIN_QUIET:
        return (
            signals.estimate_noise(time, values, (float(time[quiet][0]), float(time[quiet][-1]))),
            f"The noise of {name} was estimated from what lies before {start:g} s.",
        )
    readings = values[known]
    orders = [k for k in range(2, 9) if len(readings) > 3 * k]
    estimates = [np.std(np.diff(readings, k)) / np.sqrt(comb(2 * k, k)) for k in orders]
    noise = max(float(min(estimates, default=0.0)), signals.noise_floor(readings))
    return noise, (
        f"The noise of {name} was taken as {noise:.2g}, from differences between readings: too much if it moves fast. "
        "Errors below the noise are not seen, so state it where it is known."
    )


def warn_implausible(V: float, where: str) -> list[str]:
    """Sentences, also warned of, on a voltage before the event that a wrong unit or base would explain.

    What power is plausible depends on whose it is: a line of a grid carries many times the base.
    """
    if PLAUSIBLE_V[0] <= V <= PLAUSIBLE_V[1]:
        return []
    note = Doubt(f"V before the event is {V:.3g} pu: check its unit and base_kv.")
    warnings.warn(f"{where}: {note}", DataWarning, stacklevel=3)
    return [note]
