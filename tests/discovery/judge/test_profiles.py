"""Intervals of thresholds, to which the response does not react where they are."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.result import Estimate
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.hypotheses import fit_hypothesis
from errorscreen.discovery.judge.profiles import profile, with_profiles
from errorscreen.discovery.judge.ranking import Cause
from errorscreen.events import Playback
from tests.plants import OPERATING_POINT, plant

NOISE = np.full(2, 2e-3)
TIME = np.arange(0.0, 5.0, 1 / 60)
#: the shallow dip does nothing, the deep one stops the plant
SHALLOW, DEEP = 0.8, 0.6


def fitted_with(name, own, voltage):
    """A plant with an effect at some values, fitted from the truth, and the effect."""
    event = Playback(TIME, "dips", 1.0, {"V": voltage, "angle": 0.0 * TIME}, OPERATING_POINT)
    model = plant("pv_plant", event).extend(name)
    effect = model.extensions[0]
    truth = np.concatenate([model.parameters.nominal[: -len(own)], own])
    y = model.simulate(truth).require_ok().values[0]
    y = y + NOISE[:, None] * np.random.default_rng(0).standard_normal(y.shape)
    problem = FitProblem(model, Observation(event, y, NOISE, model.channels, model.units))
    u = (truth - problem.space.nominal) / problem.space.scales
    return fit_hypothesis((effect,), problem, u), effect


def fitted(threshold):
    """A plant whose threshold lies between the two dips, and its cause."""
    voltage = np.where((TIME > 1) & (TIME < 1.3), SHALLOW, np.where((TIME > 2.5) & (TIME < 2.8), DEEP, 1.0))
    hypothesis, effect = fitted_with("cessation", [1.0, threshold, 0.05, 0.2, 0.2, 0.4], voltage)
    space, values = hypothesis.simulator.parameters, hypothesis.parameters_of(effect, 1.645)
    estimates = tuple(Estimate.of(space[effect.local(name)], *found) for name, found in values.items())
    return hypothesis, Cause("cessation", "", "effect", 0.9, "release", estimates, 1.0, True)


@pytest.mark.parametrize("threshold", [0.65, 0.7, 0.77])
def test_a_threshold_lies_between_the_dip_that_did_nothing_and_the_one_that_tripped(threshold):
    hypothesis, cause = fitted(threshold)
    (found,), _, count = with_profiles([cause], [hypothesis], hypothesis.observations)
    value, low, high = found.values["cessation.Vth"]
    assert low < value < high  # where in between, nothing tells
    # the clock of the timer begins to run 0.005 pu above the threshold
    assert low == pytest.approx(DEEP, abs=0.005)
    assert high == pytest.approx(SHALLOW - 0.005, abs=0.005)
    assert count > 0


def test_what_the_recording_tells_of_has_the_same_interval_in_both_ways():
    hypothesis, cause = fitted(0.7)
    for name in ("cessation.Tc", "cessation.Tramp"):
        value, low, high = cause.values[name]
        profiled_low, profiled_high, _ = profile(hypothesis, name, 1.645)
        assert profiled_low < value < profiled_high
        assert profiled_high - profiled_low == pytest.approx(high - low, rel=0.3)


def test_what_is_only_determined_together_goes_as_far_as_the_other_one_can_follow():
    """A step down tells the lower edge of a dead band, its centre less its half width, and nothing of the upper one."""
    edge = -0.02
    hypothesis, _ = fitted_with(
        "volt_var", [20.0, 0.03, 0.03 + edge, 1.0, 0.2, 0.05, 2.0], np.where(TIME > 1, 0.95, 1.0)
    )
    low, high, _ = profile(hypothesis, "volt_var.db", 1.645)
    assert low == pytest.approx(-edge / 2, abs=2e-3)  # narrower, and the plant begins on the upper slope
    assert high == pytest.approx(0.08, abs=2e-3)  # the end of its range


def test_an_improbable_cause_is_left_as_it_is():
    hypothesis, cause = fitted(0.7)
    unlikely = replace(cause, probability=0.01)
    assert with_profiles([unlikely], [hypothesis], hypothesis.observations) == ([unlikely], [hypothesis], 0)
