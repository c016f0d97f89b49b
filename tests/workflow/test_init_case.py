"""Case files that are guessed from recordings: what is written runs, and what cannot be seen is marked."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from errorscreen.cases import load_case
from errorscreen.cli import main
from errorscreen.data.plausibility import Doubt
from errorscreen.exceptions import DataWarning, InputError
from errorscreen.workflow.init_case import init_case
from tests.data.readers import test_comtrade

DYR = Path(__file__).parents[2] / "examples" / "dyr"
TIME = np.arange(200) * 0.02
UNIT = "{bus} 'GENROU' {id}  6.0 0.04 0.8 0.06 4.0 0.0 1.8 1.7 0.3 0.5 0.22 0.15 0.1 0.4 /\n"
pytestmark = pytest.mark.filterwarnings("ignore::errorscreen.exceptions.DataWarning")


def dip(size, level):
    """A level that falls by a part at 1 s, with noise."""
    rng = np.random.default_rng(len(str(level)))
    return level * (1 - size * (TIME >= 1.0) * np.exp(-(TIME - 1.0) / 2)) + 1e-4 * level * rng.normal(
        size=len(TIME)
    )


def angle():
    return np.deg2rad(20.0) + 0.3 * (TIME >= 1.0) * (TIME - 1.0)


VALUES = {"V": dip(0.3, 1.0), "angle": angle(), "P": dip(0.4, 80.0), "Q": dip(-0.9, 10.0)}


def write(folder, headers, values, *, delimiter=",", decimal=".", above=(), time=None, name="unit.csv"):
    stamps = [f"{t:.2f}" for t in TIME] if time is None else time
    rows = [
        delimiter.join([stamp, *(f"{x:.6f}" for x in row)]).replace(".", decimal)
        for stamp, *row in zip(stamps, *values, strict=True)
    ]
    path = folder / name
    path.write_text("\n".join([*above, delimiter.join(headers), *rows]) + "\n")
    return path


def initiated(path, **options):
    """Written case, its recording as it is read, and the text of the file."""
    written = init_case(path, out=path.with_suffix(".toml"), **options)
    case = load_case(written.case)
    return written, case, case.load_recording(), written.case.read_text()


def check(recording, base_mva=None):
    first = recording.initial(["V", "P", "Q"])
    base = recording.base_mva if base_mva is None else base_mva
    assert first["V"] == pytest.approx(1.0, abs=1e-3)
    assert first["P"] * base == pytest.approx(80.0, rel=1e-3)
    assert first["Q"] * base == pytest.approx(10.0, rel=1e-3)
    assert recording.event_time == pytest.approx(1.0, abs=0.021)


def test_units_in_headers_are_taken_from_there(tmp_path):
    V, A, P, Q = VALUES.values()
    headers = ["t [ms]", "U [kV]", "Angle [deg]", "P [MW]", "Q [Mvar]", "f [Hz]"]
    f = 60.0 + np.gradient(A, TIME) / (2 * np.pi)
    values = [20.0 * V, np.rad2deg(A), P, Q, f]
    path = write(tmp_path, headers, values, time=[f"{1000 * t:.0f}" for t in TIME])
    written, case, recording, text = initiated(path)
    assert not written.missing
    check(recording)
    assert (case.recording.f_nominal, case.recording.base_kv, case.recording.time_unit) == (60.0, 20.0, "ms")
    assert recording.channel("angle").values[0] == pytest.approx(np.deg2rad(20.0))
    assert "f is 60 Hz before the event" in text
    assert written.picture == tmp_path / "unit.png"
    assert written.picture.read_bytes().startswith(b"\x89PNG")
    (asked,) = [line for line in written.check if line.startswith("base_mva")]
    assert "the file does not say" in asked
    assert not case.device.constant_frequency


def test_units_that_are_not_stated_follow_from_the_numbers(tmp_path):
    V, A, P, Q = VALUES.values()
    path = write(
        tmp_path, ["time", "Voltage", "Phase angle", "Pgen", "Qgen"], [13.8e3 * V, np.rad2deg(A) * 20, P, Q]
    )
    written, case, recording, text = initiated(path)
    check(recording)
    columns = case.recording.columns
    assert [columns[name].unit for name in ("V", "angle", "P", "Q")] == ["V", "deg", "MW", "Mvar"]
    assert case.recording.base_kv == 13.8
    assert "CHECK: the file does not tell 50 or 60" in text
    assert any(line.startswith("f_nominal") for line in written.check)


def test_semicolons_decimal_commas_and_two_rows_of_headers_are_seen(tmp_path):
    V, _, P, Q = VALUES.values()
    headers = ["b:tnow in s", "m:u1 in p.u.", "m:Psum:bus1 in MW", "m:Qsum:bus1 in Mvar"]
    above = ["All calculations;Bus A;Plant B;Plant B"]
    path = write(tmp_path, headers, [V, P, Q], delimiter=";", decimal=",", above=above)
    written, case, recording, text = initiated(path)
    assert (case.recording.decimal, case.recording.header_rows) == (",", 2)
    check(recording)
    assert case.device.constant_frequency
    assert "CHECK: no column was taken for the angle" in text
    assert not written.missing


def test_dates_and_consumed_power_are_seen(tmp_path):
    V, _, P, Q = VALUES.values()
    stamps = [f"03.05.2026 10:00:{t:06.3f}" for t in TIME]
    path = write(tmp_path, ["Date", "V (pu)", "P (MW)", "Q (Mvar)"], [V, -P, -Q], time=stamps)
    _, case, recording, text = initiated(path)
    assert case.recording.time_format == "%d.%m.%Y %H:%M:%S.%f"
    check(recording)
    assert [case.recording.columns[name].sign for name in "PQ"] == ["load", "load"]
    assert "P before the event is negative" in text


def test_the_unit_of_an_angle_follows_from_the_frequency(tmp_path):
    V, A, P, Q = VALUES.values()
    degrees = np.rad2deg(A - A[0]) / 10.0  # within a turn in rad, too
    f = 50.0 + np.gradient(A / 10.0, TIME) / (2 * np.pi)
    path = write(tmp_path, ["time", "V", "angle", "P", "Q", "f"], [V, degrees, P, Q, f])
    _, case, recording, text = initiated(path)
    assert case.recording.columns["angle"].unit == "deg"
    assert "would not follow the frequency" in text
    assert not any(isinstance(one, Doubt) for one in recording.assumptions)


def test_a_comtrade_record_gives_its_waveforms(tmp_path):
    path = test_comtrade.write(tmp_path, test_comtrade.waves(test_comtrade.TIME), test_comtrade.TIME)
    written, case, recording, text = initiated(path)
    assert case.recording.waveforms.voltage == ["VA", "VB", "VC"]
    assert (case.recording.f_nominal, case.recording.base_kv) == (50.0, 20.0)
    assert case.recording.base_mva == pytest.approx(100.0, rel=0.02)
    assert "line frequency of the record" in text
    first = recording.initial(["V", "P", "Q"])
    assert first["V"] == pytest.approx(1.0, abs=1e-3)
    assert first["P"] * recording.base_mva == pytest.approx(80.0, rel=1e-3)
    assert not written.missing


@pytest.mark.parametrize("unit", ["", " (pu)"])
def test_waves_in_pu_are_seen_by_their_size_or_unit(tmp_path, unit):
    peak = {"V": np.sqrt(2 / 3) * 20.0, "I": np.sqrt(2 / 3) * 100.0 / 20.0}
    waves = {name: x / peak[name[0]] for name, x in test_comtrade.waves(test_comtrade.TIME).items()}
    names = [f"{name[0]}{name[1].lower()}{unit}" for name in waves]
    path = tmp_path / "waves.csv"
    pd.DataFrame({"time": test_comtrade.TIME, **dict(zip(names, waves.values(), strict=True))}).to_csv(
        path, index=False
    )
    _, case, recording, text = initiated(path)
    assert (case.recording.waveforms.voltage_unit, case.recording.waveforms.current_unit) == ("pu", "pu")
    assert ("their units by size" in text) == (not unit)
    assert "f_nominal = 50.0  # the wave repeats 50 times a second" in text
    first = recording.initial(["V", "P", "Q"])
    assert first["V"] == pytest.approx(1.0, abs=1e-3)
    assert first["P"] == pytest.approx(0.8, abs=1e-3)


def test_a_long_file_is_cut_to_a_window_around_the_event(tmp_path):
    time = np.arange(0, 200, 0.1)
    V = (
        1
        - 0.3 * (time >= 100.0) * np.exp(-(time - 100.0))
        + 1e-4 * np.random.default_rng(0).normal(size=len(time))
    )
    rows = "\n".join(f"{t:.1f},{v:.6f},{0.8 * v:.6f},{0.1 * v:.6f}" for t, v in zip(time, V, strict=True))
    path = tmp_path / "long.csv"
    path.write_text(f"time,V,P,Q\n{rows}\n")
    _, case, recording, _ = initiated(path)
    assert (recording.time[0], recording.time[-1]) == pytest.approx((90.0, 130.0), abs=0.2)
    assert case.recording.event_time == pytest.approx(100.0, abs=0.11)


def test_a_stamp_far_from_the_others_leaves_a_case_around_the_event(tmp_path):
    V, _, P, Q = VALUES.values()
    time = [f"{t:.2f}" for t in [*TIME[:-1], 9e10]]
    written, _, recording, _ = initiated(write(tmp_path, ["time", "V", "P", "Q"], [V, P, Q], time=time))
    assert not written.missing
    assert any(
        "disturbances were not looked for: only 200 samples lie between 0" in one for one in written.check
    )
    assert recording.time[-1] == pytest.approx(TIME[-2])


def test_one_unit_of_a_model_file_is_taken_and_of_several_none_is_guessed(tmp_path):
    shutil.copy(DYR / "unit.csv", tmp_path)
    one, two = tmp_path / "one.dyr", tmp_path / "two.dyr"
    one.write_text(UNIT.format(bus=101, id=1))
    two.write_text(UNIT.format(bus=101, id=1) + UNIT.format(bus=102, id="'A'"))
    written = init_case(tmp_path / "unit.csv", one, tmp_path / "one.toml")
    assert not written.missing
    case = load_case(written.case)
    assert (case.device.dyr, case.device.bus, case.device.id) == ("one.dyr", 101, "1")
    written = init_case(tmp_path / "unit.csv", two, tmp_path / "two.toml")
    (missing,) = written.missing
    assert "Give bus and id" in missing
    text = written.case.read_text()
    assert '# bus = 101, id = "1"' in text
    assert '# bus = 102, id = "A"' in text
    with pytest.raises(InputError, match="Give bus and id"):
        load_case(written.case)
    assert written.picture is not None
    written.case.write_text(text.replace('# bus = 102, id = "A"', 'bus = 102\nid = "A"'))
    assert load_case(written.case).device.id == "A"


def test_doubts_stand_in_the_file(tmp_path):
    V, _, P, Q = VALUES.values()
    V, P, Q = V.copy(), P.copy(), Q.copy()
    for values in (V, P, Q):
        values[120:123] = 0.0
    written, _, _, text = initiated(write(tmp_path, ["time", "V", "P", "Q"], [V, P, Q]))
    assert "# Doubt: 3 rows, the first at 2.4 s, hold exactly 0" in text
    assert any("lost frames" in line for line in written.check)


def test_what_cannot_be_guessed_is_a_line_to_state(tmp_path):
    V, _, P, Q = VALUES.values()
    written = init_case(write(tmp_path, ["time", "a", "b", "c"], [V, P, Q]), out=tmp_path / "case.toml")
    assert written.picture is None
    assert (
        "no column is recognised as P"
        not in written.case.read_text().replace("was", "is").split("[recording]")[0]
    )
    assert '# P = { column = "…", unit = "MW" }  # STATE' in written.case.read_text()
    assert any("state recording.columns.V" in text for text in written.missing)
    assert "# base_kv = 20.0  # STATE" in written.case.read_text()
    assert any("P was not found, so nothing tells it" in text for text in written.check)
    with pytest.raises(InputError, match="no column is mapped"):
        load_case(written.case).load_recording()


def test_existing_files_stay_and_unreadable_ones_are_refused(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    V, _, P, Q = VALUES.values()
    path = write(tmp_path, ["time", "V", "P", "Q"], [V, P, Q])
    assert main(["init", str(path)]) == 0
    assert "Next: errorscreen check unit.toml" in capsys.readouterr().out
    before = (tmp_path / "unit.toml").read_bytes()
    assert main(["init", str(path)]) == 2
    assert "unit.toml: exists already" in capsys.readouterr().err
    assert (tmp_path / "unit.toml").read_bytes() == before
    assert main(["init", str(path), "--out", "other.toml"]) == 0
    (tmp_path / "binary.dat").write_bytes(bytes(range(256)) * 40)
    (tmp_path / "words.txt").write_text("There is\nno table\nin here\n")
    for name in ("binary.dat", "words.txt", "missing.csv", "."):
        assert main(["init", name, "--out", "new.toml"]) == 2, name
        assert "errorscreen:" in capsys.readouterr().err
        assert not (tmp_path / "new.toml").exists()


def test_control_characters_in_names_stay_out_of_the_comments(tmp_path):
    V, _, P, Q = VALUES.values()
    path = write(tmp_path, ["time", "V", "P", "Q\x7f [Mvar]"], [V, P, Q], name="a\nb = 1\x01.csv")
    written = init_case(path, out=tmp_path / "case.toml")
    assert not written.missing
    case = load_case(written.case)
    assert (case.recording.path, case.recording.columns["Q"].column) == (path.name, "Q\x7f [Mvar]")


def test_no_warning_is_left_to_be_read_on_the_terminal(tmp_path, recwarn):
    V, _, P, Q = VALUES.values()
    init_case(
        write(tmp_path, ["time", "V", "P", "Q"], [V / np.sqrt(3) * 13.8, P, Q]), out=tmp_path / "c.toml"
    )
    assert not [one for one in recwarn if issubclass(one.category, DataWarning)]
    assert "line_neutral = true" in (tmp_path / "c.toml").read_text()


def test_output_of_pscad(tmp_path):
    V, A, P, Q = VALUES.values()
    columns = [("Vterm", "kV", 20.0 * V), ("Theta", "deg", np.rad2deg(A)), ("Pg", "MW", P), ("Qg", "MVAR", Q)]
    path = tmp_path / "run.inf"
    path.write_text(
        "".join(
            f'PGB({k}) Output Desc="{name}" Group="Main" Max=2.0 Min=-2.0 Units="{unit}"\n'
            for k, (name, unit, _) in enumerate(columns, start=1)
        )
    )
    rows = np.column_stack([TIME, *(values for *_, values in columns)])
    (tmp_path / "run_01.out").write_text("\n".join(" ".join(f"{x:.8E}" for x in row) for row in rows) + "\n")
    written, case, recording, _ = initiated(path)
    assert not written.missing
    check(recording)
    assert {name: one.column for name, one in case.recording.columns.items()} == {
        **{"V": "Vterm", "angle": "Theta", "P": "Pg", "Q": "Qg"}
    }
    assert (case.recording.format, case.recording.time) == ("pscad", "time")


def test_a_workbook(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    V, _, P, Q = VALUES.values()
    book = openpyxl.Workbook()
    book.active.title = "cover"
    sheet = book.create_sheet("readings")
    for row in [("time", "U", "P", "Q"), ("s", "kV", "MW", "Mvar"), *zip(TIME, 20 * V, P, Q, strict=True)]:
        sheet.append([x if isinstance(x, str) else float(x) for x in row])
    path = tmp_path / "unit.xlsx"
    book.save(path)
    written, case, recording, text = initiated(path)
    assert not written.missing
    check(recording)
    assert (case.recording.sheet, case.recording.base_kv) == ("readings", 20.0)
    assert "CHECK: the first one with time stamps; others: 'cover'" in text


def test_a_matlab_file(tmp_path):
    from scipy.io import savemat

    V, A, P, Q = VALUES.values()
    path = tmp_path / "unit.mat"
    savemat(
        path, {"t": TIME, "vt": 20 * V, "theta": np.rad2deg(A), "pg": P, "qg": Q, "slow": TIME[::2], "n": 3.0}
    )
    written, case, recording, _ = initiated(path)
    assert not written.missing
    check(recording)
    assert (case.recording.format, case.recording.time, case.recording.time_unit) == ("matlab", "t", "s")
    assert "Variable 'slow' is of another length." in written.check


def test_a_parquet_file(tmp_path):
    pytest.importorskip("pyarrow")
    import pandas as pd

    V, _, P, Q = VALUES.values()
    stamps = pd.Timestamp("2026-05-03 10:00", tz="Europe/Berlin") + pd.to_timedelta(TIME, unit="s")
    path = tmp_path / "unit.parquet"
    pd.DataFrame({"V [pu]": V, "P [MW]": P, "Q [Mvar]": Q}, index=stamps).to_parquet(path)
    written, case, recording, _ = initiated(path)
    assert not written.missing
    check(recording)
    assert (case.recording.time, case.recording.time_unit) == ("(index)", None)
    pd.DataFrame({"stamp": stamps, "V": V, "P": P, "Q": Q}).to_parquet(path)
    assert init_case(path, out=tmp_path / "b.toml").missing == ()
    assert load_case(tmp_path / "b.toml").recording.time == "stamp"


def test_a_tag_in_each_row(tmp_path):
    rows = ["TagName,TimeStamp,Value,Quality"]
    for k, t in enumerate(TIME):
        for name, unit in (("V", "pu"), ("P", "MW"), ("Q", "Mvar")):
            status = "Bad" if (k, name) == (150, "Q") else "Good"
            stamp = f"2026-05-03T10:00:{t:06.3f}Z"
            rows.append(f"{name} [{unit}],{stamp},{VALUES[name][k]:.6f},{status}")
    path = tmp_path / "tags.csv"
    path.write_text("\n".join(rows))
    written, case, recording, _ = initiated(path)
    assert not written.missing
    check(recording)
    assert (case.recording.long.tag, case.recording.long.value) == ("TagName", "Value")
    assert case.recording.columns["P"].column == "P [MW]"
    assert (case.recording.quality.column, case.recording.quality.good) == ("Quality", ["Good"])
    assert np.isnan(recording.channel("Q").values).sum() == 1


def test_numbers_without_headers(tmp_path):
    V, A, P, Q = VALUES.values()
    f = 50.0 + np.gradient(A, TIME) / (2 * np.pi)
    turned = np.rad2deg((A + np.pi - 0.8) % (2 * np.pi) - np.pi)
    turned[100:] = (turned[100:] + 40 * (TIME[100:] - 2.0) * 12 + 180) % 360 - 180
    rows = "\n".join(",".join(f"{x:.6f}" for x in row) for row in zip(TIME, f, V, P, Q, turned, strict=True))
    path = tmp_path / "bare.csv"
    path.write_text(rows + "\n")
    written = init_case(path, out=tmp_path / "bare.toml")
    text = written.case.read_text()
    assert 'time = "column 1"' in text
    assert 'f = { column = "column 2", unit = "Hz" }  # CHECK: near 50' in text
    assert 'V = { column = "column 3", unit = "pu" }  # CHECK: ' in text
    assert 'angle = { column = "column 6", unit = "deg" }  # CHECK: jumps by 360' in text
    assert "# Open: Numbers alone do not tell P and Q: 'column 4' begins at 80" in text
    assert '# P = { column = "…", unit = "MW" }  # STATE' in text
    assert any("state recording.columns.P" in one for one in written.missing)
    for name, factor, said in (
        (
            "a",
            0.7,
            'V = { column = "column 2", unit = "kV" }  # CHECK: 20 before the event, near a usual level',
        ),
        ("b", 1.0, "# Open: V may be one of 'column 2', 'column 3': state which."),  # 138/√3 is 79.7
    ):
        rows = (f"{t:.2f},{20 * v:.5f},{factor * p:.5f}" for t, v, p in zip(TIME, V, P, strict=True))
        path.write_text("\n".join(rows))
        assert said in init_case(path, out=tmp_path / f"{name}.toml").case.read_text()


def test_curves_of_dynawo(tmp_path):
    """A semicolon ends each line, and a step has several rows, as its source CRVCsvExporter.cpp writes them."""
    V, A, P, Q = VALUES.values()
    names = ("UPu", "UPhase", "PGenPu", "QGenPu")
    lines = ["time;" + "".join(f"GEN_generator_{name};" for name in names)]
    for k, row in enumerate(zip(TIME, V, A, P / 100, Q / 100, strict=True)):
        lines += ["".join(f"{x:.6f};" for x in row)] * (4 if k == 10 else 1)
    jump = next(k for k, line in enumerate(lines) if line.startswith("1.000000"))
    lines.insert(jump, "1.000000;" + lines[jump - 1].split(";", 1)[1])
    path = tmp_path / "curves.csv"
    path.write_text("\n".join(lines) + "\n")
    written, case, recording, _ = initiated(path)
    assert not written.missing
    check(recording, 100.0)
    assert case.recording.on_duplicate == "keep-step"
    columns = {name: one.column for name, one in case.recording.columns.items()}
    assert columns["angle"] == "GEN_generator_UPhase"
    assert np.diff(recording.time).min() < 1e-6
    check(recording, 100.0)


def test_variables_of_a_machine_of_dynawo(tmp_path):
    names = (
        "SM_generator_UStatorPu",
        "NETWORK_BUS_TN_Upu_phase",
        "SM_generator_PGenPu",
        "SM_generator_QGenPu",
    )
    V, A, P, Q = VALUES.values()
    _, case, recording, _ = initiated(write(tmp_path, ["time", *names], (V, A, P / 100, Q / 100)))
    check(recording, 100.0)
    columns = {name: one.column for name, one in case.recording.columns.items()}
    assert columns == dict(zip(("V", "angle", "P", "Q"), names, strict=True))


def test_an_angle_that_may_be_of_the_rotor_is_an_open_point(tmp_path):
    V, A, P, Q = VALUES.values()
    written, case, _, text = initiated(
        write(tmp_path, ["time", "V_pu", "delta", "P_MW", "Q_Mvar"], (V, A, P, Q))
    )
    assert "angle" not in case.recording.columns
    assert any(one.startswith("Column 'delta' was not used: it may be of the rotor") for one in written.check)
    assert "constant_frequency = true  # CHECK" in text


def test_a_machine_of_typical_values_has_wide_ranges(tmp_path):
    _, case, _, _ = initiated(
        write(tmp_path, ["time", "V_pu", "angle_rad", "P_MW", "Q_Mvar"], VALUES.values())
    )
    space = case.device.space(tmp_path)
    assert (space["Xq"].lower, space["Xq"].upper) == pytest.approx((0.62, 2.48))
    assert (space["Ra"].lower, space["Ra"].upper) == (0.0, 0.01)


@pytest.mark.parametrize("kind", ["BINARY", "ASCII"])
def test_waves_of_several_places_in_a_record(tmp_path, kind):
    """Phases stand at the end of the names, or in the field for them."""
    waves = test_comtrade.waves(test_comtrade.TIME)
    both = {f"{place} {name}": x for place in ("BUS", "LINE") for name, x in waves.items()}
    phases = [name[-1] if kind == "BINARY" else "" for name in both]
    path = test_comtrade.write(tmp_path, both, test_comtrade.TIME, kind=kind, phases=phases)
    written, case, _, text = initiated(path)
    assert not written.missing
    assert case.recording.waveforms.voltage == ["BUS VA", "BUS VB", "BUS VC"]
    assert case.recording.waveforms.current == ["BUS IA", "BUS IB", "BUS IC"]
    assert "the first of several sets, others: 'LINE VA'" in text


def test_a_frequency_less_the_nominal_one(tmp_path):
    V, _A, P, Q = VALUES.values()
    mHz = 8.0 + 50.0 * (TIME >= 1.0) * np.exp(-(TIME - 1.0).clip(0))
    headers = ["time", "V_pu", "FREQ DEV (mHz)", "P_MW", "Q_Mvar"]
    written, case, recording, _ = initiated(write(tmp_path, headers, (V, mHz, P, Q)))
    assert case.recording.columns["f"].unit == "mHz deviation"
    assert recording.channel("f").values[:40] == pytest.approx(case.recording.f_nominal + 0.008, abs=1e-9)
    assert any("angle of the voltage was not recorded" in text for text in written.check)


@pytest.mark.parametrize(("kv", "others"), [(15.91, "15.75 and 16.5"), (21.4, "21 and 22")])
def test_levels_beside_the_nearest_one_are_told(tmp_path, kv, others):
    V, A, P, Q = VALUES.values()
    *_, text = initiated(write(tmp_path, ["time", "V_kV", "angle_rad", "P_MW", "Q_Mvar"], (kv * V, A, P, Q)))
    (line,) = [line for line in text.splitlines() if line.startswith("base_kv")]
    assert all(f" {one}" in line for one in others.split(" and "))


def test_minutes_are_no_rival_of_seconds(tmp_path):
    """Nobody records a disturbance with a sample in 1.2 s who could have one in 20 ms."""
    headers = ["t", "V_pu", "angle_rad", "P_MW", "Q_Mvar"]
    *_, text = initiated(write(tmp_path, headers, VALUES.values()))
    (line,) = [line for line in text.splitlines() if line.startswith("time_unit")]
    assert line.startswith('time_unit = "s"')
    assert "min" not in line
