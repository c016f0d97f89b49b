"""Channels of a table that PSS/E exported, by the names that it gives them.

A channel of a machine is named ``POWR 101[BUS 1 230.00]1``: quantity, number of the bus, its name and base voltage in
kV, and the id of the machine. That of a bus is ``VOLT 101 [BUS 1 230.00]``. ``POWR`` and ``VARS`` are in pu of the
system's base, ``FREQ`` is the deviation of the frequency in pu, and angles are in degrees. Sources: ``results.csv`` of
PSSE_3_BUS in the public repository PSIDValidation of the Sienna platform, which PSS/E wrote, and the example of the
module ``dyntools``, which multiplies ``POWR`` by 100 to get MW and turns ``FREQ`` into (1 + v)·60 Hz.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from errorscreen._runtime.display import listed
from errorscreen.data.guesses import ChannelGuess
from errorscreen.data.table import Table

_NAME = re.compile(r"(?P<what>[A-Z]{3,4})\s+(?P<bus>\d+)\s*\[[^\]]*\]\s*(?P<id>\S*)")
#: system base in MVA, unless the case says otherwise
SYSTEM_MVA = 100.0
#: names of each channel, of the machine or of its bus, in order of preference; unit; base
_CHANNELS = {
    "V": (("VOLT", "ETRM"), "pu", None),
    "angle": (("ANGL",), "deg", None),
    "f": (("FREQ",), "pu deviation", None),
    "P": (("POWR",), "pu", SYSTEM_MVA),
    "Q": (("VARS",), "pu", SYSTEM_MVA),
}
#: quantities that are those of the bus: ``ANGL`` with an id is the angle of a rotor
_OF_BUS = {"VOLT", "ANGL", "FREQ"}


class Machine(NamedTuple):
    """Number of the bus and id of a machine."""

    bus: int
    id: str


def guess_psse(
    table: Table, names: Sequence[str], decimal: str, units: Iterable[tuple[object, str]] = ()
) -> tuple[Machine, dict[str, ChannelGuess], list[str]] | None:
    """Machine, its channels and open points; None where no header names the power of a machine as PSS/E does.

    Parameters
    ----------
    table : Table
    names : sequence of str
        Headers.
    decimal : str
        Mark of decimals.
    units : iterable of (bus, id)
        Units of a model file: the machine is one of them where a header names it.
    """
    known: dict[tuple[str, int, str], str] = {}
    for name in names:
        if match := _NAME.fullmatch(name.strip()):
            known.setdefault((match["what"], int(match["bus"]), match["id"]), name)
    machines = [Machine(bus, id) for what, bus, id in known if what == "POWR" and id]
    if not machines:
        return None
    stated = [one for one in machines if one in {*units}]
    chosen = (stated or machines)[0]
    others = [one for one in stated or machines if one != chosen]
    whose = f"of the machine {chosen.id} at bus {chosen.bus}" + (
        ", which is in the model file" if stated else ""
    )
    channels: dict[str, ChannelGuess] = {}
    for role, (kinds, unit, base) in _CHANNELS.items():
        keys = [(kind, chosen.bus, "" if kind in _OF_BUS else chosen.id) for kind in kinds]
        found = [known[key] for key in keys if key in known]
        if not found:
            continue
        fields = {"column": found[0], "unit": unit} | ({} if base is None else {"base": base})
        reason = f"{whose}; PSS/E writes it in {unit}"
        if base is not None:
            reason += f" of the system base, which is {base:g} MVA unless the RAW file says otherwise"
        if role == "angle":
            reason += "; it must not be relative to another machine"
        check = bool(others) or base is not None
        channels[role] = ChannelGuess(fields, reason, table.numbers(found[0], decimal=decimal), check)
    told = []
    if others:
        rest = listed(f"{one.id} at bus {one.bus}" for one in others)
        told.append(f"The columns are {whose}. The file also holds the machines {rest}.")
    return chosen, channels, told
