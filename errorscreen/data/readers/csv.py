"""Reading recordings from text files of columns, with or without headers."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from errorscreen.data.frames import Specs, build_recording
from errorscreen.data.headers import known_unit
from errorscreen.data.no_readings import Quality, as_quality
from errorscreen.data.readers.base import Reader
from errorscreen.data.readers.text import decoded, is_text, refuse_other_format
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.data.timestamps import format_of_time, read_time
from errorscreen.data.units import Column, as_column
from errorscreen.data.waveforms import Waveforms, as_waveforms, recording_of_waveforms
from errorscreen.exceptions import InputError, unknown_name

DELIMITERS = (",", ";", "\t", "|")
#: runs of blanks and tabulators
WHITESPACE = "whitespace"
#: what a line of comment above the header begins with
_COMMENTS = ("#", "!", "//")
#: bytes that are looked at together
_BLOCK = 2**22
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


def read_csv(
    path: str | os.PathLike[str],
    columns: Specs | None,
    *,
    time: str | Sequence[str] = "time",
    time_unit: str | None = None,
    name: str | None = None,
    delimiter: str | None = None,
    decimal: str = ".",
    encoding: str = "utf-8-sig",
    skip_rows: int = 0,
    header_rows: int = 1,
    header: Sequence[str] | None = None,
    quality: Quality | Mapping[str, Any] | None = None,
    waveforms: Waveforms | Mapping[str, Any] | None = None,
    **options: Any,
) -> Recording:
    r"""Read a recording from a text file of columns.

    `Recording.assumptions` says what was assumed, dropped, sorted or averaged.

    Parameters
    ----------
    path : path-like
    columns : mapping of str to Column, str or mapping
        As in `from_frame`.
    time : str or two of them
        Header of the time stamps, as in `from_frame`.
    time_unit : str, optional
        As in `errorscreen.data.frames.build_recording`; that of the row of units, or seconds, where not given.
    name : str, optional
        The file's name without ending where not given.
    delimiter : str, optional
        One character, or ``"whitespace"``. Where not given, a first line such as ``sep=;`` states it, or it is the most
        frequent of comma, semicolon, tabulator and bar in the header, or whitespace without any of them.
    decimal : {".", ","}
    encoding : str
        The default understands byte-order marks, and UTF-16 without one.
    skip_rows : int
        Lines above the header. Comments there, which begin with ``#``, ``!`` or ``//``, are skipped, unless the last
        one names the columns.
    header_rows : int
        Rows of the header; the cells of a column are joined by ``|``. A row of units below it is recognised.
    header : sequence of str, optional
        Names of the columns of a file without headers.
    quality : Quality or mapping, optional
        As in `errorscreen.data.frames.build_recording`.
    waveforms : Waveforms or mapping, optional
        Sampled voltages and currents of three phases, from which V, angle, f, P and Q follow; `columns` then holds only
        further channels.
    **options
        `base_mva`, `f_nominal` and all others of `from_frame`.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If something cannot be used; it says what was found, where (file, line, column), what is allowed, and what to
        do.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from errorscreen.data import Column
    >>> rows = [f"{0.1 * k:.1f},{20.0 if k < 20 else 18.0},{30.0 if k < 20 else 27.0}" for k in range(60)]
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "dip.csv")
    ...     _ = path.write_text("time,U,P\n" + "\n".join(rows))
    ...     columns = {"V": Column("U", unit="kV"), "P": Column("P", unit="MW")}
    ...     rec = read_csv(path, columns, base_mva=50, base_kv=20, f_nominal=50)
    >>> rec.initial(["V", "P"]), rec.event_time
    ({'V': 1.0, 'P': 0.6}, 2.0)
    """
    path = Path(path)
    source = f"file {path}"
    specs = {role: as_column(role, c, f"{source}, channel {role!r}") for role, c in (columns or {}).items()}
    sampled = None if waveforms is None else as_waveforms(waveforms, source)
    status = as_quality(quality, source)
    headers_of_time = [time] if isinstance(time, str) else [*time]
    needed = [*headers_of_time, *(header for spec in specs.values() for header in spec.headers)]
    needed = [*needed, *(() if sampled is None else (*sampled.voltage, *sampled.current))]
    layout = Layout(delimiter, decimal, encoding, skip_rows, header_rows, header)
    form = format_of_time(
        time, time_unit or "s", options.get("time_format"), options.get("time_base"), source
    )
    texts = [*(form.headers if form.of_texts else ()), *([status.column] if status else [])]
    table = read_table(path, layout, [*needed, *texts], texts)
    stated = known_unit("time", table.units.get(needed[0], ""))
    if time_unit is None:
        time_unit = stated
    elif stated is not None and stated != time_unit:
        raise _other_unit("time", needed[0], time_unit, stated, table)
    options["name"] = path.stem if name is None else name
    if sampled is not None:
        notes: list[str] = []
        stamps, _ = read_time(table, replace(form, unit=time_unit or "s"), notes, decimal)
        if (np.diff(stamps) <= 0).any():
            raise InputError(
                "time does not increase with each sample",
                where=source,
                allowed="stamps with all their decimals",
            )
        return recording_of_waveforms(
            table, stamps, sampled, with_units(specs, table), notes=notes, **options
        )
    return build_recording(
        table,
        with_units(specs, table),
        time=time,
        time_unit=time_unit or "s",
        decimal=decimal,
        quality=status,
        **options,
    )


def with_units(columns: Specs, table: Table) -> dict[str, Column]:
    """Sources of channels with the units that the file states; a unit that is given must be the same."""
    specs = {role: as_column(role, c, f"{table.source}, channel {role!r}") for role, c in columns.items()}
    return {role: _with_unit(role, spec, table) for role, spec in specs.items()}


def _with_unit(role: str, spec: Column, table: Table) -> Column:
    found = known_unit(role, table.units.get(spec.column or "", ""))
    if found is None or found == spec.unit:
        return spec
    if spec.unit is not None:
        raise _other_unit(role, spec.column, spec.unit, found, table)
    return as_column(role, {**spec.__dict__, "unit": found}, f"{table.source}, channel {role!r}")


def _other_unit(what: str, header: str | None, given: str, found: str, table: Table) -> InputError:
    return InputError(
        f"the unit of {what} is given as {given!r}, but the file says {found!r}",
        where=f"{table.source}, column {header!r}",
        allowed="the same unit",
        remedy="Correct the unit, or leave it out",
    )


def read_headers(path: Path, layout: Layout) -> list[str]:
    """Headers of a text file, as `read_table` names its columns."""
    return _Head.of(path, layout).names


def read_table(
    path: Path, layout: Layout, only: Iterable[str] | None = None, texts: Iterable[str] = ()
) -> Table:
    """Read the cells of a file.

    Parameters
    ----------
    path : Path
    layout : Layout
    only : iterable of str, optional
        Headers of the columns that are read; all where not given. One that the file lacks raises `InputError`.
    texts : iterable of str
        Headers of columns that stay texts, for example because leading zeros count.

    Returns
    -------
    Table
        Numbers as an array where a whole column holds them, else texts. Blank lines are skipped.
    """
    head = _Head.of(path, layout)
    wanted = list(dict.fromkeys(head.names if only is None else only))
    for name in wanted:
        if head.names.count(name) > 1:
            raise InputError(
                f"column {name!r} occurs {head.names.count(name)} times in the header",
                where=head.source,
                allowed="a name of its own for each column",
                remedy="Give header_rows = 2 where two rows name the columns, or header, a name for each column",
            )
    for name in wanted:
        if name not in head.names:
            raise unknown_name(name, dict.fromkeys(head.names), kind="column", where=head.source)
    found = _read_fast(head, wanted, layout, {*texts}) or _read_rows(head, wanted)
    if not len(found.rows):
        raise InputError(
            "holds a header but no samples", where=head.source, allowed="rows of numbers below it"
        )
    return found


@dataclass
class _Head:
    """What stands above the first row of numbers, and the text below it."""

    source: str
    names: list[str]
    delimiter: str
    units: dict[str, str]
    body: str
    #: number of the first line of `body` in the file
    line: int

    @classmethod
    def of(cls, path: Path, layout: Layout) -> _Head:
        source = f"file {path}"
        layout.check(source)
        text = decoded(path, layout.encoding)
        refuse_other_format(text[:20].encode("utf-8", "replace"), path)
        if not text.strip():
            raise InputError("is empty", where=source, allowed="a header row and rows of numbers")
        lines = _Lines(text)
        for _ in range(layout.skip_rows):
            lines.take()
        stated, comment = None, ""
        while (line := lines.next()) is not None and (
            not line.strip() or line.lstrip().startswith(_COMMENTS) or _STATED.fullmatch(line)
        ):
            match = _STATED.fullmatch(line)
            stated, comment = match[1] if match else stated, line.strip()
            lines.take()
        if line is None:
            raise InputError("is empty", where=source, allowed="a header row and rows of numbers")
        delimiter = layout.delimiter or stated or _guessed(line)
        if delimiter != WHITESPACE and (len(delimiter) != 1 or delimiter == layout.decimal == ","):
            raise InputError(
                f"the fields are separated by {delimiter!r} and decimals by {layout.decimal!r}",
                where=source,
                allowed=f"one character, and not the same, or {WHITESPACE!r}",
                remedy="Give delimiter=';' or a file with decimal points",
            )
        if layout.header is not None:
            return cls(source, [str(one) for one in layout.header], delimiter, {}, lines.rest, lines.number)
        first, above = _split(line, delimiter), _split(comment.lstrip("#!/ "), delimiter)
        numeric = all(_is_number(cell, layout.decimal) for cell in first if cell)
        if numeric and len(above) == len(first) > 1:
            return cls(source, above, delimiter, {}, lines.rest, lines.number)
        rows = [_split(lines.take() or "", delimiter) for _ in range(layout.header_rows)]
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
        below = _split(lines.next() or "", delimiter)
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


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == WHITESPACE:
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]


def _is_number(cell: str, decimal: str) -> bool:
    try:
        float(cell.replace(",", ".") if decimal == "," else cell)
    except ValueError:
        return False
    return True


def _read_fast(head: _Head, wanted: Sequence[str], layout: Layout, texts: set[str]) -> Table | None:
    """The table by the parser of pandas, where every line has as many fields as the header; else None."""
    if head.delimiter == WHITESPACE or len(head.names) == 1 or '"' in head.body or not head.body.isascii():
        return None
    data = head.body.encode("ascii").rstrip()
    if not _even(data, head.delimiter, len(head.names)):
        return None
    head.body = ""  # a large file is held once
    places = [head.names.index(name) for name in wanted]
    frame = pd.read_csv(
        io.BytesIO(data), sep=head.delimiter, decimal=layout.decimal, header=None, usecols=places, quoting=3,
        skip_blank_lines=False, skipinitialspace=True, low_memory=False,
        dtype={place: str for name, place in zip(wanted, places, strict=True) if name in texts},
    )  # fmt: skip
    cells = {
        name: column.to_numpy() if pd.api.types.is_float_dtype(column) or pd.api.types.is_integer_dtype(column)
        else column.astype("string").fillna("").tolist()
        for name, column in ((name, frame[place]) for name, place in zip(wanted, places, strict=True))
    }  # fmt: skip
    return Table(cells, range(head.line, head.line + len(frame)), head.source, units=head.units)


def _even(data: bytes, delimiter: str, width: int) -> bool:
    """Whether every line has as many fields."""
    begin = 0
    while begin < len(data):
        end = data.find(b"\n", begin + _BLOCK)
        end = len(data) if end < 0 else end
        block = np.frombuffer(data[begin:end], dtype=np.uint8)
        lines = np.append(np.flatnonzero(block == ord("\n")), len(block))
        found = np.searchsorted(np.flatnonzero(block == ord(delimiter)), lines)
        if (np.diff(found, prepend=0) != width - 1).any():
            return False
        begin = end + 1
    return begin > 0


def _read_rows(head: _Head, wanted: Sequence[str]) -> Table:
    """The table line by line, with a message for the line that does not fit."""
    rows, numbers = [], []
    places = [head.names.index(name) for name in wanted]
    for line, row in _rows(head):
        if any(cell.strip() for cell in row):
            fitting = _fitting(row, head.names, f"{head.source}, line {line}", head.delimiter)
            rows.append([fitting[place] for place in places])
            numbers.append(line)
    cells: dict[str, Any] = dict(zip(wanted, map(list, zip(*rows, strict=True)), strict=True)) if rows else {}
    return Table(cells, numbers, head.source, units=head.units)


def _rows(head: _Head) -> Iterator[tuple[int, list[str]]]:
    if head.delimiter == WHITESPACE:
        for k, line in enumerate(head.body.splitlines()):
            yield head.line + k, line.split()
        return
    reader = csv.reader(io.StringIO(head.body, newline=""), delimiter=head.delimiter, skipinitialspace=True)
    try:
        for row in reader:
            yield head.line - 1 + reader.line_num, row
    except csv.Error as error:
        raise InputError(
            f"cannot be split into fields: {error}",
            where=f"{head.source}, line {head.line - 1 + reader.line_num}",
            remedy="Look for a quotation mark that is not closed",
        ) from error


def _fitting(row: list[str], header: list[str], where: str, delimiter: str) -> list[str]:
    """Return as many cells as the header has; empty ones at the end of the line are cut off."""
    surplus = row[len(header) :]
    if len(row) < len(header) or any(cell.strip() for cell in surplus):
        remedy = "Complete or delete the line"
        if surplus and delimiter == ",":
            remedy += "; numbers with a decimal comma need another delimiter, and decimal=','"
        problem = f"the line has {len(row)} fields, the header has {len(header)}"
        raise InputError(problem, where=where, remedy=remedy)
    return row[: len(header)]


CSV = Reader(is_text, read_csv)
