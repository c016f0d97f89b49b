"""Noise of injected signals as it passes through a model with its effects."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.hypotheses import JointFit
from errorscreen.discovery.judge.own_noise import own_noise, refitted
from tests.plants import dip, plant

NOISE_OF_V, NOISE = 5e-3, 1e-3


@pytest.fixture(scope="module")
def lagged():
    """What was measured of a plant whose active power is recorded behind a lag, and a fit with that."""
    event = replace(dip(), noise={"V": NOISE_OF_V})
    simulator = plant("pv_plant", event).extend("lag_P")
    theta = simulator.parameters.nominal
    theta[simulator.parameters.index("lag_P.T")] = 0.1
    rng = np.random.default_rng(3)
    response = simulator.simulate(theta).values[0]
    V = event.signals["V"] + NOISE_OF_V * rng.standard_normal(len(event.time))
    seen = replace(event, signals={**event.signals, "V": V})
    # before anything is known of the lag, the noise of P is what the model without it makes of that of the voltage
    noise = np.hypot(NOISE, [NOISE_OF_V, NOISE_OF_V])
    values = response + NOISE * rng.standard_normal(response.shape)
    measured = [Observation(seen, values, noise, simulator.channels, simulator.units)]
    problem = FitProblem(simulator, measured)
    u = (theta - simulator.parameters.nominal) / simulator.parameters.scales
    return measured, JointFit(simulator.extensions, problem, u).run(3).hypothesis()


def test_what_passes_less_is_subtracted_once(lagged):
    measured, hypothesis = lagged
    once = own_noise(hypothesis, hypothesis.simulator, measured)
    assert once[0].noise[0] < 0.9 * measured[0].noise[0]
    again = replace(hypothesis, observations=tuple(once))
    np.testing.assert_array_equal(own_noise(again, again.simulator, measured)[0].noise, once[0].noise)


def test_a_fit_that_has_its_own_noise_keeps_it_when_it_is_fitted_again(lagged):
    measured, hypothesis = lagged
    known = own_noise(hypothesis, hypothesis.simulator, measured)
    problem = FitProblem(hypothesis.simulator, known, hypothesis.names)
    fitted = JointFit(hypothesis.effects, problem, hypothesis.u).run(6).hypothesis()
    final, others, count = refitted(fitted, measured)
    assert final.chi2_per_sample == pytest.approx(fitted.chi2_per_sample, rel=0.1)
    np.testing.assert_allclose(final.observations[0].noise, known[0].noise, rtol=0.05)
    assert others.shape[1] == len(final.u)
    assert count > 256
