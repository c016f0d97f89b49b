"""Event, quiet part, held readings and noise of a new recording, and its channels on another grid."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from math import comb

import numpy as np
from numpy.typing import NDArray

from errorscreen.data import moves, resampling, signals
from errorscreen.data.channels import Channel
from errorscreen.exceptions import DataWarning, InputError, check_real

_Array = NDArray[np.float64]
#: In pu: a smaller move is no event.
LEAST_MOVE = 0.002
#: Samples by which a stated event may begin late.
_LATE = 2
#: Least number of samples after the start of the event; fewer are no response.
MIN_AFTER = 5
#: s of a recording that are used before and after its event where it is long, and s that count as long
_BEFORE, _AFTER, _LONG = 10.0, 30.0, 60.0
#: Samples of a stated level before a recording that begins in its event.
_STATED = 20


def in_window(time: _Array, start: float | None, stop: float | None, where: str) -> NDArray[np.bool_]:
    """Mask of the samples from `start` to `stop` seconds, both included; an end that is None is open."""
    first, last = float(time[0]), float(time[-1])
    start, stop = first if start is None else start, last if stop is None else stop
    keep = (time >= start) & (time <= stop)
    if keep.sum() < 2:
        problem = f"the window from {start:g} to {stop:g} s holds {int(keep.sum())} samples"
        raise InputError(problem, where=where, allowed=f"a window within {first:g} to {last:g} s")
    return keep


def find_event(
    time: _Array,
    values: Mapping[str, _Array],
    event_time: float | None,
    notes: list[str],
    where: str,
    stated: bool = False,
) -> float:
    """Return the event time, or detect it from V, P and Q, or from all channels without these.
    With a stated level before it, it is the first instant.
    """
    if stated and event_time is not None:
        remedy = (
            "Leave event_time out: with a stated level, the event begins at t_start, or at the first reading"
        )
        raise InputError("level and event_time are given", where=where, allowed="one of them", remedy=remedy)
    if stated:
        return float(time[0])
    if event_time is not None:
        if not time[0] < event_time <= time[-1]:
            allowed = f"{time[0]:g} to {time[-1]:g} s"
            raise InputError(f"event_time is {event_time:g} s", where=where, allowed=allowed)
        return float(event_time)
    watched = {k: v for k, v in values.items() if k in ("V", "P", "Q")} or values
    start = moves.detect_event(time, watched, least=LEAST_MOVE, where=where)
    notes.append(
        f"The event was taken to begin at {start:g} s, where the first of {', '.join(watched)} leaves its "
        "quiet band."
    )
    return start


def proposed_window(time: _Array, event_time: float) -> tuple[float, float] | None:
    """First and last instant in seconds that a long recording is best cut to; None for a short one."""
    if time[-1] - time[0] <= _LONG:
        return None
    return max(float(time[0]), event_time - _BEFORE), min(float(time[-1]), event_time + _AFTER)


def preceded(
    time: _Array,
    values: Mapping[str, _Array],
    level: Mapping[str, float],
    f_nominal: float,
    notes: list[str],
    where: str,
) -> tuple[_Array, dict[str, _Array], tuple[float, float]]:
    """Put a stated level before a recording that begins in its event; returns time, values and that quiet part.

    The frequency is nominal where it is not stated, the angle turns with it, and other channels are gaps.
    """
    needed = [name for name in ("V", "P", "Q") if name in values]
    missing = [name for name in needed if name not in level]
    unknown = [name for name in level if name not in values]
    if missing or unknown:
        found = f"no {missing[0]}" if missing else f"{unknown[0]!r}, which is no channel"
        raise InputError(
            f"the stated level holds {found}",
            where=f"{where}, level",
            allowed=f"values before the event of {', '.join(needed or values)}",
        )
    for name, value in level.items():
        check_real(value, name, where=f"{where}, level")
    f = float(level.get("f", f_nominal))
    before = float(np.median(np.diff(time))) * np.arange(-_STATED, 0)
    out = {name: np.concatenate([np.full(_STATED, level.get(name, np.nan)), v]) for name, v in values.items()}
    if "f" in values:
        out["f"][:_STATED] = f
    if "angle" in values:
        known = values["angle"][np.isfinite(values["angle"])]
        out["angle"][:_STATED] = known[0] + 2 * np.pi * (f - f_nominal) * before
    told = ", ".join(f"{name} = {value:g}" for name, value in level.items())
    notes.append(
        f"The recording has no quiet part: it was taken to begin with the event, at {time[0]:g} s, and the level "
        f"before it was stated as {told}. Errors of that level are errors of the model."
    )
    warnings.warn(f"{where}: {notes[-1]}", DataWarning, stacklevel=3)
    stamps = np.concatenate([time[0] + before, time])
    return stamps, out, (float(stamps[0]), float(stamps[_STATED - 1]))


def quiet_part(time: _Array, start: float, where: str) -> tuple[float, float]:
    """First and last instant before the event, less two samples or a twentieth, because filters run ahead."""
    before = time[time < start]
    guard = max(2, int(np.ceil(0.05 * len(before))))
    if len(before) - guard < signals.MIN_QUIET:
        raise InputError(
            f"{len(before)} samples lie before the event at {start:g} s",
            where=where,
            allowed=f"at least {signals.MIN_QUIET + guard}",
            remedy="Use a recording that starts earlier, or correct event_time; or set t_start to the event, and state "
            "the values before it: level",
        )
    return float(before[0]), float(before[-1 - guard])


def check_rest(
    time: _Array,
    values: Mapping[str, _Array],
    event: float,
    quiet: tuple[float, float],
    notes: list[str],
    where: str,
    *,
    stated: bool = True,
) -> None:
    """Refuse a clear move before a stated event, and warn of a small one in the quiet part, perhaps a switching.

    An oscillation or a ramp up to the event is warned of, too, unless no channel shows a sudden event.
    """
    watched = {name: values[name] for name in ("V", "P", "Q") if name in values}
    found = {
        name: moves.event_move(*moves.measured(time, v), least=LEAST_MOVE)
        for name, v in watched.items()
        if stated  # an event that was found begins with the first clear move
    }
    for name, move in moves.voters(found).items():
        t, _ = moves.measured(time, watched[name])
        if move.clear + _LATE < np.searchsorted(t, event):
            raise InputError(
                f"{name} moves from {t[move.onset]:g} s on, before the stated event at {event:g} s, so there is no "
                "quiet part",
                where=where,
                allowed="an event_time at the first disturbance that is read",
                remedy="Correct event_time, or set t_start behind the earlier disturbance",
            )
    for name, v in watched.items():
        t, x = moves.measured(time, v)
        small, part = moves.first_move(t, x, least=LEAST_MOVE, clear=0.0), t <= quiet[1]
        if small is None or not part[min(small.clear + 2, len(part) - 1)]:
            continue
        first = small.onset
        distance = np.abs(x - np.median(x[: max(first, signals.MIN_QUIET)]))
        notes.append(
            f"{name} moves from {t[first]:g} s on by {np.max(distance[part]) / np.max(distance):.0%} of its largest "
            "excursion, before the event; noise and operating point are taken from there all the same."
        )
        warnings.warn(f"{where}: {notes[-1]}", DataWarning, stacklevel=3)


def check_response(time: _Array, start: float, where: str) -> None:
    """Refuse a recording that ends with its event."""
    after = int(np.sum(time >= start))
    if after < MIN_AFTER:
        raise InputError(
            f"{after} samples lie after the event at {start:g} s",
            where=where,
            allowed=f"at least {MIN_AFTER}",
            remedy="Use a recording or a window that ends later, or correct event_time",
        )


def treat_held(time: _Array, values: dict[str, _Array], held: str, notes: list[str]) -> dict[str, float]:
    """Replace stale repeats by NaN, in place, unless `held` is ``"keep"``; returns the seconds held, by channel."""
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
    time: _Array,
    values: _Array,
    quiet: tuple[float, float] | None,
    known: Mapping[str, float],
    units: Mapping[str, str],
    notes: list[str],
    where: str,
) -> float:
    """Return the known noise of a channel, or estimate it from the quiet part, or without one from differences."""
    if name in known:
        notes.append(f"The noise of {name} was given as {known[name]:g}.")
        return float(known[name])
    if quiet is None:
        noise, note = noise_of_signal(name, time, values, float(time[0]))
        notes.append(note)
        return noise
    noise, resolved = signals.quiet_noise(time, values, quiet, where=f"{where}, channel {name!r}")
    if not resolved:
        size = f"{noise:.2g} {units[name]}".rstrip()
        notes.append(
            f"{name} scatters less before the event than it can resolve, "
            f"so its noise was set to its resolution, {size}."
        )
    return noise


def noise_of_signal(name: str, time: _Array, values: _Array, start: float) -> tuple[float, str]:
    r"""Estimate the noise of a channel that rests before `start`, and say how.

    The scatter of at least `errorscreen.data.signals.MIN_QUIET` readings at rest gives it. With fewer, differences do:
    the k-th ones of white noise have the variance :math:`\binom{2k}{k}\sigma^2`, those of a slow signal vanish, and
    the smallest estimate of the orders 2 to 8 counts.
    """
    known = np.isfinite(values)
    quiet = known & (time < start)
    if quiet.sum() >= signals.MIN_QUIET:
        noise = signals.estimate_noise(time, values, (float(time[quiet][0]), float(time[quiet][-1])))
        return noise, f"The noise of {name} was estimated from the part before {start:g} s."
    readings = values[known]
    orders = [k for k in range(2, 9) if len(readings) > 3 * k]
    estimates = [np.std(np.diff(readings, k)) / np.sqrt(comb(2 * k, k)) for k in orders]
    noise = max(float(min(estimates, default=0.0)), signals.noise_floor(readings))
    return noise, (
        f"The noise of {name} was taken as {noise:.2g}, from differences between readings; a fast signal gives too "
        "much. Errors below the noise are not seen, so state the noise where it is known."
    )


def resampled(
    channel: Channel,
    source: _Array,
    grid: _Array,
    quiet: tuple[float, float],
    max_gap: float | None,
    notes: list[str],
) -> Channel:
    """Channel of readings at the instants `source`, on a grid; its noise is less where a filter takes part of it."""
    values = resampling.interpolate(source, channel.values, grid, max_gap=max_gap)
    noise, step = channel.noise, float(np.median(np.diff(grid)))
    if resampling.low_pass_needed(step, resampling.spacing(source, channel.values)):
        notes.append(f"{channel.name} was low-pass filtered before it was sampled every {step:g} s.")
        readings = np.isfinite(values[signals.within(grid, quiet)]).sum()
        if readings >= signals.MIN_QUIET and not channel.fixed:
            noise = min(noise, signals.estimate_noise(grid, values, quiet))
    return replace(channel, values=values, noise=noise)
