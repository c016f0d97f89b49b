import numpy as np
import pytest

from errorscreen.exceptions import InputError, SimulationError
from errorscreen.screening import IdentifiabilityScreener, SensitivityScreener
from tests.toys import linear, oscillator


def test_what_looks_like_a_stronger_parameter_comes_last():
    # p1 moves the response almost as p0 does, p2 is weak but moves it differently
    rng = np.random.default_rng(0)
    first, third = rng.standard_normal((2, 30))
    matrix = np.stack([3 * first, 2.9 * first + 0.01 * rng.standard_normal(30), 0.3 * third], axis=1)
    simulator = linear(matrix)
    recording = simulator.record({}, 0.1, seed=0)
    assert SensitivityScreener(simulator).fit(recording).ranking_.tolist() == [0, 1, 2]
    found = IdentifiabilityScreener(simulator).fit(recording)
    assert found.ranking_.tolist() == [0, 2, 1]
    assert found.n_simulations_ == 1 + 2 * 3


def test_contributions_are_those_of_gram_and_schmidt():
    matrix = np.random.default_rng(1).standard_normal((30, 5)) * [5.0, 4.0, 3.0, 2.0, 1.0]
    simulator = linear(matrix)
    found = IdentifiabilityScreener(simulator).fit(simulator.record({}, 0.2, seed=0))
    rest = matrix * simulator.parameters.scales / 0.2
    expected, order = np.zeros(5), []
    for _ in range(5):
        j = int(np.argmax(np.linalg.norm(rest, axis=0)))
        expected[j] = np.linalg.norm(rest[:, j])
        order.append(j)
        direction = rest[:, j] / expected[j]
        rest = rest - np.outer(direction, direction @ rest)
    assert found.ranking_.tolist() == order
    np.testing.assert_allclose(found.contributions_, expected, rtol=1e-6)


def test_more_parameters_than_samples_are_all_ranked():
    simulator = linear(np.random.default_rng(2).standard_normal((3, 5)))
    found = IdentifiabilityScreener(simulator).fit(simulator.record({}, 0.1, seed=0))
    assert sorted(found.ranking_) == list(range(5))
    assert np.sum(found.contributions_ > 0) == 3


def test_bad_step_and_failed_baseline():
    simulator = oscillator()
    recording = simulator.record({}, 0.01, seed=0)
    with pytest.raises(InputError, match="step"):
        IdentifiabilityScreener(simulator, step=0).fit(recording)
    failing = oscillator(fail_above=0.0)
    with pytest.raises(SimulationError):
        IdentifiabilityScreener(failing).fit(recording)
