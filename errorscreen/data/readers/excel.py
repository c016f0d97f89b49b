"""Workbooks (.xlsx): a sheet is read as a text file is."""

from __future__ import annotations

import csv
import io
import os
import zipfile
from collections.abc import Iterator
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from errorscreen.data.frames import Specs
from errorscreen.data.readers.base import LAYOUT_KEYS, Reader
from errorscreen.data.readers.csv import headers_of_text, recording_of_text
from errorscreen.data.readers.head import Head, Layout
from errorscreen.data.readers.text import check_file, check_size
from errorscreen.data.recordings import Recording
from errorscreen.exceptions import InputError, MissingExtraError, unknown_name

#: rows of a sheet
_ROWS = 1_048_576


def read_excel(
    path: str | os.PathLike[str],
    columns: Specs | None,
    *,
    sheet: str | None = None,
    name: str | None = None,
    decimal: str = ".",
    skip_rows: int = 0,
    header_rows: int = 1,
    header: Any = None,
    **options: Any,
) -> Recording:
    """Read a recording from a sheet of a workbook; cells with dates need ``time_unit="iso"``.

    Parameters
    ----------
    path : path-like
    columns : mapping of str to Column, str or mapping
        As in `errorscreen.data.from_frame`.
    sheet : str, optional
        Name of the sheet; the first one where not given.
    name : str, optional
        The file's name without ending where not given.
    decimal, skip_rows, header_rows, header
        As in `errorscreen.data.read_csv`.
    **options
        Of `errorscreen.data.read_csv`, but for `delimiter` and `encoding`.

    Raises
    ------
    InputError
        If the file is no workbook, or cannot be used.
    MissingExtraError
        Without openpyxl.
    """
    path = Path(path)
    layout = Layout("\t", decimal, "utf-8", skip_rows, header_rows, header)
    head = Head.of_text(_text(path, sheet)[0], layout, f"file {path}")
    label = path.stem if name is None else name
    return recording_of_text(head, layout, columns, name=label, row_word="row", **options)


def read_headers(path: Path, *, sheet: str | None = None, long: Any = None, **layout: Any) -> list[str]:
    """Headers of a sheet."""
    found = Layout("\t", **layout)
    return headers_of_text(Head.of_text(_text(path, sheet)[0], found, f"file {path}"), found, long)


def sheets(path: Path) -> Iterator[tuple[str, str, list[str]]]:
    """Name and cells of each sheet that is not empty, and the names of the others."""
    first, titles = _text(path, None)
    for title in titles:
        text = first if title == titles[0] else _text(path, title)[0]
        if text.strip():
            yield title, text, [other for other in titles if other != title]


def _text(path: Path, sheet: str | None) -> tuple[str, list[str]]:
    """Cells of a sheet, separated by tabulators, and the names of all sheets."""
    check_file(path)
    where = f"file {path}"
    try:
        import openpyxl
    except ModuleNotFoundError as error:
        raise MissingExtraError("openpyxl", extra="excel") from error
    try:
        with zipfile.ZipFile(path) as archive:
            check_size(sum(one.file_size for one in archive.infolist()), f"{where}, unpacked")
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        try:
            sheets = {one.title: one for one in book.worksheets}
            if sheet is not None and sheet not in sheets:
                raise unknown_name(sheet, sheets, kind="sheet", where=where)
            chosen = sheets[sheet] if sheet is not None else next(iter(sheets.values()))
            chosen.reset_dimensions()  # some programs write wrong ones
            return _lines(chosen, where), [*sheets]
        finally:
            book.close()
    except InputError:
        raise
    except Exception as error:  # the library passes on what its parsers of zip and XML raise
        raise InputError(
            f"is no sound workbook: {type(error).__name__} {error}",
            where=where,
            allowed="a workbook (.xlsx) with a sheet",
            remedy="Open it and save it as .xlsx or CSV; unpack another archive",
        ) from error


def _lines(sheet: Any, where: str) -> str:
    """Rows as lines. Empty cells at the end of a row, which a file lacks, are there up to the widest row above."""
    text = io.StringIO()
    width = 0
    writer = csv.writer(text, delimiter="\t", lineterminator="\n")
    for number, row in enumerate(sheet.iter_rows(values_only=True), start=1):
        if number > _ROWS:
            # the library gives rows that the file lacks as empty ones, up to any number that the file states
            raise InputError("a row has a number beyond the last one", where=where, allowed=f"1 to {_ROWS}")
        cells = [_cell(value) for value in row]
        if any(cells):
            width = max(width, len(cells))
            cells += [""] * (width - len(cells))
        writer.writerow(cells if any(cells) else [])
        check_size(text.tell(), f"{where}, as text")
    return text.getvalue()


def _cell(value: Any) -> str:
    """Text of a cell; an instant in the form of ISO 8601."""
    if isinstance(value, datetime | time):
        return value.isoformat(timespec="microseconds")
    if isinstance(value, date):
        return value.isoformat()
    return "" if value is None else " ".join(str(value).splitlines())


EXCEL = Reader(
    lambda head: head.startswith(b"PK\x03\x04"),
    read_excel,
    layout=LAYOUT_KEYS - {"delimiter", "encoding"},
    headers=read_headers,
)
