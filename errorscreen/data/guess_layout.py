"""Layout of a text of unknown origin: delimiter, decimal mark, rows of headers, as guesses."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from errorscreen.data.guesses import Guess
from errorscreen.data.headers import known_unit
from errorscreen.data.readers.head import (
    COMMENTS,
    DELIMITERS,
    WHITESPACE,
    counts_columns,
    is_number,
    split_line,
)
from errorscreen.data.readers.text import decoded
from errorscreen.exceptions import InputError

#: lines that the layout is guessed from
_LINES = 200
#: characters of a file from which on no further line is looked at: a file of many columns shows its layout in few
_CHARACTERS = 1_000_000


def text_of(path: Path) -> tuple[str, dict[str, Guess]]:
    """Text of a file, and its encoding where it is not UTF-8."""
    try:
        return decoded(path, "utf-8-sig"), {}
    except InputError as error:
        if not error.what.endswith("text"):
            raise
    return decoded(path, "latin-1"), {"encoding": Guess("latin-1", "the file is not UTF-8")}


def guess_layout(text: str, source: str, delimiter: str | None = None) -> dict[str, Guess]:
    """Keys of `Layout` that differ from the defaults; a delimiter that is known is not guessed; `source` is for
    messages.
    """
    keys: dict[str, Guess] = {}
    lines = text[: text.find("\0")].splitlines() if "\0" in text else _first_lines(text)
    told = [k for k, one in enumerate(lines) if one.strip() and not one.lstrip().startswith(COMMENTS)]
    rows = [k for k in told if not re.fullmatch(r"sep=.\s*", lines[k], re.IGNORECASE)]
    tail = [lines[k] for k in rows[len(rows) // 2 :]]
    if not tail:
        return keys
    known, delimiter = delimiter is not None, delimiter or _delimiter(tail)
    cells = {k: split_line(lines[k], delimiter, source) for k in rows}
    of_tail = [cell for one in tail for cell in split_line(one, delimiter, source)]
    decimal = "."
    commas = [cell for cell in of_tail if re.fullmatch(r"[+-]?\d*,\d+([eE][+-]?\d+)?", cell)]
    # in quotation marks between commas, groups of three digits may be thousands
    if commas and (delimiter != "," or any(not re.search(r",\d{3}$", cell) for cell in commas)):
        decimal = ","
        keys["decimal"] = Guess(",", "as the numbers in the file have it")
    # the reader knows a row that counts the columns above their names
    rows = [
        k for k, after in pairwise([*rows, rows[-1]]) if not counts_columns(cells[k], cells[after], decimal)
    ]
    width = len(split_line(tail[-1], delimiter, source))
    # spreadsheets fill a title with delimiters up to the width of the table
    filled = {k: sum(map(bool, cells[k])) for k in rows}
    begin = next((k for k in rows if len(cells[k]) == width and (width < 3 or filled[k] > 1)), rows[0])
    numeric = [any(is_number(cell, decimal) for cell in cells[k]) for k in rows if k >= begin]
    n_heads = numeric.index(True) if True in numeric else len(numeric)
    if begin != rows[0]:
        keys["skip_rows"] = Guess(begin, "lines above the table")
    heads = [k for k in rows if k >= begin][:n_heads]
    if len(heads) > 1 and all(known_unit("", cell) for cell in cells[heads[-1]] if cell):
        heads = heads[:-1]  # a row of units, which the reader knows
    if len(heads) > 1:
        keys["header_rows"] = Guess(len(heads), "rows of texts above the numbers")
    above = [lines[k] for k in range(begin) if lines[k].lstrip().startswith(COMMENTS)]
    named = bool(above) and len(split_line(above[-1].lstrip("#!/ "), delimiter, source)) == width > 1
    if not heads and not named:
        names = [f"column {k}" for k in range(1, width + 1)]
        keys["header"] = Guess(
            names, "the file has no headers; replace them by what the columns hold", check=True
        )
    if delimiter == WHITESPACE and not known:
        keys["delimiter"] = Guess(WHITESPACE, "fields are separated by blanks")
    return keys


def _first_lines(text: str) -> list[str]:
    end = 0
    for _ in range(_LINES):
        end = text.find("\n", end) + 1
        if not end:
            return text.splitlines()
        if end > _CHARACTERS:
            break
    return text[:end].splitlines()


def _delimiter(lines: Sequence[str]) -> str:
    """Delimiter that gives all lines equal numbers of fields; the comma last, because it may be a decimal mark."""
    lines = [re.sub('"[^"]*"', "", line) for line in lines]
    for one in (";", "\t", "|", ","):
        counts = {line.count(one) for line in lines}
        if len(counts) == 1 and counts != {0}:
            return one
    return max(DELIMITERS, key=lines[-1].count) if any(d in lines[-1] for d in DELIMITERS) else WHITESPACE
