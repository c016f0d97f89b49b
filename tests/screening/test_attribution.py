import numpy as np
import pytest
from sklearn.exceptions import NotFittedError
from sklearn.frozen import FrozenEstimator

from errorscreen.calibration import MAPCalibrator
from errorscreen.exceptions import InputError
from errorscreen.screening import AttributionScreener
from tests.toys import linear, oscillator

MATRIX = np.random.default_rng(0).standard_normal((200, 4)) * [1.0, 3.0, 0.5, 2.0]


def test_a_well_determined_fit_gives_the_true_label():
    simulator = linear(MATRIX, half_range=5.0)
    recording = simulator.record({"p0": 2.0, "p3": 0.6}, 1e-3, seed=0)
    screener = AttributionScreener(simulator, random_state=0).fit(recording)
    deviation = (
        np.abs(np.array([2.0, 1.0, 1.0, 0.6]) - simulator.parameters.nominal) / simulator.parameters.scales
    )
    sensitivity = np.linalg.norm(MATRIX, axis=0) * simulator.parameters.scales
    expected = deviation * sensitivity * np.sqrt(recording.event.dt)
    np.testing.assert_allclose(screener.contributions_, expected, atol=2e-3 * expected.max())
    assert screener.n_simulations_ == screener.calibrator_.n_simulations_ + 64 * 5


def test_what_is_not_determined_may_have_moved():
    # only the sum of the first two is seen: both may carry the error, and neither is certain
    matrix = MATRIX.copy()
    matrix[:, 1] = matrix[:, 0]
    simulator = linear(matrix, half_range=5.0)
    recording = simulator.record({"p0": 1.5, "p1": 0.5}, 0.01, seed=1)
    screener = AttributionScreener(simulator, random_state=0).fit(recording)
    point = screener.calibrator_.theta_
    assert np.abs(point[:2] - 1).max() < 0.05  # the fit sees nothing
    assert screener.ranking_[:2].tolist() in ([0, 1], [1, 0])
    chance = screener.inclusion_probability(1)
    assert chance.sum() == pytest.approx(1.0)
    assert np.all(chance[:2] > 0.2)


def test_several_recordings_are_averaged_and_seeds_repeat():
    simulator = oscillator()
    recordings = [simulator.record({"omega": 7.0}, 0.01, seed=s) for s in (0, 1)]
    first, second = (
        AttributionScreener(simulator, MAPCalibrator(simulator, n_starts=1), n_samples=8, random_state=3).fit(
            recordings
        )
        for _ in range(2)
    )
    assert np.array_equal(first.contributions_, second.contributions_)
    assert first.samples_.shape == (8, len(simulator.parameters))


def test_a_fit_of_something_else_is_refused():
    simulator = oscillator()
    recording = simulator.record({"omega": 7.0}, 0.01, seed=0)
    part = MAPCalibrator(simulator, ["omega"], n_starts=1).fit(recording)
    with pytest.raises(InputError, match="the calibrator fitted omega"):
        AttributionScreener(simulator, FrozenEstimator(part)).fit(recording)
    whole = MAPCalibrator(simulator, n_starts=1).fit(recording)
    found = AttributionScreener(simulator, FrozenEstimator(whole), n_samples=8, random_state=0).fit(recording)
    assert found.calibrator_.theta_ is whole.theta_


def test_bad_input():
    simulator = oscillator()
    with pytest.raises(NotFittedError):
        AttributionScreener(simulator).inclusion_probability(1)
    recording = simulator.record({}, 0.01, seed=0)
    with pytest.raises(InputError, match="n_samples"):
        AttributionScreener(simulator, n_samples=0).fit(recording)
