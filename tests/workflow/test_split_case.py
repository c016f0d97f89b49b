"""Case files for the disturbances of one recording, whose instants are known from how it is made up here."""

import tomllib

import numpy as np
import pandas as pd
import pytest

from errorscreen.cases import load_case
from errorscreen.cli import main
from errorscreen.exceptions import InputError
from errorscreen.workflow.split_case import split_case

TIME = np.arange(0, 150, 0.02)
INSTANTS = [20.0, 60.0, 130.0]
CASE = """# my unit
title = "Unit 2"

[recording]  # of last autumn
path = "unit.csv"
base_mva = 100  # from the plate
f_nominal = 50
t_end = 45.0    # the first event only
held = "keep"
[recording.columns]
V = { column = "V", unit = "pu" }
P = { column = "P", unit = "MW" }  # net
Q = { column = "Q", unit = "Mvar" }

[device]
type = "synchronous_machine"
constant_frequency = true
"""


def signals(instants=INSTANTS, sizes=(0.2, 0.4, 0.1)):
    rng = np.random.default_rng(0)
    V, P = np.ones(len(TIME)), np.full(len(TIME), 80.0)
    for start, size in zip(instants, sizes, strict=False):
        late = np.maximum(TIME - start - 0.1, 0.0)
        V -= size * ((start <= TIME) & (start + 0.1 > TIME))
        P += 100 * 0.5 * size * (late > 0) * np.sin(2 * np.pi * 1.2 * late) * np.exp(-late / 2.0)
    return {
        "time": TIME,
        "V": V + 1e-4 * rng.normal(size=len(TIME)),
        "P": P + 1e-2 * rng.normal(size=len(TIME)),
        "Q": 10 * V + 1e-2 * rng.normal(size=len(TIME)),
    }


def write(folder, text=CASE, **options):
    pd.DataFrame(signals(**options)).to_csv(folder / "unit.csv", index=False)
    (folder / "unit.toml").write_text(text)
    return folder / "unit.toml"


def test_each_disturbance_gets_a_case_that_reads(tmp_path, capsys):
    path = write(tmp_path)
    assert main(["split", str(path)]) == 0
    told = capsys.readouterr().out
    assert told.startswith("3 disturbances in unit:\n1  20 s")
    assert "the largest" in told.splitlines()[2]
    assert "V by 0.4 pu" in told.splitlines()[2]
    after = []
    for k, start in enumerate(INSTANTS, start=1):
        case = load_case(tmp_path / f"unit_{k}.toml")
        assert case.recording.event_time == pytest.approx(start, abs=0.03)
        recording = case.load_recording()
        assert recording.event_time == case.recording.event_time
        assert recording.time[0] == pytest.approx(start - 10.0, abs=0.05)
        after.append(recording.time[-1] - start)
        assert not any(start < other < recording.time[-1] + 0.1 for other in INSTANTS)
    assert after == pytest.approx([30.0, 30.0, 20.0], abs=0.1)


def test_all_else_stays_as_it_is(tmp_path):
    path = write(tmp_path)
    before = path.read_text()
    split_case(path)
    assert path.read_text() == before
    changed = (tmp_path / "unit_2.toml").read_text().splitlines()
    lost = [line for line in before.splitlines() if line not in changed]
    assert lost == ["t_end = 45.0    # the first event only"]
    added = [line for line in changed if line not in before.splitlines()]
    assert [line.split(" ")[0] for line in added] == ["t_start", "t_end", "event_time"]
    assert all(line.endswith("# by errorscreen split: disturbance 2 of 3") for line in added)
    old, new = tomllib.loads(before), tomllib.loads("\n".join(changed))
    for key in ("t_start", "t_end", "event_time"):
        old["recording"].pop(key, None)
        del new["recording"][key]
    assert new == old


def test_lines_of_windows_keep_their_ends(tmp_path):
    path = write(tmp_path)
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    split_case(path)
    raw = (tmp_path / "unit_1.toml").read_bytes()
    assert raw.count(b"\r\n") == raw.count(b"\n")


@pytest.mark.parametrize("instants", [[20.0], []])
def test_less_than_two_are_not_split(tmp_path, capsys, instants):
    path = write(tmp_path, instants=instants)
    if not instants:
        with pytest.raises(InputError, match="no event was found"):
            split_case(path)
        return
    assert main(["split", str(path)]) == 0
    assert "There is nothing to split." in capsys.readouterr().out
    assert not list(tmp_path.glob("unit_*.toml"))


def test_disturbances_close_together_get_the_rest_between_them(tmp_path):
    path = write(tmp_path, instants=[20.0, 40.0])
    found = split_case(path)
    first, second = (load_case(case).recording for case in found.cases)
    assert first.t_end == pytest.approx(39.8, abs=0.03)
    assert found.disturbances[0].end <= second.t_start <= 31.0
    assert not found.check


def test_nothing_is_overwritten(tmp_path):
    path = write(tmp_path)
    (tmp_path / "unit_3.toml").write_text("mine")
    with pytest.raises(InputError, match="unit_3.toml: exists already"):
        split_case(path)
    assert (tmp_path / "unit_3.toml").read_text() == "mine"
    assert not (tmp_path / "unit_1.toml").exists()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "[device]",
            "[[recording.step]]\nquantity = 'Vref'\ntime = 20.0\nsize = 0.01\n[device]",
            "stated event",
        ),
        ("base_mva = 100 ", "level = { V = 1.0, P = 0.8 }\nbase_mva = 100 ", "without a stated level"),
        ("base_mva = 100 ", "base_mva = -1 ", "base_mva"),
    ],
)
def test_cases_that_cannot_be_split_are_explained(tmp_path, old, new, message):
    with pytest.raises(InputError, match=message):
        split_case(write(tmp_path, CASE.replace(old, new)))


def test_a_section_in_one_line_is_not_changed(tmp_path):
    columns = '{ V = "V", P = { column = "P", unit = "MW" } }'
    text = (
        f'recording = {{ path = "unit.csv", base_mva = 100, f_nominal = 50, columns = {columns} }}\n'
        '[device]\ntype = "synchronous_machine"\nconstant_frequency = true\n'
    )
    with pytest.raises(InputError, match="cannot be changed line by line.*lines of their own"):
        split_case(write(tmp_path, text))


def test_a_recording_gets_its_case_first(tmp_path, monkeypatch, capsys):
    write(tmp_path)
    (tmp_path / "unit.toml").unlink()
    monkeypatch.chdir(tmp_path)
    assert main(["init", "unit.csv", "--out", "first.toml"]) == 0
    told = capsys.readouterr().out
    assert "holds 3 disturbances, at" in told
    assert "errorscreen split first.toml" in told
    assert main(["split", "unit.csv"]) == 0
    for k, start in enumerate(INSTANTS, start=1):
        recording = load_case(f"unit_{k}.toml").load_recording()
        assert recording.event_time == pytest.approx(start, abs=0.03)
