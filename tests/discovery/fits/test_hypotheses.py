"""Joint fits, evidence and signatures of hypotheses."""

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.search import BoundedSearch, Track
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.hypotheses import PRIOR, JointFit, fit_hypothesis, hypothesis_of, linearised
from errorscreen.discovery.starts.signatures import SignatureSearch
from tests.discovery.conftest import PLANT_NOISE, observed
from tests.plants import dip, plant
from tests.simulators.models import oscillator


def test_evidence_is_the_marginal_likelihood_of_a_linear_model():
    """z = r + J u with u ~ N(0, s²): ln N(r; 0, I + s² J Jᵀ), up to the constant that all models share."""
    base = plant("synchronous_machine", dip(stop=2.0))
    problem = FitProblem(base, observed(base, base.parameters.nominal))
    rng = np.random.default_rng(0)
    n, k = problem.n_values, 8
    J, r = rng.standard_normal((n, k)) * 3, rng.standard_normal(n)
    A = J.T @ J + np.eye(k) / PRIOR**2
    u = -np.linalg.solve(A, J.T @ r)
    search = BoundedSearch(problem.residuals, *problem.scaled_bounds, prior=PRIOR, tol=1e-2, step=1e-4)
    search.tracks = [Track(u, r + J @ u, 0.0, J, state="converged")]
    found = hypothesis_of((), problem, search, 0.0)
    covariance = np.eye(n) + PRIOR**2 * J @ J.T
    expected = -0.5 * r @ np.linalg.solve(covariance, r) - 0.5 * np.linalg.slogdet(covariance)[1]
    assert found.evidence == pytest.approx(expected, rel=1e-9)


def test_the_joint_fit_finds_parameters_and_effect(hidden):
    base, theta, values, observation = hidden
    problem = FitProblem(base.extend("exciter"), observation)
    near = np.concatenate([theta, values]) * 1.03
    start = (near - problem.space.nominal) / problem.space.scales
    found = fit_hypothesis(base.extend("exciter").extensions, problem, start)
    assert found.chi2_per_sample < 1.15
    intervals = found.parameters_of(found.effects[0], width=4.0)
    assert set(intervals) == {"K", "TA_TB", "TB", "TE"}
    triples = list(intervals.values())
    assert all(low <= value <= high for value, low, high in triples)
    assert sum(low <= true <= high for (_, low, high), true in zip(triples, values, strict=True)) >= 3
    assert np.abs(found.predict(observation.event) - observation.values).std() < 1.2 * PLANT_NOISE[0]


def test_intervals_hold_hidden_values_as_often_as_they_say():
    """90 % intervals of a strength that the recording determines: the prior hardly matters."""
    base = oscillator()
    extended, rng, inside = base.extend("velocity.drag(velocity)"), np.random.default_rng(4), []
    space = extended.parameters
    for _ in range(100):
        theta = space.nominal * rng.uniform(0.7, 1.3, 3)
        y = extended.simulate(theta).require_ok().values[0]
        measured = y + 0.02 * rng.standard_normal(y.shape)
        seen = Observation(base.event, measured, np.array([0.02]), base.channels, base.units)
        problem = FitProblem(extended, seen)
        found = fit_hypothesis(extended.extensions, problem, (theta - space.nominal) / space.scales)
        ((_, low, high),) = found.parameters_of(extended.extensions[0], width=1.645).values()
        inside.append(low <= theta[2] <= high)
    assert 0.8 < np.mean(inside) < 0.97


def test_a_fit_goes_on_where_it_stopped(hidden):
    base, _, _, observation = hidden
    effects = base.extend("exciter").extensions
    at_once = JointFit(effects, FitProblem(base.extend("exciter"), observation), np.zeros(12)).run(8)
    in_parts = JointFit(effects, FitProblem(base.extend("exciter"), observation), np.zeros(12))
    first = in_parts.run(3).objective
    assert in_parts.run(5).objective == at_once.objective
    assert in_parts.gained == pytest.approx(first - at_once.objective)


def test_the_right_effect_has_the_best_signature(hidden):
    """Before any joint fit; what is promised is an estimate of what the joint fit reaches."""
    base, _, _, observation = hidden
    problem = FitProblem(base, observation)
    fitted = fit_hypothesis((), problem, np.zeros(8))
    zero = np.zeros(8)
    points = [(fitted.u, fitted.jacobian), (zero, linearised(problem, zero)[1])]
    found = {
        e.name: SignatureSearch(base, [observation], e, points, 64, 0).run()
        for e in base.effects
        if e.kind != "latent"
    }
    best = min(found, key=lambda name: found[name].objective)
    assert best == "exciter"
    assert found["exciter"].objective < 0.1 * fitted.objective
    again = [
        SignatureSearch(base, [observation], found["exciter"].effect, points, 64, 0).run(2).run().starts(64)
        for _ in range(2)
    ]
    assert np.array_equal(*again)
    assert again[0].shape == (6, len(problem.space) + 4)
