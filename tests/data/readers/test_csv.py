import os
import tracemalloc

import numpy as np
import pytest

from errorscreen.data import read_csv, read_recording
from errorscreen.data.readers import csv
from errorscreen.data.readers.head import Layout
from errorscreen.exceptions import InputError

TIME = np.arange(0, 3, 0.05)
P = np.where(TIME < 1, 40.0, 30.0) + 0.05 * np.sin(9e4 * TIME)


def write(folder, *, delimiter=",", decimal=".", prefix="", end="\n", encoding="utf-8", tail=""):
    rows = [f"{t:.2f}{delimiter}{p:.4f}{tail}".replace(".", decimal) for t, p in zip(TIME, P, strict=True)]
    path = folder / "rec.csv"
    path.write_bytes((prefix + end.join([f"time{delimiter} P ", *rows]) + end).encode(encoding))
    return path


def read(path, **options):
    return read_csv(path, {"P": {"column": "P", "unit": "MW"}}, base_mva=50, f_nominal=50, **options)


@pytest.mark.parametrize(
    ("file", "options"),
    [
        ({}, {}),
        ({"delimiter": ";"}, {}),
        ({"delimiter": "\t"}, {}),
        ({"delimiter": ";", "decimal": ","}, {"decimal": ","}),
        ({"delimiter": "|"}, {"delimiter": "|"}),
        ({"end": "\r\n"}, {}),
        ({"prefix": "\ufeff"}, {}),
        ({"prefix": "# logger 7\n\n"}, {"skip_rows": 2}),
        ({"tail": ","}, {}),
        ({"end": "\n\n"}, {}),
        ({"encoding": "utf-16"}, {"encoding": "utf-16"}),
    ],
)
def test_dialects_give_the_same_recording(tmp_path, file, options):
    rec = read(write(tmp_path, **file), **options)
    np.testing.assert_allclose(rec.time, TIME, atol=1e-12)
    np.testing.assert_allclose(rec.channel("P").values, np.round(P, 4) / 50, atol=1e-12)
    assert rec.name == "rec"


def test_gaps_are_read_in_any_spelling(tmp_path):
    lines = write(tmp_path).read_text().splitlines()
    for row, mark in enumerate(["", "NaN", "nan", " NA", "N/A", "null", "Bad", "No Data", "OFF"], start=2):
        lines[row] = lines[row].split(",")[0] + "," + mark
    path = tmp_path / "gaps.csv"
    path.write_text("\n".join(lines))
    rec = read(path, missing=["off"])
    assert np.isnan(rec.channel("P").values).sum() == 9
    assert "9 of 60 readings of P are missing." in rec.assumptions


@pytest.mark.parametrize(
    ("file", "options"),
    [
        ({"delimiter": "|"}, {}),
        ({"delimiter": "   "}, {}),
        ({"delimiter": "  "}, {"delimiter": "whitespace"}),
        ({"prefix": "sep=;\n", "delimiter": ";"}, {}),
        ({"prefix": "# logger 7\n! two\n\n"}, {}),
        ({"encoding": "utf-16-le"}, {}),
        ({"encoding": "utf-16-be"}, {}),
    ],
)
def test_the_layout_is_recognised(tmp_path, file, options):
    np.testing.assert_allclose(read(write(tmp_path, **file), **options).time, TIME, atol=1e-12)


@pytest.mark.parametrize(
    ("encoding", "options"),
    [("utf-16", {}), ("utf-16-be", {}), ("utf-8-sig", {}), ("latin-1", {"encoding": "latin-1"})],
)
def test_encodings(tmp_path, encoding, options):
    """With a mark: ``utf-16`` of Python writes one."""
    path = write(tmp_path)
    text = ("\ufeff" * (encoding == "utf-16-be")) + path.read_text().replace(" P ", "Leistung Süd")
    path.write_bytes(text.encode(encoding))
    rec = read_csv(
        path, {"P": {"column": "Leistung Süd", "unit": "MW"}}, base_mva=50, f_nominal=50, **options
    )
    np.testing.assert_allclose(rec.channel("P").values, np.round(P, 4) / 50, atol=1e-12)


def _edited(tmp_path, first, above=""):
    """The file with another first row."""
    path = write(tmp_path)
    path.write_text(above + "\n".join([*first, *path.read_text().splitlines()[1:]]))
    return path


def test_a_file_without_headers_is_read_by_names(tmp_path):
    assert read(_edited(tmp_path, []), header=["time", "P"]).event_time == 1.0


def test_headers_may_stand_in_a_comment(tmp_path):
    assert read(_edited(tmp_path, ["# time, P"])).event_time == 1.0


def test_two_rows_may_name_a_column(tmp_path):
    path = _edited(tmp_path, ["all,Plant B", "t in s,m:Psum in MW"])
    columns = {"P": {"column": "Plant B|m:Psum in MW", "unit": "MW"}}
    rec = read_csv(path, columns, time="all|t in s", header_rows=2, base_mva=50, f_nominal=50)
    assert rec.event_time == 1.0


def test_a_row_of_units_counts_where_none_is_stated(tmp_path):
    path = _edited(tmp_path, ["time,P", "[s],[GW]"])
    rec = read_csv(path, {"P": "P"}, base_mva=50, f_nominal=50)
    assert rec.initial(["P"])["P"] == pytest.approx(800, rel=1e-3)


def test_columns_that_are_not_read_may_hold_anything(tmp_path):
    lines = write(tmp_path).read_text().splitlines()
    path = tmp_path / "wide.csv"
    path.write_text("\n".join([lines[0] + ",x,x", *(line + ",on,1:2" for line in lines[1:])]))
    assert read(path).event_time == 1.0


def test_rows_with_a_bad_status_are_gaps(tmp_path):
    lines = write(tmp_path).read_text().splitlines()
    rows = [line + ",0000" for line in lines[1:]]
    rows[5:8] = [line.split(",")[0] + ",0,8000" for line in lines[6:9]]
    path = tmp_path / "status.csv"
    path.write_text("\n".join([lines[0] + ",STAT", *rows]))
    rec = read(path, quality={"column": "STAT", "good": ["0000"]})
    assert (rec.event_time, np.isnan(rec.channel("P").values).sum()) == (1.0, 3)
    assert "3 of 60 rows have a bad status in 'STAT'; they count as gaps." in rec.assumptions


@pytest.mark.parametrize("mark", ["-9999", -9999, "-9999.0"])
def test_numbers_may_mark_gaps(tmp_path, mark):
    lines = write(tmp_path).read_text().splitlines()
    lines[5] = lines[5].split(",")[0] + ",-9999.00"
    path = tmp_path / "gaps.csv"
    path.write_text("\n".join(lines))
    assert np.isnan(read(path, missing=[mark]).channel("P").values).sum() == 1
    with pytest.raises(InputError, match=r"exactly -9999.*Give missing = \['-9999'\]"):
        read(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PK\x03\x04" + bytes(40), "is no sound workbook.*save it as .xlsx or CSV"),
        (
            b"MATLAB 5.0 MAT-file" + bytes(200),
            "is damaged.*Allowed: a MATLAB file of version 5 or 7.3.*or export CSV",
        ),
        (b"\x89HDF\r\n\x1a\n" + bytes(40), "is an HDF5 file.*as CSV"),
    ],
)
def test_other_formats_are_called_by_name(tmp_path, content, message):
    path = tmp_path / "file.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_recording(path, {"P": "P"}, base_mva=1, f_nominal=50)


def test_a_pipe_is_refused_at_once(tmp_path):
    path = tmp_path / "pipe.csv"
    os.mkfifo(path)
    for reader in (read_csv, read_recording):
        with pytest.raises(InputError, match="is a device or a pipe"):
            reader(path, {"P": "P"}, base_mva=1, f_nominal=50)


def test_a_column_that_occurs_twice_matters_only_where_it_is_read(tmp_path):
    lines = write(tmp_path).read_text().splitlines()
    path = tmp_path / "twice.csv"
    path.write_text("\n".join([lines[0] + ",P", *(line + ",1" for line in lines[1:])]))
    with pytest.raises(InputError, match=r"column 'P' occurs 2 times.*header_rows = 2"):
        read(path)


def test_a_file_of_several_blocks_is_read_as_one_of_a_single_block(tmp_path, monkeypatch):
    """Whole numbers, others, gaps and texts that begin in different blocks; texts stay as they are written."""
    rows = [
        f"{k},{k if k < 40 else k + 0.5},{'' if k == 70 else 0.25 * k},{'bad' if k == 90 else f'{k}.50'},{k:03d}"
        for k in range(120)
    ]
    (tmp_path / "many.csv").write_text("t,a,b,c,d\n" + "\n".join(rows) + "\n")
    monkeypatch.setattr(csv, "_BLOCK", 100)
    cells = csv.read_table(tmp_path / "many.csv", Layout(), texts=["d"]).columns
    np.testing.assert_array_equal(cells["t"], np.arange(120))
    np.testing.assert_array_equal(cells["a"], [k if k < 40 else k + 0.5 for k in range(120)])
    np.testing.assert_array_equal(cells["b"], [np.nan if k == 70 else 0.25 * k for k in range(120)])
    assert list(cells["c"]) == ["bad" if k == 90 else f"{k}.50" for k in range(120)]
    assert list(cells["d"]) == [f"{k:03d}" for k in range(120)]


def test_a_large_file_takes_less_than_three_times_its_size(tmp_path, monkeypatch):
    """In bytes that numpy and Python hold. Blocks are small beside the file, as they are beside a large one."""
    monkeypatch.setattr(csv, "_BLOCK", 2**16)
    rows = "\n".join(
        f"{0.001 * k:.3f},{1.0 if k < 1e5 else 0.9:.12f},{0.8 + 1e-6 * (k % 7):.12f}" for k in range(200_000)
    )
    path = tmp_path / "long.csv"
    path.write_text("time,V,P\n" + rows + "\n")
    tracemalloc.start()
    read_csv(path, {"V": "V", "P": "P"}, base_mva=1, f_nominal=50)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 3 * path.stat().st_size
