import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.data.resampling import compared_step, interpolate, uniform_grid
from errorscreen.exceptions import InputError

TIME = np.arange(100) * 0.02


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0.001, 0.039))
def test_a_straight_line_survives_any_fine_grid(slope, offset, step):
    grid = uniform_grid(TIME[0], TIME[-1], step)
    np.testing.assert_allclose(
        interpolate(TIME, slope * TIME + offset, grid), slope * grid + offset, atol=1e-12
    )


def test_irregular_samples_are_interpolated_linearly():
    time, values = np.array([0.0, 1.0, 1.5, 3.0, 4.0]), np.array([0.0, 2.0, 2.0, 5.0, 1.0])
    assert interpolate(time, values, np.array([0.5, 1.2, 2.25, 3.5])).tolist() == [1.0, 2.0, 3.5, 3.0]


def test_readings_that_are_nearly_all_holes_are_not_filtered():
    time = np.r_[TIME, 1e8]
    with pytest.raises(InputError, match=r"only 101 samples lie between 0 and 1e\+08 s.*a longer step"):
        interpolate(time, time, np.arange(10) * 0.1)


def test_a_grid_that_no_memory_could_hold_is_refused():
    assert len(uniform_grid(0.0, 6.0, 6e-6)) == 1_000_001
    with pytest.raises(InputError, match=r"6 s in steps of 1e-09 s are 6e\+09 steps.*at most 1e\+06"):
        uniform_grid(0.0, 6.0, 1e-9)


@given(st.floats(1e-5, 1.0), st.sampled_from([50.0, 60.0]))
def test_simulations_are_compared_at_readings_and_no_finer_than_they_need(distance, f_nominal):
    step = compared_step(np.arange(10_000) * distance, f_nominal)
    assert step / distance == pytest.approx(round(step / distance))
    assert step == pytest.approx(distance) or 0.75 <= step * 4 * f_nominal <= 1 + 1e-5
    assert step <= max(distance, 0.25 / f_nominal) * (1 + 1e-5)


def test_a_record_of_milliseconds_keeps_instants_to_compare():
    time = np.arange(300) * 1e-6
    assert compared_step(time, 50.0) <= time[-1] / 9


def test_its_own_grid_changes_nothing():
    values = np.random.default_rng(0).normal(size=100)
    values[[0, 30, 31, 99]] = np.nan
    inner = np.isfinite(values)
    out = interpolate(TIME, values, TIME)
    np.testing.assert_array_equal(out[inner], values[inner])
    assert np.isnan(out[[0, 99]]).all()


def test_short_gaps_are_bridged_and_long_ones_stay():
    values = TIME.copy()
    values[10:13] = np.nan
    values[40:60] = np.nan
    out = interpolate(TIME, values, TIME)
    np.testing.assert_allclose(out[10:13], TIME[10:13])
    assert np.isnan(out[40:60]).all()
    assert np.isfinite(np.delete(out, np.arange(40, 60))).all()
    assert np.isfinite(interpolate(TIME, values, TIME, max_gap=1.0)).all()
    assert np.isnan(interpolate(TIME, values, TIME, max_gap=0.03)[10:13]).all()


def test_a_coarse_grid_does_not_alias():
    # 24 Hz sampled at 12.5 Hz would show as 1 Hz of the same size
    fast, slow = np.sin(2 * np.pi * 24 * TIME), np.sin(2 * np.pi * 0.5 * TIME)
    grid = uniform_grid(0, TIME[-1], 0.08)
    out = interpolate(TIME, fast + slow, grid)[3:-3]
    np.testing.assert_allclose(out, np.sin(2 * np.pi * 0.5 * grid)[3:-3], atol=0.05)


def test_the_low_pass_does_not_delay_or_overshoot():
    values = np.where(TIME < 1.0, 1.0, 0.0)
    out = interpolate(TIME, values, uniform_grid(0, TIME[-1], 0.1))
    assert out.min() >= 0
    assert out.max() <= 1
    assert out[9] > 0.9
    assert out[11] < 0.1


def test_an_empty_channel_stays_empty():
    assert np.isnan(interpolate(TIME, np.full(100, np.nan), TIME)).all()


@pytest.mark.parametrize("step", [0.0, -0.1, np.nan, np.inf, 5.0])
def test_a_useless_step_is_refused(step):
    with pytest.raises(InputError, match=r"dt: .*Allowed"):
        uniform_grid(0.0, 1.0, step)
