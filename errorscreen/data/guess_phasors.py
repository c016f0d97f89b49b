"""Guess of rms phasors in a table of unknown layout: columns, units, base voltage and direction of the currents."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.guesses import MOST_PU, PU, Guess, base_kv_of_pu, guess_base_mva, guess_level
from errorscreen.data.headers import role_and_unit
from errorscreen.data.phase_headers import phasors_of
from errorscreen.data.phasors import as_phasors
from errorscreen.data.table import Table
from errorscreen.data.units import Bases
from errorscreen.exceptions import DataWarning

_Array = NDArray[np.float64]
#: units of a quantity, the larger one first, and the level under which numbers count in it
_UNITS = {"voltage": ("kV", "V", 1000.0), "current": ("kA", "A", 50.0)}
#: bases of phasors in pu, which scale nothing
_MVA, _KV = 100.0, 20.0
#: rad and a little more: a larger angle is in degrees
_TURN = 2 * np.pi + 0.1


@dataclass(frozen=True)
class PhasorGuess:
    """Guess of phasors.

    Parameters
    ----------
    keys : dict of str to Guess
        Keys of [recording]: ``phasors`` and bases.
    headers : tuple of str
        Columns of the phasors.
    power : bool
        P and Q follow.
    """

    keys: dict[str, Guess]
    headers: tuple[str, ...]
    power: bool


def guess_phasors(
    table: Table, names: Sequence[str], time: _Array, f_nominal: float, decimal: str
) -> PhasorGuess | None:
    """Phasors among some headers of a table; None where there are none.

    Raises
    ------
    InputError
        If there are phasors that cannot be used, for example of another phase order.
    """
    stated = {name: table.units.get(name, "").strip("[]() ") or role_and_unit(name)[1] for name in names}
    fields = phasors_of(table, names, stated)
    if fields is None:
        return None
    reasons, check = ["magnitude and angle, or both parts, of a voltage in the headers"], False
    spec = as_phasors(fields, table.source)
    numbers = spec.read(table, decimal=decimal)
    levels: dict[str, float] = {}
    for quantity in [quantity for quantity in _UNITS if quantity in fields]:
        large, small, _ = _UNITS[quantity]
        first = [one if isinstance(one, str) else one[0] for one in fields[quantity]]
        units = {stated[name] for name in first} & {large, small}
        if len(units) == 1:
            fields[f"{quantity}_unit"] = units.pop()
        else:
            found = [np.nanmedian(np.abs(x)) for name, x in numbers.items() if name.split(", ")[0] in first]
            levels[quantity] = float(max(found))
    in_pu = PU[0] < levels.get("voltage", 0.0) < PU[1] and levels.get("current", 0.0) < MOST_PU
    for quantity, level in levels.items():
        large, small, most = _UNITS[quantity]
        fields[f"{quantity}_unit"] = "pu" if in_pu else large if level < most else small
        reasons.append(f"the unit of the {quantity} by its size")
        check = True
    if spec.form == "polar" and not isinstance(spec.voltage[0], str):
        units = {stated[spec.voltage[0][1]]} & {"deg", "rad"}
        angles = np.concatenate([numbers[one[1]] for one in (*spec.voltage, *spec.current)])
        fields["angle_unit"] = units.pop() if units else "deg" if np.nanmax(np.abs(angles)) > _TURN else "rad"
        if not units:
            reasons.append("the unit of the angles by their range")
    return _with_bases(table, time, numbers, fields, "; ".join(reasons), check, f_nominal)


def _with_bases(
    table: Table,
    time: _Array,
    numbers: dict[str, _Array],
    fields: dict[str, Any],
    reason: str,
    check: bool,
    f_nominal: float,
) -> PhasorGuess:
    spec = as_phasors(fields, table.source)
    with warnings.catch_warnings():  # doubts are told when the case is read
        warnings.simplefilter("ignore", DataWarning)
        _, found, _ = spec.derive(table, time, numbers, (), f_nominal, [], Bases(_MVA, _KV, f_nominal))
    first = slice(0, max(3, len(time) // 10))
    kv = float(np.nanmedian(found["V"][first]))
    in_pu = spec.voltage_unit == "pu"
    keys = {"base_kv": base_kv_of_pu() if in_pu else guess_level(kv, "the voltage from line to line is")[0]}
    if "P" in found:
        P, Q = (float(np.nanmedian(found[name][first])) for name in "PQ")
        keys["base_mva"] = guess_base_mva(P, Q, "pu" if in_pu else "MW")
        if P < 0:
            fields["sign"] = "load"
            reason += "; P before the event is negative, so the currents count as positive into the plant"
            check = True
    return PhasorGuess({"phasors": Guess(fields, reason, check), **keys}, spec.headers, "P" in found)
