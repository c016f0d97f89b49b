"""Rms phasors of phasor measurement units: what follows is known from how the phases are made up here."""

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

import errorscreen as es
from errorscreen.cases import load_case
from errorscreen.data import from_frame, read_csv
from errorscreen.data.phasors import Phasors
from errorscreen.exceptions import DataWarning, InputError

BASES = {"base_mva": 100.0, "base_kv": 20.0, "f_nominal": 50.0}
A = np.exp(2j * np.pi / 3)
TIME = np.arange(150) / 50.0
DIP = 1.0
AFTER = TIME >= DIP
#: pu, rad and Hz of the positive sequence: the frequency is 50.1 Hz before the dip, 49.8 Hz after it
V = np.where(AFTER, 0.7, 1.0)
DEVIATION = np.where(AFTER, -0.2, 0.1)
ANGLE = 3.0 + 2 * np.pi * (0.1 * np.minimum(TIME, DIP) - 0.2 * np.maximum(TIME - DIP, 0.0))
P, Q = np.where(AFTER, 0.5, 0.8), np.where(AFTER, -0.05, 0.1)
#: pu of negative and zero sequence
V2, V0 = np.where(AFTER, 0.15, 0.01), np.where(AFTER, 0.08, 0.0)

ONE = 20.0 / np.sqrt(3) * V * np.exp(1j * ANGLE)
TWO, ZERO = (20.0 / np.sqrt(3) * part * np.exp(1j * (ANGLE + turn)) for part, turn in ((V2, 0.4), (V0, -0.9)))
CURRENT = np.conj(100.0 * (P + 1j * Q) / (3 * ONE))


def of_phases(one, two=0.0, zero=0.0):
    """Three phasors with some symmetrical components."""
    return [one + two + zero, A**2 * one + A * two + zero, A * one + A**2 * two + zero]


VOLTAGES = dict(zip(("VA", "VB", "VC"), of_phases(ONE, TWO, ZERO), strict=True))
CURRENTS = dict(zip(("IA", "IB", "IC"), of_phases(CURRENT, 0.2j * CURRENT), strict=True))


def polar(phasors, unit="deg", scale=1.0):
    cells = {}
    for name, one in phasors.items():
        cells[f"{name}_mag"] = scale * np.abs(one)
        cells[f"{name}_ang"] = np.angle(one, deg=unit == "deg")
    return cells


def pairs(names, first="mag", second="ang"):
    return [[f"{name}_{first}", f"{name}_{second}"] for name in names]


POLAR = {
    "voltage": pairs(VOLTAGES),
    "current": pairs(CURRENTS),
    "angle_unit": "deg",
    "voltage_unit": "kV",
    "current_unit": "kA",
}
CELLS = {**polar(VOLTAGES), **polar(CURRENTS)}


def read(cells, phasors, columns=None, time=TIME, **options):
    frame = pd.DataFrame({"t": time, **cells})
    return from_frame(frame, columns, phasors=phasors, time="t", **BASES, **options)


def check(recording, tolerance=1e-9):
    right = {"V": V, "P": P, "Q": Q}
    for name, values in right.items():
        assert np.abs(recording.channel(name).values - values).max() < tolerance, name
    angle = recording.channel("angle").values
    turns = 2 * np.pi * np.round((angle[0] - ANGLE[0]) / (2 * np.pi))
    assert np.abs(angle - turns - ANGLE).max() < tolerance
    f = recording.channel("f").values - 50.0
    away = np.abs(TIME - DIP) > 0.021  # a difference over the bend is of both sides
    assert np.abs(f - DEVIATION)[away].max() < max(1e-6, 10 * tolerance)
    assert recording.event_time == DIP


def test_three_phases_give_the_positive_sequence():
    recording = read(CELLS, POLAR)
    check(recording)
    assert any("in the frame of 50 Hz" in note for note in recording.assumptions)


def test_negative_and_zero_sequence_are_columns_of_their_own():
    extra = {"V2": {"column": "V2", "unit": "kV"}, "V0": {"column": "V0", "unit": "kV"}}
    recording = read(CELLS, POLAR, extra)
    assert recording.channel("V2").values == pytest.approx(20.0 * V2)
    assert recording.channel("V0").values == pytest.approx(20.0 * V0, abs=1e-9)


def test_units_peak_values_and_radians():
    cells = {**polar(VOLTAGES, "rad", 1e3 * np.sqrt(2)), **polar(CURRENTS, "rad", 1e3 * np.sqrt(2))}
    spec = {**POLAR, "angle_unit": "rad", "voltage_unit": "V", "current_unit": "A", "magnitude": "peak"}
    check(read(cells, spec))


def test_real_and_imaginary_parts():
    cells = {}
    for name, one in (VOLTAGES | CURRENTS).items():
        cells |= {f"{name}_r": one.real, f"{name}_i": one.imag}
    spec = {
        "voltage": pairs(VOLTAGES, "r", "i"),
        "current": pairs(CURRENTS, "r", "i"),
        "form": "rectangular",
        "voltage_unit": "kV",
        "current_unit": "kA",
    }
    check(read(cells, spec))


TEXTS = {
    "230.1+12.3j": lambda z: f"{z.real:.9f}{z.imag:+.9f}j",
    "1e2 - 3e0i": lambda z: f"{z.real:.9e} {'-' if z.imag < 0 else '+'} {abs(z.imag):.9e}i",
    "(230.1, 12.3)": lambda z: f"({z.real:.9f}, {z.imag:.9f})",
    "(230.1+12.3j)": lambda z: f"({z.real:.9f}{z.imag:+.9f}j)",
    "230.1∠12.5": lambda z: f"{abs(z):.9f}∠{np.angle(z, deg=True):.9f}°",
    "230.1 @ 12.5": lambda z: f"{abs(z):.9f} @ {np.angle(z, deg=True):.9f}",
}
OF_TEXTS = {"voltage": [*VOLTAGES], "current": [*CURRENTS], "voltage_unit": "kV", "current_unit": "kA"}


@pytest.mark.parametrize("kind", TEXTS)
def test_texts_in_a_file(tmp_path, kind):
    phases = VOLTAGES | CURRENTS
    cells = {"time": TIME, **{name: [f'"{TEXTS[kind](z)}"' for z in one] for name, one in phases.items()}}
    rows = [",".join(map(str, row)) for row in zip(*cells.values(), strict=True)]
    path = tmp_path / "pmu.csv"
    path.write_text("\n".join([",".join(cells), *rows]), encoding="utf-8")
    check(es.read(path, phasors=OF_TEXTS, **BASES), 1e-6)
    with pytest.raises(InputError, match=r"line 2, column 'VA'.*is a phasor.*Give phasors"):
        read_csv(path, {"V": "VA", "P": "IA"}, **BASES)


def test_complex_numbers_of_a_table():
    check(read(VOLTAGES | CURRENTS, OF_TEXTS))
    with pytest.raises(InputError, match=r"column 'VA'.*complex numbers.*Give phasors"):
        read(VOLTAGES, None, {"V": "VA"})


def test_the_positive_sequence_alone_and_its_own_frequency():
    cells = {**polar({"V1": ONE, "I1": CURRENT}), "freq": 50.0 + DEVIATION}
    spec = {**POLAR, "voltage": pairs(["V1"]), "current": pairs(["I1"])}
    recording = read(cells, spec, {"f": "freq"})
    assert recording.channel("f").values == pytest.approx(50.0 + DEVIATION)
    check(read(cells, spec))
    between = {**cells, "V1_mag": np.sqrt(3) * cells["V1_mag"]}
    check(read(between, {**spec, "line_to_line": True}))


def test_voltages_between_phases():
    va, vb, vc = VOLTAGES.values()
    cells = {**polar({"VAB": va - vb, "VBC": vb - vc, "VCA": vc - va}), **polar(CURRENTS)}
    check(read(cells, {**POLAR, "voltage": pairs(["VAB", "VBC", "VCA"]), "line_to_line": True}))


def test_currents_into_the_plant():
    into = {name: -one for name, one in CURRENTS.items()}
    check(read({**CELLS, **polar(into)}, {**POLAR, "sign": "load"}))


def test_power_from_columns_beside_voltages():
    spec = {key: value for key, value in POLAR.items() if not key.startswith("current")}
    columns = {"P": {"column": "MW", "unit": "MW"}, "Q": {"column": "Mvar", "unit": "Mvar"}}
    check(read({**CELLS, "MW": 100 * P, "Mvar": 100 * Q}, spec, columns))


def test_a_column_that_is_named_counts_before_one_that_follows():
    recording = read({**CELLS, "P": 0.9 * P}, POLAR, {"P": "P"})
    assert recording.channel("P").values == pytest.approx(0.9 * P)
    assert any("P was read from 'P', which is named for it" in note for note in recording.assumptions)


#: columns of the names of channels, of which no one said that they are meant
FOREIGN = {"V": 0.5 * V, "angle": ANGLE - 1.0, "f": 49.0 + 0.1 * V, "P": 0.3 * P, "Q": -Q, "V2": V, "V0": P}


@pytest.mark.parametrize("kind", ["frame", "csv", "xlsx", "parquet", "mat"])
def test_columns_that_nobody_named_do_not_count(tmp_path, kind):
    frame = pd.DataFrame({"time": TIME, **CELLS, **FOREIGN})
    path = tmp_path / f"pmu.{kind}"
    if kind == "frame":
        check(es.read(frame, phasors=POLAR, **BASES))
        return
    if kind == "csv":
        frame.to_csv(path, index=False)
    elif kind == "xlsx":
        pytest.importorskip("openpyxl")
        frame.to_excel(path, index=False)
    elif kind == "parquet":
        pytest.importorskip("pyarrow")
        frame.to_parquet(path)
    else:
        savemat(path, {name: frame[name].to_numpy() for name in frame})
    check(es.read(path, phasors=POLAR, **BASES), 1e-6)


def test_a_column_of_the_file_may_have_the_name_of_a_channel_that_follows():
    recording = read({**CELLS, "P": FOREIGN["P"]}, POLAR, {"feeder": {"column": "P", "unit": "pu"}})
    check(recording)
    assert recording.channel("feeder").values == pytest.approx(FOREIGN["P"])


def test_what_follows_has_its_own_unit():
    for spec in ("P", {"column": "P", "unit": "MW"}):
        check(read(CELLS, POLAR, {"P": spec}))
    with pytest.raises(InputError, match=r"'P'; it follows from the phases in MW.*given as 'pu'"):
        read(CELLS, POLAR, {"P": {"column": "P", "unit": "pu"}})


@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_a_frequency_that_is_held_is_no_fault_of_the_record(degrees):
    cells = polar({"V1": np.abs(ONE), "I1": np.conj(100.0 * (P + 1j * Q) / (3 * np.abs(ONE)))})
    cells["V1_ang"] = np.full(150, degrees)
    cells["I1_ang"] = cells["I1_ang"] + degrees
    recording = read(cells, {**POLAR, "voltage": pairs(["V1"]), "current": pairs(["I1"])})
    assert recording.channel("f").values == pytest.approx(50.0, abs=1e-12)
    assert recording.channel("angle").values == pytest.approx(np.deg2rad(degrees))
    assert recording.channel("P").values == pytest.approx(P)
    with pytest.raises(InputError, match="channel 'f': every reading is 50"):
        read({**CELLS, "Hz": np.full(150, 50.0)}, POLAR, {"f": {"column": "Hz", "unit": "Hz"}})


@pytest.mark.parametrize("between", [False, True])
def test_numbers_in_pu(between):
    volts, amps = (20.0 if between else 20.0 / np.sqrt(3)), 100.0 / (np.sqrt(3) * 20.0)
    va, vb, vc = VOLTAGES.values()
    phases = dict(zip(VOLTAGES, (va - vb, vb - vc, vc - va), strict=True)) if between else VOLTAGES
    cells = {**polar(phases, scale=1 / volts), **polar(CURRENTS, scale=1 / amps)}
    spec = {**POLAR, "voltage_unit": "pu", "current_unit": "pu", "line_to_line": between}
    check(read(cells, spec))
    with pytest.raises(InputError, match="the voltage in pu cannot be converted.*Give base_kv"):
        from_frame(
            pd.DataFrame({"t": TIME, **cells}), None, phasors=spec, time="t", base_mva=100.0, f_nominal=50.0
        )
    with pytest.raises(InputError, match="VA_mag, VB_mag, VC_mag is 'pu'.*V or kV"):
        read(cells, {**spec, "magnitude": "peak"})


def test_a_gap_is_where_a_cell_is_missing_and_nowhere_else():
    cells = {name: values.copy() for name, values in CELLS.items()}
    cells["VB_ang"][10], cells["IC_mag"][20] = np.nan, np.nan
    recording = read(cells, POLAR)
    gaps = {name: np.flatnonzero(np.isnan(c.values)).tolist() for name, c in recording.channels.items()}
    assert gaps == {"V": [10], "angle": [10], "f": [10], "P": [10, 20], "Q": [10, 20]}
    assert recording.channel("f").values[[9, 11]] == pytest.approx(50.1)


def test_shuffled_and_repeated_rows_are_put_right_first():
    order = np.random.default_rng(0).permutation(np.r_[np.arange(150), 30, 31])
    cells = {name: values[order] for name, values in CELLS.items()}
    check(read(cells, POLAR, time=TIME[order], on_backward="sort"))


def test_rows_of_bad_status_do_not_count():
    cells = {name: np.where(np.arange(150) == 40, -9999.0, values) for name, values in CELLS.items()}
    status = ["8000" if k == 40 else "0000" for k in range(150)]
    recording = read({**cells, "STAT": status}, POLAR, quality={"column": "STAT", "good": ["0000"]})
    assert np.flatnonzero(np.isnan(recording.channel("P").values)).tolist() == [40]


@pytest.mark.parametrize("reversed_one", [*CURRENTS])
def test_a_reversed_current_transformer_is_named(reversed_one):
    currents = {**CURRENTS, reversed_one: -CURRENTS[reversed_one]}
    with pytest.warns(DataWarning, match=f"sign of '{reversed_one}_mag'.*one current transformer reversed"):
        read({**CELLS, **polar(currents)}, POLAR)


def test_interchanged_currents_are_told():
    with pytest.warns(DataWarning, match=r"two phases interchanged, \['IA_mag', 'IB_mag', 'IC_mag'\]"):
        read(CELLS, {**POLAR, "current": pairs(["IA", "IC", "IB"])})


def test_another_phase_order_is_refused_with_the_right_one():
    with pytest.raises(
        InputError, match=r"Interchange two of the voltages: \['VA_mag', 'VB_mag', 'VC_mag'\]"
    ):
        read(CELLS, {**POLAR, "voltage": pairs(["VA", "VC", "VB"])})


def test_a_reversed_voltage_is_named():
    with pytest.raises(InputError, match="Correct the sign of 'VB_mag'"):
        read({**CELLS, **polar({"VB": -VOLTAGES["VB"]})}, POLAR)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"voltage": pairs(["VA", "VB"])}, "2 voltages and 3 currents.*three of each, or one of each"),
        ({"voltage": [["VA_mag", "VA_ang"]]}, "1 voltages and 3 currents"),
        ({"voltage": ["VA_mag", ["VB_mag"], "VC_mag"]}, "a phasor has 1 columns"),
        ({"voltage": [["VA_mag", "VA_ang"]] * 3}, "a column is named twice"),
        ({"form": "complex"}, "value of form 'complex'.*polar, rectangular"),
        ({"magnitude": "max"}, "value of magnitude"),
        ({"sign": "out"}, "value of sign"),
        ({"angle_unit": None}, "the unit of VA_ang is 'not stated'.*Give angle_unit"),
        ({"voltage_unit": None}, "the unit of VA_mag, VB_mag, VC_mag is 'not stated'.*Give voltage_unit"),
        ({"current_unit": None}, "Give current_unit"),
        ({"unit": "kV"}, "field 'unit'"),
        ({"voltage": "VA_mag"}, "voltage is 'VA_mag'.*a list"),
    ],
)
def test_a_description_that_does_not_fit_is_explained(change, message):
    with pytest.raises(InputError, match=message):
        read(CELLS, {**POLAR, **change})


@pytest.mark.parametrize("phasors", ["VA", {"current": ["IA"]}, {}])
def test_a_description_without_voltages_is_explained(phasors):
    with pytest.raises(InputError, match="the voltages are not stated"):
        read(CELLS, phasors)


def test_the_positive_sequence_alone_has_no_negative_one():
    spec = {**POLAR, "voltage": pairs(["V1"]), "current": pairs(["I1"])}
    with pytest.raises(InputError, match="unknown column 'V2'"):
        read(polar({"V1": ONE, "I1": CURRENT}), spec, {"V2": "V2"})


def test_a_negative_magnitude_is_refused():
    cells = {**CELLS, "VB_mag": np.where(np.arange(150) == 7, -3.0, CELLS["VB_mag"])}
    with pytest.raises(InputError, match="row 7, column 'VB_mag': a magnitude is -3.*rectangular"):
        read(cells, POLAR)


def test_a_phasor_without_an_angle_is_refused():
    cells = {name: [str(z) for z in one] for name, one in VOLTAGES.items()}
    cells["VB"][3] = "11.5"
    with pytest.raises(InputError, match="row 3, column 'VB': 11.5 has no angle"):
        read(cells, {"voltage": [*VOLTAGES], "voltage_unit": "kV"})
    cells["VB"][3] = "none so far"
    with pytest.raises(InputError, match="row 3, column 'VB': 'none so far' is not a number.*as 230.1"):
        read(cells, {"voltage": [*VOLTAGES], "voltage_unit": "kV"})


def test_waveforms_and_phasors_together_are_refused():
    with pytest.raises(InputError, match="both given"):
        read(CELLS, POLAR, waveforms={"voltage": ["a", "b", "c"]})


def test_a_case_file(tmp_path):
    pd.DataFrame({"time": TIME, **CELLS}).to_csv(tmp_path / "pmu.csv", index=False, float_format="%.9f")
    text = [f"{key} = {value!r}".replace("'", '"') for key, value in POLAR.items()]
    (tmp_path / "case.toml").write_text(
        '[recording]\npath = "pmu.csv"\nbase_mva = 100\nbase_kv = 20\nf_nominal = 50\n'
        "[recording.phasors]\n" + "\n".join(text) + '\n[device]\ntype = "synchronous_machine"\n'
    )
    check(load_case(tmp_path / "case.toml").load_recording(), 1e-6)


def test_a_description_as_an_object():
    spec = Phasors(
        tuple(map(tuple, POLAR["voltage"])),
        tuple(map(tuple, POLAR["current"])),
        angle_unit="deg",
        voltage_unit="kV",
        current_unit="kA",
    )
    check(es.read(pd.DataFrame({"time": TIME, **CELLS}), phasors=spec, **BASES))


def test_phasors_are_not_said_to_be_measured_between_lines():
    assert not any("line to line" in text for text in read(CELLS, POLAR).assumptions)
