"""Guesses about sampled waves: phases in names, and which three voltages and currents belong together."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Sequence

import numpy as np

from errorscreen.data.guesses import MOST_PU, PU
from errorscreen.data.headers import role_and_unit
from errorscreen.data.table import Table
from errorscreen.data.waveforms import Waveforms, trios
from errorscreen.exceptions import InputError

_PHASE = re.compile(
    r"(?:^|(?<=[^a-z0-9]))(?P<kind>[vui])[ _]?(?P<phase>a|b|c|ab|bc|ca|l1|l2|l3|r|s|t|y)(?:$|[^a-z0-9])",
    re.IGNORECASE,
)


def phase_of(name: str) -> str:
    """Phase that the name of a channel states; empty without one.

    >>> phase_of("VB"), phase_of("i_l2"), phase_of("BUS 1 VC"), phase_of("P")
    ('B', 'B', 'C', '')
    """
    match = _PHASE.search(name.strip())
    phase = match["phase"].upper() if match else ""
    return {"L1": "A", "L2": "B", "L3": "C"}.get(phase, phase)


def first_trios(channels: Sequence[tuple[str, str, str]], source: str) -> tuple[Waveforms | None, list[str]]:
    """Three voltages and three currents among channels (name, phase, unit), and the names of other sets of three.

    Of several sets, whose names differ beside the phase, the first. None where there are no three voltages.
    """
    with contextlib.suppress(InputError):
        return trios(channels, source), []
    sets: dict[tuple[bool, str], list[tuple[str, str, str]]] = {}
    for name, phase, unit in channels:
        if phase and unit in ("V", "kV", "A", "kA"):
            stem = re.sub(rf"{re.escape(phase)}$|(?<=[VUIvui])[A-Za-z]\d?$", "", name.strip())
            sets.setdefault((unit in ("A", "kA"), stem), []).append((name, phase, unit))
    whole = {key: one for key, one in sets.items() if {"A", "B", "C"} <= {phase for _, phase, _ in one}}
    first = [
        next((one for (of_current, _), one in whole.items() if of_current is kind), [])
        for kind in (False, True)
    ]
    with contextlib.suppress(InputError):
        found = trios([*first[0], *first[1]], source)
        taken = {*found.voltage, *found.current}
        return found, [name for one in whole.values() for name, *_ in one if name not in taken]
    return None, []


def guess_waveforms(
    table: Table, names: Sequence[str], step: float, decimal: str
) -> tuple[list[tuple[str, str, str]], bool, bool]:
    """Channels (name, phase, unit) that look like sampled waves of three phases.

    Also whether a unit was assumed, and whether all numbers are in pu; a unit is that of the kind then.
    """
    found, assumed, in_pu = [], False, True
    for name in names:
        phase, match = phase_of(name), _PHASE.search(name.strip())
        if not match or step > 1 / 300:
            continue
        numbers = table.numbers(name, decimal=decimal)
        if not np.abs(np.nanmean(numbers)) < 0.2 * np.nanstd(numbers):
            continue
        of_current = match["kind"].casefold() == "i"
        allowed = ("A", "kA") if of_current else ("V", "kV")
        told = role_and_unit(name)[1], table.units.get(name, "").strip("[]() ")
        stated = [u for u in told if u in allowed]
        most = float(np.nanmax(np.abs(numbers)))
        unit = stated[0] if stated else allowed[most < (50.0 if of_current else 1000.0)]
        assumed |= not stated and "pu" not in told
        peak = np.sqrt(2) * float(np.nanstd(numbers))
        in_pu &= "pu" in told or (not stated and (peak < MOST_PU if of_current else PU[0] < peak < PU[1]))
        found.append((name, phase, unit))
    return found, assumed, in_pu and bool(found)
