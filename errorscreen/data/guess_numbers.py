"""Channels of a table without headers, by their numbers alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.guesses import LEVELS, ChannelGuess
from errorscreen.data.table import Table
from errorscreen.exceptions import InputError

_Array = NDArray[np.float64]
#: Hz around 50 and 60 that a frequency stays in, and pu around 1 that a voltage begins in
_OFF, _NEAR_ONE = 2.5, 0.1
#: relative distance from a usual level in kV
_NEAR = 0.03


def guess_by_numbers(
    table: Table, names: Sequence[str], decimal: str, f_nominal: float | None
) -> tuple[dict[str, ChannelGuess], list[str]]:
    """Frequency, angle and voltage where one column only can be it; P and Q are left open, with their levels."""
    columns: dict[str, _Array] = {}
    for name in names:
        try:
            columns[name] = table.numbers(name, decimal=decimal)
        except InputError:
            continue
    columns = {name: x for name, x in columns.items() if np.isfinite(x).any()}
    levels = {name: ChannelGuess({}, "", x).level for name, x in columns.items()}
    known = [50.0, 60.0] if f_nominal is None else [f_nominal]
    kinds = {
        "f": [(name, "Hz", f"near {near:g}") for near in known for name in columns if _stays(columns[name], near)],
        "angle": [(name, unit, f"jumps by {turn}") for name, x in columns.items() for unit, turn in _wraps(x)],
        "V": [(name, "pu", f"{level:.4g} before the event, near 1 pu")
              for name, level in levels.items() if abs(level - 1.0) < _NEAR_ONE],
    }  # fmt: skip
    if not kinds["V"]:
        kinds["V"] = [
            (name, unit, f"{level:.4g} before the event, near a usual level in {unit}")
            for name, level in levels.items()
            if name not in {one for one, *_ in (*kinds["f"], *kinds["angle"])}
            for unit, factor in (("kV", 1.0), ("V", 1e-3))
            if _is_level(abs(level) * factor, unit)
        ]
    channels: dict[str, ChannelGuess] = {}
    told: list[str] = []
    for role, found in kinds.items():
        if len(found) == 1:
            name, unit, reason = found[0]
            channels[role] = ChannelGuess({"column": name, "unit": unit}, reason, columns[name], check=True)
        elif found:
            told.append(f"{role} may be one of {', '.join(repr(name) for name, *_ in found)}: state which.")
    taken = {one.fields["column"] for one in channels.values()}
    rest = [f"{name!r} begins at {levels[name]:.4g}" for name in columns if name not in taken]
    if rest:
        told.append(f"Numbers alone do not tell P and Q: {', '.join(rest)}. State recording.columns.")
    return channels, told


def _stays(numbers: _Array, near: float) -> bool:
    return bool(np.nanmax(np.abs(numbers - near)) < _OFF)


def _wraps(numbers: _Array) -> list[tuple[str, str]]:
    """Unit of an angle, and the turn that it jumps by; empty without jumps."""
    jumps = np.abs(np.diff(numbers[np.isfinite(numbers)]))
    if (np.abs(jumps - 360.0) < 10.0).any() and np.nanmax(np.abs(numbers)) <= 361.0:
        return [("deg", "360")]
    if (np.abs(jumps - 2 * np.pi) < 0.3).any() and np.nanmax(np.abs(numbers)) <= 6.4:
        return [("rad", "2π")]
    return []


def _is_level(kv: float, unit: str) -> bool:
    """Whether a voltage is near a usual level, of a size that is usual in the unit."""
    if not kv > 0 or (unit == "V") != (kv < 1.0):
        return False
    return any(abs(value / level - 1.0) < _NEAR for value in (kv, np.sqrt(3) * kv) for level in LEVELS)
