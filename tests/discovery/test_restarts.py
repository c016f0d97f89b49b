"""Ways out of local minima."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.hypotheses import JointFit, fit_hypothesis
from errorscreen.discovery.restarts import elsewhere, escapes, grown, off_the_edge, searched
from errorscreen.discovery.signatures import objectives
from errorscreen.events import InputSignal
from errorscreen.parameters import Parameter
from errorscreen.simulators import ODESimulator
from tests.discovery.conftest import recorded
from tests.simulators.models import oscillator_rhs


@pytest.fixture
def stuck_relay(relay):
    """A relay fitted from where its threshold, and so all else, ends in a local minimum."""
    model, effect, observation = relay
    problem = FitProblem(model.extend(effect), observation)
    start = (np.array([0.55, 0.22, 0.5, 2.6, 4.0]) - problem.space.nominal) / problem.space.scales
    return problem, JointFit((effect,), problem, start).run(30).hypothesis()


def test_a_relay_is_found_by_a_search_of_all_ranges(relay):
    model, effect, observation = relay
    problem = FitProblem(model.extend(effect), observation)
    found = problem.values(searched(problem, 0))
    assert np.allclose(found, [0.55, 0.22, 0.8, 2.1, 1.1], atol=[0.03, 0.02, 0.1, 0.05, 0.1])
    assert np.array_equal(searched(problem, 0), searched(problem, 0))


def test_escapes_lead_lower_than_a_local_minimum(stuck_relay):
    problem, stuck = stuck_relay
    ways = escapes(stuck, problem)
    assert ways
    free = JointFit(stuck.effects, problem, ways[:2]).run(30)
    assert free.objective < 0.9 * stuck.objective


def test_off_an_edge_an_effect_is_searched_and_the_model_stays(stuck_relay):
    problem, stuck = stuck_relay
    found = off_the_edge(stuck, problem, 0)
    reached = objectives(problem, found)
    assert np.all(np.diff(reached) >= 0)
    assert reached[0] < stuck.objective - 4.0
    assert np.array_equal(found[:, :2], np.tile(stuck.u[:2], (len(found), 1)))
    assert np.array_equal(found, off_the_edge(stuck, problem, 0))


def test_no_way_leads_out_of_the_lowest_minimum(spring):
    model, observation = spring
    effect = next(e for e in model.effects if e.name == "velocity.cubic(position)")
    problem = FitProblem(model.extend(effect), observation)
    best = fit_hypothesis((effect,), problem, np.zeros(3))
    for way in escapes(best, problem):
        assert JointFit((effect,), problem, way).run(30).objective > best.objective - 1.0


def test_a_fit_from_all_over_the_ranges_leaves_a_local_minimum(stuck_relay):
    problem, stuck = stuck_relay
    starts = elsewhere(stuck, problem, 0)
    lower, upper = problem.scaled_bounds
    assert np.all(starts >= lower)
    assert np.all(starts <= upper)
    assert np.array_equal(starts, elsewhere(stuck, problem, 0))
    assert JointFit(stuck.effects, problem, starts).run(30).objective < 0.9 * stuck.objective


def test_without_effects_the_lowest_minimum_is_found_too(spring):
    model, observation = spring
    problem = FitProblem(model, observation)
    fitted = fit_hypothesis((), problem, np.zeros(2))
    starts = elsewhere(fitted, problem, 0)
    assert np.allclose(starts[0], fitted.u, atol=0.1)


@pytest.mark.parametrize("k", [1.5, 2.5, 4.0, 6.0])
def test_an_oscillation_is_not_fitted_half_a_period_off_when_it_is_fitted_from_its_first_swing_on(k):
    """A blow makes an oscillator with hardly any damping swing about five times."""
    time = np.arange(0.0, 12.0, 0.02)
    event = InputSignal(time, "blow", 0.0, {"force": 5.0 * (time < 0.2)})
    parameters = [Parameter("c", 0.02, 0.01, 0.1), Parameter("k", 4.0, 1.0, 9.0)]
    states = ["position", "velocity"]
    model = ODESimulator(oscillator_rhs, states, parameters, event, inputs=["force"], outputs=["position"])
    truth = np.array([0.02, 8.2])
    recording = recorded(model.simulate(truth, event).values[0], event, "position")
    problem = FitProblem(model, model.observe(recording))
    start = (np.array([0.02, k]) - problem.space.nominal) / problem.space.scales
    assert JointFit((), problem, start).run(60).objective > 100 * problem.n_values
    np.testing.assert_allclose(problem.values(grown((), problem, [start])), [truth], rtol=0.05)


def test_starts_grow_over_a_gap(spring):
    model, observation = spring
    early = observation.time < observation.time[len(observation.time) // 3]
    gap = replace(observation, values=np.where(early, np.nan, observation.values))
    problem = FitProblem(model, gap)
    reached = grown((), problem, np.zeros((1, 2)))
    assert JointFit((), problem, reached).run(20).objective == pytest.approx(
        JointFit((), problem, np.zeros((1, 2))).run(40).objective, rel=1e-3
    )
