"""Settings of a plant simulator that depend on its device and recording: constants, channels, effects, angle."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from errorscreen.data.channels import ROLE_UNITS
from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.effects import Effect, common_skew, measurement_effects, mva_base
from errorscreen.events import Playback, SetPointStep
from errorscreen.exceptions import InputError, check_real, unknown_name
from errorscreen.models.device import Device, Remark
from errorscreen.models.set_points import with_steps
from errorscreen.models.unit import MACHINE_BASE
from errorscreen.simulators import assembly
from errorscreen.simulators.plant.connection import Connection
from errorscreen.simulators.plant.driving_voltage import check_impedance
from errorscreen.simulators.plant.imposed_power import effects_of_voltage, with_imposed_power
from errorscreen.simulators.plant.terminal_angle import AngleSource

#: what may be imposed at the recorded point
IMPOSED = ("voltage", "power")


def device_of(
    device: Device, recording: Any, imposed: str, impedance: complex, connection: Connection | None
) -> Device:
    """Device with the steps of a recording, driven by the imposed voltage or power."""
    if imposed not in IMPOSED:
        raise unknown_name(imposed, IMPOSED, kind="kind of playback", where="PlantSimulator, imposed")
    if check_impedance(impedance) and (connection is not None or imposed == "power"):
        other = "connection" if connection is not None else 'imposed = "power"'
        raise InputError(
            f"{other} and grid_impedance are both given",
            where="PlantSimulator",
            allowed="one of them: what is imposed was recorded, or follows from the grid",
        )
    if imposed == "power":
        device = with_imposed_power(device, connection)
    return with_steps(device, steps_of(recording))


def effects_in(
    device: Device, effects: Iterable[Effect] | None, behind: bool, recording: Any
) -> tuple[Effect, ...]:
    """Given effects, or those of the device and of its measured channels; none of these `behind` an impedance."""
    if effects is None:
        of_power = device.outputs == Device.outputs
        faults = measurement_effects(device.outputs) if of_power else effects_of_voltage()
        base = mva_base(getattr(recording, "base_mva", 0.0))
        if of_power and {*base.devices} & {*device.tags}:
            faults = (*faults, base)
        effects = (*assembly.library_of(device), *(() if behind else (*faults, common_skew())))
    effects = tuple(effects)
    wrong = [effect.name for effect in effects if behind and effect.kind == "measurement"]
    if wrong:  # a wrong power gives a wrong voltage behind the impedance
        raise InputError(
            f"the effects {', '.join(wrong)} distort the power that the voltage behind the impedance follows from",
            where="PlantSimulator, grid_impedance",
            allowed="effects inside the device",
            remedy="Look for faults of the measurement with the recorded voltage imposed",
        )
    return effects


def units_of(channels: Iterable[str]) -> tuple[str, ...]:
    """Units of channels: Hz for f, else pu."""
    return tuple(ROLE_UNITS.get(name, "pu") for name in channels)


def of_recording(
    values: dict[str, float], recording: Any, given: Mapping[str, float] | None
) -> dict[str, float]:
    """Constants with the recording's nominal frequency, which a given one must equal, and its base of the machine."""
    known = isinstance(recording, Recording)
    if "f0" in values and known:
        stated = (given or {}).get("f0", recording.f_nominal)
        if stated != recording.f_nominal:
            raise InputError(
                f"the constant f0 is {stated:g} Hz, but the recording's nominal frequency is "
                f"{recording.f_nominal:g} Hz",
                where="PlantSimulator",
                allowed="the same frequency",
                remedy="Leave f0 out, or correct f_nominal",
            )
        values = {**values, "f0": recording.f_nominal}
    if MACHINE_BASE in values and MACHINE_BASE not in (given or {}):
        if not known:
            raise InputError(
                "a record states TRATE, the rating of its turbine, but the base of the machine is not known",
                where="PlantSimulator",
                allowed=f"a recording, whose base_mva it is, or the constant {MACHINE_BASE} in MVA",
                remedy="State it, or set TRATE to 0, which means that the turbine has the base of the machine",
            )
        values = {**values, MACHINE_BASE: recording.base_mva}
    check_real(values.get(MACHINE_BASE, 1.0), MACHINE_BASE, low=0.0, above=True, where="PlantSimulator")
    return values


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
            f"neither {' nor '.join(device.outputs)} was recorded, so there is nothing to compare with",
            where="PlantSimulator",
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


def told_of(device: Device, given: Mapping[str, float] | None) -> tuple[Remark, ...]:
    """What the model takes otherwise than its file says, with the constants that the user states."""
    return tuple(Remark(note.text) for note in device.notes if note.constant not in (given or {}))


def not_compared(recording: Recording, channels: Iterable[str], device: Device) -> list[Remark]:
    """Sentence on the recorded channels that the device does not have; empty without any."""
    known = {*ROLE_UNITS, *device.outputs, *device.recordable, *device.driven, *channels}
    left = [name for name in recording.channels if name not in known]
    if not left:
        return []
    text = (
        f"{', '.join(left)} {'is' if len(left) == 1 else 'are'} not compared: the model {device.name} has "
        f"{', '.join((*device.outputs, *device.recordable))}."
    )
    return [Remark(text)]
