"""Uncertainty of a response from what is injected."""

from dataclasses import replace

import numpy as np

from errorscreen.observations import Observation
from errorscreen.simulators import injection_noise
from tests.plants import dip, plant


def on_the_edge():
    """A plant that stops just before a dip ends, and its uncertainty if its voltage has noise."""
    event = dip(depth=0.3, duration=0.5)
    event = replace(event, noise={"V": 2e-2})
    simulator = plant("pv_plant", event).extend("cessation")
    theta = simulator.parameters.nominal.copy()
    changes = {"s": 1.0, "Vth": 0.701, "Tth": 0.45, "Tc": 1.0, "Tramp": 0.5}
    theta[[simulator.parameters.index(f"cessation.{name}") for name in changes]] = list(changes.values())
    response = simulator.simulate(theta).values[0]
    noise = np.full(2, 1e-3)
    observation = Observation(event, response, noise, simulator.channels, simulator.units)
    return response, simulator.quantified(observation, theta)


def test_a_response_in_which_something_else_happens_is_no_uncertainty(monkeypatch):
    response, observation = on_the_edge()
    after = observation.time > 1.6  # a plant that stops stays away for a second
    assert response[0, after].min() < 0.01
    assert np.abs(observation.modes[..., after]).max(initial=0.0) < 0.1  # the return shifts a little
    assert observation.extra[:, after].max() < 0.1
    monkeypatch.setattr(injection_noise, "_ANOTHER", np.inf)
    _, explains_anything = on_the_edge()
    assert np.abs(explains_anything.modes[..., after]).max() > 0.3


def test_noise_was_estimated_without_the_effects_that_are_tried_later():
    """A lag hides the noise of the voltage; what has been counted without it is not counted again."""
    event = replace(dip(), noise={"V": 5e-3})
    old = plant("pv_plant", event)
    values = old.baseline()
    observation = Observation(event, values, np.full(2, 1e-3), old.channels, old.units)
    extended = old.extend("lag_P")
    off = extended.parameters.nominal
    off[extended.parameters.index("lag_P.T")] = 0.0
    before = observation.time < 0.9
    expected = old.quantified(observation, old.parameters.nominal).extra[0, before]
    found = extended.quantified(observation, off, off).extra[0, before]
    twice = extended.quantified(observation, off).extra[
        0, before
    ]  # as if it had been estimated behind the lag
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert twice.mean() > 1.5 * max(expected.mean(), 1e-6)
