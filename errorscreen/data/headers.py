"""Channels that the headers of a table name beyond doubt."""

from __future__ import annotations

import re
from collections.abc import Iterable

from errorscreen.data.timestamps import TIME_UNITS
from errorscreen.data.units import UNITS, Column
from errorscreen.exceptions import InputError

#: Spellings of each channel and of the time, in lower case and with spaces for underscores and dots.
_SPELLINGS = {
    "time": ("time", "t"),
    "V": ("v", "u", "voltage", "voltage magnitude", "v mag", "u mag", "vmag", "umag", "vm"),
    "angle": ("angle", "voltage angle", "phase angle", "v angle", "v ang", "u angle", "u ang"),
    "f": ("f", "freq", "frequency"),
    "P": ("p", "active power", "real power"),
    "Q": ("q", "reactive power"),
}
_ROLES = {spelling: role for role, spellings in _SPELLINGS.items() for spelling in spellings}
#: Other spellings of units.
_ALIASES = {
    **{"p.u.": "pu", "PU": "pu", "°": "deg", "degrees": "deg", "degree": "deg"},
    **{"MVAR": "Mvar", "KVAR": "kvar", "KW": "kW", "sec": "s", "seconds": "s"},
    **dict.fromkeys(("KV", "kv", "Kv"), "kV"),
    **dict.fromkeys(("volt", "Volt", "VOLT", "volts", "Volts", "VOLTS"), "V"),
    **dict.fromkeys(("KA", "ka", "Ka"), "kA"),
    **dict.fromkeys(("amp", "Amp", "AMP", "amps", "Amps", "AMPS", "ampere", "Ampere", "AMPERE"), "A"),
    **dict.fromkeys(("amperes", "Amperes", "AMPERES"), "A"),
}
#: Letters of a header; a longer text names nothing, and patterns would be tried on it for ever.
LONGEST_HEADER = 500
#: A unit in brackets, after "in", a slash or the last underscore.
_WITH_UNIT = re.compile(
    r"(?P<name>.+?)(?:\s*\[(?P<a>.+)\]|\s*\((?P<b>.+)\)|\s+in\s+(?P<c>\S+)|\s*/\s*(?P<d>[^\s()\[\]]+)"
    r"|_(?P<e>[^_()\[\]]+))"
)


def time_unit_of(header: str) -> str | None:
    """Unit that the header of time stamps states; None without one."""
    unit = role_and_unit(header)[1]
    return unit if unit in TIME_UNITS else None


def spelled(text: str) -> str:
    """Unit in a cell, in the usual spelling as far as it is known."""
    plain = text.strip().strip("[]()").strip()
    return _ALIASES.get(plain, plain)


def known_unit(role: str, text: str) -> str | None:
    """Unit of a channel, of the time, or of any of them for an empty `role`, that a cell states; None without one."""
    unit = spelled(text)
    allowed = {"time": TIME_UNITS, **UNITS}
    return unit if any(unit in units for name, units in allowed.items() if role in ("", name)) else None


def guess_time(headers: Iterable[str]) -> tuple[str | None, str | None]:
    """Header of the time stamps and the unit that it states; None where no header, or more than one, names them."""
    found = [(header, unit) for header in headers for role, unit in [role_and_unit(header)] if role == "time"]
    known = [(header, unit) for header, unit in found if unit is None or unit in TIME_UNITS]
    return known[0] if len(known) == 1 else (None, None)


def guess_columns(headers: Iterable[str], source: str) -> dict[str, Column]:
    """Map headers to channels where their names, such as ``P [MW]`` or ``angle/deg``, leave no doubt."""
    headers = list(headers)
    found: dict[str, Column] = {}
    problem = "no column names a channel"
    allowed = "V, angle, f, P, Q, or usual names with a unit, as 'P [MW]'"
    for header in headers:
        role, unit = role_and_unit(header)
        if role is None or role == "time":
            continue
        allowed = f"one column for {role}, in {', '.join(UNITS[role])}"
        if role in found:
            problem = f"columns {found[role].column!r} and {header!r} both seem to hold {role}"
            break
        if unit not in UNITS[role] and not (unit is None and header.strip() == role):
            problem = f"column {header!r} seems to hold {role}, but its unit is not clear"
            break
        found[role] = Column(header, unit=unit)
    else:
        if found:
            return found
    raise InputError(
        f"{problem}; the columns are {', '.join(map(repr, headers))}",
        where=source,
        allowed=allowed,
        remedy='Give columns, for example columns={"P": Column("P1", unit="MW")}',
    )


def role_and_unit(header: str) -> tuple[str | None, str | None]:
    """Channel, or ``"time"``, and unit that a header names; None for each that it does not."""
    if len(header) > LONGEST_HEADER:
        return None, None
    whole = _ROLES.get(_plain(header))
    if whole:
        return whole, None
    match = _WITH_UNIT.fullmatch(header.strip())
    if not match:
        return None, None
    unit = next(text for text in match.group("a", "b", "c", "d", "e") if text is not None).strip()
    return _ROLES.get(_plain(match["name"])), _ALIASES.get(unit, unit)


def _plain(name: str) -> str:
    return " ".join(re.split(r"[\s_.]+", name.strip().casefold()))
