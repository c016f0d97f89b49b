"""Channels of COMTRADE records: names, units, skews and lines; written as in tests.data.readers.test_comtrade."""

import numpy as np
import pytest

import errorscreen as es
from errorscreen.data.readers.comtrade import read_comtrade_table
from errorscreen.exceptions import InputError
from tests.data.readers.test_comtrade import BASES, DIP, TIME, WAVEFORMS, check, waves, write


def test_equal_names_are_told_apart_by_their_phases(tmp_path):
    values = waves(TIME)
    names, phases = [name[0] for name in values], [name[1] for name in values]
    path = write(tmp_path, values, TIME, names=names, phases=phases)
    assert [*read_comtrade_table(path)[0].columns][1:] == [f"{name[0]} {name[1]}" for name in values]
    check(es.read(path, **BASES))
    waveforms = {kind: [f"{kind[0]} {p}" for p in "ABC"] for kind in ("V", "I")}
    check(es.read(path, waveforms={"voltage": waveforms["V"], "current": waveforms["I"]}, **BASES))


def test_channels_that_nobody_named_do_not_count(tmp_path):
    values = {**waves(TIME), "P": 31.0 + TIME, "f": 50050.0 + TIME}
    path = write(tmp_path, values, TIME, phases=[*"AABBCC", "", ""])
    path.write_text(path.read_text().replace("P,,UNIT,kV", "P,,UNIT,MW").replace("f,,UNIT,kV", "f,,UNIT,mHz"))
    check(es.read(path, **BASES))
    named = es.read(path, {"P": "P"}, waveforms=WAVEFORMS, **BASES)
    assert named.channel("P").values[[0, -1]] == pytest.approx([0.31, 0.318], abs=1e-3)


def test_a_record_at_the_nominal_frequency(tmp_path):
    rec = es.read(write(tmp_path, waves(TIME, 50.0), TIME, kind="FLOAT32"), **BASES)
    check(rec)
    assert rec.channel("f").values[rec.time < DIP - 0.03] == pytest.approx(50.0, abs=1e-3)


@pytest.mark.parametrize(
    "units", [("KV", "KA"), ("kv", "ka"), ("V", "A"), ("Volt", "Amps"), ("v", "a"), ("VOLTS", "AMPERES")]
)
def test_spellings_of_units(tmp_path, units):
    thousand = 1.0 if units[0].lower() == "kv" else 1e3
    values = {name: thousand * x for name, x in waves(TIME).items()}
    check(es.read(write(tmp_path, values, TIME, units=units), **BASES))


def test_other_units_need_those_of_the_description(tmp_path):
    path = write(tmp_path, waves(TIME), TIME, units=("kilovolt", "kiloampere"))
    with pytest.raises(InputError, match="voltage_unit and current_unit where the record does not state"):
        es.read(path, **BASES)
    check(es.read(path, waveforms={**WAVEFORMS, "voltage_unit": "kV", "current_unit": "kA"}, **BASES))


@pytest.mark.parametrize("samples", [12, 32, 80])
def test_samples_that_are_later_than_their_stamps(tmp_path, samples):
    """As of one converter behind a switch: each channel is sampled a seventh of the period later than the former."""
    time = np.arange(int(0.8 * 50 * samples)) / (50.0 * samples)
    skews = {k: 1e6 * k / (7 * 50.0 * samples) for k in range(6)}
    values = {name: waves(time + 1e-6 * skews[k])[name] for k, name in enumerate(waves(time))}
    path = write(tmp_path, values, time, kind="FLOAT32", skews=skews)
    rec = es.read(path, **BASES)
    check(rec.window(0.025))  # the first stamp has no sample before it
    assert any("interpolated to their stamps" in note and "IA" in note for note in rec.assumptions)
    V, late = read_comtrade_table(path)[0].columns["VA"], read_comtrade_table(path)[0].columns["IC"]
    assert np.isfinite(V).all()
    assert np.flatnonzero(np.isnan(late)).tolist() == [0]


def test_a_skew_of_rms_values_and_a_gap(tmp_path):
    time = np.arange(40) / 50.0
    values = {"U": 20.0 - 3.0 * time, "W": 20.0 - 3.0 * time}
    path = write(tmp_path, values, time, kind="FLOAT32", missing=[(1, [9])], skews={0: 5000.0, 1: -5000.0})
    table = read_comtrade_table(path)[0]
    assert table.columns["U"][1:] == pytest.approx(20.0 - 3.0 * (time[1:] - 0.005), abs=1e-5)
    assert np.flatnonzero(np.isnan(table.columns["W"])).tolist() == [8, 9, 39]
    assert table.columns["W"][:8] == pytest.approx(20.0 - 3.0 * (time[:8] + 0.005), abs=1e-5)


@pytest.mark.parametrize("revision", [1991, 1999, 2013])
@pytest.mark.parametrize(
    ("tail", "names"),
    [(",", None), (",,", None), (", ", None), (",", [f"{kind}, of {p}" for p in "ABC" for kind in "VI"])],
)
def test_commas_at_the_end_of_a_line(tmp_path, revision, tail, names):
    phases = [*"AABBCC"]
    path = write(
        tmp_path, waves(TIME), TIME, revision=revision, kind="ASCII", names=names, phases=phases, tail=tail
    )
    data = path.with_suffix(".dat")
    data.write_text("".join(f"{line}{tail}\n" for line in data.read_text().splitlines()))
    check(es.read(path, **BASES))


@pytest.mark.parametrize(
    ("revision", "tail", "count"), [(1999, ",1,x", 15), (1999, ",7", 14), (1991, ",7", 11), (2013, ",,7", 15)]
)
def test_a_line_with_too_many_entries_is_named(tmp_path, revision, tail, count):
    path = write(tmp_path, waves(TIME), TIME, revision=revision, tail=tail)
    with pytest.raises(InputError, match=f"line 3 of the configuration: a channel has {count} entries.*only"):
        es.read(path, **BASES)
