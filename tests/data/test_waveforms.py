"""Sampled waves of a table; those of COMTRADE records and text files are in tests.data.readers.test_comtrade."""

import numpy as np
import pandas as pd
import pytest

import errorscreen as es
from errorscreen.data import from_frame, read_csv
from errorscreen.exceptions import InputError
from tests.data.readers.test_comtrade import AFTER, BASES, BEFORE, TIME, check, waves

WAVEFORMS = {
    "voltage": ["VA", "VB", "VC"],
    "current": ["IA", "IB", "IC"],
    "voltage_unit": "kV",
    "current_unit": "kA",
}


def test_waves_of_a_table():
    frame = pd.DataFrame({"time": TIME, **waves(TIME)})
    check(from_frame(frame, None, time="time", waveforms=WAVEFORMS, **BASES))
    check(es.read(frame, waveforms=WAVEFORMS, **BASES))


def test_sign_and_further_channels_of_a_text_file(tmp_path):
    path = tmp_path / "waves.csv"
    pd.DataFrame({"time": TIME, **waves(TIME), "Efd": 2.0 + TIME}).to_csv(path, index=False)
    columns = {
        "P": {"column": "P", "unit": "MW", "sign": "load"},
        "V2": {"column": "V2", "unit": "kV"},
        "Efd": "Efd",
        "raw": {"column": "VA", "unit": "kV"},
    }
    recording = read_csv(path, columns, waveforms=WAVEFORMS, **BASES)
    t = recording.time
    assert recording.channel("P").values[[0, -1]] == pytest.approx([-BEFORE[2], -AFTER[2]], abs=1e-3)
    assert recording.channel("Q").values[[0, -1]] == pytest.approx([BEFORE[3], AFTER[3]], abs=1e-3)
    away = np.abs(t - 0.4) > 0.03
    assert np.abs(recording.channel("V2").values[away]).max() < 0.02
    assert recording.channel("Efd").values == pytest.approx(2.0 + t)
    assert np.abs(recording.channel("raw").values[away]).max() < 0.1, "the mean of a period"


def test_columns_that_nobody_named_do_not_count(tmp_path):
    values = waves(TIME)
    values = {"V": values["VA"], **values, "P": 30.0 + TIME, "f": 49.0 + TIME}
    del values["VA"]
    frame, spec = pd.DataFrame({"time": TIME, **values}), {**WAVEFORMS, "voltage": ["V", "VB", "VC"]}
    check(es.read(frame, waveforms=spec, **BASES))
    frame.to_csv(tmp_path / "waves.csv", index=False)
    check(es.read(tmp_path / "waves.csv", waveforms=spec, **BASES))


def test_currents_into_the_plant():
    values = {name: -x if name[0] == "I" else x for name, x in waves(TIME).items()}
    frame = pd.DataFrame({"time": TIME, **values})
    check(es.read(frame, waveforms={**WAVEFORMS, "sign": "load"}, **BASES))
    with pytest.raises(InputError, match="sign 'out'.*generator, load"):
        es.read(frame, waveforms={**WAVEFORMS, "sign": "out"}, **BASES)


def test_waves_in_pu_are_of_the_peak_values():
    peak = {
        "V": np.sqrt(2 / 3) * BASES["base_kv"],
        "I": np.sqrt(2 / 3) * BASES["base_mva"] / BASES["base_kv"],
    }
    per_unit = {name: x / peak[name[0]] for name, x in waves(TIME).items()}
    frame = pd.DataFrame({"time": TIME, **per_unit})
    spec = {**WAVEFORMS, "voltage_unit": "pu", "current_unit": "pu"}
    check(es.read(frame, waveforms=spec, **BASES))
    with pytest.raises(InputError, match="the voltage in pu cannot be converted.*Give base_kv"):
        es.read(frame, waveforms=spec, base_mva=BASES["base_mva"], f_nominal=BASES["f_nominal"])


def test_stamps_that_do_not_increase_are_refused():
    frame = pd.DataFrame({"time": np.round(TIME, 2), **waves(TIME)})
    with pytest.raises(InputError, match="time does not increase with each sample"):
        es.read(frame, waveforms=WAVEFORMS, **BASES)


def test_a_hole_in_the_samples_is_a_gap():
    keep = (TIME < 0.5) | (TIME >= 0.6)
    frame = pd.DataFrame({"time": TIME, **waves(TIME)})[keep]
    recording = from_frame(frame, None, time="time", waveforms=WAVEFORMS, **BASES)
    t, V = recording.time, recording.channel("V").values
    assert np.isnan(V[(t > 0.491) & (t < 0.609)]).all()
    assert V[((t > 0.421) & (t < 0.479)) | (t > 0.621)] == pytest.approx(AFTER[0], abs=1e-3)


def test_a_stamp_far_from_the_others_is_refused():
    frame = pd.DataFrame({"time": np.r_[TIME, 9e9], **waves(np.r_[TIME, 1.0])})
    with pytest.raises(
        InputError, match=r"only 1281 samples lie between 0 and 9e\+09 s.*far from the others"
    ):
        from_frame(frame, None, time="time", waveforms=WAVEFORMS, **BASES)
