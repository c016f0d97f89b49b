import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from errorscreen.data import Column, from_frame
from errorscreen.exceptions import InputError

TIME = np.arange(0, 5, 0.02)
BASES = {"base_mva": 50.0, "base_kv": 20.0, "f_nominal": 50.0}
UNITS = {"V": "pu", "angle": "rad", "f": "Hz", "P": "pu", "Q": "pu"}


def plain() -> pd.DataFrame:
    """A disturbance in the units of a recording."""
    rng = np.random.default_rng(3)
    after = np.clip(TIME - 1, 0, None)
    swing = np.where(TIME < 1, 0, np.exp(-after) * np.cos(6 * after))
    signals = {
        "V": 1.0 - 0.1 * swing,
        "angle": 0.2 + 8 * after,
        "f": 50 + 0.1 * swing,
        "P": 0.6 - 0.2 * swing,
        "Q": 0.1 + 0.1 * swing,
    }
    return pd.DataFrame({k: v + 1e-3 * rng.normal(size=len(TIME)) for k, v in signals.items()}, index=TIME)


def same(one, other, names=UNITS):
    np.testing.assert_allclose(one.time, other.time)
    assert one.event_time == pytest.approx(other.event_time)
    for name in names:
        np.testing.assert_allclose(one.channel(name).values, other.channel(name).values, rtol=1e-9, atol=1e-9)
        assert one.channel(name).noise == pytest.approx(other.channel(name).noise, rel=1e-6)


FRAME = plain()
REFERENCE = from_frame(FRAME, {k: Column(k, unit=u) for k, u in UNITS.items()}, **BASES)


@settings(max_examples=40)
@given(
    power=st.sampled_from(["W", "kW", "MW", "pu"]),
    voltage=st.sampled_from(["V", "kV", "pu"]),
    degrees=st.booleans(),
    load=st.booleans(),
    per_phase=st.booleans(),
    line_neutral=st.booleans(),
    base=st.floats(1.0, 5000.0),
    order=st.permutations(list(UNITS)),
    milliseconds=st.booleans(),
)
def test_the_same_recording_in_any_dress(
    power, voltage, degrees, load, per_phase, line_neutral, base, order, milliseconds
):
    sign, physical = -1 if load else 1, power != "pu"
    mw = {"W": 50e6, "kW": 50e3, "MW": 50.0, "pu": 50.0 / base}[power] / (3 if per_phase and physical else 1)
    volts = {"V": 20e3, "kV": 20.0, "pu": 1.0}[voltage] / (
        np.sqrt(3) if line_neutral and voltage != "pu" else 1
    )
    frame = pd.DataFrame(
        {
            "t": TIME * (1000 if milliseconds else 1),
            "V": FRAME["V"].to_numpy() * volts,
            "angle": np.angle(np.exp(1j * FRAME["angle"].to_numpy())) * (180 / np.pi if degrees else 1),
            "f": (FRAME["f"].to_numpy() - 50) * 1000,
            "P": FRAME["P"].to_numpy() * sign * mw,
            "Q": FRAME["Q"].to_numpy() * sign * mw,
        }
    )[["t", *order]]
    watts = {
        "unit": power,
        "sign": "load" if load else "generator",
        "base": None if physical else base,
        "per_phase": per_phase and physical,
    }
    columns = {
        "Q": {"column": "Q", **watts},
        "V": Column("V", unit=voltage, line_neutral=line_neutral and voltage != "pu"),
        "angle": Column("angle", unit="deg" if degrees else "rad"),
        "f": Column("f", unit="mHz deviation"),
        "P": {"column": "P", **watts},
    }
    rec = from_frame(frame, columns, time="t", time_unit="ms" if milliseconds else "s", **BASES)
    same(rec, REFERENCE, ("V", "f", "P", "Q"))
    angle = rec.channel("angle").values
    np.testing.assert_allclose(angle - angle[0], FRAME["angle"] - FRAME["angle"].iloc[0], atol=1e-9)
    assert rec.names == tuple(columns)


def test_a_phasor_in_parts_gives_magnitude_and_angle():
    phasor = FRAME["V"] * np.exp(1j * FRAME["angle"])
    frame = pd.DataFrame(
        {"re": 20 * np.real(phasor), "im": 20 * np.imag(phasor), "P": FRAME["P"]}, index=TIME
    )
    columns = {"V": Column(real="re", imag="im", unit="kV"), "P": "P"}
    same(from_frame(frame, columns, **BASES), REFERENCE, ("V", "angle", "P"))


def test_a_turned_phasor_has_a_positive_magnitude():
    phasor = -FRAME["V"] * np.exp(1j * FRAME["angle"])
    frame = pd.DataFrame({"re": np.real(phasor), "im": np.imag(phasor)}, index=TIME)
    rec = from_frame(frame, {"V": Column(real="re", imag="im", scale=-1.0)}, **BASES)
    same(rec, REFERENCE, ("V", "angle"))


def test_assumptions_are_written_down():
    frame = FRAME.copy()
    frame.loc[TIME > 4.5, "P"] = np.nan
    frame.loc[TIME[10], "P"] = np.inf
    rec = from_frame(
        frame,
        {"V": "V", "P": Column("P", sign="load"), "Q": Column("Q", unit="MW", per_phase=True, scale=10)},
        **BASES,
        event_time=1.0,
    )
    text = " ".join(rec.assumptions)
    for sentence in (
        "No unit of V was stated; pu was assumed.",
        "P in pu was taken to be on the base of 50 MVA.",
        "P was recorded positive when consumed; its sign was turned.",
        "Q was recorded for one phase; the other two were taken to be equal.",
        "1 infinite or absurdly large readings of P were taken as gaps.",
        f"{int((TIME > 4.5).sum()) + 1} of 250 readings of P are missing.",
    ):
        assert sentence in text


def test_stated_values_and_other_channels():
    frame = FRAME.assign(Efd=2 + FRAME["Q"])
    rec = from_frame(
        frame, {"Q": "Q", "P": Column(value=27.0, unit="MW"), "Efd": Column("Efd", unit="pu")}, **BASES
    )
    assert rec.initial(["P"])["P"] == pytest.approx(0.54)
    assert rec.names == ("Q", "Efd")
    assert rec.channel("Efd").unit == "pu"
    assert "P was not measured; it was given as 0.54 pu." in rec.assumptions


def test_irregular_sampling_is_said():
    rng = np.random.default_rng(0)
    rec = from_frame(FRAME.set_index(TIME + 0.008 * rng.random(len(TIME))), {"P": "P"}, **BASES)
    assert any(s.startswith("Samples are 0.01") for s in rec.assumptions)
    assert not any(s.startswith("Samples are") for s in REFERENCE.assumptions)


def test_dates_in_the_index():
    stamps = pd.Timestamp("2024-05-01", tz="Europe/Berlin") + pd.to_timedelta(TIME, unit="s")
    rec = from_frame(FRAME.set_index(stamps), {"P": "P"}, time_unit="iso", **BASES)
    np.testing.assert_allclose(rec.time, TIME, atol=1e-9)


def test_text_columns_are_read_as_numbers():
    frame = FRAME.astype(str)
    frame.iloc[5, frame.columns.get_loc("P")] = " Bad "
    rec = from_frame(frame, {"P": "P"}, **BASES)
    assert np.isnan(rec.channel("P").values[5])
    assert np.isfinite(rec.channel("P").values).sum() == 249


def test_columns_of_a_table_must_be_unique():
    with pytest.raises(InputError, match="column 'P' occurs more than once"):
        from_frame(pd.concat([FRAME, FRAME[["P"]]], axis=1), {"P": "P"}, **BASES)


@pytest.mark.parametrize("unit", ["pu", "MW"])
def test_readings_too_large_to_calculate_with_are_gaps(unit):
    frame = FRAME.copy()
    frame.iloc[[3, 70], frame.columns.get_loc("P")] = [1e308, -1e20]
    rec = from_frame(frame, {"P": Column("P", unit=unit, scale=100.0 if unit == "MW" else 1.0)}, **BASES)
    assert np.isnan(rec.channel("P").values[[3, 70]]).all()
    assert any("2 infinite or absurdly large readings of P" in s for s in rec.assumptions)
