"""Intervals hold what they promise, on a plant with noise in all recorded signals, also in the injected ones."""

import numpy as np
import pytest

from errorscreen.calibration import MAPCalibrator
from errorscreen.cases.demo import demo_recordings
from errorscreen.simulators import PlantSimulator

DRAWS = 20


@pytest.mark.slow
def test_coverage_of_the_intervals_on_a_machine():
    """90 % intervals of eight parameters, 20 blind draws.

    The eight of one draw share its noise, so the draws are what counts: the share of a draw has a standard deviation of
    at most sqrt(0.9 * 0.1) = 0.3, the mean of 20 of at most 0.07. The lower limit is little more than one of them below
    0.9, because an interval that holds less than 0.82 would mislead.
    """
    shares, chi2 = [], []
    for seed in range(500, 500 + DRAWS):
        recording, _, truth = demo_recordings(seed)
        simulator = PlantSimulator("synchronous_machine", recording)
        fit = MAPCalibrator(simulator, n_starts=3, library_size=256, random_state=0).fit(recording)
        low, high = fit.intervals_.T
        values = np.array([truth[name] for name in fit.names_])
        shares.append(np.mean((low <= values) & (values <= high)))
        chi2.append(fit.chi2_per_sample_)
    assert 0.82 <= np.mean(shares) <= 0.98
    assert 0.9 < np.mean(chi2) < 1.1
