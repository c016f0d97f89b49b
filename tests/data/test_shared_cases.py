"""Small files of the kinds that were read wrongly before; each has its right values beside it."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from errorscreen.data import Column, read_csv, read_recording
from errorscreen.data.plausibility import Doubt
from errorscreen.exceptions import InputError

CASES = Path(__file__).parents[3] / "shared" / "cases" / "recordings"
pytestmark = pytest.mark.skipif(not CASES.exists(), reason="the shared cases are not there")

BASES = {"base_mva": 100.0, "base_kv": 20.0, "f_nominal": 50.0}
COLUMNS = {"V": Column("V", unit="kV"), "P": Column("P", unit="MW"), "Q": Column("Q", unit="Mvar")}
ANGLE = {**COLUMNS, "angle": Column("ang_deg", unit="deg"), "f": Column("f_hz", unit="Hz")}


def read(name, columns=COLUMNS, **options):
    """The recording and its doubts."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rec = read_csv(CASES / name, columns, **{**BASES, **options})
    return rec, " ".join(note for note in rec.assumptions if isinstance(note, Doubt))


def check(rec, event=0.8, dt=0.02, V=1.0):
    assert rec.event_time == pytest.approx(event, abs=1e-6)
    assert np.median(np.diff(rec.time)) == pytest.approx(dt, rel=1e-3)
    assert rec.initial(["V"])["V"] == pytest.approx(V, abs=1e-3)
    if "P" in rec.channels:
        assert rec.initial(["P"])["P"] == pytest.approx(0.8, abs=1e-3)


@pytest.mark.parametrize(
    ("file", "V", "factor"), [("ln", 0.577, "1/√3"), ("peak_ll", 1.414, "√2"), ("peak_ln", 0.816, "√(2/3)")]
)
def test_01_voltage_of_another_kind(file, V, factor):
    rec, doubts = read(f"01-voltage-scale/{file}.csv")
    check(rec, V=V)
    assert f"near {factor}:" in doubts


def test_02_equal_stamps_at_a_wrap_of_the_angle():
    rec, _ = read("02-angle-mean-at-wrap/in.csv", {**COLUMNS, "angle": Column("ang", unit="deg")})
    angle = rec.channel("angle").values
    assert np.degrees(angle[-1] - angle[0]) == pytest.approx(56.88, abs=0.8)


@pytest.mark.parametrize(
    ("changes", "options", "told"),
    [
        ({}, {}, ""),
        ({"angle": Column("ang_deg")}, {}, "unit = 'deg'"),
        ({"angle": Column("ang_deg", unit="deg", scale=-1.0)}, {}, "scale = -1"),
        ({"f": Column("df_mhz", unit="Hz deviation")}, {}, "mHz deviation"),
        ({}, {"f_nominal": 60.0}, "f_nominal = 50"),
    ],
)
def test_03_angle_against_frequency(changes, options, told):
    rec, doubts = read("03-angle-against-frequency/in.csv", {**ANGLE, **changes}, **options)
    assert told in doubts
    assert bool(told) == bool(doubts)
    assert bool(told) != any("their slope is" in note for note in rec.assumptions)


def test_04_numbers_that_mean_no_reading():
    rec, _ = read("04-sentinel-numbers/in.csv", missing=["-9999"])
    check(rec)
    assert np.isnan(rec.channel("V").values).sum() == 3
    with pytest.raises(InputError, match="-9999"):
        read("04-sentinel-numbers/in.csv")


@pytest.mark.parametrize("file", ["before", "after"])
def test_05_quality_flags(file):
    rec, _ = read(f"05-quality-flags/{file}.csv", quality={"column": "STAT", "good": ["0000"]})
    check(rec)
    assert np.nanmin(rec.channel("V").values) > 0.5
    assert "lost frames?" in read(f"05-quality-flags/{file}.csv")[1]


def test_06_short_quiet_part():
    options = {"columns": {"V": "V"}}
    rec, _ = read("06-short-quiet-part/in.csv", **options)
    check(rec, event=0.2, dt=0.001)
    for event_time in (0.21, 0.5, 1.0, 2.0):
        with pytest.raises(InputError, match=r"V moves from 0\.2 s on"):
            read("06-short-quiet-part/in.csv", **options, event_time=event_time)


@pytest.mark.parametrize(("file", "unit"), [("ms", "ms"), ("days", "d"), ("us", "us")])
def test_07_time_units(file, unit):
    check(read(f"07-time-unit/{file}.csv", time_unit=unit)[0])
    assert f"time_unit = '{unit}' (0.02 s)" in read(f"07-time-unit/{file}.csv")[1]


def test_09_two_header_rows_and_units():
    columns = {
        "V": Column("Bus A|m:u1 in p.u."),
        "P": Column("Plant B|m:Psum:bus1 in MW", unit="MW"),
        "Q": Column("Plant B|m:Qsum:bus1 in Mvar", unit="Mvar"),
    }
    layout = {"time": "All calculations|b:tnow in s", "header_rows": 2, "decimal": ","}
    check(read("09-two-header-rows/powerfactory.csv", columns, **layout)[0])
    check(read("09-two-header-rows/units_row.csv", {"V": "V", "P": "P", "Q": "Q"})[0])


@pytest.mark.parametrize("file", ["in", "many"])
@pytest.mark.parametrize("on_duplicate", ["last", "keep-step"])
def test_10_several_rows_at_the_event(file, on_duplicate):
    rec, _ = read(f"10-several-rows-at-the-event/{file}.csv", on_duplicate=on_duplicate)
    check(rec)
    V = rec.channel("V").values
    at = np.flatnonzero(rec.time <= 0.8 + 1e-4)[-1]
    assert V[at] == pytest.approx(0.70, abs=2e-3)
    assert V[at + 1] == pytest.approx(0.724, abs=2e-3)
    assert V[np.flatnonzero(rec.time < 0.799)[-1]] == pytest.approx(1.0, abs=2e-3)


def test_11_a_table_without_headers():
    check(read("11-out-files-without-header/noheader.csv", header=["time", "V", "P", "Q"])[0])
    columns = {name: COLUMNS[name] for name in ("V", "P")}
    check(read("11-out-files-without-header/run_01.out", columns, header=["time", "V", "P"])[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rec = read_recording(CASES / "11-out-files-without-header/run.inf", COLUMNS, **BASES)
    check(rec)
    assert rec.initial(["Q"])["Q"] == pytest.approx(0.1, abs=1e-3)


def test_15_time_in_two_columns():
    check(read("15-soc-fracsec/in.csv", time=["SOC", "FRACSEC"], time_base=1_000_000)[0])
    check(read("15-soc-fracsec/date_time.csv", time=["Date", "Time"])[0])


@pytest.mark.parametrize(
    ("file", "options"),
    [
        ("utc", {"time_unit": "iso"}),
        ("comma", {"time_unit": "iso"}),
        ("us", {"time_format": "%m/%d/%Y %H:%M:%S.%f"}),
        ("mon", {"time_format": "%d-%b-%Y %H:%M:%S.%f"}),
        ("colon", {"time_format": "%Y-%m-%d %H:%M:%S:%f"}),
        ("tod", {"time_format": "%H:%M:%S.%f"}),
    ],
)
def test_16_texts_of_time(file, options):
    check(read(f"16-time-stamp-texts/{file}.csv", **options)[0])


def test_21_dates_for_the_event():
    options = {"time_unit": "iso", "event_time": "2026-05-03T10:00:00.800Z"}
    check(read("21-event-time-as-text/in.csv", **options)[0])


@pytest.mark.parametrize("fault", ["asgn", "deg", "dup", "ln", "pk", "qs", "xl", "z"])
def test_23_the_command_line_names_the_reading_first(fault, tmp_path, capsys):
    from errorscreen.cli import SUSPECT, main

    case = CASES / "23-cli-verdicts" / f"{fault}.toml"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert main(["diagnose", str(case), "--out", str(tmp_path), "--quiet"]) == SUSPECT
    assert "suspect" in capsys.readouterr().err
