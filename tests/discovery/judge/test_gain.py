"""Gain on held-out events: identity, right extension, wrong extension, failure."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from errorscreen.data.observations import Observation
from errorscreen.discovery import measure_gain
from errorscreen.events import InputSignal
from errorscreen.exceptions import InputError
from errorscreen.parameters import Parameter
from errorscreen.simulators import CallableSimulator
from tests.plants import dip, plant

NOISE = np.array([2e-3, 2e-3])


@pytest.fixture(scope="module")
def case():
    """Old model, the true one with an exciter, a wrong one, and two recordings that none was fitted to."""
    old = plant("synchronous_machine", dip(stop=5.0))
    true, wrong = old.extend("exciter"), old.extend("scale_Q", a={"nominal": 0.1})
    rng = np.random.default_rng(0)
    recordings = []
    for depth, duration in ((0.3, 0.2), (0.2, 0.4)):
        event = dip(depth=depth, duration=duration, stop=5.0)
        y = true.simulate(true.parameters.nominal, event).values[0]
        noisy = y + NOISE[:, None] * rng.standard_normal(y.shape)
        recordings.append(Observation(event, noisy, NOISE, old.channels, old.units))
    return old, true, wrong, recordings


def test_no_change_is_no_gain(case):
    old, _, _, recordings = case
    gain = measure_gain(old, old, recordings)
    assert gain.gain == 0
    assert gain.interval == (0, 0)
    assert not gain.holds


def test_the_right_extension_leaves_noise(case):
    old, true, wrong, recordings = case
    gain = measure_gain(old, true, recordings, placebo=wrong)
    assert gain.extended == pytest.approx(1.0, abs=0.1)
    assert gain.recalibrated > 3
    assert gain.gain == pytest.approx(1 - (gain.extended / gain.recalibrated) ** 2)
    low, high = gain.interval
    assert 0.5 < low <= gain.gain <= high < 1
    assert gain.placebo < 0.2
    assert gain.holds
    assert [e.recording for e in gain.events] == ["dip", "dip"]


def test_a_wrong_extension_does_not_hold(case):
    old, _, wrong, recordings = case
    gain = measure_gain(old, wrong, recordings, placebo=old)
    assert gain.gain < 0
    assert not gain.holds


def test_a_model_that_fails_gains_nothing(case):
    old, _, _, recordings = case
    # a rotor without inertia diverges at this step
    space = old.parameters.replace({"Tj": {"lower": 1e-6, "nominal": 1e-6, "scale": 9.0}})
    broken = plant("synchronous_machine", dip(stop=5.0), parameters=space)
    gain = measure_gain(old, broken, recordings)
    assert gain.gain == -np.inf
    assert not gain.holds


def test_what_only_the_extended_model_can_simulate_is_a_gain(case):
    old, true, wrong, recordings = case
    space = old.parameters.replace({"Tj": {"lower": 1e-6, "nominal": 1e-6, "scale": 9.0}})
    broken = plant("synchronous_machine", dip(stop=5.0), parameters=space)
    gain = measure_gain(old, true, recordings, recalibrated=broken, placebo=wrong)
    assert gain.gain == 1
    assert gain.interval == (1, 1)
    assert gain.recalibrated == np.inf
    assert gain.holds  # a placebo tells nothing there


def test_an_event_that_the_old_model_cannot_simulate_is_left_out(case, monkeypatch):
    old, true, wrong, recordings = case
    more = [*recordings, replace(recordings[0], event=replace(recordings[0].event, name="too much"))]
    simulate = type(old).simulate

    def fails(self, theta, event=None):
        found = simulate(self, theta, event)
        if event.name == "too much" and not self.extensions:
            return replace(found, values=np.full_like(found.values, np.nan))
        return found

    expected = measure_gain(old, true, recordings, placebo=wrong)
    monkeypatch.setattr(type(old), "simulate", fails)
    gain = measure_gain(old, true, more, placebo=wrong)
    assert (gain.gain, gain.interval, gain.placebo) == (expected.gain, expected.interval, expected.placebo)
    assert gain.events[2].recalibrated == np.inf


@pytest.mark.parametrize(("dt", "samples"), [(0.01, 400), (0.002, 200), (4.0, 250)])
def test_smooth_errors_without_gain_seldom_look_like_one(dt, samples):
    """Errors of both models of the same size, smooth over ten samples: one 90 % interval in twenty should lie above 0.

    One record tells little of its own scatter, so there are about twice as many; with blocks of half a second there
    were eight times as many where the record is short or slow.
    """
    event = InputSignal(dt * np.arange(samples), "record", 0.0)
    seen = Observation(event, np.zeros((1, samples)), np.ones(1), ("y",), ("1",))
    rng, above = np.random.default_rng(0), 0
    for _ in range(40):
        old, new = (lfilter([1.0], [1.0, -0.9], rng.standard_normal(samples + 100))[100:] for _ in range(2))
        models = [
            CallableSimulator(
                lambda theta, event, y=y: y, [Parameter("a", 1.0, 0.5, 2.0)], event, outputs={"y": "1"}
            )
            for y in (old, new)
        ]
        above += measure_gain(*models, seen).interval[0] > 0
    assert above <= 8


@pytest.mark.parametrize("part", [slice(198, None), slice(None, 2)], ids=["last", "first"])
def test_the_interval_holds_the_gain_where_the_errors_lie_at_one_end(part):
    """The old model is wrong all over, smoothly, the extended one in the hundredth that blocks inside seldom reach."""
    event = InputSignal(0.1 * np.arange(200), "record", 0.0)
    old = 10.0 * np.sin(np.linspace(0.0, 3.0, 200)) + 5.0
    new = np.zeros(200)
    new[part] = 25.0
    models = [
        CallableSimulator(
            lambda theta, event, y=y: y, [Parameter("a", 1.0, 0.5, 2.0)], event, outputs={"y": "1"}
        )
        for y in (old, new)
    ]
    seen = Observation(event, np.zeros((1, 200)), np.ones(1), ("y",), ("1",))
    found = measure_gain(*models, seen)
    assert found.interval[0] < found.gain < found.interval[1]
    assert found.gain == pytest.approx(1.0 - np.sum(new**2) / np.sum(old**2))


def test_bad_arguments_are_refused(case):
    old, true, _, recordings = case
    with pytest.raises(InputError, match="list of recordings is empty"):
        measure_gain(old, true, [])
    with pytest.raises(InputError, match="level"):
        measure_gain(old, true, recordings, level=90)


def test_the_old_model_is_recalibrated_and_a_placebo_fitted_on_what_the_extension_was_fitted_to(case):
    old, true, _, recordings = case
    wrong = old.with_nominal(1.2 * old.parameters.nominal)
    gain, again = (
        measure_gain(wrong, true, recordings[1], fitted=recordings[0], random_state=3) for _ in range(2)
    )
    assert gain == again
    assert gain.recalibrated < gain.baseline
    assert gain.extended == pytest.approx(1.0, abs=0.1)
    assert gain.placebo_parameters == gain.extension_parameters == 4
    assert gain.placebo < gain.gain
    assert gain.holds


def test_without_what_was_fitted_the_old_model_counts_as_calibrated(case):
    old, true, _, recordings = case
    gain = measure_gain(old, true, recordings)
    assert gain.baseline == gain.recalibrated
    assert gain.placebo is None


def test_a_smaller_step_is_no_gain(case):
    old, _, _, recordings = case
    gain = measure_gain(old, old.with_step(old.step / 8), recordings)
    assert (gain.gain, gain.holds) == (0.0, False)
