r"""Steps of set-points of a unit: voltage, active power, reactive power, frequency.

A step of size s at the instant :math:`t_s` adds to the set-point that the start gives:

.. math::

    r(t) = r_0 + k\,\big(s_1\,\sigma(t - t_1) + s_2\,\sigma(t - t_2) + \dots\big)                   \qquad (1)

with the unit step :math:`\sigma` and k = 1. Governors whose reference is a speed have k = R, their droop, so that the
size of a step of the active power is one of power (or gate) for all governors. A step of the frequency moves the
reference that the governor or the plant controller compares the speed or the frequency with; s > 0 raises the power,
by s over the droop at rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from errorscreen.engine.stages import Call, reads_of, stage
from errorscreen.events import SetPointStep
from errorscreen.exceptions import InputError
from errorscreen.models.device import Device, SetPoint
from errorscreen.models.part import Part
from errorscreen.parameters import Parameter, ParameterSpace

#: set-points, and the largest size in pu of a step that is to be found
SET_POINTS = {"Vref": 0.1, "Pref": 0.5, "Qref": 0.5, "Qext": 0.5, "Fref": 0.02}
#: governors whose reference is a speed, with its name
_BY_SPEED = {"HYGOV": "nref", "GGOV1": "Pref"}


@stage("move")
def total(known: Any, unknown: Any, size: Any) -> Any:
    """Sum of stated steps and of those of a size that is to be found, (1)."""
    return (known + size * unknown,)


@stage("now")
def added(value: Any, move: Any) -> Any:
    """Set-point with its steps, (1)."""
    return (value + move,)


@stage("now")
def scaled(value: Any, move: Any, factor: Any) -> Any:
    """Set-point with its steps, (1)."""
    return (value + factor * move,)


def set_points(slots: Mapping[str, Any]) -> dict[str, SetPoint]:
    """Set-points that can step, of a unit with these records by slot."""
    found = {}
    parts: dict[str, Part] = {slot: one.part for slot, one in slots.items()}
    exciter, governor, plant = (parts.get(slot) for slot in ("exciter", "governor", "plant_control"))
    if exciter is not None and "Vref" in exciter.setpoints:
        found["Vref"] = SetPoint(exciter.qualified("Vref"))
    if governor is not None:
        reference = _BY_SPEED.get(governor.name, "Pref")
        factor = governor.qualified("R") if governor.name in _BY_SPEED else ""
        if reference in governor.setpoints:
            found["Pref"] = SetPoint(governor.qualified(reference), factor)
        frequency = _BY_SPEED.get(governor.name, "wref")
        if frequency in governor.setpoints:
            found["Fref"] = SetPoint(governor.qualified(frequency))
    if plant is not None and "yref" in plant.setpoints:
        values = slots["plant_control"].values
        found["Vref" if values["RefFlag"] == 1 else "Qref"] = SetPoint(plant.qualified("yref"))
        power = SetPoint(plant.qualified("Pplant"))
        found["Pref"] = power if values["Fflag"] == 1 else SetPoint("Pref", computed=True)
        if values["Fflag"] == 1:
            found["Fref"] = SetPoint(plant.qualified("fref"))
    elif "converter" in parts:
        read = {name for part in parts.values() for function in part.stages for name in reads_of(function)}
        found |= {name: SetPoint(name, computed=True) for name in ("Pref", "Qext") if _acts(name, read)}
    return found


def _acts(name: str, read: set[str]) -> bool:
    """Whether a reference of a converter unit reaches a part; without torque control that of power is Pset, too."""
    return name in read or (name == "Pref" and "Pset" in read)


def size_name(quantity: str) -> str:
    """Candidate parameter for the size of a step that is not stated."""
    return f"{quantity}.step"


def with_steps(device: Device, steps: Iterable[SetPointStep]) -> Device:
    """Device whose set-points can step; a size that is not given is a candidate parameter.

    Parameters
    ----------
    device : Device
        A unit of standard models.
    steps : iterable of SetPointStep
        Of all recordings. A quantity that the device has already stays as it is.

    Raises
    ------
    InputError
        If the device has no such set-point.
    """
    sought: dict[str, bool] = {}
    for one in steps:
        sought[one.quantity] = sought.get(one.quantity, False) or one.size is None
    for quantity, unknown in sought.items():
        if quantity not in device.steps:
            device = _with_step(device, quantity, unknown)
    return device


def _with_step(device: Device, quantity: str, unknown: bool) -> Device:
    if quantity not in device.set_points:
        raise InputError(
            f"{device.name} has no set-point {quantity}",
            where="step of a set-point",
            allowed=", ".join(device.set_points) or "no step: the unit has no set-point",
            remedy="A machine with an exciter has Vref, one with a governor Pref and Fref; a converter unit has Pref "
            "and Qext, or what its plant controller regulates. A recorded input leaves no set-point of what it "
            "replaces",
        )
    point = device.set_points[quantity]
    move, calls = f"{quantity}.known", []
    if unknown:
        reads = (move, f"{quantity}.unknown", size_name(quantity))
        move = f"{quantity}.move"
        calls.append(Call(total, reads, (move,)))
    before, now = (f"{point.name}.set", point.name) if point.computed else (point.name, f"{point.name}.now")
    if point.factor:
        calls.append(Call(scaled, (before, move, point.factor), (now,)))
    else:
        calls.append(Call(added, (before, move), (now,)))
    stages: list[Any] = []
    for call in device.stages:
        assert isinstance(call, Call)
        if point.computed:
            stages.append(replace(call, writes=_renamed(call.writes, point.name, before)))
            stages += calls if point.name in call.writes else []
        else:
            if point.name in call.reads and calls:
                stages, calls = [*stages, *calls], []
            stages.append(replace(call, reads=_renamed(call.reads, point.name, now)))
    candidates = device.candidates
    if unknown:
        most = SET_POINTS[quantity]
        size = Parameter(
            size_name(quantity), 0.0, -most, most, "pu", quantity, f"Δ{quantity}",
            f"size of the steps of {quantity} that no recording states", scale=most,
        )  # fmt: skip
        candidates = ParameterSpace([*candidates, size])
    return replace(
        device, stages=tuple(stages), candidates=candidates, steps={**device.steps, quantity: unknown}
    )


def _renamed(names: tuple[str, ...], old: str, new: str) -> tuple[str, ...]:
    return tuple(new if name == old else name for name in names)
