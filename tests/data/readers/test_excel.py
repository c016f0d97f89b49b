"""Workbooks."""

import sys
import zipfile
from datetime import datetime, timedelta

import pytest
from hypothesis import given

import errorscreen as es
from errorscreen.data import read_recording
from errorscreen.exceptions import InputError
from tests.data.readers.shared_rows import BASES, COLUMNS, TIME, P, V, bounded, check, damages, survives

openpyxl = pytest.importorskip("openpyxl")


def write(path, rows, sheets=("first", "data")):
    book = openpyxl.Workbook()
    book.active.title = sheets[0]
    for title in sheets[1:]:
        book.create_sheet(title)
    for row in rows:
        book[sheets[-1]].append(row)
    book.save(path)
    return path


ROWS = [(float(t), float(v), float(p)) for t, v, p in zip(TIME, V, P, strict=True)]


def test_sheets_headers_and_units(tmp_path):
    path = write(tmp_path / "a.xlsx", [("time", "V", "P"), ("s", "kV", "MW"), *ROWS])
    check(read_recording(path, {"V": "V", "P": "P"}, sheet="data", **BASES))
    check(es.read(path, sheet="data", **BASES))
    with pytest.raises(InputError, match="unknown sheet 'dat' .did you mean 'data'"):
        read_recording(path, COLUMNS, sheet="dat", **BASES)
    with pytest.raises(InputError, match="is empty"):
        read_recording(path, COLUMNS, **BASES)
    check(
        read_recording(write(tmp_path / "b.xlsx", ROWS, ("x",)), COLUMNS, header=["time", "V", "P"], **BASES)
    )


def test_two_rows_of_headers(tmp_path):
    path = write(
        tmp_path / "a.xlsx", [("run", "Plant B", "Plant B"), ("t", "U in kV", "P in MW"), *ROWS], ("x",)
    )
    columns = {
        "V": {"column": "Plant B|U in kV", "unit": "kV"},
        "P": {"column": "Plant B|P in MW", "unit": "MW"},
    }
    check(read_recording(path, columns, time="run|t", header_rows=2, **BASES))


def test_dates_and_a_text_among_numbers(tmp_path):
    begin = datetime(2026, 5, 3, 10)
    rows = [(begin + timedelta(seconds=t), v, p) for t, v, p in ROWS]
    path = write(tmp_path / "a.xlsx", [("time", "V", "P"), *rows], ("x",))
    check(read_recording(path, COLUMNS, time_unit="iso", **BASES))
    path = write(tmp_path / "a.xlsx", [("time", "V", "P"), *ROWS[:9], (9.0, "off", 1.0)], ("x",))
    with pytest.raises(InputError, match="row 11, column 'V': 'off' is not a number"):
        read_recording(path, COLUMNS, **BASES)


def test_a_row_beyond_the_last_one_is_refused(tmp_path):
    path = write(tmp_path / "a.xlsx", [("time", "V", "P"), *ROWS[:9]], ("x",))
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    sheet = "xl/worksheets/sheet1.xml"
    parts[sheet] = parts[sheet].replace(b'<row r="10">', b'<row r="1000000000000">')
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    with pytest.raises(InputError, match="a row has a number beyond the last one. Allowed: 1 to 1048576"):
        read_recording(path, COLUMNS, **BASES)


def test_other_archives_and_a_missing_package(tmp_path, monkeypatch):
    path = tmp_path / "a.xlsx"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.txt", "x")
    with pytest.raises(InputError, match="is no sound workbook"):
        read_recording(path, COLUMNS, **BASES)
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(ImportError, match=r'pip install "errorscreen\[excel\]"'):
        read_recording(path, COLUMNS, **BASES)


@bounded
@given(damages)
def test_damage(tmp_path_factory, damage):
    path = write(tmp_path_factory.mktemp("book") / "a.xlsx", [("time", "V", "P"), *ROWS], ("x",))
    survives(path, path.read_bytes(), damage, format="excel")
