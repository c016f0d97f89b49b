"""The search without one step after the other, on hidden scenarios."""

import json

import pytest

from errorscreen.bench import ablation as module
from errorscreen.bench import ablation_study
from errorscreen.cli import main
from errorscreen.discovery.search.plan import STEPS
from errorscreen.exceptions import InputError


def row(number, outcome, simulations, seconds=1.0):
    return {"number": number, "outcome": outcome, "simulations": simulations, "seconds": seconds}


@pytest.fixture
def studied(monkeypatch):
    """Plans that were asked for; without a step the second scenario is lost, at half the simulations."""
    plans = []

    def study(out, *, plan=None, **options):
        plans.append(plan)
        if plan is None:
            return {"scenarios": [row(0, "correct", 100), row(1, "correct", 200), row(2, "wrong", 300)]}
        return {"scenarios": [row(0, "correct", 50), row(1, "unknown", 100, 2.0), row(2, "correct", 150)]}

    monkeypatch.setattr(module, "discovery_study", study)
    return plans


def test_each_step_is_left_out_in_turn(tmp_path, studied):
    result = ablation_study(tmp_path, scenarios=3)
    assert studied[0] is None
    assert [set(STEPS) - set(plan) for plan in studied[1:]] == [
        {step} for step in STEPS if step != "add effects"
    ]
    found = result["without"]["drop effects"]
    assert (found["lost"], found["gained"]) == ([1], [2])
    assert (found["simulations_ratio"], found["cost"]) == (0.5, 1.0)
    assert found["right"]["value"] == result["whole"]["right"]["value"] == pytest.approx(2 / 3)
    assert found["wrong"]["value"] == 0.0
    assert json.loads((tmp_path / "result.json").read_text())["without"]["drop effects"]["lost"] == [1]
    assert "| drop effects | 0.667 [" in (tmp_path / "tables.md").read_text()


def test_a_step_that_is_needed_or_unknown_is_refused(tmp_path):
    with pytest.raises(InputError, match="nothing is searched without the step 'add effects'"):
        ablation_study(tmp_path, steps=["add effects"])
    with pytest.raises(InputError, match="'finer stp'.*'finer step'"):
        ablation_study(tmp_path, steps=["finer stp"])


def test_the_command_searches_scenarios_and_goes_on_from_them(tmp_path, capsys):
    arguments = [
        "bench",
        "ablation",
        "--case",
        "traps",
        "--scenarios",
        "1",
        "--seed",
        "3",
        "--jobs",
        "1",
        "--quiet",
    ]
    arguments += ["--step", "finer step", "--out", str(tmp_path)]
    assert main(arguments) == 0
    said = capsys.readouterr().out
    assert "| finer step |" in said
    first = json.loads((tmp_path / "result.json").read_text())
    assert main(arguments) == 0
    again = json.loads((tmp_path / "result.json").read_text())
    assert again["without"] == first["without"]  # also the times: nothing was searched again
