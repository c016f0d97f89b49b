"""The search for causes from the command line: what is used again, folders, and what to check first."""

import re
from pathlib import Path

import pytest
from markupsafe import escape
from threadpoolctl import threadpool_limits

from errorscreen.cases import load_case
from errorscreen.cli import main
from errorscreen.discovery import channel_fits
from errorscreen.report import read_result
from errorscreen.workflow import Study
from tests.test_cli import CASE, folder, refused

pytestmark = pytest.mark.usefixtures("undrawn_figures")

RESULTS = Path(__file__).parents[1] / "docs" / "reference" / "results.md"


def test_a_search_that_was_left_out_is_made_up_for(tmp_path):
    case, out = (
        folder(tmp_path, CASE.replace('"random"', '"sensitivity"').replace('"sensitivity", ', "")),
        tmp_path / "o",
    )
    assert main(["run", case, "--out", str(out), "--quiet", "--no-discovery"]) == 0
    first = read_result(out / "result.json")
    assert first.diagnosis.tried == ()
    assert main(["run", case, "--out", str(out), "--quiet"]) == 0
    second = read_result(out / "result.json")
    assert second.diagnosis.tried
    assert "diagnosis" not in second.run.reused  # of another search
    stages = {f"{stage}-{m}" for stage in ("screening", "calibration-pso") for m in ("cnn", "sensitivity")}
    assert set(second.run.reused) == stages
    # diagnose asks for less, and that is there
    assert main(["diagnose", case, "--out", str(out), "--quiet"]) == 0
    assert read_result(out / "result.json").run.reused == ("diagnosis",)


def test_the_folder_of_a_case_keeps_the_reports_of_both_commands(tmp_path):
    case = folder(tmp_path, CASE.replace('"cnn", ', "") + '[run]\nout = "kept"\n')
    assert main(["run", case, "--quiet", "--no-discovery"]) == 0
    report = (tmp_path / "kept" / "report.html").read_bytes()
    assert main(["diagnose", case, "--quiet"]) == 0
    assert (tmp_path / "kept" / "report.html").read_bytes() == report
    assert read_result(tmp_path / "kept" / "diagnose" / "result.json").diagnosis.tried


def test_the_model_is_rebuilt_from_the_result_as_documented(tmp_path):
    """The block of `docs/reference/results.md`, on a case of which parameters are wrong."""
    case, out = folder(tmp_path, CASE.replace('"cnn", ', "")), tmp_path / "out"
    assert main(["diagnose", case, "--out", str(out), "--quiet"]) == 0
    block = re.search(
        r"^```python\n(.*?)^```", RESULTS.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )[1]
    assert '"case-results/result.json"' in block
    assert '"case.toml"' in block
    space = {}
    exec(block.replace("case-results", str(out)).replace("case.toml", case), space)
    model, fits = space["model"], space["found"].model("parameters only").channels
    again = channel_fits(model.observe(load_case(case).load_recording()), model.baseline())
    assert [f.rms for f in again] == pytest.approx([f.rms for f in fits], rel=1e-12)
    assert model.step == space["found"].step


def test_a_damaged_part_of_a_search_can_be_forgotten(tmp_path, capsys):
    case, out = folder(tmp_path, CASE.replace('"cnn", ', "")), tmp_path / "out"
    key = Study.from_case(load_case(case)).fingerprint("diagnosis", ())[:16]
    damaged = out / "stages" / key / "search" / "store.json"
    damaged.parent.mkdir(parents=True)
    damaged.write_text("{")
    arguments = ["diagnose", case, "--out", str(out), "--quiet"]
    last = refused(arguments, f"file {re.escape(str(damaged))}: is damaged", capsys)
    assert last.endswith("Delete it, or forget all stages of earlier runs with --fresh.")
    # a case file has a remedy of its own
    assert "--fresh" not in refused(["diagnose", str(tmp_path / "no.toml")], "does not exist", capsys)
    assert main([*arguments, "--fresh"]) == 0


def test_the_network_is_the_same_beside_a_search_as_without_one(tmp_path):
    """Also where threads are limited."""
    case = folder(tmp_path)
    results = []
    for name, threads, arguments in (("beside", 2, []), ("alone", 1, ["--no-discovery"])):
        with threadpool_limits(limits=threads):
            assert main(["run", case, "--out", str(tmp_path / name), "--quiet", *arguments]) == 0
        results.append(read_result(tmp_path / name / "result.json"))
    beside, alone = results
    assert beside.diagnosis.tried
    assert beside.screening[0].threads == alone.screening[0].threads == 1
    rankings = [[(m.method, m.contributions) for m in r.screening] for r in results]
    assert rankings[0] == rankings[1]
    assert [m.label for m in beside.calibration] == [m.label for m in alone.calibration]
    # a network that was trained beside the search is a stage like others
    assert main(["run", case, "--out", str(tmp_path / "beside"), "--quiet", "--no-discovery"]) == 0
    assert "screening-cnn" in read_result(tmp_path / "beside" / "result.json").run.reused


@pytest.mark.filterwarnings("ignore:.*P before the event is")
@pytest.mark.parametrize("arguments", [[], ["--no-discovery"]])
def test_a_doubtful_sign_is_what_to_check_first(arguments, tmp_path, capsys):
    text = CASE.replace('"cnn", ', "").replace('unit = "MW"', 'unit = "MW"\nsign = "load"')
    out = tmp_path / "out"
    call = ["run", folder(tmp_path, text), "--out", str(out), "--quiet", *arguments]
    assert main(call) == 3
    assert main([*call, "--accept-readings"]) == 0
    hint = (
        "r: P before the event is -0.721 pu, but generation is positive: check its sign (sign = 'load' in its column, "
        "in waveforms or in phasors)."
    )
    first = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("Next: "))
    assert first == f"Next: {hint}"
    result = read_result(out / "result.json")
    assert result.diagnosis.final.kind == "unknown"
    assert result.hints[0] == hint
    assert (result.advice[0], result.advice[-1]) == result.hints
    assert result.hints[1].startswith("The model begins with typical values of Xd, Xd1")
    assert f"<li>{escape(hint)}</li>" in (out / "report.html").read_text()


def test_the_least_first_look_works(tmp_path):
    text = CASE.replace('"cnn", ', "").replace(
        "[discovery]", '[discovery]\nfirst_look = 20\neffects = ["exciter"]'
    )
    assert main(["run", folder(tmp_path, text), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    result = read_result(tmp_path / "out" / "result.json")
    rank = 1 + [one.name for one in result.first_look].index("exciter")
    assert f"has rank {rank} of {len(result.first_look)}" in result.first_look_compared
    assert result.first_look_compared in (tmp_path / "out" / "report.html").read_text()
