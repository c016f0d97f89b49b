"""Starts of events whose instants are known from how the signals are made up here."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.data import Recording, moves
from errorscreen.exceptions import DataWarning, InputError

TIME = np.arange(300) / 60


def _noise(seed: int, size: int = 300) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=size)


@given(st.integers(30, 270), st.floats(0.02, 0.5), st.booleans(), st.integers(0, 20))
def test_a_step_is_found_at_its_sample(start, size, down, seed):
    values = 1 + 1e-3 * _noise(seed)
    values[start:] += -size if down else size
    assert moves.detect_event(TIME, {"V": values}) == TIME[start]


def test_correlated_noise_is_no_event():
    for seed in range(100):
        noise = np.convolve(_noise(seed, 304), np.ones(5) / np.sqrt(5), "valid")
        values = np.where(TIME < 1, 1.0, 0.8) + 0.006 * noise  # 30 dB
        assert moves.detect_event(TIME, {"V": values}) == 1.0


def test_the_earliest_channel_sets_the_event():
    early, late = np.where(TIME < 1, 1.0, 0.7), np.where(TIME < 2, 0.5, 0.2)
    assert moves.detect_event(TIME, {"P": late, "V": early}) == 1.0


def test_one_spike_and_a_slow_drift_are_no_event():
    values = 1 + 0.001 * TIME + 1e-3 * _noise(5)
    values[50] = 1.5
    with pytest.raises(InputError, match="no event was found: V never leaves its quiet band"):
        moves.detect_event(TIME, {"V": values})
    values[200:] -= 0.3
    assert moves.detect_event(TIME, {"V": values}) == TIME[200]


def test_what_moves_less_than_least_is_no_event():
    values = np.where(TIME < 1, 0.620, 0.621)
    assert moves.detect_event(TIME, {"P": values}) == 1.0
    with pytest.raises(InputError, match="no event"):
        moves.detect_event(TIME, {"P": values}, least=0.002)


@pytest.mark.parametrize("rate", [1.0, 3.0, 7.0])
@pytest.mark.parametrize("phase", [0.0, 0.5, 1.0, 1.5])
def test_a_recording_that_starts_within_the_event_is_refused(rate, phase):
    with pytest.raises(InputError, match="moves from its first reading on"):
        moves.detect_event(TIME, {"P": np.cos(rate * TIME + phase) * np.exp(-TIME)})


@pytest.mark.parametrize("before", [1, 2, 3, 4])
def test_too_few_readings_before_a_clear_event_are_called_so(before):
    values = 1 + 1e-3 * _noise(6)
    values[before:] -= 0.5 * np.exp(-TIME[: len(TIME) - before])
    with pytest.raises(InputError, match="no quiet part: 'V' moves from its first reading on"):
        moves.detect_event(TIME, {"V": values}, least=0.002)


@given(st.integers(0, 1000))
def test_noise_alone_is_no_event_and_has_a_quiet_part(seed):
    with pytest.raises(InputError, match="no event was found"):
        moves.detect_event(TIME, {"V": 1 + 1e-3 * _noise(seed)})


FIFTY = np.arange(0, 40, 0.02)


def _fault(before, seed, time=FIFTY, at=15.0):
    """A dip of 0.3 pu at 15 s and swings; `before` adds to P, half of it to Q, and 15 % of it to V."""
    rng = np.random.default_rng(seed)
    on, since = time >= at - 1e-9, np.maximum(time - at, 0.0)
    fault = on & (since < 0.1)
    more = before(time) if before else np.zeros(len(time))
    dip, swing = np.where(fault, -0.3, on * -0.04 * np.exp(-since / 2)), 0.15 * np.exp(-since / 2)
    values = {
        "V": 1.0 + dip + 0.15 * more,
        "P": 0.8 + np.where(fault, -0.25, on * swing * np.sin(7 * since)) + more,
        "Q": 0.1 + np.where(fault, 0.3, on * 0.4 * swing) + 0.5 * more,
    }
    return {
        name: x + (2e-4 if name == "V" else 1e-3) * rng.normal(size=len(time)) for name, x in values.items()
    }


def _after(start, shape):
    return lambda t: np.where(t >= start, shape(np.maximum(t - start, 0.0)), 0.0)


@pytest.mark.parametrize(
    ("before", "right", "why"),
    [
        (None, 15.0, "nothing"),
        (lambda t: 0.015 * np.sin(np.pi * t), 15.0, "a forced oscillation of 0.5 Hz"),
        (lambda t: 0.1 * np.sin(np.pi * t), 15.0, "one of 40 % of the fault"),
        (lambda t: 0.1 * np.cos(0.2 * np.pi * t), 15.0, "one of 0.1 Hz that begins at its crest"),
        (lambda t: 0.05 * np.sin(4 * np.pi * t), 15.0, "one of 2 Hz"),
        (lambda t: (t < 15) * 0.1 * np.exp((t - 15) / 5) * np.sin(np.pi * t), 15.0, "one that grows"),
        (lambda t: (t < 15) * 0.1 * np.exp((t - 15) / 3) * np.cos(3 * np.pi * t), 15.0, "one that grows fast"),
        (lambda t: 0.1 * np.clip(t / 15, 0, 1), 15.0, "a ramp from the first reading on"),
        (_after(5.0, lambda s: 0.1 * np.clip(s / 10, 0, 1)), 15.0, "a ramp up to the fault"),
        (_after(8.0, lambda s: 0.2 * np.clip(s / 4, 0, 1)), 15.0, "a ramp that ends before the fault"),
        (_after(8.0, lambda s: np.full_like(s, -0.025)), 15.0, "a step of a tenth"),
        (_after(8.0, lambda s: np.full_like(s, -0.08)), 8.0, "a step of a third"),
        (_after(8.0, lambda s: -0.1 * np.sin(np.pi * s) * np.exp(-s / 3)), 8.0, "a swing from rest"),
        (lambda t: (abs(t - 7) < 0.3) * 0.015 * _noise(3, len(t)), 15.0, "a burst of noise"),
        (lambda t: 0.5 * (np.arange(len(t)) % 97 == 3), 15.0, "single wild readings"),
    ],
)  # fmt: skip
def test_the_event_is_the_disturbance_and_not_what_precedes_it(before, right, why):
    for seed in range(4):
        values = _fault(before, seed)
        found = moves.detect_event(FIFTY, values, least=0.002)
        # a swing from rest leaves the noise after some readings
        assert found == pytest.approx(right, abs=0.1 if "swing" in why else 0.021), (why, seed)


@pytest.mark.parametrize("rate", [10, 200, 1000])
def test_an_oscillation_before_the_event_at_other_rates(rate):
    time = np.arange(0, 20, 1 / rate)
    values = _fault(lambda t: 0.05 * np.sin(np.pi * t), 0, time, at=12.0)
    values["V"] -= 0.3 * (time >= 12.0)  # at 10 a second, the dip is one reading
    assert moves.detect_event(time, values, least=0.002) == pytest.approx(12.0, abs=1.01 / rate)


def test_a_stated_event_behind_an_oscillation_is_taken_with_a_warning():
    values = _fault(lambda t: 0.1 * np.sin(np.pi * t), 0)
    with pytest.warns(DataWarning, match=r"[VPQ] moves from .* of its largest excursion, before the event"):
        rec = Recording.from_arrays(FIFTY, values, base_mva=1, f_nominal=50, event_time=15.0)
    assert rec.event_time == 15.0
    step = _fault(_after(8.0, lambda s: np.full_like(s, -0.08)), 0)
    with pytest.raises(InputError, match="moves from 8 s on, before the stated event at 15 s"):
        Recording.from_arrays(FIFTY, step, base_mva=1, f_nominal=50, event_time=15.0)


def test_a_slow_event_without_a_sudden_one_counts():
    values = {"P": 0.8 + _after(15.0, lambda s: 0.2 * (1 - np.exp(-s / 4)))(FIFTY) + 1e-3 * _noise(0, 2000)}
    assert moves.detect_event(FIFTY, values) == pytest.approx(15.0, abs=0.4)


def test_a_slow_event_before_a_switching_in_another_channel_counts():
    """A unit follows the frequency from 15 s on; a capacitor is switched at 30 s."""
    rise = _after(15.0, lambda s: 0.2 * (1 - np.exp(-s / 4)))(FIFTY)
    values = {
        "P": 0.8 + rise + 1e-4 * _noise(0, 2000),
        "V": 1 + 0.01 * (FIFTY >= 30) + 1e-4 * _noise(1, 2000),
    }
    assert moves.detect_event(FIFTY, values) == pytest.approx(15.0, abs=0.4)
