"""Columns of text or numbers from a file or a table: finding them, reading numbers, naming cells."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from errorscreen._runtime.display import listed
from errorscreen.data.complex_texts import is_complex
from errorscreen.exceptions import InputError, unknown_name

#: Texts that mark a gap, in any case.
MISSING = (
    *("", "nan", "na", "n/a", "#n/a", "n.a.", "null", "(null)", "<null>", "none", "-", "--", "---", "*", "?"),
    *(
        "bad",
        "bad data",
        "bad input",
        "bad quality",
        "no data",
        "no sample",
        "no result",
        "invalid",
        "missing",
    ),
    *(
        "i/o timeout",
        "comm fail",
        "scan off",
        "shutdown",
        "pt created",
        "out of serv",
        "calc failed",
        "over range",
    ),
    *(
        "under range",
        "not connect",
        "questionable",
        "#value!",
        "#ref!",
        "#div/0!",
        "#num!",
        "1.#qnan",
        "-1.#ind",
    ),
)
#: what to do with a column of complex numbers
_AS_PHASORS = (
    "Give phasors = { voltage = [...], current = [...] } instead of columns, with all three phases or the positive "
    "sequence; or split it into two columns, which V takes as real and imag"
)


def _shown(text: str) -> str:
    """A cell in quotation marks, and the beginning of a long one."""
    return repr(text if len(text) <= 80 else f"{text[:80]}…")


@dataclass(frozen=True)
class Table:
    """Columns by header, and the number of each row in its source; `source` and `row_word` are for messages, `units`
    what a row of units below the header says.
    """

    columns: Mapping[str, Any]
    rows: Sequence[int]
    source: str
    row_word: str = "line"
    units: Mapping[str, str] = field(default_factory=dict)

    def place(self, row: int, header: str) -> str:
        """Name of a cell."""
        return f"{self.source}, {self.row_word} {self.rows[row]}, column {header!r}"

    def column(self, header: str) -> Any:
        """Return a column; an unknown header raises `InputError` with the nearest matches."""
        if header not in self.columns:
            raise unknown_name(header, self.columns, kind="column", where=self.source)
        return self.columns[header]

    def numbers(
        self,
        header: str,
        *,
        missing: Iterable[str | float] = (),
        decimal: str = ".",
        remedy: str | None = None,
    ) -> NDArray[np.float64]:
        """Numbers of a column, NaN for gaps; other texts are refused."""
        cells = self.column(header)
        cells = pd.Series(cells if isinstance(cells, np.ndarray) else list(cells))
        known = [str(mark).strip() for mark in missing]
        marks = pd.to_numeric(pd.Series(known, dtype="string"), errors="coerce").dropna().to_numpy()
        if pd.api.types.is_complex_dtype(cells):
            raise InputError(
                "the column holds complex numbers",
                where=f"{self.source}, column {header!r}",
                allowed="real numbers",
                remedy=_AS_PHASORS,
            )
        if pd.api.types.is_numeric_dtype(cells):
            numbers = cells.to_numpy(dtype=float, na_value=np.nan)
            return np.where(np.isin(numbers, marks), np.nan, numbers) if len(marks) else numbers
        text = cells.astype("string").fillna("").str.strip()
        plain = text
        if decimal == ",":  # a dot would be one of thousands, or the mark of another file
            plain = text.where(~text.str.contains(".", regex=False)).str.replace(",", ".", regex=False)
        numbers = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=float, na_value=np.nan)
        gap = text.str.lower().isin({text.lower() for text in (*MISSING, *known)}).to_numpy(dtype=bool)
        gap = gap | np.isin(numbers, marks)
        wrong = np.flatnonzero(np.isnan(numbers) & ~gap)
        if len(wrong):
            found = str(text[int(wrong[0])])
            kinds = text.iloc[wrong].unique()
            more = f" ({len(wrong)} such cells)" if len(wrong) > 1 else ""
            if len(kinds) > 1:
                more = f", nor are {listed(map(_shown, kinds[1:]))} ({len(wrong)} such cells)"
            remedy = remedy or "Correct the cells, or add their texts to missing if they mark gaps"
            if re.fullmatch(r"[+-]?\d+,\d+([eE][+-]?\d+)?", found):
                remedy = "Give decimal=',' for numbers with a decimal comma"
            if re.fullmatch(r"[+-]?\d{1,3}([.,]\d{3})+([.,]\d+)?", found) and found.count(decimal) < 2:
                remedy = f"Export numbers without marks between thousands; {decimal!r} is their decimal mark"
            if is_complex(found):
                remedy = _AS_PHASORS
            raise InputError(
                f"{_shown(found)} is {'a phasor' if is_complex(found) else 'not a number'}{more}",
                where=self.place(int(wrong[0]), header),
                allowed=f"numbers with {decimal!r} before decimals, or a mark of a gap: an empty cell, NaN, 'bad'",
                remedy=remedy,
            )
        return np.where(gap, np.nan, numbers)
