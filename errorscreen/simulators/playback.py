"""From a recording to what is injected at a terminal and compared with: the recorded voltage and power."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from errorscreen.events import Playback
from errorscreen.exceptions import InputError
from errorscreen.recordings import Observation, Recording


def playback_observation(
    recording: Recording,
    channels: tuple[str, ...],
    *,
    dt: float | None = None,
    needs_angle: bool = True,
    operating_point: Mapping[str, float] | None = None,
) -> Observation:
    r"""Voltage to inject and channels to compare with, on one uniform grid.

    The angle is taken in a frame that rotates at the mean pre-event frequency, because the device is started at an
    equilibrium: the straight line through the angle's quiet part is removed. Where only the frequency was recorded, the
    angle is its integral, :math:`\theta = 2\pi\int (f - f_{pre})\,dt`. Short gaps of the voltage are interpolated.

    Parameters
    ----------
    recording : Recording
    channels : tuple of str
        Names of the R channels to compare with; one that was not recorded is all NaN.
    dt : float, optional
        Step of the grid in seconds; the recording's median sample distance where not given.
    needs_angle : bool
        Whether the device's response depends on the angle.
    operating_point : mapping of str to float, optional
        Pre-event ``"P"`` or ``"Q"`` in pu, needed for what was not recorded.

    Returns
    -------
    Observation

    Raises
    ------
    InputError
        If the voltage was not recorded, or the angle is needed and neither angle nor frequency was recorded, or an
        operating point is unknown.
    """
    where = f"recording {recording.name!r}"
    if "V" not in recording.channels:
        raise InputError(
            "the magnitude of the terminal voltage was not recorded",
            where=where,
            allowed="a channel V",
            remedy="Plant playback injects the recorded voltage, so map a column to V",
        )
    source = recording.resample(dt)
    time = source.time
    notes = list(source.assumptions)
    quiet = (time >= source.quiet[0]) & (time <= source.quiet[1])
    signals = {"V": _filled(source, "V", notes)}
    if needs_angle:
        signals["angle"] = _angle(source, quiet, notes, where)
    given = {**source.given, **(operating_point or {})}
    initial = {"V": source.initial(["V"])["V"]}
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
    values = np.full((len(channels), len(time)), np.nan)
    noise = np.ones(len(channels))
    for r, name in enumerate(channels):
        if name in source.channels:
            values[r] = source.channels[name].values
            noise[r] = source.channels[name].noise
    event = Playback(time, source.name, source.event_time, signals, initial)
    return Observation(event, values, noise, channels, ("pu",) * len(channels), tuple(notes))


def _filled(recording: Recording, name: str, notes: list[str]) -> NDArray[np.float64]:
    """Channel without gaps: what is injected must be known at every instant."""
    values = recording.channels[name].values
    known = np.isfinite(values)
    if not known.all():
        share = 1 - known.mean()
        notes.append(f"{100 * share:.1f} % of {name} was missing and was interpolated for the injection.")
        values = np.interp(recording.time, recording.time[known], values[known])
    return values


def _angle(
    recording: Recording, quiet: NDArray[np.bool_], notes: list[str], where: str
) -> NDArray[np.float64]:
    """Angle of the terminal voltage in rad against a frame of the pre-event frequency."""
    time = recording.time
    if "angle" in recording.channels:
        angle = _filled(recording, "angle", notes)
        slope, offset = (
            np.polyfit(time[quiet], angle[quiet], 1) if quiet.sum() > 1 else (0.0, angle[quiet].mean())
        )
        notes.append(
            "The angle is taken against a frame of the mean pre-event frequency, "
            f"{recording.f_nominal + slope / (2 * np.pi):.4f} Hz."
        )
        return angle - offset - slope * time
    if "f" in recording.channels:
        frequency = _filled(recording, "f", notes)
        before = float(frequency[quiet].mean())
        deviation = 2 * np.pi * (frequency - before)
        steps = 0.5 * (deviation[1:] + deviation[:-1]) * np.diff(time)
        notes.append(f"The angle is the integral of the recorded frequency against {before:.4f} Hz.")
        return np.concatenate([[0.0], np.cumsum(steps)])
    raise InputError(
        "neither the angle nor the frequency of the terminal voltage was recorded, and the response of this "
        "device depends on it",
        where=where,
        allowed="a channel angle or f",
        remedy="Map a column to angle or f; a converter model without inertia (pv_plant) needs none",
    )
