"""Columns of text or numbers from a file or a table: finding them, reading numbers, naming cells."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from errorscreen.exceptions import InputError, unknown_name

#: Texts that mark a gap, in any case.
MISSING = (
    *("", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--"),
    *("bad", "bad data", "bad input", "no data", "invalid"),
)


@dataclass(frozen=True)
class Table:
    """Columns by header, and the number of each row in its source; `source` and `row_word` are for messages."""

    columns: Mapping[str, Any]
    rows: Sequence[int]
    source: str
    row_word: str = "line"

    def place(self, row: int, header: str) -> str:
        """Name of a cell."""
        return f"{self.source}, {self.row_word} {self.rows[row]}, column {header!r}"

    def column(self, header: str) -> Any:
        """Return a column; an unknown header raises `InputError` with the nearest matches."""
        if header not in self.columns:
            raise unknown_name(header, self.columns, kind="column", where=self.source)
        return self.columns[header]

    def numbers(
        self, header: str, *, missing: Iterable[str] = (), decimal: str = ".", remedy: str | None = None
    ) -> NDArray[np.float64]:
        """Numbers of a column, NaN for gaps; other texts are refused."""
        cells = pd.Series(list(self.column(header)))
        if pd.api.types.is_numeric_dtype(cells):
            return cells.to_numpy(dtype=float, na_value=np.nan)
        text = cells.astype("string").fillna("").str.strip()
        plain = text.str.replace(",", ".", regex=False) if decimal == "," else text
        numbers = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=float, na_value=np.nan)
        gap = text.str.lower().isin({t.lower() for t in (*MISSING, *missing)}).to_numpy(dtype=bool)
        wrong = np.flatnonzero(np.isnan(numbers) & ~gap)
        if len(wrong):
            found = str(text[int(wrong[0])])
            more = f" ({len(wrong)} such cells)" if len(wrong) > 1 else ""
            remedy = remedy or "Correct the cell, or add its text to missing if it marks a gap"
            if re.fullmatch(r"[+-]?\d+,\d+([eE][+-]?\d+)?", found):
                remedy = "Give decimal=',' for numbers with a decimal comma"
            marks = ", ".join(text or "empty" for text in MISSING)
            raise InputError(
                f"{found!r} is not a number{more}",
                where=self.place(int(wrong[0]), header),
                allowed=f"numbers with a decimal point, or a mark of a gap: {marks}",
                remedy=remedy,
            )
        return np.where(gap, np.nan, numbers)
