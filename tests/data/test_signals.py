import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.data import signals
from errorscreen.exceptions import InputError

TIME = np.arange(300) / 60


def _noise(seed: int, size: int = 300) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=size)


@pytest.mark.parametrize("drift", [0.0, 0.5, -3.0])
def test_noise_ignores_slow_drift_and_spikes(drift):
    values = 1 + drift * TIME + 0.1 * drift * TIME**2 + 0.01 * _noise(1)
    values[[40, 170]] += 2.0
    assert signals.estimate_noise(TIME, values, (0, 5)) == pytest.approx(0.01, rel=0.15)


@given(st.floats(1e-3, 1e3), st.floats(-100, 100))
def test_noise_scales_with_the_unit_and_ignores_the_offset(scale, offset):
    values = 0.01 * _noise(2)
    plain, scaled = signals.scatter(TIME, values), signals.scatter(TIME, scale * values + offset)
    assert scaled == pytest.approx(scale * plain, rel=1e-6, abs=1e-12)


def test_noise_of_rounded_readings_is_the_rounding():
    rounded = np.where(TIME < 1, 0.62, np.round(0.6 + 0.1 * np.sin(TIME), 2))
    assert signals.estimate_noise(TIME, rounded, (0, 0.9)) == pytest.approx(0.01 / np.sqrt(12), rel=1e-6)


def test_noise_counts_toggling_of_the_last_digit():
    toggling = np.where(np.arange(300) % 4 == 0, 0.63, 0.62)
    assert signals.estimate_noise(TIME, toggling, (0, 5)) == pytest.approx(np.std(toggling), rel=0.02)


@given(st.floats(-1e6, 1e6))
def test_noise_is_never_zero(level):
    assert signals.estimate_noise(TIME, np.full(300, level), (0, 5)) > 0


def test_too_short_a_quiet_part_is_refused():
    with pytest.raises(InputError, match=r"4 readings in the quiet part .* Allowed: at least 5"):
        signals.estimate_noise(TIME, np.ones(300), (0, 3.5 / 60))


@given(st.integers(2, 6))
def test_held_readings_are_recognised_and_dropped(hold):
    fresh = _noise(3, 80)
    held = np.repeat(fresh, hold)
    assert signals.hold_length(held) == hold
    left = signals.drop_held(held, hold)
    np.testing.assert_array_equal(left[np.isfinite(left)], fresh)


def test_a_meter_read_slightly_faster_than_it_updates_is_held():
    updates = np.floor(np.arange(200) * 0.7).astype(int)
    assert signals.hold_length(_noise(4, 200)[updates]) == 2


def test_a_resting_channel_is_not_held():
    assert signals.hold_length(np.where(TIME < 2, 0.5, np.sin(TIME))) == 1
    assert signals.hold_length(np.nextafter(0.5, 0.5 + np.round(_noise(5)))) == 1  # moves by rounding alone
    assert signals.hold_length(np.round(np.where(TIME < 2, 0.5, 0.5 * np.exp(2 - TIME)), 3)) == 1
