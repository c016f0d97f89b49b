"""The noise of a recording: what it alone explains, and what it does not."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.data.observations import Observation
from errorscreen.data.signals import correlation_time
from errorscreen.discovery import noise_limit
from errorscreen.discovery.fits.noise import by_recording, noise_model, quiet_part
from errorscreen.events import Event

TIME = 0.01 * np.arange(600)


def seen(start=2.0, seed=0, name="record"):
    """White noise of unit size about zero."""
    values = np.random.default_rng(seed).standard_normal((2, len(TIME)))
    return Observation(Event(TIME, name, start), values, np.ones(2), ("P", "Q"), ("pu", "pu"))


def test_the_limit_is_that_of_the_equation():
    observation = seen()
    zero = np.zeros(observation.values.shape)
    quiet = -observation.values[:, TIME < 2.0 - 1e-9]
    tau = correlation_time(*(quiet - quiet.mean(axis=1, keepdims=True)))
    total, quiet = 2 * len(TIME), 2 * int(np.sum(TIME < 2.0 - 1e-9))
    expected = 1 + 3 * np.sqrt(2 * tau / total + 2 * tau / quiet)
    assert noise_limit([observation], [zero]) == pytest.approx(expected)
    assert noise_limit([observation, seen(seed=1)], [zero, zero]) < noise_limit([observation], [zero])


@pytest.mark.parametrize("start", [0.0, 0.05])
def test_without_a_quiet_part_the_noise_is_what_was_stated(start):
    observation = seen(start)
    assert not quiet_part(observation).any()
    zero = np.zeros(observation.values.shape)
    assert noise_limit([observation], [zero]) == pytest.approx(1 + 3 * np.sqrt(2 / (2 * len(TIME))))
    assert noise_model([observation], observation.values[observation.mask]) == (1.0, [0.0])


def test_an_offset_before_the_event_is_no_correlated_noise():
    observation = seen()
    zero = np.zeros(observation.values.shape)
    shifted = replace(observation, values=observation.values + 1.0)
    assert noise_limit([shifted], [zero]) == pytest.approx(noise_limit([observation], [zero]), rel=1e-6)


def test_residuals_come_back_by_recording_with_gaps():
    first, second = seen(), seen(seed=1, name="other")
    values = first.values.copy()
    values[0, 10:20] = np.nan
    first = replace(first, values=values)
    residuals = np.concatenate([o.values[o.mask] for o in (first, second)])
    (_, a), (_, b) = by_recording([first, second], residuals)
    assert np.array_equal(a, np.nan_to_num(values))
    assert np.array_equal(b, second.values)
