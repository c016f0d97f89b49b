"""Reading recordings from text files of columns, with or without headers."""

from __future__ import annotations

import csv
import io
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from errorscreen.data.frames import Specs
from errorscreen.data.headers import known_unit
from errorscreen.data.no_readings import Quality, as_quality
from errorscreen.data.phase_headers import sisters
from errorscreen.data.phasors import Phasors, as_phases, to_read
from errorscreen.data.readers.base import LAYOUT_KEYS, Reader
from errorscreen.data.readers.head import WHITESPACE, Head, Layout
from errorscreen.data.readers.long import Long, as_long, spread
from errorscreen.data.readers.tables import recording_of_table
from errorscreen.data.readers.text import is_text
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.data.timestamps import format_of_time
from errorscreen.data.units import as_column
from errorscreen.data.waveforms import Waveforms
from errorscreen.exceptions import InputError, unknown_name

#: bytes that are looked at together
_BLOCK = 2**22


def read_csv(
    path: str | os.PathLike[str],
    columns: Specs | None,
    *,
    name: str | None = None,
    delimiter: str | None = None,
    decimal: str = ".",
    encoding: str = "utf-8-sig",
    skip_rows: int = 0,
    header_rows: int = 1,
    header: Sequence[str] | None = None,
    **options: Any,
) -> Recording:
    r"""Read a recording from a text file of columns.

    `Recording.assumptions` says what was assumed, dropped, sorted or averaged.

    Parameters
    ----------
    path : path-like
    columns : mapping of str to Column, str or mapping
        As in `from_frame`.
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
    **options
        `time`, the header of the time stamps or two of them (``"time"``); `time_unit`, that of the row of units, or
        seconds, where not given; `waveforms` or `phasors`, three phases from which V, angle, f, P and Q follow
        (`columns` then holds only further channels); `long`, the columns with tags and values of a file
        with one reading in each row (`columns` then names tags); `base_mva`, `f_nominal`, `quality` and all others of
        `from_frame`.

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
    return recording_of_text(
        Head.of(path, layout := Layout(delimiter, decimal, encoding, skip_rows, header_rows, header)),
        layout,
        columns,
        name=path.stem if name is None else name,
        **options,
    )


def recording_of_text(
    head: Head,
    layout: Layout,
    columns: Specs | None,
    *,
    time: str | Sequence[str] = "time",
    time_unit: str | None = None,
    quality: Quality | Mapping[str, Any] | None = None,
    waveforms: Waveforms | Mapping[str, Any] | None = None,
    phasors: Phasors | Mapping[str, Any] | None = None,
    long: Long | Mapping[str, Any] | None = None,
    row_word: str = "line",
    **options: Any,
) -> Recording:
    """Recording of a text whose head was read; `row_word` is for messages, all else as in `read_csv`."""
    source = head.source
    specs = {role: as_column(role, c, f"{source}, channel {role!r}") for role, c in (columns or {}).items()}
    phases = as_phases(waveforms, phasors, source)
    status = as_quality(quality, source)
    tags = None if long is None else as_long(long, source)
    form = format_of_time(
        time, time_unit or "s", options.get("time_format"), options.get("time_base"), source
    )
    wanted = to_read(phases, (header for spec in specs.values() for header in spec.headers), head.names)
    wanted = list(dict.fromkeys([*wanted, *(() if phases is None else phases.headers)]))
    once = [name for name, count in Counter(head.names).items() if count == 1]
    beside = sisters(specs["V"].column or "", once) if "V" in specs and tags is None else []
    texts = [*(form.headers if form.of_texts else ()), *([status.column] if status else [])]
    texts = [*texts, *([tags.tag] if tags else [])]
    columns_read = [*form.headers, *(wanted if tags is None else [tags.value]), *beside, *texts]
    table = replace(read_body(head, layout, columns_read, texts), row_word=row_word)
    told: list[str] = []
    if tags is not None:
        unit = time_unit or known_unit("time", table.units.get(form.header, "")) or "s"
        table = spread(
            table, tags, wanted, replace(form, unit=unit), told, quality=status, decimal=layout.decimal,
            missing=options.get("missing", ()), on_backward=options.get("on_backward", "error"),
        )  # fmt: skip
        status = None
    return recording_of_table(
        table, specs, time=time, time_unit=time_unit, waveforms=waveforms, phasors=phasors, quality=status,
        decimal=layout.decimal, notes=told, **options,
    )  # fmt: skip


def read_headers(path: Path, layout: Layout) -> list[str]:
    """Headers of a text file, as `read_table` names its columns."""
    return Head.of(path, layout).names


def _headers(path: Path, *, long: Any = None, **layout: Any) -> list[str]:
    return headers_of_text(Head.of(path, found := Layout(**layout)), found, long)


def headers_of_text(head: Head, layout: Layout, long: Any) -> list[str]:
    """Headers below a head, or the tags of the long format."""
    if long is None:
        return head.names
    tag = as_long(long, head.source).tag
    return list(dict.fromkeys(read_body(head, layout, [tag], [tag]).columns[tag]))


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
    return read_body(Head.of(path, layout), layout, only, texts)


def read_body(head: Head, layout: Layout, only: Iterable[str] | None, texts: Iterable[str]) -> Table:
    """As `read_table`, below a head, which is used up."""
    wanted = list(dict.fromkeys(head.names if only is None else only))
    times = Counter(head.names)
    for name in wanted:
        if times[name] > 1:
            raise InputError(
                f"column {name!r} occurs {times[name]} times in the header",
                where=head.source,
                allowed="a name of its own for each column",
                remedy="Give header_rows = 2 where two rows name the columns, or header, a name for each column",
            )
    for name in wanted:
        if name not in times:
            raise unknown_name(name, dict.fromkeys(head.names), kind="column", where=head.source)
    found = _read_fast(head, wanted, layout, {*texts}) or _read_rows(head, wanted)
    if not len(found.rows):
        raise InputError(
            "holds a header but no samples", where=head.source, allowed="rows of numbers below it"
        )
    return found


def _read_fast(head: Head, wanted: Sequence[str], layout: Layout, texts: set[str]) -> Table | None:
    """The table by the parser of pandas, where every line has as many fields as the header; else None."""
    if head.delimiter == WHITESPACE or len(head.names) == 1 or '"' in head.body or not head.body.isascii():
        return None
    head.body = head.body.rstrip("\r\n")  # a delimiter at the end may close the last row
    data = head.body.encode("ascii")
    if not data or not all(_even(block, head.delimiter, len(head.names)) for block in _blocks(data)):
        return None
    head.body = ""  # a large file is held once
    place_of = {name: place for place, name in enumerate(head.names)}

    def read(names: Iterable[str], as_texts: Iterable[str]) -> dict[str, Any]:
        return _read_blocks(
            data, {name: place_of[name] for name in names}, {*as_texts},
            sep=head.delimiter, decimal=layout.decimal, header=None, quoting=3, skip_blank_lines=False,
            skipinitialspace=True, low_memory=False,
        )  # fmt: skip

    cells = read(wanted, texts)
    mixed = [name for name in wanted if cells[name] is None]
    cells |= read(mixed, mixed) if mixed else {}
    lines = len(next(iter(cells.values())))
    return Table(cells, range(head.line, head.line + lines), head.source, units=head.units)


def _blocks(data: bytes) -> Iterator[bytes]:
    """Whole lines of a text, as many as are looked at together."""
    begin = 0
    while begin < len(data):
        end = data.find(b"\n", begin + _BLOCK)
        end = len(data) if end < 0 else end
        yield data[begin:end]
        begin = end + 1


def _even(block: bytes, delimiter: str, width: int) -> bool:
    """Whether every line has as many fields."""
    marks = np.frombuffer(block, dtype=np.uint8)
    lines = np.append(np.flatnonzero(marks == ord("\n")), len(marks))
    found = np.searchsorted(np.flatnonzero(marks == ord(delimiter)), lines)
    return bool((np.diff(found, prepend=0) == width - 1).all())


def _read_blocks(data: bytes, places: Mapping[str, int], texts: set[str], **options: Any) -> dict[str, Any]:
    """Cells of columns, by blocks, because the parser holds a multiple of what it reads; None for texts among numbers.

    Columns of `texts` are read as such.
    """
    cells: dict[str, Any] = {name: [] if name in texts else np.empty(0, dtype=np.int64) for name in places}
    lines, done = data.count(b"\n") + 1, 0
    for block in _blocks(data):
        frame = pd.read_csv(
            io.BytesIO(block), usecols=sorted(places.values()),
            dtype={places[name]: str for name in texts}, **options,
        )  # fmt: skip
        for name, place in places.items():
            column = frame[place]
            if name in texts:
                cells[name].extend(column.astype("string").fillna("").tolist())
            elif not (pd.api.types.is_float_dtype(column) or pd.api.types.is_integer_dtype(column)):
                cells[name] = None
            elif cells[name] is not None:
                cells[name] = _held(cells[name], column.to_numpy(), lines)
                cells[name][done : done + len(column)] = column
        done += len(frame)
    return cells


def _held(cells: NDArray[Any], block: NDArray[Any], lines: int) -> NDArray[Any]:
    """Room for the numbers of a column, of a type that holds those of the next block, too."""
    if not len(cells):
        return np.empty(lines, dtype=block.dtype)
    return cells.astype(np.result_type(cells, block), copy=False)


def _read_rows(head: Head, wanted: Sequence[str]) -> Table:
    """The table line by line, with a message for the line that does not fit."""
    rows, numbers = [], []
    place_of = {name: place for place, name in enumerate(head.names)}
    places = [place_of[name] for name in wanted]
    for line, row in _rows(head):
        if any(cell.strip() for cell in row):
            fitting = _fitting(row, head.names, f"{head.source}, line {line}", head.delimiter)
            rows.append([fitting[place] for place in places])
            numbers.append(line)
    cells: dict[str, Any] = dict(zip(wanted, map(list, zip(*rows, strict=True)), strict=True)) if rows else {}
    return Table(cells, numbers, head.source, units=head.units)


def _rows(head: Head) -> Iterator[tuple[int, list[str]]]:
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


CSV = Reader(is_text, read_csv, layout=LAYOUT_KEYS - {"sheet"}, headers=_headers)
