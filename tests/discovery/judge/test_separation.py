"""What would tell explanations apart."""

import numpy as np

from errorscreen.discovery.judge.separation import differing, states_of
from errorscreen.simulators import PlantSimulator
from tests.plants import dip

T = np.linspace(0.0, 1.0, 101)


def test_states_that_differ_most_are_told_in_shares_of_their_range():
    a = {("m", "flux"): 5.0 * T, ("m", "speed"): T, ("m", "angle"): T, ("m", "other"): T}
    b = {("m", "flux"): 4.0 * T, ("m", "speed"): 0.0 * T, ("m", "angle"): T}
    found = differing([a, b])
    assert [one.state for one in found] == [
        "speed",
        "flux",
    ]  # what is the same, or in one alone, tells nothing
    assert np.allclose([one.share for one in found], [0.58, 0.12])
    scaled = [{key: 7.0 * row for key, row in states.items()} for states in (a, b)]
    assert differing(scaled) == differing([b, a]) == found
    assert differing([{}, a]) == differing([a, a]) == ()


def test_states_are_those_of_the_device():
    plant = PlantSimulator("synchronous_machine", dip(stop=3.0))
    event = dip(stop=3.0)
    states = states_of(plant, plant.parameters.nominal, event)
    assert set(states) == {("synchronous_machine", name) for name in plant.device.states}
    assert all(row.shape == event.time.shape for row in states.values())


def test_states_that_are_recorded_need_not_be_recorded(spring):
    model, observation = spring
    names = {name for _, name in states_of(model, model.parameters.nominal, observation.event)}
    assert "velocity" in names
    assert not names & set(model.channels)
