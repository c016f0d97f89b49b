"""What the model of a unit takes otherwise than its file says, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Protocol

from errorscreen.models.device import Note
from errorscreen.models.part import Part

#: models whose reactance stands in the network's file
_BEHIND_A_SOURCE = ("GENCLS", "REGCB1", "REGFMA1")
#: shares of IEEEG1 for its other machine
_OTHER_SHARES = ("K2", "K4", "K6", "K8")


class Noted(Protocol):
    """A record of a unit: its model and its values."""

    @property
    def part(self) -> Part:
        """The standard model."""

    @property
    def values(self) -> Mapping[str, float]:
        """Constants by name."""


def notes_of(slots: Mapping[str, Noted], bus: int | str = "") -> Iterator[Note]:
    """Approximations of a unit with these records by slot, at a bus."""
    for one in slots.values():
        for name, remote in _remote_buses(one, bus):
            of_branch = name == "FromBus"
            yield Note(
                f"{one.part.name} names {'a branch from ' if of_branch else ''}the bus {remote:g} ({name}), which is "
                f"not simulated: {'the current' if of_branch else 'the voltage'} of the unit's terminal stands for it."
            )
        if one.part.name == "IEEEG1" and any(one.values[name] for name in _OTHER_SHARES):
            shares = ", ".join(f"{name} = {one.values[name]:g}" for name in _OTHER_SHARES if one.values[name])
            yield Note(
                f"The shares {shares} of IEEEG1 drive another machine (JBUS = {one.values['JBUS']:g}), which is not "
                "simulated: the valve follows from the power and the shares of this unit alone."
            )
    yield from _of_the_source(slots)


def _remote_buses(one: Noted, bus: int | str) -> Iterator[tuple[str, float]]:
    """Fields that name another bus whose quantities the model would use."""
    for item in one.part.fields:
        value = one.values[item.name]
        unused = item.name.startswith("IB") and one.values[item.name.replace("IB", "IC")] == 0
        if item.unit == "bus" and item.name not in ("JBUS", "ToBus") and value not in (0, bus) and not unused:
            yield item.name, value


def _of_the_source(slots: Mapping[str, Noted]) -> Iterator[Note]:
    """Reactance that the file does not hold, and controllers of a machine without field winding."""
    names = {slot: one.part.name for slot, one in slots.items()}
    frame = names.get("machine", names.get("converter", ""))
    if frame in _BEHIND_A_SOURCE:
        yield Note(
            f"The source reactance of {frame} is taken as 0.2 pu, because it stands in the RAW file and not in the "
            "DYR file: name that file in [plant], or state the constant Xsource.",
            "Xsource",
        )
    idle = [name for slot, name in names.items() if slot not in ("machine", "governor")]
    if frame == "GENCLS" and idle:
        yield Note(
            f"GENCLS has a constant voltage and no field winding, so that {' and '.join(idle)} cannot act on it."
        )
