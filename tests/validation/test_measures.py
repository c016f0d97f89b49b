"""Errors of a window by hand, and figures of responses whose formula is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.exceptions import InputError
from errorscreen.validation import recovery_time, step_figures, window_errors

TIME = np.arange(0.0, 20.0, 0.001)
AFTER = np.clip(TIME - 1.0, 0.0, None)


def test_errors_by_hand():
    found = window_errors([1.0, 2.0, 5.0, 9.0], [1.5, 2.0, 3.0, np.nan])
    # errors -0.5, 0, 2; the last one was not measured
    told = [found.ME, found.MAE, found.MXE]
    assert told == pytest.approx([0.5, 2.5 / 3, 2.0], abs=1e-12)


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=1, max_size=30))
def test_the_three_errors_are_in_order(pairs):
    simulated, measured = np.array(pairs).T
    found = window_errors(simulated, measured)
    assert abs(found.ME) <= found.MAE + 1e-12
    assert found.MAE <= found.MXE + 1e-12
    turned = window_errors(measured, simulated)
    told = [turned.ME, turned.MAE, turned.MXE]
    assert told == pytest.approx([-found.ME, found.MAE, found.MXE])


def test_a_lag_of_first_order():
    T, size = 0.7, -0.4
    y = 0.9 + size * (1 - np.exp(-AFTER / T))
    found = step_figures(TIME, y, 1.0)
    assert found.reaction == pytest.approx(-T * np.log(0.9), abs=2e-3)
    assert found.rise == pytest.approx(T * np.log(9.0), abs=2e-3)
    assert found.settling == pytest.approx(-T * np.log(0.05), abs=3e-3)
    assert found.overshoot == pytest.approx(0.0, abs=1e-6)
    assert found.steady == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("damping", [0.2, 0.5])
def test_an_overshoot_of_second_order(damping):
    natural = 6.0
    turning = natural * np.sqrt(1 - damping**2)
    decay = np.exp(-damping * natural * AFTER)
    y = 1.0 - decay * (np.cos(turning * AFTER) + damping * natural / turning * np.sin(turning * AFTER))
    found = step_figures(TIME, y, 1.0)
    assert found.overshoot == pytest.approx(np.exp(-np.pi * damping / np.sqrt(1 - damping**2)), rel=1e-3)


def test_what_does_not_get_there_is_no_number():
    found = step_figures(TIME, np.where(TIME < 1.0, 0.0, np.sin(3.0 * TIME) + 0.01 * TIME), 1.0)
    assert np.isnan(found.settling)
    assert np.isnan(recovery_time(TIME, np.full(len(TIME), 0.5), 1.0, 2.0))
    flat = step_figures(TIME, np.ones(len(TIME)), 1.0)
    assert np.isnan(flat.reaction)
    assert flat.steady == 1.0


def test_the_recovery_is_read_between_samples():
    coarse = np.arange(0.0, 5.0, 0.1)
    ramp = np.clip(coarse - 1.0, 0.0, 1.0)
    assert recovery_time(coarse, 0.8 * ramp, 0.8, 1.25) == pytest.approx(0.65, abs=1e-9)


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="shape"):
        window_errors([1.0], [1.0, 2.0])
    with pytest.raises(InputError, match="no value was measured"):
        window_errors([1.0], [np.nan])
    with pytest.raises(InputError, match="before and after"):
        step_figures(TIME, TIME, 50.0)
