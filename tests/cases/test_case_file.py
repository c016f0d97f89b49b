import re
from dataclasses import fields

import numpy as np
import pytest

from errorscreen.cases.case_file import Case, case_reference, load_case
from errorscreen.cases.case_models import ColumnSection
from errorscreen.cases.keys import sections
from errorscreen.cases.model_sections import DeviceSection, ParameterSection
from errorscreen.cli import main
from errorscreen.data import Column
from errorscreen.exceptions import DataWarning, InputError
from errorscreen.parameters import Parameter

GOOD = """
title = "line trip"

[recording]
path = "data/rec.csv"
base_mva = 50
base_kv = 20.0
f_nominal = 50.0
t_end = 2.5

[recording.columns.V]
column = "U"
unit = "kV"

[recording.columns.P]
column = "P"
unit = "MW"
sign = "load"

[[held_out]]
path = "data/other.csv"

[device]
type = "synchronous_machine"
relative = 0.5

[device.constants]
Ra = 0.0015

[device.parameters]
Xd = { nominal = 0.95, relative = 0.4 }
D = { nominal = 1.0, lower = 0.0, upper = 2.0 }

[screening]
methods = ["sensitivity", "random"]
top_k = 3
"""


def write(folder, text=GOOD):
    path = folder / "case.toml"
    path.write_text(text)
    return path


def write_recording(folder, name="rec.csv"):
    time = np.arange(0, 3, 0.05)
    power = np.where(time < 1, -40.0, -30.0) + 0.01 * np.sin(50 * time)
    (folder / "data").mkdir(exist_ok=True)
    rows = [f"{t:.2f},{20 - (t >= 1):.3f},{p:.4f}" for t, p in zip(time, power, strict=True)]
    (folder / "data" / name).write_text("\n".join(["time,U,P", *rows]))


def test_a_case_is_read_with_its_defaults(tmp_path):
    case = load_case(write(tmp_path))
    assert (case.title, case.folder) == ("line trip", tmp_path)
    assert case.device.constants == {"Ra": 0.0015}
    assert (case.screening.methods, case.screening.top_k) == (["sensitivity", "random"], 3)
    assert (case.calibration.methods, case.simulation.step, case.run.random_state) == (
        ["map", "pso"],
        0.0025,
        0,
    )


def test_parameters_follow_their_sections(tmp_path):
    space = load_case(write(tmp_path)).parameters()
    assert (space["Xd"].nominal, space["Xd"].lower, space["Xd"].upper) == pytest.approx((0.95, 0.57, 1.33))
    assert (space["D"].lower, space["D"].upper) == (0.0, 2.0)
    assert space["Tj"].upper == pytest.approx(1.5 * space["Tj"].nominal)
    text = GOOD.replace("relative = 0.5", 'candidates = ["Tj", "Xd"]').replace("top_k = 3", "top_k = 2")
    assert load_case(write(tmp_path, text)).parameters().names == ("Tj", "Xd")


def test_values_that_are_not_those_of_the_unit_are_told():
    stated = {name: {"nominal": 1.0} for name in ("Xd", "Xd1", "Xq", "Xq1", "Td10", "Tq10")}
    section = DeviceSection(type="synchronous_machine", parameters=stated, relative=0.5)
    assert section.typical.startswith(
        "The model begins with typical values of Tj, D, not with those of this unit"
    )
    stated |= {"Tj": {"nominal": 8.0}, "D": {"nominal": 2.0}}
    assert not DeviceSection(type="synchronous_machine", parameters=stated).typical
    assert not DeviceSection(dyr="unit.dyr").typical


def test_default_bounds_keep_their_ratio_to_a_new_nominal_value():
    default = Parameter("Xd", 2.0, 1.0, 3.0)
    assert ParameterSection(nominal=1.0).apply(default) == {"nominal": 1.0, "lower": 0.5, "upper": 1.5}
    assert ParameterSection(lower=0.1).apply(default) == {"nominal": 2.0, "lower": 0.1, "upper": 3.0}
    assert ParameterSection(nominal=-1.0, relative=0.5).apply(default) == {
        "nominal": -1.0,
        "lower": -1.5,
        "upper": -0.5,
    }


def test_recordings_are_read_relative_to_the_case(tmp_path):
    write_recording(tmp_path)
    write_recording(tmp_path, "other.csv")
    case = load_case(write(tmp_path))
    rec = case.load_recording()
    assert rec.initial("VP") == pytest.approx({"V": 1.0, "P": 0.8}, abs=1e-3)
    assert rec.time[-1] == 2.5
    (other,) = case.load_held_out()
    assert (other.name, other.time[-1]) == ("other", pytest.approx(2.95))


def test_what_is_fitted_together_is_read_like_what_is_held_out(tmp_path):
    for name in ("rec.csv", "other.csv", "third.csv"):
        write_recording(tmp_path, name)
    text = replaced("[device]", '[[together]]\npath = "data/third.csv"\nname = "third one"\n\n[device]')
    case = load_case(write(tmp_path, text))
    assert list(case.recordings) == ["recording", "together[1]", "held_out[1]"]
    (third,) = case.load_together()
    assert (third.name, third.base_mva, third.time[-1]) == ("third one", 50, pytest.approx(2.95))
    assert third.initial("P")["P"] == pytest.approx(0.8, abs=1e-3)
    assert [recording.name for recording in case.load_held_out()] == ["other"]


def test_a_stated_level_belongs_to_its_recording_alone(tmp_path):
    write_recording(tmp_path)
    write_recording(tmp_path, "other.csv")
    text = replaced("t_end = 2.5", "t_start = 0.5\nt_end = 2.5\nlevel = { V = 1.0, P = 0.8 }")
    case = load_case(write(tmp_path, text))
    with pytest.warns(DataWarning, match="no quiet part"):
        rec = case.load_recording()
    assert (rec.stated, rec.event_time, rec.initial("P")["P"]) == (True, 0.5, pytest.approx(0.8))
    (other,) = case.load_held_out()
    assert (other.stated, other.event_time) == (False, pytest.approx(1.0))


def test_two_windows_of_one_file_are_two_recordings(tmp_path):
    text = replaced('"data/other.csv"', '"data/rec.csv"\nt_start = 2.5')
    assert load_case(write(tmp_path, text)).recordings["held_out[1]"].t_start == 2.5


@pytest.mark.parametrize("line", ["significance = 0.001", "first_look = 20", "first_look = 0"])
def test_the_least_that_discovery_takes(line, tmp_path):
    load_case(write(tmp_path, GOOD + f"[discovery]\n{line}\n"))


def test_a_shift_is_applied_before_resampling(tmp_path):
    write_recording(tmp_path)
    text = GOOD.replace("t_end = 2.5", "shift = { V = -0.017 }\n[simulation]\ndt = 0.01\n", 1)
    text = text.replace("[simulation]\ndt = 0.01\n", "") + "\n[simulation]\ndt = 0.01\n"
    rec = load_case(write(tmp_path, text)).load_recording()
    assert np.diff(rec.time) == pytest.approx(0.01)
    assert "The time stamps of V were shifted by -0.017 s." in rec.assumptions


def test_a_bare_header_is_a_column(tmp_path):
    text = replaced('[recording.columns.V]\ncolumn = "U"\nunit = "kV"', '[recording.columns]\nI = "I [kA]"')
    assert load_case(write(tmp_path, text)).recording.columns["I"] == ColumnSection(column="I [kA]")
    with pytest.raises(InputError, match=r"columns.I: 3 was found. Allowed: a table"):
        load_case(write(tmp_path, text.replace('"I [kA]"', "3")))


def test_column_sections_are_columns():
    assert list(ColumnSection.model_fields) == [f.name for f in fields(Column)]
    assert Column(**dict(ColumnSection(column="c"))) == Column("c")


def test_the_reference_names_every_key():
    text = case_reference()
    for heading in ("[recording]", "[recording.columns.NAME]", "[device.parameters.NAME]", "[run]"):
        assert f"### `{heading}`" in text
    for title, section in sections(Case):
        for key, field in section.model_fields.items():
            assert field.description, (title, key)
            assert any(part in text for part in (f"`{key}`", f".{key}.NAME", f".{key}]"))


def test_the_command_line_prints_the_keys_of_a_section(capsys):
    assert main(["keys", "device"]) == 0
    printed = capsys.readouterr().out
    assert "### `[device]`" in printed
    assert "### `[device.parameters.NAME]`" in printed
    assert "[run]" not in printed
    assert main(["keys", "devise"]) == 2
    assert "unknown section of a case file 'devise' (did you mean 'device'" in capsys.readouterr().err


def replaced(old, new):
    assert old in GOOD
    return GOOD.replace(old, new)


BAD = {
    "no TOML": (
        replaced('title = "line trip"', "title = line trip"),
        "is not TOML: Invalid value (at line 2",
    ),
    "no recording": ('[device]\ntype = "pv_plant"\n', "section or key 'recording' is missing."),
    "no path": (replaced('path = "data/rec.csv"', ""), "[recording]: key 'path' is missing."),
    "unknown key": (
        replaced("base_mva", "base_mwa"),
        "[recording]: unknown key 'base_mwa' (did you mean 'base_mva', 'base_kv'?). Allowed: path, format, name, "
        "base_mva, base_kv,",
    ),
    "unknown section": (
        GOOD + "[calibrate]\n",
        "unknown section or key 'calibrate' (did you mean 'calibration'?)",
    ),
    "key at the wrong place": (
        replaced('title = "line trip"', "random_state = 3"),
        "unknown section or key 'random_state'. Allowed: title, recording, together, held_out, device, plant, grid, "
        "simulation, screening, calibration, discovery, limits, run. 'random_state' belongs to [run].",
    ),
    "unknown key of a column": (
        replaced('unit = "kV"', 'units = "kV"'),
        "[recording.columns.V]: unknown key 'units' (did you mean 'unit'?). Allowed: column, unit, base, sign",
    ),
    "unknown key of a parameter": (
        replaced("relative = 0.4 }", "relativ = 0.4 }"),
        "[device.parameters.Xd]: unknown key 'relativ' (did you mean 'relative'?). Allowed: nominal, relative",
    ),
    "number in quotes": (
        replaced("base_mva = 50", 'base_mva = "50"'),
        "recording.base_mva: '50' was found. Allowed: a number.",
    ),
    "text without use": (
        replaced('column = "P"', "column = 3"),
        "recording.columns.P.column: 3 was found. Allowed: text in quotes.",
    ),
    "fraction for a count": (
        replaced("top_k = 3", "top_k = 3.5"),
        "screening.top_k: 3.5 was found. Allowed: a whole number.",
    ),
    "negative base": (
        replaced("base_mva = 50", "base_mva = -50"),
        "recording.base_mva: -50 was found. Allowed: a number > 0.",
    ),
    "no finite number": (
        replaced("f_nominal = 50.0", "f_nominal = nan"),
        "recording.f_nominal: nan was found. Allowed: a finite number.",
    ),
    "part above one": (
        replaced("t_end = 2.5", "max_missing = 40"),
        "recording.max_missing: 40 was found. Allowed: a number <= 1.",
    ),
    "value for a list": (
        replaced('methods = ["sensitivity", "random"]', 'methods = "cnn"'),
        "screening.methods: 'cnn' was found. Allowed: a list.",
    ),
    "unknown method": (
        replaced('["sensitivity", "random"]', '["sensitivty"]'),
        "screening.methods[1]: unknown screener 'sensitivty' (did you mean 'sensitivity'?). Allowed: cnn, "
        "sensitivity, identifiability, attribution, random.",
    ),
    "no method": (
        replaced('["sensitivity", "random"]', "[]"),
        "screening.methods: [] was found. Allowed: at least 1 entry.",
    ),
    "method twice": (
        replaced('["sensitivity", "random"]', '["random", "random"]'),
        "screening.methods: 'random' was found twice. Allowed: each name once.",
    ),
    "unknown format": (
        replaced("base_mva = 50", 'base_mva = 50\nformat = "cvs"'),
        "recording.format: unknown format 'cvs' (did you mean 'csv'?). Allowed: csv, comtrade,",
    ),
    "unknown sign": (
        replaced('sign = "load"', 'sign = "consumer"'),
        "recording.columns.P.sign: unknown value 'consumer'. Allowed: generator, load.",
    ),
    "table for a value": (
        replaced("base_kv = 20.0", "base_kv = { V = 20.0 }"),
        "recording.base_kv: {'V': 20.0} was found. Allowed: a number.",
    ),
    "value for a table": (
        replaced("Xd = { nominal = 0.95, relative = 0.4 }", "Xd = 0.95"),
        "device.parameters.Xd: 0.95 was found. Allowed: a table.",
    ),
    "two rules of selection": (
        replaced("top_k = 3", "top_k = 3\nthreshold = 0.2"),
        "screening: top_k and threshold are both given. Allowed: one of them.",
    ),
    "two kinds of bounds": (
        replaced("relative = 0.4 }", "relative = 0.4, upper = 2.0 }"),
        "device.parameters.Xd: relative and absolute bounds are both given. Allowed: one kind of bounds.",
    ),
    "more parameters than there are": (
        replaced("top_k = 3", "top_k = 9"),
        "screening.top_k is 9. Allowed: an integer from 1 to 8.",
    ),
    "unknown device": (
        replaced("synchronous_machine", "synchronous_generator"),
        "device.type: unknown device 'synchronous_generator' (did you mean 'synchronous_machine'?). Allowed:",
    ),
    "unknown parameter": (
        replaced("Xd = {", "Xd2 = {"),
        "unknown parameter 'Xd2' (did you mean 'Xd', 'Xd1'?). Allowed: Xd, Xd1, Xq, Xq1, Td10, Tq10, Tj, D, Ra.",
    ),
    "unknown candidate": (
        replaced("relative = 0.5", 'candidates = ["H"]'),
        "unknown parameter 'H'. Allowed: Xd, Xd1,",
    ),
    "unknown constant": (replaced("Ra = 0.0015", "R = 0.0015"), "unknown constant 'R' (did you mean 'Ra'?)"),
    "negative resistance of the grid": (
        replaced("relative = 0.5", "relative = 0.5\ngrid_resistance = -0.1"),
        "device.grid_resistance: -0.1 was found. Allowed: a number >= 0.",
    ),
    "constant of a loop that there is only behind an impedance": (
        replaced("synchronous_machine", "pv_plant").replace("Ra = 0.0015", "KPLL = 30.0"),
        "unknown constant 'KPLL'",
    ),
    "bounds that exclude nominal": (
        replaced("lower = 0.0, upper = 2.0", "lower = 1.5, upper = 2.0"),
        "parameter 'D': the range [1.5, 2] excludes the nominal value 1. Allowed: lower <= nominal <= upper.",
    ),
    "empty range": (
        replaced("lower = 0.0, upper = 2.0", "lower = 2.0, upper = 1.5"),
        "parameter 'D': the range [2, 1.5] is empty. Allowed: lower < upper.",
    ),
    "zero nominal": (
        replaced("nominal = 1.0, lower = 0.0", "nominal = 0.0, lower = 0.0"),
        "parameter 'D': the nominal value is 0 and the scale is 0, so a relative deviation is undefined. "
        "Allowed: a nominal value other than 0, or a positive scale. Give scale=",
    ),
    "empty window": (
        replaced("t_end = 2.5", "t_start = 3.0\nt_end = 2.5"),
        "recording: the window from 3 to 2.5 s is empty. Allowed: t_start < t_end.",
    ),
    "no process": (GOOD + "[run]\nn_jobs = 0\n", "run: n_jobs is 0. Allowed: a number of processes, or -1."),
    "fewer simulations than starts": (
        GOOD + "[calibration]\nstarts = 9\nlibrary = 4\n",
        "calibration: 9 starts cannot be taken from a library of 4. Allowed: library >= starts - 1.",
    ),
    "significance that the draws cannot tell apart": (
        GOOD + "[discovery]\nsignificance = 0.0009\n",
        "discovery.significance: 0.0009 was found. Allowed: a number >= 0.001.",
    ),
    "a first look at too little": (
        GOOD + "[discovery]\nfirst_look = 1\n",
        "discovery: first_look is 1. Allowed: 0 for none, or a whole number >= 20.",
    ),
    "no effect to try": (
        GOOD + "[discovery]\neffects = []\n",
        "discovery.effects: [] was found. Allowed: at least 1 entry.",
    ),
    "effect twice": (
        GOOD + '[discovery]\neffects = ["exciter", "governor", "exciter"]\n',
        "discovery.effects: 'exciter' was found twice. Allowed: each name once.",
    ),
    "fitted and held out": (
        replaced("[device]", '[[together]]\npath = "data/other.csv"\n[device]'),
        "held_out[1]: 'data/other.csv' is the file of together[1] too. Allowed: each recording once: as [recording], "
        "in [[together]] or in [[held_out]]. A fitted recording cannot confirm the fit: leave one of them out.",
    ),
    "held out what is fitted": (
        replaced('"data/other.csv"', '"data/rec.csv"\nt_end = 2.5'),
        "held_out[1]: 'data/rec.csv' is the file of recording too.",
    ),
    "unknown key of a further recording": (
        replaced("[device]", '[[together]]\npath = "b.csv"\nevent = 1.0\n[device]'),
        "[together[1]]: unknown key 'event' (did you mean 'event_time'",
    ),
    "several": (
        replaced("base_mva = 50", "base_mva = -50").replace("top_k = 3", "top_k = 0"),
        "Allowed: a number > 0. 1 further keys are wrong.",
    ),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD.keys())
def test_unusable_cases_are_explained(tmp_path, text, message):
    path = write(tmp_path, text)
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        load_case(path)
    assert str(caught.value).startswith(f"case file {path}")


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"no.toml: does not exist. Allowed: a TOML file"):
        load_case(tmp_path / "no.toml")
    with pytest.raises(InputError, match=r"is a folder. Allowed: a TOML file"):
        load_case(tmp_path)
    (tmp_path / "case.toml").write_bytes(b"title = '\xff'")
    with pytest.raises(InputError, match="byte 9 is not UTF-8 text"):
        load_case(tmp_path / "case.toml")
    case = load_case(write(tmp_path))
    with pytest.raises(InputError, match=r"rec.csv: does not exist"):
        case.load_recording()
