"""A unit: standard models in slots, joined to one device."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeVar

from errorscreen.effects.base import Effect
from errorscreen.effects.flags import other_flag
from errorscreen.engine.stages import Call, stage, writes_of
from errorscreen.exceptions import InputError
from errorscreen.models.device import Constant, Device, GridInterface
from errorscreen.models.empty_slots import NULL_PARTS
from errorscreen.models.notes import notes_of
from errorscreen.models.part import SLOTS, Part
from errorscreen.models.recorded_inputs import RECORDED, REPLACED, take_replaced
from errorscreen.models.set_points import set_points
from errorscreen.models.unit_start import UnitStart
from errorscreen.parameters import ParameterSpace

#: shortest time constant in steps of the integration; Runge-Kutta of order four advances it with an error of 1e-2
#: over a step, and stays stable down to 0.36
SHORTEST = 0.8


@stage("speed_reference")
def speed_reference(value: Any) -> Any:
    """Reference that a governor compares the speed with."""
    return (value,)


#: channels of a synchronous unit that may be recorded beside P and Q, in pu, and their quantities
MACHINE_CHANNELS = {"Efd": "Efd", "If": "If", "Pm": "Pm", "speed": "omega"}
#: constant of a unit whose record refers to the rating of its turbine: the base of the machine in MVA
MACHINE_BASE = "MBASE"
#: ports of a synchronous unit at which effects may act
MACHINE_PORTS = {
    "Efd": "field voltage in pu",
    "Pm": "mechanical power in pu",
    "Vs": "signal of the stabiliser in pu",
    "Vc": "voltage that the exciter controls, in pu",
    "VOEL": "signal of the over-excitation limiter in pu, 0 where it does not act",
    "VUEL": "signal of the under-excitation limiter in pu, 0 where it does not act",
    "speed_reference": "reference that the governor compares the speed with, in pu",
}
#: ports of a converter unit
CONVERTER_PORTS = {
    "Pref": "reference of the active power in pu",
    "Qext": "reference of the reactive power in pu",
    "Ipcmd": "command of the active current in pu",
    "Iqcmd": "command of the reactive current in pu",
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


class Placed(Protocol):
    """What fills a slot: a record, or one of a file that is not checked yet."""

    @property
    def part(self) -> Part:
        """The standard model."""

    @property
    def where(self) -> str:
        """Place in a file, for messages."""


P = TypeVar("P", bound=Placed)


def in_slots(records: Iterable[P]) -> dict[str, P]:
    """Records by the slots that they fill; `InputError` if two fill the same one."""
    slots: dict[str, P] = {}
    for one in records:
        if one.part.slot in slots:
            other = slots[one.part.slot]
            raise InputError(
                f"{one.part.name} and {other.part.name} are both in the slot {one.part.slot}",
                where=" and ".join(filter(None, (other.where, one.where))),
                allowed=f"one {one.part.slot} of a unit",
                remedy="Remove one of the records, or give one of them another identifier",
            )
        slots[one.part.slot] = one
    return slots


def family_of(slots: Mapping[str, Placed]) -> tuple[str, ...]:
    """Slots of the kind of unit that records make; `InputError` if they make none."""
    family = next((family for family in SLOTS if family[0] in slots), None)
    if family is None:
        named = ", ".join(one.part.name for one in slots.values()) or "nothing"
        raise InputError(
            f"the unit has {named}, but no machine or converter",
            where=next((one.where for one in slots.values()), "unit"),
            allowed="a machine such as GENROU or GENSAL, or a converter such as REGCA1",
            remedy="Check bus number and identifier of the records",
        )
    for slot, one in slots.items():
        if slot not in family:
            raise InputError(
                f"{one.part.name} is for another kind of unit than {slots[family[0]].part.name}",
                where=one.where,
                allowed=f"parts for {', '.join(family)}",
            )
    for slot in ("over_excitation", "under_excitation"):
        if slot in slots and "exciter" not in slots:
            raise InputError(
                f"{slots[slot].part.name} limits an exciter, but the unit has none",
                where=slots[slot].where,
                allowed="an exciter such as SEXS or ESST1A beside it",
                remedy="Check bus number and identifier of the records, or leave the limiter out",
            )
    return family


def unit(
    records: Sequence[Record],
    *,
    name: str = "",
    inputs: Iterable[str] = (),
    identifier: str = "",
    bus: int | str = "",
) -> Device:
    """Device of a unit from its records, in any order.

    Parameters
    ----------
    records : sequence of Record
        One for each filled slot; empty slots hold a constant field voltage, constant mechanical power and so on.
    name : str, optional
        The names of the parts, joined by ``+``, where not given.
    inputs : iterable of str
        Recorded quantities that drive a machine instead of its controllers: ``"Efd"``, ``"Pm"``. The records that they
        replace do not count; see `errorscreen.models.recorded_inputs`.
    identifier : str, optional
        Of the unit at its bus, for titles of effects.
    bus : int or str, optional
        Of the unit, for what a record says of other buses.

    Raises
    ------
    InputError
        If no record is a machine or converter, two fill the same slot, or the unit has no such input.
    """
    slots = in_slots(records)
    family = family_of(slots)
    driven = take_replaced(slots, inputs)
    filled = {slot: slots[slot].part if slot in slots else NULL_PARTS.get(slot) for slot in family}
    filled |= {RECORDED[name].slot: RECORDED[name] for name in driven}
    parts = tuple(part for part in filled.values() if part is not None)
    frame, of_machine = parts[0], family[0] == "machine"
    placed = [slots[slot] for slot in family if slot in slots]
    candidates, further, fixed = _sorted_out(placed)
    # a stabiliser of accelerating power reads the mechanical power
    in_turn = sorted(parts, key=lambda part: (part is not frame, part.slot != "governor"))
    calls = [part.call(function) for part in in_turn for function in part.stages]
    calls += [part.call(function) for part in parts for function in part.closing]
    points = set_points(slots)
    governed = "governor" in slots and "Fref" in points
    if governed:
        calls = _with_speed_reference(calls, points["Fref"].name)
    return Device(
        name=name or "+".join(one.part.name for one in placed),
        title=", ".join([*(one.part.title for one in placed), *(RECORDED[name].title for name in driven)]),
        candidates=candidates,
        further=further,
        limits=tuple(
            name
            for one in placed
            for item in one.part.fields
            if item.limit and (name := f"{one.part.name}.{item.name}") in further
        ),
        notes=tuple(notes_of(slots, bus)),
        constants=(
            *fixed,
            Constant("Ra", 0.0, "pu", "armature resistance"),
            Constant("Xsource", 0.2, "pu", "source reactance of the network's file, for GENCLS and REGCB1"),
            Constant("f0", 60.0, "Hz", "nominal frequency"),
            Constant(
                "shortest", 0.001, "s", "shortest time constant that the step advances; follows from the step"
            ),
        ),
        states=tuple(part.qualified(state) for part in parts for state in part.states),
        setpoints=tuple(part.qualified(one) for part in parts for one in part.setpoints),
        stages=tuple(calls),
        initialise=UnitStart(parts if of_machine else (frame, *parts[:0:-1])),
        ports={n: text for n, text in MACHINE_PORTS.items() if governed or n != "speed_reference"}
        if of_machine
        else CONVERTER_PORTS,
        needs_angle=True,
        grid=_behind_impedance(frame),
        source="; ".join(one.part.source for one in placed),
        recordable=_recordable(filled["governor"], driven) if of_machine else {},
        tags=tuple(_tags(family, slots, driven)),
        driven=driven,
        set_points=points,
        effects=() if of_machine else tuple(_flags(slots)),
        words={
            "unit": f"unit {identifier}" if identifier else "the unit",
            **{slot: one.part.name for slot, one in slots.items()},
        },
    )


def _sorted_out(placed: Iterable[Record]) -> tuple[ParameterSpace, ParameterSpace, list[Constant]]:
    """Candidates, constants that are candidates where the user names them, and constants."""
    candidates, further, fixed = [], [], []
    for one in placed:
        for item in one.part.fields:
            value, prefix = one.values[item.name], one.part.name
            absent = item.name == "S12" and one.values["S10"] == 0  # S(1.0) = 0 means no saturation
            if not absent and (parameter := item.parameter(value, prefix)) is not None:
                candidates.append(parameter)
                continue
            fixed.append(Constant(f"{prefix}.{item.name}", value, item.unit, item.description))
            if (parameter := item.on_request(value, prefix)) is not None:
                further.append(parameter)
    if any(one.values.get("TRATE") for one in placed):
        fixed.append(Constant(MACHINE_BASE, 0.0, "MVA", "base of the machine, that of the recording"))
    return ParameterSpace(candidates), ParameterSpace(further), fixed


def _recordable(governor: Part | None, driven: Iterable[str]) -> dict[str, str]:
    """Channels of a machine that are compared where they were recorded, and their quantities."""
    found = {name: quantity for name, quantity in MACHINE_CHANNELS.items() if name not in driven}
    if governor is not None and governor.gate:
        found["gate"] = governor.qualified(governor.gate)
    return found


def _with_speed_reference(calls: list[Call], reference: str) -> list[Call]:
    """Calls with the reference of a governor behind a stage of its own, so that an effect may act on it."""
    first = next(number for number, call in enumerate(calls) if reference in call.reads)
    (name,) = writes_of(speed_reference)
    bound = [
        replace(call, reads=tuple(name if one == reference else one for one in call.reads)) for call in calls
    ]
    return [*bound[:first], Call(speed_reference, (reference,), (name,)), *bound[first:]]


def _flags(slots: Mapping[str, Record]) -> Iterator[Effect]:
    """Flags of a converter unit, each in its other setting."""
    for one in slots.values():
        for item in one.part.fields:
            # the speed of a converter without drive train is 1
            rests = item.name == "PFLAG" and "drive_train" not in slots
            if item.unit == "code" and item.allowed == "0, 1" and not rests:
                yield other_flag(
                    one.part.name, item.name, one.values[item.name], item.description, one.part.source
                )


def _behind_impedance(frame: Part) -> GridInterface | None:
    """Connection to an impedance: of a machine by its voltage behind X'', of a converter by its own stage."""
    if frame.slot == "machine" and "Xpp" in frame.own:
        Xpp = frame.qualified("Xpp")
        names = {"Ed1": "psi2q", "Eq1": "psi2d", "Xd1": Xpp, "Xq1": Xpp}
        return GridInterface("rotor", source=(frame.call(frame.stages[0]),), terminal=(), names=names)
    if frame.behind is None:
        return None
    return GridInterface("solved", (frame.call(frame.behind),), (frame.call(frame.stages[0]),))


def _tags(family: tuple[str, ...], slots: Mapping[str, Record], driven: Iterable[str]) -> Iterator[str]:
    """What effects may ask for: the kind of unit, filled and empty slots, and what they make possible.

    Of what a record drives, nothing is missing and nothing unknown.
    """
    yield f"{family[0]} unit"
    known = {slot for name in driven for slot in REPLACED[name]}
    for slot in family[1:]:
        if slot not in known:
            yield f"{'with' if slot in slots else 'without'} {slot}"
    if family[0] == "machine":
        yield from (f"computed {name}" for name in RECORDED if name not in driven)
        if not known & {"exciter", "stabiliser"} and "stabiliser" not in slots:
            yield "exciter without stabiliser" if "exciter" in slots else "without exciter and stabiliser"
        for slot in ("over_excitation", "under_excitation"):
            if "exciter" in slots and slot not in slots:
                yield f"exciter without {slot}"
        if "governor" in slots and slots["governor"].values.get("DB", 0.0) == 0:
            yield "governor without dead band"
        if slots["machine"].values.get("S10") == 0:
            yield "without saturation"
