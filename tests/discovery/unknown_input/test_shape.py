"""Forms of an unknown signal, seen through the knots that it is fitted by."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.discovery.unknown_input.locations import waveform
from errorscreen.discovery.unknown_input.shape import shape_of
from errorscreen.effects.latent_input import KNOTS

TIME = np.linspace(1.0, 6.0, 601)
HATS = np.array([waveform(knot, TIME, 1.0) for knot in np.eye(KNOTS)]).T


def through_knots(signal):
    """The signal as knots show it, with noise of 3 % of its peak."""
    seen = HATS @ np.linalg.lstsq(HATS, signal, rcond=None)[0]
    noise = np.random.default_rng(0).standard_normal(len(TIME))
    return seen + 0.03 * np.abs(seen).max() * noise


@given(st.floats(1.0, 5.0), st.floats(0.01, 10.0), st.booleans())
def test_a_step_has_its_instant_and_size(at, size, down):
    size = -size if down else size
    found = shape_of(TIME, through_knots(size * (at <= TIME)))
    assert found.kind == "step"
    assert found.start == pytest.approx(at, abs=0.25)
    assert found.size == pytest.approx(size, rel=0.1)


@given(st.floats(0.5, 1.8), st.floats(0.0, 0.15), st.floats(0.0, 6.2))
def test_an_oscillation_has_its_frequency_and_damping(frequency, damping, phase):
    after, rate = TIME - 1.0, 2 * np.pi * frequency
    signal = np.exp(-damping * rate * after) * np.cos(rate * np.sqrt(1 - damping**2) * after + phase)
    found = shape_of(TIME, signal)
    assert found.kind == "oscillation"
    assert found.frequency == pytest.approx(frequency * np.sqrt(1 - damping**2), rel=0.03)
    assert found.damping == pytest.approx(damping, abs=0.02)


@pytest.mark.parametrize(
    ("signal", "kind", "text"),
    [
        (0.4 * np.clip((TIME - 1.5) / 2, 0, 1), "ramp", "a ramp from 1.455 s to 3.551 s, to 0.4 pu"),
        (0.3 * ((TIME > 2.0) & (TIME < 3.0)), "pulse", "a pulse of 0.29 pu from 1.9"),
        (0.2 * np.sin(2 * np.pi * 0.6 * TIME), "oscillation", "0.6 Hz, undamped, up to 0.2 pu"),
        (np.exp(0.3 * TIME) * np.sin(2 * np.pi * TIME), "oscillation", "growing"),
        (np.exp(-0.1 * TIME) * np.sin(2 * np.pi * TIME), "oscillation", "damping ratio 0.02"),
        (np.exp((1.0 - TIME) / 0.7), "", "up to 1 pu, from 1 s to"),
        (np.random.default_rng(1).standard_normal(len(TIME)), "", "up to"),
    ],
)
def test_forms_in_words(signal, kind, text):
    found = shape_of(TIME, signal)
    assert found.kind == kind
    assert text in found.text("pu")


def test_a_signal_that_is_zero_has_no_form():
    assert shape_of(TIME, 0 * TIME).text("pu") == shape_of(TIME[:2], TIME[:2]).text("pu") == ""
