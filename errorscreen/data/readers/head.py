"""Layout of text files, and what stands above their first row of numbers."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from errorscreen.data.headers import known_unit
from errorscreen.data.readers.text import decoded, refuse_other_format
from errorscreen.exceptions import InputError

DELIMITERS = (",", ";", "\t", "|")
#: runs of blanks and tabulators
WHITESPACE = "whitespace"
#: what a line of comment above the header begins with
COMMENTS = ("#", "!", "//")
#: first line by which spreadsheets state the delimiter
_STATED = re.compile(r"sep=(.)\s*", re.IGNORECASE)


@dataclass(frozen=True)
class Layout:
    """Layout of a text file, see `read_csv`."""

    delimiter: str | None = None
    decimal: str = "."
    encoding: str = "utf-8-sig"
    skip_rows: int = 0
    header_rows: int = 1
    header: Sequence[str] | None = None

    def check(self, source: str) -> None:
        """Raise `InputError` for a value that is not allowed."""
        if self.decimal not in (".", ","):
            raise InputError(f"decimal is {self.decimal!r}", where=source, allowed="'.' or ','")
        if self.skip_rows < 0:
            raise InputError(f"skip_rows is {self.skip_rows}", where=source, allowed="0 or more")
        if self.header_rows < 1:
            raise InputError(
                f"header_rows is {self.header_rows}",
                where=source,
                allowed="1 or more",
                remedy="Of a file without headers give header, the names of its columns",
            )


@dataclass
class Head:
    """What stands above the first row of numbers, and the text below it."""

    source: str
    names: list[str]
    delimiter: str
    units: dict[str, str]
    body: str
    #: number of the first line of `body` in the file
    line: int

    @classmethod
    def of(cls, path: Path, layout: Layout) -> Head:
        """Head of a text file."""
        layout.check(f"file {path}")
        text = decoded(path, layout.encoding)
        refuse_other_format(text[:20].encode("utf-8", "replace"), path)
        return cls.of_text(text, layout, f"file {path}")

    @classmethod
    def of_text(cls, text: str, layout: Layout, source: str) -> Head:
        """Head of a text; `source` is for messages."""
        layout.check(source)
        if not text.strip():
            raise InputError("is empty", where=source, allowed="a header row and rows of numbers")
        lines = _Lines(text)
        for _ in range(min(layout.skip_rows, len(text))):
            lines.take()
        stated, comment = None, ""
        while (line := lines.next()) is not None and (
            not line.strip() or line.lstrip().startswith(COMMENTS) or _STATED.fullmatch(line)
        ):
            match = _STATED.fullmatch(line)
            stated, comment = match[1] if match else stated, line.strip()
            lines.take()
        if line is None:
            raise InputError("is empty", where=source, allowed="a header row and rows of numbers")
        delimiter = layout.delimiter or stated or _guessed(line)
        same = delimiter == layout.decimal == "," and '"' not in text  # marks keep a comma inside a number
        if delimiter != WHITESPACE and (len(delimiter) != 1 or same):
            raise InputError(
                f"the fields are separated by {delimiter!r} and decimals by {layout.decimal!r}",
                where=source,
                allowed=f"one character, and not the same unless numbers stand in quotation marks, or {WHITESPACE!r}",
                remedy="Give delimiter=';' or a file with decimal points",
            )
        if layout.header is not None:
            return cls(source, [str(one) for one in layout.header], delimiter, {}, lines.rest, lines.number)
        first, above = (split_line(one, delimiter, source) for one in (line, comment.lstrip("#!/ ")))
        if counts_columns(first, split_line(lines.after() or "", delimiter, source), layout.decimal):
            lines.take()
            first = split_line(lines.next() or "", delimiter, source)
        numeric = all(is_number(cell, layout.decimal) for cell in first if cell)
        if numeric and len(above) == len(first) > 1:
            return cls(source, above, delimiter, {}, lines.rest, lines.number)
        rows = [
            split_line(lines.take() or "", delimiter, source)
            for _ in range(min(layout.header_rows, len(text)))
        ]
        width = max(map(len, rows))
        padded = [[*row, *[""] * (width - len(row))] for row in rows]
        names = ["|".join(cell for cell in cells if cell) for cells in zip(*padded, strict=True)]
        if numeric:
            raise InputError(
                "has numbers in its first row where headers are expected",
                where=source,
                allowed="a row with the names of the columns",
                remedy='Give header, for example header = ["time", "V", "P"], or skip_rows',
            )
        units: dict[str, str] = {}
        below = split_line(lines.next() or "", delimiter, source)
        stated_units = [cell for cell in below if cell]
        if len(below) == len(names) and stated_units and all(known_unit("", cell) for cell in stated_units):
            units = dict(zip(names, below, strict=True))
            lines.take()
        return cls(source, names, delimiter, units, lines.rest, lines.number)


class _Lines:
    """Lines of a text one after the other, and the rest."""

    def __init__(self, text: str) -> None:
        self._text, self._at, self.number = text, 0, 1

    def next(self) -> str | None:
        """The next line, which stays; None at the end."""
        end = self._text.find("\n", self._at)
        end = len(self._text) if end < 0 else end
        return None if self._at >= len(self._text) else self._text[self._at : end].rstrip("\r")

    def after(self) -> str | None:
        """The line after the next one."""
        at, number = self._at, self.number
        self.take()
        line, self._at, self.number = self.next(), at, number
        return line

    def take(self) -> str | None:
        line = self.next()
        if line is not None:
            end = self._text.find("\n", self._at)
            self._at, self.number = (len(self._text) if end < 0 else end + 1), self.number + 1
        return line

    @property
    def rest(self) -> str:
        return self._text[self._at :]


def _guessed(line: str) -> str:
    plain = re.sub('"[^"]*"', "", line)
    best = max(DELIMITERS, key=plain.count)
    return best if best in plain or len(plain.split()) < 2 else WHITESPACE


def split_line(line: str, delimiter: str, source: str) -> list[str]:
    """Fields of a line, without quotation marks around them."""
    if delimiter == WHITESPACE:
        return line.split()
    try:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error as error:  # a carriage return within the line, or no end of a quotation
        raise InputError(
            f"the line {line[:40]!r} cannot be split into fields: {error}",
            where=source,
            allowed="lines that end with a line feed, with or without a carriage return before it",
            remedy="Save the file as text of Windows or Unix, and look for quotation marks that are not closed",
        ) from error
    return [cell.strip() for cell in cells]


def counts_columns(cells: Sequence[str], below: Sequence[str], decimal: str) -> bool:
    """Whether a row counts the columns whose names stand below it, as ``time, 1, 2`` in an export of PSS/E."""
    numbers = [cell.isdecimal() for cell in cells[1:]]
    return (
        len(cells) == len(below) > 1
        and not is_number(cells[0], decimal)
        and all(numbers)
        and not any(is_number(cell, decimal) for cell in below)
    )


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell holds a number; beside a decimal comma, a dot is part of none."""
    if decimal == ",":
        cell = cell.replace(".", "?").replace(",", ".")
    try:
        float(cell)
    except ValueError:
        return False
    return True
