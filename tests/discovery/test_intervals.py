"""Intervals of thresholds, to which the response does not react where they are."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.hypotheses import fit_hypothesis
from errorscreen.discovery.intervals import profile, with_profiles
from errorscreen.discovery.ranking import Cause
from errorscreen.events import Playback
from errorscreen.observations import Observation
from tests.plants import OPERATING_POINT, plant

NOISE = np.full(2, 2e-3)
#: the shallow dip does nothing, the deep one stops the plant
SHALLOW, DEEP = 0.8, 0.6


def fitted(threshold):
    """A plant whose threshold lies between the two dips, fitted from the truth, and its cause."""
    time = np.arange(0.0, 5.0, 1 / 60)
    voltage = np.where((time > 1) & (time < 1.3), SHALLOW, np.where((time > 2.5) & (time < 2.8), DEEP, 1.0))
    event = Playback(time, "two dips", 1.0, {"V": voltage, "angle": 0.0 * time}, OPERATING_POINT)
    model = plant("pv_plant", event).extend("cessation")
    effect = model.extensions[0]
    truth = np.concatenate([model.parameters.nominal[:-6], [1.0, threshold, 0.05, 0.2, 0.2, 0.4]])
    y = model.simulate(truth).require_ok().values[0]
    y = y + NOISE[:, None] * np.random.default_rng(0).standard_normal(y.shape)
    problem = FitProblem(model, Observation(event, y, NOISE, model.channels, model.units))
    u = (truth - problem.space.nominal) / problem.space.scales
    hypothesis = fit_hypothesis((effect,), problem, u)
    values = {effect.local(name): found for name, found in hypothesis.parameters_of(effect, 1.645).items()}
    return hypothesis, Cause("cessation", "", "effect", 0.9, "release", values, 1.0, True)


@pytest.mark.parametrize("threshold", [0.65, 0.7, 0.77])
def test_a_threshold_lies_between_the_dip_that_did_nothing_and_the_one_that_tripped(threshold):
    hypothesis, cause = fitted(threshold)
    (found,), count = with_profiles([cause], [hypothesis])
    value, low, high = found.parameters["cessation.Vth"]
    assert value == pytest.approx(threshold, abs=0.03)
    # the clock of the timer begins to run 0.005 pu above the threshold
    assert low == pytest.approx(DEEP, abs=0.005)
    assert high == pytest.approx(SHALLOW - 0.005, abs=0.005)
    assert count > 0


def test_what_the_recording_tells_of_has_the_same_interval_in_both_ways():
    hypothesis, cause = fitted(0.7)
    for name in ("cessation.Tc", "cessation.Tramp"):
        value, low, high = cause.parameters[name]
        profiled_low, profiled_high, _ = profile(hypothesis, name, 1.645)
        assert profiled_low < value < profiled_high
        assert profiled_high - profiled_low == pytest.approx(high - low, rel=0.3)


def test_an_improbable_cause_is_left_as_it_is():
    hypothesis, cause = fitted(0.7)
    unlikely = replace(cause, probability=0.01)
    assert with_profiles([unlikely], [hypothesis]) == ([unlikely], 0)
