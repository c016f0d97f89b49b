"""The command line as a user meets it: results, resuming, Ctrl-C, and what bad input is answered with."""

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from errorscreen import cli, workflow
from errorscreen._runtime.typed import to_json
from errorscreen.cases.demo import demo_recordings
from errorscreen.cli import main
from errorscreen.report import read_result

CASE = """
title = "a test"
[recording]
path = "r.csv"
base_mva = 100.0
f_nominal = 60.0
event_time = 1.0
[recording.columns.V]
column = "V"
unit = "pu"
[recording.columns.angle]
column = "A"
unit = "rad"
[recording.columns.P]
column = "P"
unit = "MW"
[recording.columns.Q]
column = "Q"
unit = "Mvar"
[device]
type = "synchronous_machine"
[screening]
methods = ["cnn", "sensitivity", "random"]
samples = 40
epochs = 1
frequencies = 8
columns = 16
top_k = 3
[calibration]
library = 64
starts = 2
particles = 5
iterations = 3
[discovery]
max_effects = 1
fits = 1
draws = 8
"""


def table():
    """Columns of the recording of the demo, thinned out."""
    recording, _, _ = demo_recordings(3)
    frame = recording.to_frame().iloc[::3].reset_index()
    frame.columns = ["time", "V", "A", "P", "Q"]
    frame[["P", "Q"]] *= 100
    return frame


FRAME = table()


def folder(tmp_path, case=CASE, frame=FRAME):
    if isinstance(frame, pd.DataFrame):
        frame = frame.to_csv(index=False)
    (tmp_path / "r.csv").write_text(frame)
    (tmp_path / "case.toml").write_text(case)
    return str(tmp_path / "case.toml")


def changed(**columns):
    frame = FRAME.astype(dict.fromkeys(columns, object))
    for name, (rows, value) in columns.items():
        frame.loc[rows, name] = value
    return frame


def shuffled():
    return FRAME.iloc[np.random.default_rng(0).permutation(len(FRAME))]


gaps = slice(20, 20 + int(0.5 * len(FRAME)))
BAD_DATA = {
    "no file": ("r.csv: does not exist", None),
    "empty file": ("r.csv: is empty", ""),
    "header only": ("holds a header but no samples", "time,V,A,P,Q\n"),
    "missing column": (r"column.*'P'", FRAME.rename(columns={"P": "PP"})),
    "missing time": (r"'time'", FRAME.rename(columns={"time": "t"})),
    "text in a number column": (r"r.csv.*'P'.*abc", changed(P=(7, "abc"))),
    "all NaN": ("'Q': all readings are missing", changed(Q=(slice(None), np.nan))),
    "half of a channel missing": (r"'P': .*50%.* missing. Allowed: at most 40%", changed(P=(gaps, np.nan))),
    "one sample": ("there is one sample only", FRAME.iloc[:1]),
    "two samples": ("event_time is 1 s", FRAME.iloc[:2]),
    "unsorted time": ("time runs backwards 123 times.*on_backward", shuffled()),
    "zero variance": ("'V': every reading is 1: the channel never moves", changed(V=(slice(None), 1.0))),
    "time not a number": ("line 11, column 'time': 'noon' is not a number", changed(time=(9, "noon"))),
}  # fmt: skip
BAD_CASE = {
    "wrong unit": ('unit = "MW"', 'unit = "MegaWatt"', r"unit.*MegaWatt.*Allowed.*MW"),
    "unit of another role": ('unit = "Mvar"', 'unit = "kV"', "kV"),
    "unknown key": ("title =", "titel =", r"unknown section or key 'titel' \(did you mean 'title'"),
    "unknown section key": ("base_mva = 100.0", "base_mwa = 100.0", "base_mwa.*did you mean 'base_mva'"),
    "missing key": ("f_nominal = 60.0", "", "'f_nominal' is missing"),
    "not TOML": ('title = "a test"', "title = a test", "is not TOML"),
    "negative base": ("base_mva = 100.0", "base_mva = -1.0", "base_mva.*Allowed: a number > 0"),
    "text for a number": ("base_mva = 100.0", 'base_mva = "big"', "base_mva.*'big'.*Allowed: a number"),
    "unknown device": ('"synchronous_machine"', '"synchronous_mashine"', "did you mean 'synchronous_machine'"),
    "unknown parameter": (
        "[screening]", "[device.parameters.Xd9]\nnominal = 1.0\n[screening]", "unknown parameter 'Xd9'.*did you mean",
    ),
    "unknown constant": ("[screening]", "[device.constants]\nRb = 1.0\n[screening]", "unknown constant 'Rb'"),
    "bounds exclude nominal": (
        "[screening]", "[device.parameters.Xd]\nnominal = 1.0\nlower = 1.2\nupper = 2.0\n[screening]",
        r"Xd.*excludes the nominal value 1.*lower <= nominal <= upper",
    ),
    "empty bounds": (
        "[screening]", "[device.parameters.Xd]\nlower = 2.0\nupper = 1.0\n[screening]", r"Xd.*is empty.*lower < upper",
    ),
    "negative time constant": (
        "[screening]", "[device.parameters.Tj]\nrelative = 1.5\n[screening]",
        "parameter 'Tj': lower is -4.5. Allowed: a number > 0. Correct the value, or narrow the bounds",
    ),
    "zero reactance": (
        "[screening]", "[device.parameters.Xd]\nlower = 0.0\n[screening]", "'Xd': lower is 0. Allowed: a number > 0",
    ),
    "negative damping": (
        "[screening]", "[device.parameters.D]\nlower = -1.0\n[screening]", "'D': lower is -1. Allowed: a number >= 0",
    ),
    "zero nominal": (
        "[screening]", "[device.parameters.D]\nnominal = 0.0\nlower = 0.0\nupper = 1.0\n[screening]",
        "D.*nominal value is 0.*positive scale",
    ),
    "K > m": ("top_k = 3", "top_k = 9", "top_k.*9.*8"),
    "K = 0": ("top_k = 3", "top_k = 0", "top_k.*>= 1"),
    "too few samples": ("samples = 40", "samples = 4", "samples.*>= 20"),
    "unknown method": ('"sensitivity"', '"sensitivty"', "did you mean 'sensitivity'"),
    "unknown calibrator": ("[calibration]", '[calibration]\nmethods = ["pos"]', "pos.*map"),
    "window without samples": ("event_time = 1.0", "event_time = 1.0\nt_start = 50.0", "window.*holds 0 samples"),
    "event after the end": ("event_time = 1.0", "event_time = 99.0", "event_time is 99 s. Allowed: 0 to 5.9"),
    "event before the start": ("event_time = 1.0", "event_time = -5.0", "event_time is -5 s. Allowed: 0 to 5.9"),
    "no angle for a machine": (
        '[recording.columns.angle]\ncolumn = "A"\nunit = "rad"\n', "", "neither the angle nor the frequency",
    ),
    "no voltage": ('[recording.columns.V]\ncolumn = "V"\nunit = "pu"\n', "", "terminal voltage was not recorded"),
    "absurd step": ("[screening]", "[simulation]\nstep = -1.0\n[screening]", "step.*Allowed: a number > 0"),
    "tiny step": ("[screening]", "[simulation]\nstep = 1e-9\n[screening]", "simulation.step: 5.9.* are 5.9.*e.09 st"),
    "tiny dt": ("[screening]", "[simulation]\ndt = 1e-9\n[screening]", "simulation.dt: 5.9.*Allowed: at most 1e.06"),
    "unknown effect": (
        "[discovery]", '[discovery]\neffects = ["lag_P", "exiter"]', "toml, discovery.effects: unknown effect 'exiter'",
    ),
    "a first look at one sample": ("[discovery]", "[discovery]\nfirst_look = 1", "first_look is 1.*>= 20"),
    "zero jobs": ("[calibration]", "[run]\nn_jobs = 0\n[calibration]", "n_jobs is 0"),
}  # fmt: skip


def refused(arguments, message, capsys):
    assert main(arguments) == 2
    captured = capsys.readouterr()
    last = captured.err.strip().splitlines()[-1]
    assert last.startswith("errorscreen: ")
    assert "Traceback" not in captured.err
    assert re.search(message, last), last
    return last


@pytest.mark.parametrize("kind", BAD_DATA)
def test_bad_recordings(kind, tmp_path, capsys):
    message, frame = BAD_DATA[kind]
    case = folder(tmp_path, frame="" if frame is None else frame)
    if frame is None:
        (tmp_path / "r.csv").unlink()
    refused(["run", case, "--out", str(tmp_path / "out"), "--quiet"], message, capsys)


@pytest.mark.parametrize("kind", BAD_CASE)
def test_bad_cases(kind, tmp_path, capsys):
    found, replacement, message = BAD_CASE[kind]
    assert found in CASE
    case = folder(tmp_path, CASE.replace(found, replacement, 1))
    last = refused(["run", case, "--out", str(tmp_path / "out"), "--quiet"], message, capsys)
    assert "case.toml" in last or "r.csv" in last or "recording 'r'" in last  # where


def test_bad_arguments(tmp_path, capsys):
    refused(["run", str(tmp_path / "no.toml")], "no.toml: does not exist. Allowed: a TOML file", capsys)
    refused(["demo", "--seed", "-1"], "--seed: the seed is -1", capsys)
    file = tmp_path / "file"
    file.write_text("")
    refused(["demo", "--out", str(file / "out")], "output folder.*cannot be written.*--out", capsys)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "stages").write_text("")
    quiet = ["--out", str(tmp_path / "out"), "--quiet"]
    refused(["run", folder(tmp_path), *quiet], "folder .*stages.*cannot be made.*finished parts", capsys)
    for arguments in ([], ["walk"], ["bench"], ["demo", "--seed", "x"]):
        with pytest.raises(SystemExit) as caught:
            main(arguments)
        assert caught.value.code == 2


@pytest.mark.usefixtures("undrawn_figures")
def test_a_reading_that_is_not_finite_is_a_gap_and_the_report_says_so(tmp_path):
    case = folder(tmp_path, CASE.replace('"cnn", ', ""), changed(P=(9, np.inf)))
    assert main(["run", case, "--out", str(tmp_path / "out"), "--quiet", "--no-discovery"]) == 0
    data = read_result(tmp_path / "out" / "result.json").recordings[0]
    assert any("infinite" in note for note in data.assumptions), data.assumptions


def test_run_writes_result_and_report_and_reuses_stages(tmp_path, capsys, request):
    case = folder(tmp_path)
    out = tmp_path / "out"
    assert main(["run", case, "--out", str(out)]) == 0
    captured = capsys.readouterr()
    assert "Written" in captured.out
    first = read_result(out / "result.json")
    raw = json.loads((out / "result.json").read_text())
    assert {"schema_version", "diagnosis", "screening", "calibration", "models"} <= set(raw)
    assert [m.method for m in first.screening] == ["cnn", "sensitivity", "random"]
    assert [m.label for m in first.calibration] == [
        "map on all", "pso on cnn", "pso on sensitivity", "pso on random",
    ]  # fmt: skip
    assert first.run.reused == ()
    html = (out / "report.html").read_text()
    assert "<img" in html
    assert "http://" not in html.replace("http://www.w3.org", "")
    assert len(html) > 100_000  # its figures are drawn
    request.getfixturevalue("undrawn_figures")

    assert main(["run", case, "--out", str(out), "--quiet"]) == 0
    second = read_result(out / "result.json")
    assert len(second.run.reused) == 7
    assert to_json(second.diagnosis) == to_json(first.diagnosis)
    assert to_json(second.calibration) == to_json(first.calibration)
    assert to_json(second.screening) == to_json(first.screening)

    # another seed is another study: nothing of the first is used
    (tmp_path / "case.toml").write_text(CASE.replace('"cnn", ', "") + "[run]\nrandom_state = 1\n")
    assert main(["run", case, "--out", str(out), "--quiet"]) == 0
    assert read_result(out / "result.json").run.reused == ()
    # stages can be forgotten, and the number of jobs does not matter
    (tmp_path / "case.toml").write_text(CASE + "[run]\nn_jobs = 2\n")
    assert main(["run", case, "--out", str(out), "--quiet", "--fresh"]) == 0
    third = read_result(out / "result.json")
    assert third.run.reused == ()
    one, two = (
        re.sub(r'"seconds": [-e\d.]+', "", to_json(replace(r, run=None)).decode()) for r in (first, third)
    )
    assert one == two


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one child")
def test_interrupt_keeps_what_was_finished(tmp_path):
    text = CASE.replace('["cnn", "sensitivity", "random"]', '["sensitivity", "cnn"]')
    text = text.replace("samples = 40", "samples = 20000")  # so that it is still simulating when interrupted
    case = folder(tmp_path, text)
    process = subprocess.Popen(
        [sys.executable, "-m", "errorscreen", "run", case, "--out", str(tmp_path / "out")],
        stderr=subprocess.PIPE, stdout=subprocess.PIPE, cwd=Path(__file__).parents[1],
        # what a shell runs in the background ignores interrupts, and so would the child
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    stages = tmp_path / "out" / "stages"
    deadline = time.monotonic() + 600
    while not list(stages.glob("*/dataset/batch*")) and time.monotonic() < deadline:
        time.sleep(0.2)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=600)
    assert process.returncode == 130, error
    assert b"give the same command again" in error
    assert b"Traceback" not in error
    assert len(list(stages.glob("*/screening-sensitivity.npz"))) == 1
    assert not (tmp_path / "out" / "result.json").exists()


def test_an_interrupt_that_a_library_swallows_is_not_lost(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cli, "_interrupts", [])
    with pytest.raises(KeyboardInterrupt):
        cli._interrupt(signal.SIGINT, None)
    case = folder(tmp_path, CASE)
    assert main(["run", case, "--out", str(tmp_path / "out"), "--quiet"]) == 130
    assert "give the same command again" in capsys.readouterr().err


def test_a_model_that_cannot_start_at_the_recorded_values_is_bad_input(tmp_path, capsys):
    """The plant would have to deliver more than its current limit: no equilibrium."""
    text = CASE.replace("base_mva = 100.0", "base_mva = 40.0").replace('"synchronous_machine"', '"pv_plant"')
    message = (
        r"recording 'r': .* P = 1\.8.* pu: no steady state exists.*Allowed: V near 1 pu.*Correct units, bases"
    )
    refused(["run", folder(tmp_path, text), "--out", str(tmp_path / "out"), "--quiet"], message, capsys)


@pytest.mark.filterwarnings("default")  # it is also noted that V is implausible
def test_a_suspect_reading_ends_a_run_before_the_search(tmp_path, capsys):
    case = folder(tmp_path, frame=FRAME.assign(V=100 * FRAME["V"]))
    arguments = ["run", case, "--out", str(tmp_path / "out"), "--quiet"]
    assert main(arguments) == 3
    told = capsys.readouterr().err
    assert "r: V before the event is 100 pu: check its unit and base_kv." in told
    assert "--accept-readings" in told
    message = r"recording 'r': .* V = 100, .*Correct units"
    refused([*arguments, "--accept-readings"], message, capsys)


def test_the_fitted_recording_cannot_be_judged_on(tmp_path, capsys):
    (tmp_path / "copy.csv").write_text(FRAME.to_csv(index=False))
    case = folder(
        tmp_path, CASE.replace("[device]", '[[held_out]]\npath = "copy.csv"\nevent_time = 1.0\n[device]')
    )
    message = r"recording 'copy' in \[\[held_out\]\]: it holds the same readings as recording 'r'"
    refused(["run", case, "--out", str(tmp_path / "out"), "--quiet"], message, capsys)


def test_a_missing_extra_is_told_before_anything_is_simulated(tmp_path, capsys, monkeypatch):
    monkeypatch.delitem(sys.modules, "errorscreen.learning.network", raising=False)
    monkeypatch.delattr("errorscreen.learning.network", raising=False)
    monkeypatch.setitem(sys.modules, "torch", None)
    assert main(["run", folder(tmp_path), "--out", str(tmp_path / "out"), "--quiet"]) == 1
    assert 'pip install "errorscreen[cnn]"' in capsys.readouterr().err
    assert not list((tmp_path / "out").glob("stages/*/dataset"))


@pytest.mark.usefixtures("undrawn_figures")
def test_failed_simulations_are_counted_with_a_remedy(tmp_path, capsys):
    """A converter whose current limit may lie below the current before the event."""
    text = CASE.replace('"synchronous_machine"', '"pv_plant"').replace('"cnn", ', "")
    text = text.replace("[screening]", "[device.parameters.Imax]\nlower = 0.5\nupper = 1.5\n[screening]")
    arguments = ["run", folder(tmp_path, text), "--out", str(tmp_path / "out"), "--quiet", "--no-discovery"]
    assert main(arguments) == 0
    failed = read_result(tmp_path / "out" / "result.json").run.n_failed
    line = next(s for s in capsys.readouterr().out.splitlines() if "failed" in s)
    assert sum(map(int, re.findall(r"(\d+) in calibration", line))) == failed > 0
    assert "narrow the bounds" in line


def test_memory_that_is_not_enough_is_a_failure_with_a_remedy(tmp_path, capsys, monkeypatch):
    def greedy(*arguments, **options):
        raise MemoryError("Unable to allocate 4 TiB")

    monkeypatch.setattr(workflow, "run_study", greedy)
    assert main(["run", folder(tmp_path), "--out", str(tmp_path / "out"), "--quiet"]) == 1
    assert "Unable to allocate 4 TiB. Choose fewer samples" in capsys.readouterr().err


@pytest.mark.usefixtures("undrawn_figures")
def test_a_console_without_greek_letters_shows_the_rest(tmp_path, monkeypatch):
    """The streams are those that Python makes for such a console; the second run finds all stages."""
    case = folder(tmp_path, CASE.replace('"cnn", ', "").replace("a test", "Bus α"))
    for encoding in ("ascii", "latin-1"):
        out, error = (io.TextIOWrapper(io.BytesIO(), encoding=encoding) for _ in range(2))
        monkeypatch.setattr(sys, "stdout", out)
        monkeypatch.setattr(sys, "stderr", error)
        assert main(["run", case, "--out", str(tmp_path / "out"), "--quiet"]) == 0
        out.flush()
        assert out.buffer.getvalue().startswith(b"Bus ?: ")


@pytest.mark.usefixtures("undrawn_figures")
def test_damaged_stages_are_computed_again(tmp_path, caplog):
    case = folder(tmp_path, CASE.replace('"cnn", ', ""))
    out = tmp_path / "out"
    assert main(["run", case, "--out", str(out), "--quiet"]) == 0
    first = read_result(out / "result.json")
    stage = next(out.glob("stages/*/diagnosis.npz"))
    stage.write_bytes(stage.read_bytes()[:200])
    other = next(out.glob("stages/*/screening-random.npz"))
    other.write_bytes(next(out.glob("stages/*/calibration-pso-random.npz")).read_bytes())
    caplog.clear()
    assert main(["run", case, "--out", str(out)]) == 0
    assert caplog.text.count("it is computed again") == 2
    second = read_result(out / "result.json")
    assert len(second.run.reused) == 3
    assert second.calibration[0].parameters == first.calibration[0].parameters


def test_a_pipe_that_closes_early_leaves_no_traceback():
    command = [sys.executable, "-m", "errorscreen", "keys"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdout.close()
        assert "Traceback" not in process.stderr.read()
    assert process.returncode == 1


def test_version_and_help(capsys):
    for argument in ("--version", "--help"):
        with pytest.raises(SystemExit) as caught:
            main([argument])
        assert caught.value.code == 0
    assert "bench" in capsys.readouterr().out


def test_public_names_of_the_workflow():
    assert set(workflow.__all__) == {"Outcome", "Study", "run_study", "write_outputs"}


def test_control_characters_of_files_do_not_reach_the_terminal(tmp_path, capsys):
    steering = CASE.replace("title = ", 'title = "red \\u001b[31m\\u202e" #', 1)
    assert "title = " in CASE
    case = folder(tmp_path, steering.replace('"cnn", ', ""))
    assert main(["run", case, "--out", str(tmp_path / "out"), "--quiet", "--no-discovery"]) == 0
    shown = capsys.readouterr().out
    assert "\x1b" not in shown
    assert "red \\x1b[31m\\u202e" in shown


def test_the_result_can_be_printed_as_json(tmp_path, capsys):
    case = folder(tmp_path, CASE.replace('"cnn", ', ""))
    out = tmp_path / "out"
    assert main(["run", case, "--out", str(out), "--quiet", "--no-discovery", "--json"]) == 0
    shown = capsys.readouterr().out
    assert json.loads(shown) == json.loads((out / "result.json").read_bytes())


def test_help_has_examples_and_exit_codes(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    shown = capsys.readouterr().out
    assert "errorscreen run units/*.toml --jobs 4" in shown
    assert "3 a reading is suspect" in shown
