"""Long format: a tag, a time, a value and perhaps a status in each row, as historians export it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from errorscreen.data.no_readings import Quality, without_bad_rows
from errorscreen.data.table import Table
from errorscreen.data.timestamps import TimeFormat, order_samples, read_time
from errorscreen.exceptions import InputError, unknown_name


@dataclass(frozen=True)
class Long:
    """Headers of the columns with the tag and the value of each reading."""

    tag: str
    value: str


def as_long(found: Long | Mapping[str, Any], source: str) -> Long:
    """Check a description of the long format, given as a mapping of fields or as `Long`."""
    if isinstance(found, Long):
        return found
    given = {key: str(value) for key, value in found.items()}
    for key in given:
        if key not in ("tag", "value"):
            raise unknown_name(key, ("tag", "value"), kind="field", where=f"{source}, long")
    if not given.get("tag") or not given.get("value"):
        raise InputError(
            "long lacks the column of the tags or of the values",
            where=source,
            allowed='for example {tag = "tag", value = "value"}',
        )
    return Long(**given)


def spread(
    table: Table,
    long: Long,
    wanted: Sequence[str],
    form: TimeFormat,
    notes: list[str],
    *,
    quality: Quality | None,
    missing: Iterable[str | float],
    decimal: str,
    on_backward: str,
) -> Table:
    """Table with a column for each wanted tag, on all their instants in order, with gaps where a tag has none.

    Several readings of a tag at one instant stay several rows. Rows of other tags are not looked at.
    """
    if form.of_day:
        raise InputError(
            "times of day do not put the readings of several tags in order",
            where=f"{table.source}, column {form.header!r}",
            allowed="dates, or seconds",
        )
    tags = pd.Series(list(table.column(long.tag)), dtype="string").fillna("").str.strip()
    for tag in wanted:
        if not (tags == tag).any():
            raise unknown_name(tag, tags.unique(), kind="tag", where=f"{table.source}, column {long.tag!r}")
    table, tags = _part(table, tags.isin([*wanted]).to_numpy(dtype=bool), tags)
    values = {long.value: table.numbers(long.value, missing=missing, decimal=decimal)}
    values = without_bad_rows(values, table, quality, notes)
    time, _ = read_time(table, form, [], decimal)
    readings = []
    for tag in dict.fromkeys(wanted):
        rows = np.flatnonzero((tags == tag).to_numpy(dtype=bool))
        of_tag = Table(
            {}, [table.rows[row] for row in rows.tolist()], f"{table.source}, tag {tag!r}", table.row_word
        )
        told: list[str] = []
        order = {"row": rows.astype(float)}
        stamps, order = order_samples(time[rows], order, of_tag, form.header, on_backward, told)
        notes += [f"{tag}: {note}" for note in told]
        readings.append(pd.DataFrame({"time": stamps, "row": order["row"].astype(int), "tag": tag}))
    found = pd.concat(readings, ignore_index=True)
    found["again"] = found.groupby(["tag", "time"]).cumcount()
    found["value"] = values[long.value][found["row"]]
    places = found.groupby(["time", "again"])["row"].min()
    wide = found.pivot(index=["time", "again"], columns="tag", values="value").reindex(places.index)
    at = places.to_numpy()
    columns: dict[str, Any] = {tag: wide[tag].to_numpy(dtype=float) for tag in dict.fromkeys(wanted)}
    for header in form.headers:
        columns[header] = _picked(table.column(header), at)
    notes.append(f"The readings of {len(columns) - len(form.headers)} tags stand on {len(at)} rows.")
    units = {header: table.units[header] for header in form.headers if header in table.units}
    return Table(columns, [table.rows[row] for row in at], table.source, table.row_word, units)


def _part(table: Table, keep: np.ndarray[Any, Any], tags: Any) -> tuple[Table, Any]:
    """Some rows of a table, and their tags."""
    at = np.flatnonzero(keep)
    columns = {header: _picked(cells, at) for header, cells in table.columns.items()}
    rows = [table.rows[row] for row in at.tolist()]
    return Table(columns, rows, table.source, table.row_word, table.units), tags.iloc[at]


def _picked(cells: Any, at: np.ndarray[Any, Any]) -> Any:
    return cells[at] if isinstance(cells, np.ndarray) else [cells[row] for row in at]
