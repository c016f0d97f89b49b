import numpy as np
import pytest

from errorscreen.bench.trap_scenarios import TRAPS, draw_trap_scenario
from errorscreen.events import InputSignal
from errorscreen.exceptions import InputError

HIDDEN = [(name, number) for name, trap in TRAPS.items() for number in range(len(trap.hidden))]


def scenario(name, seed, kind="effect"):
    return draw_trap_scenario(seed, 40.0, kind=kind, device=name)


@pytest.mark.parametrize("name", TRAPS)
def test_truth_and_model_agree_where_nothing_is_hidden(name):
    hidden = scenario(name, 1, "nothing")
    for observation, truth in zip(hidden.held_out, hidden.truths, strict=True):
        y = hidden.simulator.simulate(hidden.theta, observation.event).values[0]
        assert np.sqrt(np.mean((y - truth) ** 2)) < 0.2 * observation.noise[0]


@pytest.mark.parametrize(("name", "number"), [h for h in HIDDEN if h[0] != "relay"])
def test_truth_and_library_agree_on_what_is_hidden(name, number):
    # hard against smoothed: the difference is smaller than the noise; relays sum up errors of the instants
    trap, rng = TRAPS[name], np.random.default_rng(5)
    nothing = scenario(name, 5, "nothing")
    extended = nothing.simulator.extend(trap.hidden[number].effect)
    u, (values, own) = trap.inflow(rng), trap.hidden[number].draw(rng)
    truth = trap.truth(u, trap.dt, *nothing.theta, *values)
    event = InputSignal(trap.dt * np.arange(len(u)), trap.inputs[0], 0.0, {trap.inputs[0]: u})
    y = extended.simulate([*nothing.theta, *own], event).values[0, 0]
    plain = nothing.simulator.simulate(nothing.theta, event).values[0, 0]
    assert np.sqrt(np.mean((y - truth) ** 2)) < 0.03 * np.sqrt(np.mean((y - plain) ** 2))


def test_relay_of_truth_and_library_switch_at_the_same_instants():
    trap = TRAPS["relay"]
    rng = np.random.default_rng(3)
    u, theta, values = trap.inflow(rng), np.array([0.5, 0.25]), (1.0, 1.8, 0.8)
    truth = trap.truth(u, trap.dt, *theta, 1, *values)
    event = InputSignal(trap.dt * np.arange(len(u)), "supply", 0.0, {"supply": u})
    extended = scenario("relay", 0).simulator.extend("supply.relay_above(level)")
    y = extended.simulate([*theta, *values], event).values[0, 0]
    assert np.abs(y - truth).max() < 0.03 * np.ptp(truth)


def test_friction_of_the_truth_sticks():
    u = np.r_[np.full(100, 0.3), np.full(100, 1.0), np.full(200, 0.3)]
    y = TRAPS["friction"].truth(u, 0.05, 1.0, 0.8, 0.5, 0.0, 1.0)
    assert np.all(y[:101] == 0.0)
    assert y[199] == pytest.approx((1.0 - 0.5) / 0.8, rel=0.03)
    assert np.all(y[-100:] == 0.0)


@pytest.mark.parametrize(("name", "number"), HIDDEN)
def test_every_hidden_effect_is_in_the_library(name, number):
    effect = TRAPS[name].hidden[number].effect
    library = {e.name: e for e in scenario(name, 0, "nothing").simulator.effects}
    assert effect in library
    _, own = TRAPS[name].hidden[number].draw(np.random.default_rng(0))
    assert len(own) == len(library[effect].parameters)


def test_scenarios_are_reproducible():
    one, two = scenario("play", 8), scenario("play", 8)
    assert one.effects == two.effects
    assert np.array_equal(one.recordings[0].values, two.recordings[0].values)


def test_an_unknown_trap_is_refused():
    with pytest.raises(InputError, match="did you mean 'friction'"):
        draw_trap_scenario(0, 40.0, device="frictoin")
