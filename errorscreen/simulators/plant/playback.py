"""From a recording to the injected signals at a terminal and the channels to compare with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from errorscreen.data import resampling
from errorscreen.data.channels import ROLE_UNITS
from errorscreen.data.observations import Observation
from errorscreen.data.plausibility import doubt
from errorscreen.data.recordings import Recording
from errorscreen.data.signals import scatter, within
from errorscreen.events import IDLE, Playback, SetPointStep
from errorscreen.exceptions import InputError
from errorscreen.simulators.plant.terminal_angle import NO_ANGLE, AngleSource, angle_behind, noise_of_angle

#: plausible P in pu: less is a plant out of service, or a base a hundred times too large; more is a wrong unit or base
LEAST_P, MOST_P = 0.01, 2.0
#: Q of at least this (pu) and this part of P is a power factor below 0.55, which no plant has for long
LARGE_Q, Q_OVER_P = 0.3, 1.5
#: a change of imposed power between two samples that is larger than those beside it by so many pu is a jump, and f is
#: not compared within so many s of it: five filters of `errorscreen.models.measured_voltage`
JUMP, APART_FROM_JUMP = 0.02, 0.1
#: levels of a recorded input and of the model are told apart by more than this part of at least so many pu
APART, _SMALL = 0.05, 0.1


def playback_observation(
    recording: Recording,
    channels: tuple[str, ...],
    *,
    dt: float | None = None,
    needs_angle: bool = True,
    grid_impedance: complex = 0.0,
    operating_point: Mapping[str, float] | None = None,
    driven: Mapping[str, tuple[str, ...]] | None = None,
    imposed: str = "voltage",
    angle_source: AngleSource = NO_ANGLE,
) -> Observation:
    r"""Signals to inject and channels to compare with, on one uniform grid.

    The device starts at an equilibrium, so the angle is taken in a frame that rotates at the mean pre-event frequency:
    the straight line through its quiet part is removed. Where only the frequency was recorded, the angle is its
    integral, :math:`\theta = 2\pi\int (f - f_{pre})\,dt`; without both, `angle_source` gives it. Short gaps of the
    voltage are interpolated, longer ones (`errorscreen.data.resampling.SHORT_GAP`) only before the event, and nothing
    is compared there. With an impedance, the recorded P and Q are injected as well, and so are the quantities that
    drive the device (`Device.driven`). Where power is `imposed`, P and Q are injected alone, and the unit starts at the
    mean voltage and frequency before the event.
    """
    by_power = imposed == "power"
    where = f"recording {recording.name!r}"
    if "V" not in recording.channels:
        raise InputError(
            "the magnitude of the terminal voltage was not recorded",
            where=where,
            allowed="a channel V",
            remedy="Plant playback injects the recorded voltage, so map a column to V"
            if not by_power
            else "The unit starts at this voltage, so map a column to V",
        )
    source = recording.resample(dt)
    time = source.time
    notes = list(source.assumptions)
    quiet = within(time, source.quiet)
    unknown = np.zeros(len(time), dtype=bool)
    signals = {} if by_power else {"V": _filled(source, "V", unknown, notes)}
    power = ["P", "Q"] if grid_impedance or by_power else []
    # behind an impedance a recorded angle counts for every device, as a phase-locked loop follows it
    needs_angle = needs_angle or bool(grid_impedance and {"angle", "f"} & set(source.channels))
    of_angle: dict[str, float] = {}
    if needs_angle:
        signals["angle"], of_angle = _angle(source, quiet, unknown, notes, where, angle_source)
    if by_power:
        signals = _power(source, unknown, notes, where, "voltage that belongs to it", 'imposed = "power"')
        notes.append("The recorded P and Q are imposed on the unit; its voltage and frequency are compared.")
    elif grid_impedance:
        signals |= _power(source, unknown, notes, where)
        notes.append(
            "The plant moves its own voltage: it is driven by the voltage behind the grid's impedance of "
            f"{grid_impedance.real:.3g} + j{grid_impedance.imag:.3g} pu."
        )
    driven = driven or {}
    signals |= {name: _driving(source, name, unknown, notes, where) for name in driven}
    given = {**source.given, **(operating_point or {})}
    initial = source.initial(["V", *(["f"] if by_power and "f" in source.channels else []), *driven])
    notes += [_said_of(name, replaced, initial[name]) for name, replaced in driven.items()]
    for name in ("P", "Q"):
        measured = name in source.channels and np.isfinite(source.channels[name].values[quiet]).any()
        if measured:
            initial[name] = source.initial([name])[name]
        elif name in given:
            initial[name] = float(given[name])
            if name not in source.given:  # else the recording says so itself
                notes.append(
                    f"{name} was not recorded before the event; it is taken as {initial[name]:g} pu."
                )
        else:
            raise InputError(
                f"{name} before the event is unknown: it was not recorded",
                where=where,
                remedy=f"Give it as operating point, for example {name} = 0.5 (pu)",
            )
    if not (by_power and np.hypot(initial["P"], initial["Q"]) < IDLE):
        notes += _warn_implausible(initial["P"], initial["Q"], where)
    notes += [_told(one, source, where) for one in source.steps]
    values = np.full((len(channels), len(time)), np.nan)
    noise = np.ones(len(channels))
    for r, name in enumerate(channels):
        if name in source.channels:
            values[r] = source.channels[name].values
            noise[r] = source.channels[name].noise
    values[:, unknown] = np.nan
    if source.stated:
        values[:, quiet] = np.nan
    if by_power and "f" in channels and (near := _near_jumps(time, signals)).any():
        values[channels.index("f"), near] = np.nan
        notes.append(
            f"f is not compared within {APART_FROM_JUMP:g} s of a jump of P or Q: the angle of the voltage jumps as "
            "well, and f is what the filter of the meter makes of it."
        )
    injected = {} if by_power else {"V": float(source.channels["V"].noise), **of_angle}
    injected |= {name: float(source.channels[name].noise) for name in driven}
    injected |= {name: _scatter(source, name, quiet) for name in power}
    used = {"V", *of_angle, *power, *driven, *channels} & set(source.channels)
    age = max(source.channels[name].age for name in used)
    event = Playback(time, source.name, source.event_time, signals, initial, injected, age, source.steps)
    if event.kind != "disturbance":
        notes.append(f"The event counts as {event.kind}.")
    units = tuple(ROLE_UNITS.get(name, "pu") for name in channels)
    return Observation(event, values, noise, channels, units, tuple(notes))


def input_noise(event: Playback) -> dict[str, tuple[NDArray[np.float64], float]]:
    """Noise of each injected signal: effect of one sample in time, and its standard deviation."""
    found = {name: (np.ones(1), sigma) for name, sigma in event.noise.items() if name != "f"}
    if "f" in event.noise:
        found["angle"] = (np.full(len(event.time), 2 * np.pi * event.dt), event.noise["f"])
    return found


def levels_apart(event: Playback, model: Mapping[str, float]) -> list[str]:
    """Warn of recorded inputs whose level before the event is not that of the model; return the sentences."""
    notes = []
    for name, own in model.items():
        recorded = event.initial[name]
        if abs(recorded - own) > APART * max(abs(own), _SMALL):
            factor = f" (factor {own / recorded:.3g})" if recorded * own > 0 else ""
            notes.append(
                f"{name} before the event was recorded as {recorded:.4g} pu, the model's equilibrium has {own:.4g} pu"
                f"{factor}. Only the recorded deviation is used. If the record has another base, state the factor as "
                f"scale of its column, because the deviation is as wrong; if not, the model's equilibrium is."
            )
    return [doubt(note, f"event {event.name!r}") for note in notes]


def _warn_implausible(P: float, Q: float, where: str) -> list[str]:
    """Warn of an operating point that is rare for a generator but common for a wrong column; return the sentences."""
    notes = []
    if abs(P) < LEAST_P:
        notes.append(f"P before the event is only {P:.2g} pu: check its unit and base_mva.")
    if abs(P) > MOST_P:
        notes.append(f"P before the event is {P:.3g} pu: check its unit and base_mva.")
    if P <= -LEAST_P:
        notes.append(
            f"P before the event is {P:.3g} pu, but generation is positive: check its sign (sign = 'load' in its "
            "column, in waveforms or in phasors)."
        )
    if abs(Q) > max(LARGE_Q, Q_OVER_P * abs(P)):
        notes.append(
            f"Q before the event is {Q:.3g} pu and P {P:.3g} pu: check that they are not interchanged."
        )
    return [doubt(note, where) for note in notes]


def _filled(
    recording: Recording, name: str, unknown: NDArray[np.bool_], notes: list[str], key: str = ""
) -> NDArray[np.float64]:
    """Channel without gaps, as an injected signal must be; long gaps are marked in `unknown`."""
    time, values = recording.time, recording.channels[name].values
    known = np.isfinite(values)
    if known.all():
        return values
    usual = resampling.spacing(time, values)
    edges = np.flatnonzero(np.diff(np.r_[False, ~known, False]))
    for first, last in zip(edges[::2], edges[1::2] - 1, strict=True):
        start, stop = time[max(first - 1, 0)], time[min(last + 1, len(time) - 1)]
        if stop - start <= resampling.SHORT_GAP * usual * (1 + 1e-9):  # at an end of the recording
            continue
        if stop > recording.event_time:
            raise InputError(
                f"{name} was not recorded from {start:g} to {stop:g} s, so the input of the device in the event is "
                "unknown",
                where=f"recording {recording.name!r}",
                allowed=f"gaps of at most {resampling.SHORT_GAP * usual:.3g} s from the event on",
                remedy="End the window before the gap (t_end), or use another recording"
                + (f", or leave {key} out" if key else "")
                + (f", or leave {name} out of inputs" if name in ("Efd", "Pm") else ""),
            )
        unknown[first : last + 1] = True
    notes.append(
        f"{100 * np.mean(~known):.1f} % of {name} was missing and was interpolated for the injection"
        + (", and nothing is compared there." if unknown.any() else ".")
    )
    return np.interp(time, time[known], values[known])


def _driving(
    recording: Recording, name: str, unknown: NDArray[np.bool_], notes: list[str], where: str
) -> NDArray[np.float64]:
    """Channel that drives the device in place of a model."""
    if name not in recording.channels or not np.isfinite(recording.channels[name].values).any():
        raise InputError(
            f"{name} was not recorded, but shall drive the unit",
            where=where,
            allowed=f"a channel {name} in pu",
            remedy=f"Map a column to {name}, or leave {name} out of inputs",
        )
    return _filled(recording, name, unknown, notes)


def _told(step: SetPointStep, recording: Recording, where: str) -> str:
    """Sentence on a step; `InputError` if it lies outside of the event."""
    low, high = recording.quiet[1], float(recording.time[-1])
    if not low < step.time < high:
        raise InputError(
            f"{step.quantity} steps at {step.time:g} s",
            where=where,
            allowed=f"behind the quiet part and before the end, {low:g} to {high:g} s",
            remedy="Correct its time, or set event_time to the first step",
        )
    size = (
        f"by a size that is to be found, {step.quantity}.step"
        if step.size is None
        else f"by {step.size:g} pu"
    )
    return f"As stated, {step.quantity} steps at {step.time:g} s {size}."


def _said_of(name: str, replaced: tuple[str, ...], level: float) -> str:
    """Sentence on a recorded input."""
    models = f" in place of {', '.join(replaced)}, whose parameters are no candidates" if replaced else ""
    return (
        f"The recorded {name} drives the unit{models}: its deviation from {level:.4g} pu, its mean before the event, "
        f"is added to the {name} of the model's equilibrium. {name} is not compared."
    )


def _near_jumps(time: NDArray[np.float64], signals: Mapping[str, NDArray[np.float64]]) -> NDArray[np.bool_]:
    """Samples (L,) beside a jump of the imposed power."""
    change = np.abs(np.diff(signals["P"] + 1j * signals["Q"]))
    beside = np.maximum(np.r_[0.0, change[:-1]], np.r_[change[1:], 0.0])
    near = np.zeros(len(time), dtype=bool)
    for k in np.flatnonzero(change - beside > JUMP):
        near |= (time > time[k] - APART_FROM_JUMP) & (time < time[k + 1] + APART_FROM_JUMP)
    return near


def _scatter(recording: Recording, name: str, quiet: NDArray[np.bool_]) -> float:
    """Noise of P or Q that moves what follows from it: a given noise may cover more than scatter."""
    channel = recording.channels[name]
    if recording.stated:
        return float(channel.noise)
    return min(float(channel.noise), scatter(recording.time[quiet], channel.values[quiet]))


def _power(
    recording: Recording,
    unknown: NDArray[np.bool_],
    notes: list[str],
    where: str,
    wanted: str = "voltage behind the grid's impedance",
    key: str = "the grid's impedance",
) -> dict[str, NDArray[np.float64]]:
    for name in ("P", "Q"):
        if name not in recording.channels or not np.isfinite(recording.channels[name].values).any():
            raise InputError(
                f"{name} was not recorded, so the {wanted} is unknown",
                where=where,
                allowed="P and Q of the plant",
                remedy=f"Map a column to {name}, or leave {key} out",
            )
    return {name: _filled(recording, name, unknown, notes, key) for name in ("P", "Q")}


def _angle(
    recording: Recording,
    quiet: NDArray[np.bool_],
    unknown: NDArray[np.bool_],
    notes: list[str],
    where: str,
    source: AngleSource,
) -> tuple[NDArray[np.float64], dict[str, float]]:
    """Angle of the terminal voltage in rad against a frame of the pre-event frequency, and noise by its channel."""
    time = recording.time
    if "angle" in recording.channels:
        angle = _filled(recording, "angle", unknown, notes)
        one = quiet.sum() <= 1
        slope, offset = (0.0, angle[quiet].mean()) if one else np.polyfit(time[quiet], angle[quiet], 1)
        notes.append(
            "The angle is taken against a frame of the mean pre-event frequency, "
            f"{recording.f_nominal + slope / (2 * np.pi):.4f} Hz."
        )
        return angle - offset - slope * time, {"angle": float(recording.channels["angle"].noise)}
    if "f" in recording.channels:
        frequency = _filled(recording, "f", unknown, notes)
        before = float(frequency[quiet].mean())
        deviation = 2 * np.pi * (frequency - before)
        steps = 0.5 * (deviation[1:] + deviation[:-1]) * np.diff(time)
        notes.append(f"The angle is the integral of the recorded frequency against {before:.4f} Hz.")
        return np.concatenate([[0.0], np.cumsum(steps)]), {"f": float(recording.channels["f"].noise)}
    if source.constant_frequency:
        notes.append("As stated, the frequency of the terminal keeps its value before the event.")
        return np.zeros(len(time)), {}
    if source.reactance:
        return _angle_from_power(recording, quiet, unknown, notes, where, source.reactance)
    raise InputError(
        "neither the angle nor the frequency of the terminal voltage was recorded, and the response of this "
        "device depends on it",
        where=where,
        allowed="a channel angle or f, or angle_reactance with recorded V, P and Q, or constant_frequency",
        remedy="Map a column to angle or f; or state angle_reactance, the reactance to a strong grid in pu; or, for an "
        "event in which the frequency rests, constant_frequency = true. A converter model without inertia (pv_plant) "
        "needs none",
    )


def _angle_from_power(
    recording: Recording,
    quiet: NDArray[np.bool_],
    unknown: NDArray[np.bool_],
    notes: list[str],
    where: str,
    X: float,
) -> tuple[NDArray[np.float64], dict[str, float]]:
    """Angle against a source behind a reactance, and its noise."""
    V = _filled(recording, "V", unknown, [])
    power = _power(recording, unknown, notes, where, "angle of the terminal", "angle_reactance")
    angle, size = angle_behind(V, power["P"], power["Q"], X)
    middle = (float(V[quiet].mean()), float(power["P"][quiet].mean()), float(power["Q"][quiet].mean()))
    noise = (
        float(recording.channels["V"].noise),
        _scatter(recording, "P", quiet),
        _scatter(recording, "Q", quiet),
    )
    notes.append(
        f"The angle follows from V, P and Q against a source of constant angle behind {X:.3g} pu. The magnitude of "
        f"that source is {size[quiet].mean():.3f} pu before the event, and {size.min():.3f} to {size.max():.3f} pu in "
        "all: where it moves far, the grid is another one, and the angle is not known so."
    )
    return angle - angle[quiet].mean(), {"angle": noise_of_angle(middle, noise, X)}
