import numpy as np
import pytest

from errorscreen.data import read_csv

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
