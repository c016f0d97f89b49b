"""A unit: standard models in slots, joined to one device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.engine.stages import stage, writes_of
from errorscreen.exceptions import InputError
from errorscreen.models.device import Constant, Device
from errorscreen.models.part import SLOTS, Limit, Part, Values
from errorscreen.parameters import ParameterSpace

#: shortest time constant in steps of the integration; Runge-Kutta of order four advances it with an error of 1e-2
#: over a step, and stays stable down to 0.36
SHORTEST = 0.8
#: how far beyond a limit a unit may start, relative to the limit or 1 pu: recorded starts are that inexact
SLACK = 0.02


@stage("Vc")
def no_compensation(V: Any) -> Any:
    """Voltage that an exciter controls, of a unit without load compensation."""
    return (V,)


@stage("Vs")
def no_stabiliser(omega: Any) -> Any:
    """Signal of a stabiliser that is not there."""
    return (0.0 * omega,)


@stage("Efd")
def constant_field(Efd0: Any) -> Any:
    """Field voltage of a unit without exciter."""
    return (Efd0,)


@stage("Pm")
def constant_power(Pm0: Any) -> Any:
    """Mechanical power of a unit without governor."""
    return (Pm0,)


def _null(name: str, slot: str, title: str, function: Any) -> Part:
    return Part(name, slot, title, (), (function,), writes_of(function))


#: what stands in an empty slot
NULL_PARTS = {
    part.slot: part
    for part in (
        _null("no compensation", "compensator", "no load compensation", no_compensation),
        _null("no stabiliser", "stabiliser", "no stabiliser", no_stabiliser),
        _null("constant field", "exciter", "constant field voltage", constant_field),
        _null("constant power", "governor", "constant mechanical power", constant_power),
    )
}
#: ports of a synchronous unit at which effects may act
MACHINE_PORTS = {
    "Efd": "field voltage in pu",
    "Pm": "mechanical power in pu",
    "Vs": "signal of the stabiliser in pu",
    "Vc": "voltage that the exciter controls, in pu",
}


@dataclass(frozen=True)
class Record:
    """One record of a model file that is understood.

    Parameters
    ----------
    part : Part
    values : mapping of str to float
        Constants by the names of `Part.fields`.
    where : str
        File and line, for messages.
    """

    part: Part
    values: Mapping[str, float]
    where: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", {**self.part.typical, **self.values})
        self.part.check(self.values, self.where or self.part.name)


@dataclass(frozen=True)
class UnitStart:
    """Equilibrium of a unit: each part from the quantities of those before it; see `Device.initialise`."""

    parts: tuple[Part, ...]

    def __call__(self, values: Values) -> tuple[Values, Values, NDArray[np.bool_]]:
        """States, references, and rows that start within all limits and whose constants keep all rules."""
        states, setpoints, limits, fits = self.explain(values)
        for limit in limits:
            low, high = _slack(limit)
            fits = fits & (limit.value >= low) & (limit.value <= high)
        return states, setpoints, fits

    def explain(self, values: Values) -> tuple[Values, Values, list[Limit], NDArray[np.bool_]]:
        """States, references, limits with the start between them, and rows whose constants keep all rules."""
        known = {
            **values,
            "Vr": values["V"] * np.cos(values["angle"]),
            "Vi": values["V"] * np.sin(values["angle"]),
        }
        states: Values = {}
        setpoints: Values = {}
        limits: list[Limit] = []
        fits = np.ones_like(values["V"], dtype=bool)
        for part in self.parts:
            local = part.local(known)
            for wrong in part.broken(local).values():
                fits = fits & ~wrong
            start = part.start(local)
            states |= {part.qualified(name): value for name, value in start.states.items()}
            setpoints |= {
                part.qualified(name): value + 0.0 * values["V"] for name, value in start.setpoints.items()
            }
            limits += [limit._replace(quantity=f"{part.name}: {limit.quantity}") for limit in start.limits]
            known |= states | setpoints
            for function in part.stages:
                call = part.call(function)
                known |= dict(zip(call.writes, function(*(known[name] for name in call.reads)), strict=True))
        return states, setpoints, limits, fits


def _slack(limit: Limit) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = np.asarray(limit.lower, dtype=float), np.asarray(limit.upper, dtype=float)
    return low - SLACK * np.maximum(1.0, np.abs(low)), high + SLACK * np.maximum(1.0, np.abs(high))


def unit(records: Sequence[Record], *, name: str = "") -> Device:
    """Device of a unit from its records, in any order.

    Parameters
    ----------
    records : sequence of Record
        One for each filled slot; empty slots hold a constant field voltage, constant mechanical power and so on.
    name : str, optional
        The names of the parts, joined by ``+``, where not given.

    Raises
    ------
    InputError
        If no record is a machine or converter, or two fill the same slot.
    """
    slots: dict[str, Record] = {}
    for one in records:
        if one.part.slot in slots:
            raise InputError(
                f"{one.part.name} and {slots[one.part.slot].part.name} are both in the slot {one.part.slot}",
                where=one.where,
                allowed=f"one {one.part.slot} of a unit",
                remedy="Remove one of the records, or give one of them another identifier",
            )
        slots[one.part.slot] = one
    family = next((family for family in SLOTS if family[0] in slots), None)
    if family is None:
        named = ", ".join(one.part.name for one in records) or "nothing"
        raise InputError(
            f"the unit has {named}, but no machine or converter",
            where=records[0].where if records else "unit",
            allowed="a machine such as GENROU or GENSAL, or a converter such as REGCA1",
            remedy="Check bus number and identifier of the records",
        )
    for slot in slots:
        if slot not in family:
            raise InputError(
                f"{slots[slot].part.name} is for another kind of unit than {slots[family[0]].part.name}",
                where=slots[slot].where,
                allowed=f"parts for {', '.join(family)}",
            )
    filled = {slot: slots[slot].part if slot in slots else NULL_PARTS.get(slot) for slot in family}
    parts = tuple(part for part in filled.values() if part is not None)
    frame = parts[0]
    candidates, fixed = [], []
    for one in (slots[slot] for slot in family if slot in slots):
        for item in one.part.fields:
            value = one.values[item.name]
            parameter = item.parameter(value, one.part.name)
            if parameter is not None:
                candidates.append(parameter)
            else:
                fixed.append(Constant(f"{one.part.name}.{item.name}", value, item.unit, item.description))
    calls = [part.call(function) for part in parts for function in part.stages]
    calls += [frame.call(function) for function in frame.closing]
    tags = [f"{family[0]} unit"]
    tags += [f"{'with' if slot in slots else 'without'} {slot}" for slot in family[1:]]
    device = Device(
        name=name or "+".join(slots[slot].part.name for slot in family if slot in slots),
        title=", ".join(slots[slot].part.title for slot in family if slot in slots),
        candidates=ParameterSpace(candidates),
        constants=(
            *fixed,
            Constant("Ra", 0.0, "pu", "armature resistance"),
            Constant("f0", 60.0, "Hz", "nominal frequency"),
            Constant(
                "shortest", 0.001, "s", "shortest time constant that the step advances; follows from the step"
            ),
        ),
        states=tuple(part.qualified(state) for part in parts for state in part.states),
        setpoints=tuple(part.qualified(one) for part in parts for one in part.setpoints),
        stages=tuple(calls),
        initialise=UnitStart(parts),
        ports=MACHINE_PORTS,
        needs_angle=True,
        source="; ".join(slots[slot].part.source for slot in family if slot in slots),
        tags=tuple(tags),
    )
    return device
