"""Parquet files, written by pyarrow."""

import sys
from datetime import time

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings

import errorscreen as es
from errorscreen.data import read_recording
from errorscreen.data.readers import recognised
from errorscreen.exceptions import InputError
from tests.data.readers.shared_rows import BASES, COLUMNS, TIME, P, V, bounded, check, damages, survives

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")
FRAME = pd.DataFrame({"time": TIME, "V": V, "P": P})
STAMPS = pd.Timestamp("2026-05-03 10:00") + pd.to_timedelta(TIME, unit="s")


def write(path, stamps=TIME, **columns):
    pq.write_table(pa.table({"time": stamps, "V": V, "P": P} | columns), path)
    return path


def test_columns_of_numbers(tmp_path):
    path = write(tmp_path / "a.parquet")
    assert recognised(path) == "parquet"
    check(read_recording(path, COLUMNS, **BASES))
    check(es.read(path, COLUMNS, **BASES))
    dictionary = pa.array(V).dictionary_encode()
    check(read_recording(write(path, V=dictionary), COLUMNS, **BASES))
    gaps = [None if k == 50 else round(1000 * x) for k, x in enumerate(V)]
    rec = read_recording(write(path, V=gaps), {**COLUMNS, "V": {"column": "V", "unit": "V"}}, **BASES)
    assert np.flatnonzero(np.isnan(rec.channel("V").values)).tolist() == [50]


@pytest.mark.parametrize(("unit", "zone"), [("ms", None), ("us", "UTC"), ("ns", "Europe/Berlin")])
def test_types_of_time_stamps(tmp_path, unit, zone):
    stamps = STAMPS.tz_localize(zone) if zone else STAMPS
    path = write(tmp_path / "a.parquet", pa.array(stamps, pa.timestamp(unit, zone)))
    rec = read_recording(path, COLUMNS, **BASES)
    check(rec)
    begin = {None: "10:00:00", "UTC": "10:00:00+00:00", "Europe/Berlin": "08:00:00+00:00"}[zone]
    assert f"Time 0 is 2026-05-03T{begin}." in rec.assumptions
    with pytest.raises(InputError, match="time_unit is 'ms', but the column holds dates.*Leave it out"):
        read_recording(path, COLUMNS, time_unit="ms", **BASES)


def test_durations_times_of_day_and_texts(tmp_path):
    path = tmp_path / "a.parquet"
    check(read_recording(write(path, pa.array(STAMPS - STAMPS[0], pa.duration("us"))), COLUMNS, **BASES))
    of_day = [time(10, 0, int(t), round(1e6 * (t % 1))) for t in TIME]
    write(path, pa.array(of_day, pa.time64("us")))
    check(read_recording(path, COLUMNS, time_format="%H:%M:%S.%f", **BASES))
    write(path, [stamp.isoformat() for stamp in STAMPS])
    check(read_recording(path, COLUMNS, time_unit="iso", **BASES))


def test_the_index_of_pandas(tmp_path):
    path = tmp_path / "a.parquet"
    frame = FRAME.drop(columns="time").set_index(STAMPS)
    frame.to_parquet(path)
    check(read_recording(path, COLUMNS, **BASES))
    check(read_recording(path, COLUMNS, time="(index)", **BASES))
    frame.rename_axis("time").to_parquet(path)
    check(es.read(path, COLUMNS, **BASES))
    FRAME.convert_dtypes().to_parquet(path)
    check(read_recording(path, COLUMNS, **BASES))


def test_what_is_no_column_of_numbers_is_told(tmp_path):
    path = write(tmp_path / "a.parquet", V=[[x, x] for x in V])
    with pytest.raises(InputError, match="unknown column 'V'"):
        read_recording(path, COLUMNS, **BASES)
    pq.write_table(pa.table({"V": [[1.0], [2.0]]}), path)
    with pytest.raises(InputError, match=r"only 'V' of the type list<.*double>"):
        read_recording(path, COLUMNS, **BASES)
    with pytest.raises(InputError, match="unknown column .U."):
        read_recording(write(path), {"V": "U"}, **BASES)


def test_a_missing_package(tmp_path, monkeypatch):
    path = write(tmp_path / "a.parquet")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ImportError, match=r'pip install "errorscreen\[parquet\]"'):
        read_recording(path, COLUMNS, **BASES)


@settings(bounded, max_examples=6)
@given(damages)
def test_damage(tmp_path_factory, damage):
    path = write(tmp_path_factory.mktemp("parquet") / "a.parquet")
    survives(path, path.read_bytes(), damage, format="parquet")
