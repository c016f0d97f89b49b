"""Checks of a case file: all problems at once, suspect readings apart, and the expected time."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from errorscreen.cases import load_case
from errorscreen.cli import main
from errorscreen.workflow import check_case as module
from errorscreen.workflow.check_case import check_case, in_words

DYR = Path(__file__).parents[2] / "examples" / "dyr"


@pytest.fixture
def folder(tmp_path):
    for name in ("unit.csv", "unit.dyr", "case.toml"):
        shutil.copy(DYR / name, tmp_path)
    return tmp_path


def changed(folder, *changes, file="case.toml"):
    path = folder / file
    text = path.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    return folder / "case.toml"


def test_a_good_case_has_no_problem_and_an_expected_time(folder, capsys):
    path = str(folder / "case.toml")
    assert main(["check", path]) == 0
    told = capsys.readouterr().out
    assert "No problem was found" in told
    assert "Expected time of errorscreen run: about" in told
    assert not (folder / "case-results").exists()


def test_guesses_of_init_that_nobody_confirmed_are_told(folder):
    path = changed(folder, ("base_mva = 150.0   # of", "base_mva = 150.0   # CHECK: of"))
    (told,) = [text for text in check_case(path).advice if "nobody has confirmed" in text]
    assert told.startswith("Guesses that nobody has confirmed yet: base_mva.")
    assert not any(
        "confirmed" in text for text in check_case(changed(folder, ("# CHECK: of", "# of"))).advice
    )


def test_a_suspect_reading_is_told_apart(folder, capsys):
    path = changed(folder, ('"Q_Mvar", unit = "Mvar"', '"Q_Mvar", unit = "Mvar", scale = -1'))
    found = check_case(path)
    assert not found.problems
    assert any("sign of Q" in text for text in found.suspects)
    assert main(["check", str(path)]) == 3
    assert "Suspect reading" in capsys.readouterr().out


def test_a_window_of_a_long_recording_is_proposed(folder):
    table = pd.read_csv(folder / "unit.csv")
    time = table.columns[0]
    more = table.iloc[[-1] * 2000].assign(**{time: table[time].iloc[-1] + 0.05 * np.arange(1, 2001)})
    pd.concat([table, more]).to_csv(folder / "unit.csv", index=False)
    found = check_case(folder / "case.toml")
    assert not found.problems
    assert [text for text in found.advice if "t_start = 0 and t_end = 31" in text]
    changed(folder, ("[recording]", "[recording]\nt_end = 31.0"))
    (told,) = check_case(folder / "case.toml").advice
    assert told.startswith("The limit SEXS.EMAX = 5 acts")


def test_all_wrong_keys_are_told_at_once_and_recordings_beside_them(folder):
    path = changed(
        folder,
        ("[screening]", "[screening]\nthreshold = 2.0\nsample = 3"),
        ('dyr = "unit.dyr"', 'dyr = "unit.dyr"\ncolour = 1'),
        ('"P_MW"', '"P_mw"'),
    )
    told = "\n".join(check_case(path).problems)
    for one in ("'sample'", "screening.threshold", "'colour'", "unknown column 'P_mw' (did you mean 'P_MW'"):
        assert one in told, one


def test_wrong_keys_of_a_recording_do_not_hide_its_wrong_columns_and_units(folder):
    path = changed(
        folder,
        ("[recording]", '[recording]\nevnt_time = 3.0\nheld = "perhaps"'),
        ('"P_MW", unit = "MW"', '"P_MW", unit = "MWh"'),
        ('"V_pu"', '"V_puu"'),
        ('"Q_Mvar", unit = "Mvar"', '"Q_Mvar", unit = "Mvar", sgn = "load"'),
    )
    told = check_case(path).problems
    for one in (
        "unknown key 'evnt_time'",
        "recording.held",
        "unknown key 'sgn'",
        "unknown unit 'MWh'",
        "unknown column 'V_puu'",
    ):
        assert sum(one in problem for problem in told) == 1, one
    assert len(told) == 5
    changed(folder, ('path = "unit.csv"', 'path = "nothing.csv"'))
    assert any("nothing.csv" in problem for problem in check_case(path).problems)


def test_wrong_keys_elsewhere_do_not_hide_unknown_parameters(folder):
    path = changed(
        folder,
        ("[screening]", "[screening]\nsample = 3"),
        ("[device]", "[device.parameters]\nno_such = { nominal = 1.0 }\n\n[device]"),
    )
    told = check_case(path).problems
    for one in ("'sample'", "no_such"):
        assert sum(one in problem for problem in told) == 1, one


def test_all_problems_of_a_recording_are_told(folder):
    rows = (folder / "unit.csv").read_text().splitlines()
    places = {name: k for k, name in enumerate(rows[0].split(","))}
    cells = rows[5].split(",")
    cells[places["V_pu"]] = "oops"
    rows[5] = ",".join(cells)
    (folder / "unit.csv").write_text("\n".join(rows) + "\n")
    path = changed(
        folder,
        ('"P_MW", unit = "MW"', '"P_MW", unit = "mph"'),
        ('"Q_Mvar"', '"Q"'),
        ("[screening]", '[discovery]\neffects = ["no_such_effect"]\n\n[screening]'),
    )
    told = "\n".join(check_case(path).problems)
    for one in ("'oops' is not a number", "mph", "unknown column 'Q'", "'no_such_effect'"):
        assert one in told, one
    assert main(["check", str(path)]) == 2


def test_all_problems_of_a_model_file_are_told(folder):
    text = (folder / "unit.dyr").read_text()
    first, second = [line for line in text.splitlines() if "'" in line][:2]
    changed(folder, (first.split("'")[1], "NOMODEL"), (second.split("'")[1], "NEITHER"), file="unit.dyr")
    told = "\n".join(check_case(folder / "case.toml").problems)
    assert "NOMODEL" in told
    assert "NEITHER" in told


def test_a_missing_extra_is_told(folder, monkeypatch):
    path = changed(folder, ('methods = ["sensitivity"]', 'methods = ["cnn"]'))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    (problem,) = check_case(path).problems
    assert "screening.methods: torch is not installed" in problem


def test_a_missing_extra_that_nobody_asked_for_is_left_out(folder, monkeypatch):
    path = changed(folder, ('methods = ["sensitivity"]\n', ""))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert check_case(path).problems == ()
    study = module.Study.from_case(load_case(path))
    assert study.screening.methods == ["sensitivity", "random"]
    assert "ranked without cnn: torch is not installed" in study.notes[0]


def test_effects_that_a_plant_knows_are_not_called_unknown(folder):
    case = load_case(folder / "case.toml")
    names = [effect.name for effect in module.Study.from_case(case).simulator.effects_named(None)]
    discovery = case.discovery.model_copy(update={"effects": names})
    assert not module._unknown_effects(case.model_copy(update={"discovery": discovery}))


def test_no_toml_is_refused(tmp_path, capsys):
    (tmp_path / "case.toml").write_text("[recording\n")
    assert main(["check", str(tmp_path / "case.toml")]) == 2
    assert "is not TOML" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("seconds", "words"), [(1, "about 10 seconds"), (94, "about 90 seconds"), (125, "about 2 minutes")]
)
def test_durations_in_words(seconds, words):
    assert in_words(seconds) == words
