"""The discovery study: draws are what they say, sizes are measured rightly, a study goes on where it stopped."""

import json
import logging
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from errorscreen.bench import discovery_study
from errorscreen.bench.discovery import run_scenario, streams_of
from errorscreen.bench.discovery_output import by_size, power_figure
from errorscreen.bench.grid_scenarios import draw_grid_scenario
from errorscreen.bench.hidden_effects import OTHER_FORMS, OUTSIDE
from errorscreen.bench.plant_scenarios import draw_plant_scenario, plant_setup
from errorscreen.bench.scenarios import MIX, draw_scenario, surviving
from errorscreen.bench.trap_scenarios import draw_trap_scenario
from errorscreen.cli import main
from errorscreen.exceptions import InputError, SimulationError
from tests.plants import DEVICE_NAMES, dip, flat, plant, random_rows


@pytest.mark.parametrize("device", DEVICE_NAMES)
def test_hidden_effects_are_identities_at_strength_zero_and_leave_the_equilibrium_alone(device):
    effects = [*(effect for effect, _ in OTHER_FORMS[device]), *OUTSIDE[device]]
    base = extended = plant(device, dip(stop=3.0), effects=effects)
    for effect in effects:
        extended = extended.extend(effect.name)
    theta = random_rows(extended, 5, seed=1)
    plain = base.simulate(theta[:, : len(base.parameters)]).values
    on = theta.copy()
    for effect in effects:
        theta[:, extended.parameters.index(effect.local(effect.parameters[0].name))] = 0.0
    assert np.array_equal(extended.simulate(theta).values, plain, equal_nan=True)
    at_rest = extended.simulate(on, flat(stop=1.1)).require_ok().values  # before anything is switched
    assert np.abs(at_rest - at_rest[..., :1]).max() < 1e-9


#: scenarios that several tests look at
drawn = cache(draw_plant_scenario)


def test_the_same_seed_draws_the_same_scenario():
    options = {"kind": "measurement", "device": "pv_plant"}
    hidden, again = drawn(7, 40.0, **options), draw_plant_scenario(7, 40.0, **options)
    assert hidden.hidden == again.hidden
    assert np.array_equal(hidden.values, again.values)
    assert np.array_equal(hidden.recordings[0].values, again.recordings[0].values)


@pytest.mark.parametrize("kind", [kind for kind, _ in MIX])
def test_a_scenario_hides_what_it_says(kind):
    hidden = drawn(7, 40.0, kind=kind, device="pv_plant")
    assert hidden.kind == kind
    assert len(hidden.recordings) == len(hidden.held_out) == len(hidden.truths) == 2
    count = {"nothing": 0, "two effects": 2}.get(kind, 1)
    assert len(hidden.hidden) == count
    assert bool(hidden.effects) == (kind not in ("nothing", "outside"))
    assert (hidden.size >= 3) == (count > 0)
    # the fitted model does not have what is hidden
    assert not hidden.simulator.extensions
    names = {e.name for e in hidden.simulator.effects}
    assert {name.partition("@")[0] for name in hidden.effects} <= names
    if kind in ("outside", "other form"):
        assert not set(hidden.hidden) & names


def responses_of(hidden, theta):
    return [hidden.simulator.simulate(theta, o.event).require_ok().values[0] for o in hidden.recordings]


def largest(change, observations):
    return max(np.abs(c / o.sigma).max() for c, o in zip(change, observations, strict=True))


@pytest.mark.parametrize("device", DEVICE_NAMES)
def test_no_change_that_parameters_make_survives_a_refit(device):
    hidden, other = (drawn(seed, 40.0, kind="nothing", device=device) for seed in (7, 8))
    moved = responses_of(hidden, (hidden.theta + other.theta) / 2)  # so far that the model is not linear
    change = [b - a for a, b in zip(responses_of(hidden, hidden.theta), moved, strict=True)]
    assert largest(change, hidden.recordings) > 10
    assert surviving(hidden.simulator, hidden.theta, hidden.recordings, change) < 0.02


@pytest.mark.parametrize("name", ["Xd", "Xd1", "Tj", "D"])
def test_what_only_a_value_beyond_its_bound_would_make_survives_a_refit(name):
    hidden = drawn(7, 40.0, kind="nothing", device="synchronous_machine")
    j = hidden.simulator.parameters.index(name)
    bound = hidden.simulator.parameters[name]
    at_bound = hidden.theta.copy()
    at_bound[j] = bound.upper
    inside = at_bound.copy()
    inside[j] -= 0.1 * (bound.upper - bound.lower)
    back = [b - a for a, b in zip(*(responses_of(hidden, t) for t in (at_bound, inside)), strict=True)]
    sized = [
        surviving(hidden.simulator, at_bound, hidden.recordings, [way * c for c in back]) for way in (1, -1)
    ]
    assert sized[0] < 0.01
    assert sized[1] > 0.1


def test_a_change_that_parameters_cannot_make_survives_a_refit():
    hidden = drawn(7, 40.0, kind="nothing", device="pv_plant")
    change = [5.0 * o.sigma * np.where(np.arange(o.sigma.shape[1]) % 2, 1.0, -1.0) for o in hidden.recordings]
    assert 4.5 < surviving(hidden.simulator, hidden.theta, hidden.recordings, change) < 5.1


@pytest.mark.parametrize("draw", [draw_plant_scenario, draw_grid_scenario, draw_trap_scenario])
def test_an_unknown_kind_is_refused(draw):
    with pytest.raises(InputError, match=r"unknown kind 'efect' \(did you mean 'effect'"):
        draw(0, 40.0, kind="efect")


def test_strengths_are_scaled_to_a_size_and_a_larger_size_needs_a_larger_one():
    options = {"kind": "two effects", "device": "pv_plant"}
    as_drawn = draw_plant_scenario(4, 30.0, **options, least_size=0.0)
    scaled = [
        draw_plant_scenario(4, 30.0, **options, least_size=low, largest_size=2 * low) for low in (0.05, 0.15)
    ]
    assert as_drawn.size > 0.33
    for hidden, low in zip(scaled, (0.05, 0.15), strict=True):
        assert low <= hidden.size <= 2.2 * low
        assert hidden.hidden == as_drawn.hidden
        assert np.array_equal(hidden.theta, as_drawn.theta)
    changed = scaled[0].values != as_drawn.values
    assert np.count_nonzero(changed) == len(as_drawn.hidden)  # nothing but strengths
    strengths = np.abs([hidden.values[changed] for hidden in (*scaled, as_drawn)])
    assert np.all(np.diff(strengths, axis=0) > 0)


@pytest.mark.parametrize("sizes", [(0.0, 1.0), (1.0, 1.0), (2.0, 1.0)])
def test_sizes_are_drawn_from_a_range(sizes):
    with pytest.raises(InputError, match="0 < least size < largest size"):
        draw_plant_scenario(0, 40.0, least_size=sizes[0], largest_size=sizes[1])


def record(kind, outcome, probability=0.9, top=True, size=5.0, **more):
    truth = {"kind": kind, "device": "pv_plant", "hidden": ["a"], "right": ["a"], "place": "Pm", "size": size}
    held_out = {"baseline": 20.0, "recalibrated": 10.0, "extended": 1.0, "true_structure": 0.8}
    verdict = {"correct": "effect", "wrong": "effect", "unknown": "unknown"}.get(outcome, "parameters")
    return {
        "truth": truth, "outcome": outcome, "verdict": verdict, "named": ["a"] if outcome == "correct" else [],
        "place": None, "probability": probability, "top_is_right": top, "held_out": held_out, "seconds": 1.0,
        "simulations": 10, **more,
    }  # fmt: skip


class Failing:
    """A model that cannot be simulated."""

    def simulate(self, theta, event):
        raise SimulationError("diverged")


def test_what_cannot_be_recorded_or_simulated_without_the_effect_is_drawn_again():
    setup, calls = plant_setup("pv_plant"), []

    def record(*arguments):
        calls.append(arguments)
        if len(calls) == 1:
            raise InputError("moves before the event")
        observations, simulator = setup.record(*arguments)
        return observations, Failing() if len(calls) == 2 else simulator

    rng, theta = np.random.default_rng(0), setup.truth.parameters.nominal
    hidden = draw_scenario(replace(setup, record=record), rng, "measurement", "pv_plant", theta, 40.0)
    assert len(calls) > 2
    assert hidden.size >= 3.0


def test_effects_below_the_noise_cannot_be_hidden(monkeypatch):
    monkeypatch.setattr("errorscreen.bench.trap_scenarios.TRIES", 1)
    with pytest.raises(
        InputError, match=r"none of 1 effects drawn in the trap 'play' is at least 1e\+09 times"
    ):
        draw_trap_scenario(0, 40.0, kind="effect", device="play", least_size=1e9)


def test_outcomes_by_size():
    rows = [
        record("effect", "correct", size=4.0), record("other form", "unknown", size=3.0),
        record("measurement", "correct", size=60.0), record("outside", "correct", size=4.0),
    ]  # fmt: skip
    result = {"case": "plant", "noise_db": 40.0, "scenarios": rows}
    small, large = by_size(result)
    assert (small["low"], small["high"], small["median"], small["n"]) == (3.0, 5.0, 3.5, 2)
    assert [small[name]["value"] for name in ("correct", "unknown", "wrong", "missed")] == [
        0.5,
        0.5,
        0.0,
        0.0,
    ]
    assert (large["low"], large["n"], large["correct"]["value"]) == (50.0, 1, 1.0)
    # the exact interval of 1 of 1 ends where the probability of a hit is 2.5 %
    assert np.allclose(large["correct"]["interval"], [0.025, 1.0])
    axes = power_figure(result, {**result, "noise_db": 20.0, "scenarios": rows[:1]}).axes[0]
    assert [bars.get_label() for bars in axes.containers] == ["40 dB", "20 dB"]
    line, _, (bars,) = axes.containers[0].lines
    assert np.array_equal(line.get_xydata(), [[3.5, 0.5], [60.0, 1.0]])
    ends = [segment[:, 1] for segment in bars.get_segments()]
    assert np.allclose(ends, [b["correct"]["interval"] for b in (small, large)])
    assert len(power_figure(result).axes[0].texts) == 2  # how many scenarios each point stands for
    assert len(power_figure(*[result] * 9).axes[0].containers) == 9


def test_a_study_of_some_kinds_and_sizes(tmp_path, caplog):
    options = {"seed": 5, "least_size": 0.02, "noise_db": 20.0, "kinds": ("measurement",), "n_jobs": 1}
    with caplog.at_level(logging.INFO):
        result = discovery_study(tmp_path, scenarios=1, largest_size=0.03, **options)
    assert "1 scenarios, 0 of them finished before" in caplog.text
    (found,) = result["scenarios"]
    assert found["truth"]["kind"] == "measurement"
    assert result["mix"] == {"measurement": 1.0}
    assert (result["least_size"], result["largest_size"]) == (0.02, 0.03)
    assert 0.02 <= found["truth"]["size"] <= 0.033
    assert found["outcome"] == "missed"  # a change far below the noise is not reported
    with pytest.raises(InputError, match="belongs to another run"):
        discovery_study(tmp_path, scenarios=1, largest_size=0.04, **options)


def test_a_scenario_tells_intervals_beside_true_values():
    hidden = draw_trap_scenario(streams_of(6, 0)[0], 40.0, kind="effect")
    found = run_scenario("traps", 6, 0, 40.0, 3.0, "effect")
    assert found["named"] == list(hidden.hidden)
    assert [entry["true"] for entry in found["intervals"]] == hidden.values.tolist()
    for entry in found["intervals"]:
        assert entry["name"].startswith(hidden.hidden[0])
        low, high = entry["interval"]
        assert low <= entry["value"] <= high
        # not whether it holds the truth, which one in ten need not, but that both are of the same parameter
        assert abs(entry["true"] - entry["value"]) < 5 * (high - low)


def test_a_study_goes_on_where_it_stopped(tmp_path, capsys):
    arguments = ["bench", "discovery", "--seed", "3", "--case", "traps", "--jobs", "1", "--quiet"]
    arguments += ["--out", str(tmp_path)]
    assert main([*arguments, "--scenarios", "1"]) == 0
    capsys.readouterr()
    assert main([*arguments, "--scenarios", "2"]) == 0
    printed = capsys.readouterr().out
    assert "2 hidden scenarios, seed 3" in printed
    result = json.loads((tmp_path / "result.json").read_text())
    assert [r["number"] for r in result["scenarios"]] == [0, 1]
    assert {"rates", "held_out_ratio_median", "expected_calibration_error"} <= set(result)
    for name in ("tables.md", "power.png", "reliability.png"):
        assert (tmp_path / name).stat().st_size > 0
    assert main([*arguments[:3], "4", *arguments[4:], "--scenarios", "2"]) == 2
    assert "belongs to another run" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"case": "ieee3"}, r"unknown case 'ieee3' \(did you mean 'ieee39'"),
        ({"scenarios": 0}, "the number of scenarios"),
        ({"noise_db": 200.0}, "noise_db"),
        ({"least_size": -1.0}, "the least size"),
        ({"largest_size": 3.0}, "0 < least size < largest size"),
        ({"largest_size": 9.0, "case": "traps"}, "of the case traps are not scaled to a size"),
        ({"kinds": ("efect",)}, r"unknown kind 'efect' \(did you mean 'effect'"),
        ({"n_jobs": 0}, "the number of jobs is 0"),
    ],
)
def test_bad_arguments_are_refused(change, message, tmp_path):
    with pytest.raises(InputError, match=message):
        discovery_study(tmp_path, **change)
