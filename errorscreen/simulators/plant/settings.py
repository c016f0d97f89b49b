"""Settings of a plant simulator that depend on its device and recording: frequency, channels, steps, angle."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.events import Playback, SetPointStep
from errorscreen.exceptions import InputError, unknown_name
from errorscreen.models.device import Device
from errorscreen.simulators.plant.terminal_angle import AngleSource


def with_frequency(
    values: dict[str, float], recording: Any, given: Mapping[str, float] | None
) -> dict[str, float]:
    """Constants with the recording's nominal frequency, which a given one must equal."""
    if "f0" not in values or not isinstance(recording, Recording):
        return values
    stated = (given or {}).get("f0", recording.f_nominal)
    if stated != recording.f_nominal:
        raise InputError(
            f"the constant f0 is {stated:g} Hz, but the recording's nominal frequency is {recording.f_nominal:g} Hz",
            where="PlantSimulator",
            allowed="the same frequency",
            remedy="Leave f0 out, or correct f_nominal",
        )
    return {**values, "f0": recording.f_nominal}


def channels_of(recording: Any, channels: Iterable[str] | None, device: Device) -> tuple[str, ...]:
    """Channels that are compared: the given ones, or those of a recording that the device can record."""
    outputs = (*device.outputs, *device.recordable)
    if channels is not None:
        channels = tuple(channels)
        for name in channels:
            if name not in outputs:
                raise unknown_name(name, outputs, kind="channel", where="PlantSimulator")
    elif isinstance(recording, Playback):
        channels = device.outputs
    elif isinstance(recording, Observation):
        channels = recording.channels
    else:
        channels = tuple(name for name in outputs if name in recording.channels)
    if not channels:
        raise InputError(
            "neither P nor Q was recorded, so there is nothing to compare with", where="PlantSimulator"
        )
    return channels


def steps_of(recording: Any) -> tuple[SetPointStep, ...]:
    """Steps of set-points in a recording, an observation of it, or an event."""
    event = recording.event if isinstance(recording, Observation) else recording
    return event.steps if isinstance(event, Playback | Recording) else ()


def angle_source_of(device: Device, constant_frequency: bool, reactance: float) -> AngleSource:
    """Source of the angle where it was not recorded; `InputError` for a device that does not depend on it."""
    source = AngleSource(constant_frequency, reactance)
    if source.given and not device.needs_angle:
        raise InputError(
            f"{'constant_frequency' if constant_frequency else 'angle_reactance'} is given, but the response of "
            f"{device.name!r} does not depend on the angle of the terminal",
            where="PlantSimulator",
            remedy="Leave it out",
        )
    return source
