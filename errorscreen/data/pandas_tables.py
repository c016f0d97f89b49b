"""Columns of a pandas table as they are: dates with or without a zone, nullable, categorical and Arrow types."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from errorscreen.data.table import Table
from errorscreen.exceptions import InputError

#: header of the index
INDEX = "(index)"


def headers_of_frame(frame: pd.DataFrame) -> list[str]:
    """Headers; those of several levels are joined by ``|``, as the rows of a header in a file."""
    if frame.columns.nlevels == 1:
        return [str(header) for header in frame.columns]
    return ["|".join(part for part in map(str, parts) if part) for parts in frame.columns]


def table_of_frame(frame: pd.DataFrame, source: str, *, with_index: bool) -> Table:
    """Columns by header, and the index as ``"(index)"`` if wanted.

    Raises
    ------
    InputError
        If two columns have one header.
    """
    headers = headers_of_frame(frame)
    if len({*headers}) < len(headers):
        twice = next(header for header in headers if headers.count(header) > 1)
        raise InputError(f"column {twice!r} occurs more than once", where=source, allowed="unique names")
    cells = {header: cells_of(frame.iloc[:, place]) for place, header in enumerate(headers)}
    if with_index:
        if frame.index.nlevels > 1:
            names = ", ".join(repr(str(name)) for name in frame.index.names)
            raise InputError(
                f"the index has the levels {names}",
                where=source,
                allowed="an index of instants, or time",
                remedy="Give frame.reset_index(), and time, the header of the time stamps",
            )
        cells[INDEX] = cells_of(pd.Series(frame.index))
    return Table(cells, range(len(frame)), source, "row")


def cells_of(column: pd.Series) -> Any:
    """Numbers as an array, with NaN for gaps; dates and durations as a Series; else a list, of texts where they are."""
    dtype = column.dtype
    if isinstance(dtype, pd.CategoricalDtype):
        return cells_of(column.astype(dtype.categories.dtype))
    if dtype.kind in "mM":
        if isinstance(dtype, pd.ArrowDtype):
            column = column.astype(dtype.pyarrow_dtype.to_pandas_dtype())
        return column.reset_index(drop=True)
    if dtype.kind in "iuf":
        return column.to_numpy(dtype=np.float64, na_value=np.nan)
    return column.tolist() if dtype.kind != "c" else column.to_numpy()
