"""Reading recordings from text files with one header row."""

from __future__ import annotations

import codecs
import csv
import difflib
import io
import os
from pathlib import Path
from typing import Any

from errorscreen.data.frames import Specs, build_recording
from errorscreen.data.readers.base import Reader
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.exceptions import InputError

DELIMITERS = (",", ";", "\t")


def read_csv(
    path: str | os.PathLike[str],
    columns: Specs,
    *,
    time: str = "time",
    name: str | None = None,
    delimiter: str | None = None,
    decimal: str = ".",
    encoding: str = "utf-8-sig",
    skip_rows: int = 0,
    **options: Any,
) -> Recording:
    r"""Read a recording from a text file with one header row.

    `Recording.assumptions` says what was assumed, dropped, sorted or averaged.

    Parameters
    ----------
    path : path-like
    columns : mapping of str to Column, str or mapping
        As in `from_frame`.
    time : str
        Header of the time stamps.
    name : str, optional
        The file's name without ending where not given.
    delimiter : str, optional
        Comma, semicolon or tabulator where not given, whichever is most frequent in the header.
    decimal : {".", ","}
    encoding : str
        The default understands a byte-order mark.
    skip_rows : int
        Lines above the header.
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
    if decimal not in (".", ","):
        raise InputError(f"decimal is {decimal!r}", where=source, allowed="'.' or ','")
    table = read_table(path, delimiter=delimiter, decimal=decimal, encoding=encoding, skip_rows=skip_rows)
    name = path.stem if name is None else name
    return build_recording(table, columns, time=time, decimal=decimal, name=name, **options)


def read_table(
    path: Path,
    *,
    delimiter: str | None = None,
    decimal: str = ".",
    encoding: str = "utf-8-sig",
    skip_rows: int = 0,
) -> Table:
    """Read all cells of a file as text and skip blank lines."""
    source = f"file {path}"
    text = _text(path, encoding)
    if skip_rows < 0:
        raise InputError(f"skip_rows is {skip_rows}", where=source, allowed="0 or more")
    lines = text.splitlines(keepends=True)[skip_rows:]
    if not any(line.strip() for line in lines):
        raise InputError("is empty", where=source, allowed="a header row and rows of numbers")
    if delimiter is None:
        delimiter = max(DELIMITERS, key=lines[0].count)
    if len(delimiter) != 1 or delimiter == decimal == ",":
        raise InputError(
            f"the fields are separated by {delimiter!r} and decimals by {decimal!r}",
            where=source,
            allowed="one character, and not the same",
            remedy="Give delimiter=';' or a file with decimal points",
        )
    reader = csv.reader(io.StringIO("".join(lines), newline=""), delimiter=delimiter, skipinitialspace=True)
    header = [cell.strip() for cell in next(reader)]
    twice = [h for h in dict.fromkeys(header) if h and header.count(h) > 1]
    if twice:
        problem = f"column {twice[0]!r} occurs {header.count(twice[0])} times in the header"
        raise InputError(problem, where=source, allowed="a name of its own for each column")
    rows, numbers = [], []
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                line = skip_rows + reader.line_num
                rows.append(_fitting(row, header, f"{source}, line {line}", delimiter))
                numbers.append(line)
    except csv.Error as error:
        raise InputError(
            f"cannot be split into fields: {error}",
            where=f"{source}, line {skip_rows + reader.line_num}",
            remedy="Look for a quotation mark that is not closed",
        ) from error
    if not rows:
        raise InputError("holds a header but no samples", where=source, allowed="rows of numbers below it")
    columns: dict[str, Any] = dict(zip(header, map(list, zip(*rows, strict=True)), strict=True))
    return Table(columns, numbers, source)


def _text(path: Path, encoding: str) -> str:
    where = f"file {path}"
    if path.is_dir():
        raise InputError("is a folder", where=where, allowed="a text file")
    if not path.exists():
        siblings = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        near = difflib.get_close_matches(path.name, siblings, n=3)
        remedy = f"Did you mean {', '.join(near)}?" if near else "Check the path"
        raise InputError("does not exist", where=where, remedy=remedy)
    try:
        return path.read_bytes().decode(encoding)
    except LookupError as error:
        problem = f"encoding {encoding!r} is unknown"
        raise InputError(problem, where=where, allowed="utf-8, latin-1, ...") from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"byte {error.start} is not {encoding} text",
            where=where,
            remedy="Give encoding='latin-1' or 'utf-16', or save the file as UTF-8",
        ) from error
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", where=where) from error


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


def _is_text(head: bytes) -> bool:
    """Whether a file may hold text: bytes of value 0 occur only in UTF-16 and UTF-32, which have a mark."""
    return b"\0" not in head or head.startswith(
        (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, codecs.BOM_UTF32_BE)
    )


CSV = Reader(_is_text, read_csv)
