"""The noise of what is injected does not bias a fit."""

from functools import cache

import numpy as np
import pytest

from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.calibration import MAPCalibrator
from errorscreen.calibration.attenuation import bias_corrected, noise_slope
from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.search import BoundedSearch
from errorscreen.data.observations import Observation
from tests.simulators.models import oscillator


def searched(problem, start):
    """Search from one start to its end."""
    search = BoundedSearch(
        lambda u: problem.residuals(problem.values(u)), *problem.scaled_bounds, prior=0.3, tol=1e-2, step=1e-4
    )
    search.begin(start)
    while search.iterate():
        pass
    return search


@cache
def noisy(seed, noise_db=20.0):
    """A machine whose parameters deviate, nothing else, seen through noise."""
    return draw_plant_scenario(seed, noise_db, kind="nothing", device="synchronous_machine")


def distance(hidden, u, jacobian, problem):
    """Of fitted from hidden parameters in standard deviations: in the mean square one for each parameter."""
    true = (hidden.theta - problem.space.nominal) / problem.space.scales
    precision = jacobian.T @ jacobian + np.eye(len(u)) / 0.3**2
    return float(np.sqrt((u - true) @ precision @ (u - true)))


def test_fits_come_as_near_to_hidden_parameters_as_the_linear_model_says():
    """Noise of 20 dB, six draws of parameters and noise; least squares alone ends three times as far away."""
    found = []
    for seed in range(6):
        hidden = noisy(seed)
        problem = FitProblem(hidden.simulator, list(hidden.recordings))
        search = searched(problem, (hidden.theta - problem.space.nominal) / problem.space.scales)
        pair = [bias_corrected(search, problem).best, search.best]  # both with a Jacobian now
        found.append([distance(hidden, track.u, track.jacobian, problem) for track in pair])
    without, biased = np.sqrt(np.mean(np.square(found), axis=0) / len(problem.names))
    assert without < 1.5  # six draws of eight parameters: 1.0 give or take a tenth
    assert biased > 2.5


def test_a_calibrator_is_not_biased():
    hidden = noisy(11)
    options = {"n_starts": 1, "starts": hidden.theta}
    fit = MAPCalibrator(hidden.simulator, **options).fit(list(hidden.recordings))
    error = np.linalg.solve(np.linalg.cholesky(fit.covariance_), fit.theta_ - hidden.theta)
    assert np.sqrt(np.mean(error**2)) < 2.0
    assert fit.chi2_per_sample_ == pytest.approx(1.0, abs=0.15)


def test_the_slope_is_that_of_the_energy():
    hidden = noisy(3)
    problem = FitProblem(hidden.simulator, list(hidden.recordings))
    u = np.full(len(problem.names), 0.05)
    slope, energy = noise_slope(problem, u)
    j = problem.names.index("Xd1")  # with a larger reactance less noise passes
    assert slope[j] < 0
    moved = u + 0.02 * np.eye(len(u))[j]
    assert noise_slope(problem, moved)[1] - energy == pytest.approx(0.02 * slope[j], rel=0.3)


def test_the_energy_grows_with_the_variance_of_the_noise():
    """At 40 dB the injected noise is a tenth of that at 20 dB, and so is that of the channels."""
    energies = []
    for noise_db in (20.0, 40.0):
        hidden = noisy(5, noise_db)
        observation = hidden.recordings[0]
        simulator = hidden.simulator
        energy = simulator.propagated_noise(observation, simulator.parameters.nominal[None])
        energies.append(energy.mean(axis=0)[0] * observation.noise**2)
    np.testing.assert_allclose(energies[0], 100 * energies[1], rtol=0.3)


def test_without_injected_noise_a_fit_stays_where_it_is():
    simulator = oscillator()
    y = simulator.simulate(simulator.parameters.nominal * 1.1).values[0]
    y = y + 0.05 * np.random.default_rng(0).standard_normal(y.shape)
    problem = FitProblem(simulator, Observation(simulator.event, y, np.array([0.05]), ("position",), ("m",)))
    search = searched(problem, np.zeros(len(problem.names)))
    assert not problem.passes_noise
    np.testing.assert_array_equal(bias_corrected(search, problem).best.u, search.best.u)


def corrected_objective(problem, u):
    """(K1)."""
    z = problem.residuals(problem.values(u))[0]
    return float(z @ z - noise_slope(problem, u)[1] + (u @ u) / 0.3**2)


@pytest.mark.parametrize("seed", range(3))
def test_the_end_is_the_lowest_point_that_was_seen(seed):
    """Also where parameters are said not to be followed smoothly, so that the first steps leave them out."""
    hidden = noisy(seed)
    problem = FitProblem(hidden.simulator, list(hidden.recordings))
    search = searched(problem, (hidden.theta - problem.space.nominal) / problem.space.scales)
    smooth = np.arange(len(problem.names)) % 2 == 0
    whole, half = (bias_corrected(search, problem, mask).best.u for mask in (True, smooth))
    ends = [corrected_objective(problem, u) for u in (whole, half, search.best.u)]
    assert max(ends[:2]) < ends[2]
    assert abs(ends[0] - ends[1]) < 1.0  # of the order of a standard deviation squared
