"""Parquet files, as pandas and data stores write them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from errorscreen.data.frames import Specs
from errorscreen.data.pandas_tables import INDEX
from errorscreen.data.readers.apart import Variables, check_extra, variables_of
from errorscreen.data.readers.base import Reader
from errorscreen.data.readers.tables import recording_of_table
from errorscreen.data.readers.text import check_file
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.exceptions import InputError


def read_parquet(
    path: str | os.PathLike[str],
    columns: Specs | None,
    *,
    time: str | Sequence[str] = "time",
    name: str | None = None,
    **options: Any,
) -> Recording:
    """Read a recording from a Parquet file; dates and durations are known by their type, and need no `time_unit`.

    Parameters
    ----------
    path : path-like
    columns : mapping of str to Column, str or mapping
        As in `errorscreen.data.from_frame`.
    time : str or two of them
        Header of the time stamps. ``"(index)"`` is the index that pandas stored; it is taken, too, where there is no
        column ``time``.
    name : str, optional
        The file's name without ending where not given.
    **options
        `time_unit`, `time_format`, `time_base`, `quality`, and those of `errorscreen.data.frames.build_recording`.

    Raises
    ------
    InputError
        If the file is damaged, or lacks a column.
    MissingExtraError
        Without pyarrow.
    """
    path = Path(path)
    table = read_parquet_table(path)
    if time == "time" and "time" not in table.columns and INDEX in table.columns:
        time = INDEX
    options["name"] = path.stem if name is None else name
    return recording_of_table(table, columns, time=time, **options)


def read_parquet_table(path: Path) -> Table:
    """Columns of a file, and the index as ``"(index)"`` where pandas stored one."""
    found = _found("parquet", path)
    cells: dict[str, Any] = {name: _cells(values) for name, values in found.arrays.items()}
    cells |= found.texts
    for name in found.report["zoned"]:
        cells[name] = cells[name].dt.tz_localize("UTC")
    index = found.report["index"]
    if len(index) == 1 and index[0] in cells:
        cells[INDEX] = cells[index[0]]
    if not cells:
        kinds = ", ".join(f"{name!r} of the type {kind}" for name, kind in found.unread.items())
        raise InputError(
            f"holds no columns of numbers or texts{', only ' + kinds if kinds else ''}",
            where=f"file {path}",
            allowed="columns of numbers, each with a name of its own",
        )
    length = len(next(iter(cells.values())))
    return Table(cells, range(1, length + 1), f"file {path}", "row")


def _cells(values: np.ndarray[Any, Any]) -> Any:
    return pd.Series(values) if values.dtype.kind in "mM" else values


def read_headers(path: Path) -> list[str]:
    """Names of the columns."""
    return list(_found("parquet_names", path).report["columns"])


def _found(kind: str, path: Path) -> Variables:
    check_file(path)
    check_extra("pyarrow", "parquet")
    return variables_of(kind, path, "a Parquet file")


PARQUET = Reader(
    lambda head: head.startswith(b"PAR1"),
    read_parquet,
    layout=frozenset({"time", "time_unit", "time_format", "time_base", "quality"}),
    headers=read_headers,
)
