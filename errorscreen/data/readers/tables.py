"""From the table of a file to a recording: units that the file states, and names that occur twice."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from errorscreen.data.frames import Specs, build_recording
from errorscreen.data.headers import known_unit
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.data.units import Column, as_column
from errorscreen.exceptions import InputError


def recording_of_table(
    table: Table,
    columns: Specs | None,
    *,
    time: str | Sequence[str],
    time_unit: str | None = None,
    notes: Iterable[str] = (),
    **options: Any,
) -> Recording:
    """Recording of columns, or of channels that follow from three phases; units of the file count where none is given.

    The options are those of `errorscreen.data.frames.build_recording`.
    """
    specs = with_units(columns or {}, table)
    first_header = time if isinstance(time, str) else time[0]
    stated = known_unit("time", table.units.get(first_header, ""))
    if time_unit is None:
        time_unit = stated or "s"
    elif stated is not None and stated != time_unit:
        raise other_unit("time", first_header, time_unit, stated, table)
    return build_recording(table, specs, time=time, time_unit=time_unit, notes=notes, **options)


def numbered(names: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """The names; the second of equal ones gets its number."""
    seen: dict[str, int] = dict.fromkeys(taken, 1)
    found = []
    for name in names:
        seen[name] = count = seen.get(name, 0) + 1
        found.append(name if count == 1 else f"{name} ({count})")
    return found


def with_units(columns: Specs, table: Table) -> dict[str, Column]:
    """Sources of channels with the units that the file states; a unit that is given must be the same."""
    specs = {role: as_column(role, c, f"{table.source}, channel {role!r}") for role, c in columns.items()}
    return {role: _with_unit(role, spec, table) for role, spec in specs.items()}


def _with_unit(role: str, spec: Column, table: Table) -> Column:
    found = known_unit(role, table.units.get(spec.column or "", ""))
    if found is None or found == spec.unit:
        return spec
    if spec.unit is not None:
        raise other_unit(role, spec.column, spec.unit, found, table)
    return as_column(role, {**spec.__dict__, "unit": found}, f"{table.source}, channel {role!r}")


def other_unit(what: str, header: str | None, given: str, found: str, table: Table) -> InputError:
    """Error for a unit that differs from that of the file."""
    return InputError(
        f"the unit of {what} is given as {given!r}, but the file says {found!r}",
        where=f"{table.source}, column {header!r}",
        allowed="the same unit",
        remedy="Correct the unit, or leave it out",
    )
