"""Hidden scenarios of units of standard models."""

import numpy as np
import pytest

from errorscreen.bench import unit_scenarios
from errorscreen.bench.andes_network import FAULT, RECORDS, GridEvent, simulate_unit
from errorscreen.bench.discovery import run_scenario
from errorscreen.bench.reference_models import play
from errorscreen.bench.scenarios import Scenario
from errorscreen.bench.unit_differences import device_of
from errorscreen.bench.unit_scenarios import draw_andes_scenario, draw_models_scenario
from errorscreen.exceptions import InputError
from tests.power.andes_reference import andes


def seeds(number):
    return np.random.SeedSequence(12, spawn_key=(number,))


def test_a_part_that_is_missing_is_hidden_and_the_file_lacks_it():
    hidden = draw_models_scenario(seeds(0), 40.0, kind="part missing", least_size=1.0)
    (name,) = hidden.hidden
    model = name.split()[0]
    assert name == f"{model} missing"
    assert model not in hidden.simulator.device.name
    assert hidden.answers == {frozenset(hidden.effects)}
    assert set(hidden.effects) <= {effect.name for effect in hidden.simulator.effects}
    assert hidden.size >= 1.0
    assert (len(hidden.recordings), len(hidden.held_out), len(hidden.truths)) == (2, 1, 1)
    again = draw_models_scenario(seeds(0), 40.0, kind="part missing", least_size=1.0)
    assert np.array_equal(again.recordings[1].values, hidden.recordings[1].values)


def test_where_nothing_is_hidden_the_model_at_the_true_values_leaves_noise():
    hidden = draw_models_scenario(seeds(1), 40.0, kind="healthy")
    assert hidden.hides_nothing
    for observation in (*hidden.recordings, *hidden.held_out):
        y = hidden.simulator.simulate(hidden.theta, observation.event).values[0]
        z = observation.deviations(y)
        assert 0.6 < np.mean(z**2) < 1.4


def test_a_healthy_unit_is_searched_and_nothing_is_found():
    row = run_scenario("models", 12, 0, 40.0, 1.0, "healthy")
    assert (row["truth"]["kind"], row["outcome"], row["top_is_right"]) == ("healthy", "correct", True)


def test_bad_arguments_are_refused(monkeypatch):
    with pytest.raises(InputError, match="unknown kind 'flagg'"):
        draw_models_scenario(0, 40.0, kind="flagg")
    with pytest.raises(InputError, match="unknown kind 'flag'"):
        draw_andes_scenario(0, 40.0, kind="flag")
    monkeypatch.setattr(unit_scenarios, "_TRIES", 1)
    with pytest.raises(InputError, match="at least 1e\\+06 times the noise"):
        draw_models_scenario(0, 40.0, kind="MVA base", least_size=1e6)


def test_answers_of_a_scenario():
    nothing = Scenario("nothing", "", (), (), "", 0.0, np.zeros(0), None, (), (), (), (), np.zeros(0))
    assert nothing.answers == set()
    several = Scenario(
        "two effects", "", ("a", "c"), ("x", "y"), "", 0.0, np.zeros(0), None, (), (), (), (), np.zeros(0),
        (("a", "b"), ("c",)),
    )  # fmt: skip
    assert several.answers == {frozenset("ac"), frozenset("bc")}


@andes
def test_andes_and_this_package_simulate_the_same_unit():
    records = {model: RECORDS[model] for model in ("GENROU", "SEXS", "IEEEST")}
    rows = simulate_unit(records, GridEvent(0.05, 0.1), power=0.6, voltage=1.03, end=3.0)
    time, V, angle, P, Q = rows.T
    assert (P[0], V[0]) == pytest.approx((0.6, 1.03), abs=1e-6)
    assert np.ptp(V[time > FAULT]) > 0.2
    out = play(device_of(records), time, V, angle, {"P": P[0], "Q": Q[0]}, ["P", "Q"], f_nominal=60.0)
    for name, values in (("P", P), ("Q", Q)):
        assert np.sqrt(np.mean((out[name] - values) ** 2)) < 2e-4


@andes
def test_a_scenario_of_andes_leaves_noise_at_the_values_of_the_file():
    hidden = draw_andes_scenario(seeds(2), 40.0, kind="healthy")
    for observation in hidden.recordings:
        y = hidden.simulator.simulate(hidden.theta, observation.event).values[0]
        assert 0.6 < np.mean(observation.deviations(y) ** 2) < 1.6
