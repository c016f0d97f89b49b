"""The filter against its formula, and what it must not do."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.exceptions import InputError
from errorscreen.validation import low_pass

DT = 5e-5
TIME = np.arange(0.0, 6.0, DT)
MIDDLE = slice(40_000, 80_000)  # 2 s, a whole number of periods of every tone below


def amplitude(values):
    """Of the middle part of a tone."""
    return np.sqrt(2.0 * np.mean(values[MIDDLE] ** 2))


@pytest.mark.parametrize("frequency", [0.5, 3.0, 10.0, 15.0, 30.0, 60.0])
def test_the_response_is_that_of_the_formula(frequency):
    omega = 2 * np.pi * 15.0 / np.sqrt(np.sqrt(2.0) - 1.0)
    wanted = (1.0 + (2 * np.pi * frequency / omega) ** 2) ** -2
    found = amplitude(low_pass(np.sin(2 * np.pi * frequency * TIME), DT))
    assert found == pytest.approx(wanted, rel=2e-4)


def test_nothing_is_delayed():
    tone = np.sin(2 * np.pi * 5.0 * TIME)
    late = low_pass(tone, DT)[MIDDLE] @ np.cos(2 * np.pi * 5.0 * TIME[MIDDLE])
    assert abs(late) < 1e-6 * len(TIME)


def test_two_equal_poles_never_swing_beyond_a_step():
    step = (TIME > 3.0).astype(float)
    found = low_pass(step, DT)
    assert found.min() > -1e-9
    assert found.max() < 1.0 + 1e-9


@given(st.floats(-5.0, 5.0), st.floats(-2.0, 2.0), st.floats(1e-3, 0.05), st.integers(200, 400))
def test_a_level_and_a_slope_stay_as_they_are(level, slope, dt, length):
    line = level + slope * dt * np.arange(length)
    assert low_pass(line, dt) == pytest.approx(line, abs=1e-5 * abs(slope) + 1e-9)


def test_a_record_that_is_coarser_than_the_filter_stays_as_it_is():
    values = np.random.default_rng(0).standard_normal(50)
    assert np.array_equal(low_pass(values, 0.04), values)


@pytest.mark.parametrize("values", [np.zeros(9), np.r_[np.zeros(20), np.nan]])
def test_too_few_or_missing_values_are_refused(values):
    with pytest.raises(InputError, match="at least 10 finite samples"):
        low_pass(values, 0.01)
