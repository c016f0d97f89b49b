"""A slow error of the model that is allowed: its covariance, and what counts as an error beside it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.data.observations import Observation
from errorscreen.data.slow_errors import slow_modes
from errorscreen.events import Event
from errorscreen.exceptions import InputError

TIME = np.linspace(0.0, 4.0, 161)


def observed(noise=(0.01, 0.02), level=None):
    level = None if level is None else np.array(level)
    event = Event(TIME, start=1.0)
    return Observation(event, np.zeros((2, 161)), np.array(noise), ("P", "Q"), ("pu", "pu"), level_std=level)


def covariance(size, seconds):
    """The stated covariance (M1) on the grid, written down."""
    after = TIME >= 1.0
    lag = TIME[:, None] - TIME
    return size**2 * np.exp(-(lag**2) / (2 * seconds**2)) * np.outer(after, after)


@given(st.floats(0.05, 5.0), st.floats(0.0, 3.9))
def test_covariance_of_the_modes_is_the_stated_one(seconds, start):
    modes = slow_modes(TIME, start, seconds)
    after = np.greater_equal(TIME, start - 1e-9)
    wanted = np.exp(-((TIME[:, None] - TIME) ** 2) / (2 * seconds**2)) * np.outer(after, after)
    assert modes.T @ modes == pytest.approx(wanted, abs=1e-3)


@pytest.mark.parametrize("seconds", [0.1, 0.5, 3.0])
def test_chi_square_is_that_of_the_whole_covariance(seconds):
    allowed = observed(level=(0.002, 0.0)).with_model_error({"P": 0.05}, seconds)
    errors = np.random.default_rng(3).normal(0.0, 0.02, (2, 161))
    step = (TIME >= 1.0).astype(float)
    sigma = np.diag(np.full(161, 0.01**2)) + covariance(0.05, seconds) + 0.002**2 * np.outer(step, step)
    wanted = errors[0] @ np.linalg.solve(sigma, errors[0]) + (errors[1] ** 2).sum() / 0.02**2
    assert (allowed.deviations(errors) ** 2).sum() == pytest.approx(wanted, rel=2e-3)


def test_an_error_of_that_kind_leaves_as_much_as_noise():
    rng = np.random.default_rng(4)
    root = np.linalg.cholesky(covariance(0.05, 0.3)[40:, 40:] + 1e-12 * np.eye(121))
    slow = np.zeros((200, 2, 161))
    slow[:, 0, 40:] = rng.standard_normal((200, 121)) @ root.T
    errors = slow + rng.normal(0.0, 1.0, slow.shape) * np.array([0.01, 0.02])[:, None]
    energy = (observed().with_model_error({"P": 0.05}, 0.3).deviations(errors) ** 2).mean(axis=-1)
    assert energy.mean(axis=0) == pytest.approx([1.0, 1.0], abs=0.03)
    assert (observed().deviations(errors) ** 2).mean(axis=(0, 2))[0] > 10


def test_an_error_that_is_faster_or_in_another_channel_counts_as_before():
    allowed = observed().with_model_error({"P": 0.05}, 0.5)
    fast = 0.05 * np.sin(2 * np.pi * 6.0 * TIME) * (TIME >= 1.0)
    both = np.stack([fast, fast])
    before, now = (np.square(one.deviations(both)).sum(axis=-1) for one in (observed(), allowed))
    assert now == pytest.approx(before, rel=0.02)


def test_first_part_and_summary_keep_it():
    allowed = observed().with_model_error({"P": 0.05}, 0.5)
    errors = np.full((2, 161), 0.05)
    part = allowed.first(100)
    assert (part.deviations(errors[:, :100])[0, 50:] ** 2).mean() < 1.0  # 25 without
    assert "slow error of the model counts as uncertainty: P 0.05 pu, within 0.5 s" in allowed.summary()


@pytest.mark.parametrize(
    ("std", "seconds", "message"),
    [
        ({"p": 0.1}, 1.0, "unknown channel 'p'"),
        ({"P": -0.1}, 1.0, "model_error.P is -0.1"),
        ({"P": 0.1}, 0.0, "the time of the model error is 0.0"),
        ({"P": 0.1}, 0.01, "at least 0.013 s"),
        ({"P": float("nan")}, 1.0, "model_error.P is nan"),
    ],
)
def test_wrong_statements_are_refused(std, seconds, message):
    with pytest.raises(InputError, match=message):
        observed().with_model_error(std, seconds)
