"""The format of a file is recognised by its content, or stated."""

import bz2
import codecs
import gzip
import lzma
import os
import re

import numpy as np
import pytest

from errorscreen.data import READERS, Column, Recording, read_recording
from errorscreen.data.readers.base import Reader
from errorscreen.exceptions import InputError

COLUMNS = {"P": Column("P")}
BASES = {"base_mva": 1.0, "f_nominal": 50.0, "event_time": 1.0}
TEXT = "time,P\n" + "\n".join(f"{0.1 * k:.1f},{0.5 if k < 10 else 0.4}" for k in range(40))


def test_text_is_read_as_csv(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text(TEXT)
    for chosen in (None, "csv"):
        recording = read_recording(path, COLUMNS, chosen, **BASES)
        assert recording.channel("P").values[[0, -1]].tolist() == [0.5, 0.4]
    path.write_bytes(codecs.BOM_UTF16_LE + TEXT.encode("utf-16-le"))
    assert len(read_recording(path, COLUMNS, encoding="utf-16", **BASES).time) == 40


def test_the_last_reader_is_asked_first(tmp_path, monkeypatch):
    def read(path, columns, **options):
        time = np.arange(50.0)
        values = {"P": np.where(time < 20, 1.0, 2.0)}
        return Recording.from_arrays(time, values, event_time=20.0, base_mva=1, f_nominal=50)

    monkeypatch.setitem(READERS._items, "marked", Reader(lambda head: head.startswith(b"MARK"), read))
    path = tmp_path / "a.csv"
    path.write_text("MARK,P")
    assert len(read_recording(path, COLUMNS, **BASES).time) == 50


def test_an_unknown_format_is_answered_with_the_allowed_ones(tmp_path):
    path = tmp_path / "a.dat"
    path.write_bytes(b"\x01\x00\x02")
    allowed = "csv, comtrade, pscad, excel, matlab, parquet"
    message = f"file {path}: the format is not recognised. Allowed: {allowed}. State it"
    with pytest.raises(InputError, match=re.escape(message)):
        read_recording(path, COLUMNS, **BASES)
    with pytest.raises(InputError, match="unknown format 'cvs' .did you mean 'csv'"):
        read_recording(path, COLUMNS, "cvs", **BASES)


def test_a_file_of_columns_needs_a_channel(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(TEXT)
    with pytest.raises(InputError, match="no column is mapped to a channel.*Give columns, or waveforms"):
        read_recording(path, None, **BASES)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("run.psout", b"\x00\x01", "output of PSCAD 5.*PSOUT Reader"),
        ("run.CHF", b"\x11\x00\x00", "channels of PSLF.*as CSV"),
        ("run.out", b"\x00\x01", "channel output of PSS/E.*xlsout"),
        ("run.outx", b"\x00\x01", "channel output of PSS/E"),
        ("a.h5", b"\x89HDF\r\n\x1a\n\0", "is an HDF5 file.*as CSV"),
        (
            "a.xls",
            b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(40),
            "spreadsheet of an old version.*as .xlsx or CSV",
        ),
        ("a.csv.gz", gzip.compress(TEXT.encode()), "compressed by gzip.*Unpack it"),
        ("a.csv.bz2", bz2.compress(TEXT.encode()), "compressed by bzip2.*Unpack it"),
        ("a.csv.xz", lzma.compress(TEXT.encode()), "compressed by xz.*Unpack it"),
        ("a.csv.zst", b"\x28\xb5\x2f\xfd\x24\xff\xfe", "compressed by Zstandard.*Unpack it"),
        ("table.txt", b"#1\ndouble Table(2,2)\n0 1\n1 1\n", "file of tables of Modelica"),
    ],
)
def test_formats_of_programs_are_refused_by_name(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_recording(tmp_path / name, COLUMNS, **BASES)


def test_text_of_channels_below_a_title_is_read(tmp_path):
    """What is known of the text of PSS/E: titles, then rows of numbers between blanks (a public reader of it)."""
    rows = TEXT.partition("\n")[2].replace(",", "  ")
    (tmp_path / "run.out").write_text(f" TITLE OF THE CASE\n SECOND LINE\n\n{rows}\n")
    layout = {"skip_rows": 3, "header": ["time", "P"], "delimiter": "whitespace"}
    recording = read_recording(tmp_path / "run.out", COLUMNS, **layout, **BASES)
    assert recording.channel("P").values[[0, -1]].tolist() == [0.5, 0.4]


def test_a_file_above_the_largest_size_is_refused_at_once(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(TEXT)
    os.truncate(path, 2**31 + 2**20)  # a hole, which takes no room on the disk
    with pytest.raises(InputError, match="has 2049 MiB. Allowed: at most 2048 MiB.*cut it"):
        read_recording(path, COLUMNS, **BASES)
