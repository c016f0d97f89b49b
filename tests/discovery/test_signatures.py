"""What effects promise before a joint fit, and ways out of local minima; see also test_hypotheses for a plant."""

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.hypotheses import PRIOR, JointFit, fit_hypothesis
from errorscreen.discovery.signatures import SignatureSearch, elsewhere, escapes, searched, spread_over
from errorscreen.events import InputSignal
from errorscreen.parameters import Parameter
from errorscreen.recordings import Recording
from errorscreen.simulators import ODESimulator
from tests.simulators.models import oscillator, push

NOISE = 0.01


def store_rhs(t, x, u, p, dx):
    dx[0] = p[0] * u[0] - p[1] * x[0]


def recorded(truth, event, output):
    y = truth[0] + NOISE * np.random.default_rng(4).standard_normal(truth.shape[1])
    return Recording.from_signals(
        event.time, {**event.signals, output: y}, noise={output: NOISE}, name=event.name
    )


@pytest.fixture(scope="module")
def spring():
    """An oscillator whose spring softens, and the linear model of it."""
    event = push()
    truth = oscillator(event, step=0.005).extend("velocity.cubic(position)").simulate([0.45, 4.4, 0.6], event)
    observation = oscillator(event).observe(recorded(truth.values[0], event, "position"))
    return oscillator(event), observation


@pytest.fixture(scope="module")
def relay():
    """A leaking store whose supply is cut again and again."""
    time = np.arange(0, 40, 0.1)
    event = InputSignal(time, "supply", 0.0, {"supply": np.repeat([1.6, 0.4, 1.9, 1.2], 100)})
    parameters = [Parameter("a", 0.5, 0.25, 0.75), Parameter("b", 0.25, 0.12, 0.37)]
    model = ODESimulator(
        store_rhs,
        ["level"],
        parameters,
        event,
        inputs=["supply"],
        outputs=["level"],
        interpolation="hold",
        step=0.025,
    )
    effect = next(e for e in model.effects if e.name == "supply.relay_above(level)")
    truth = model.extend(effect).simulate([0.55, 0.22, 0.8, 2.1, 1.1], event)
    return model, effect, model.observe(recorded(truth.values[0], event, "level"))


def test_the_right_effect_promises_most(spring):
    model, observation = spring
    fitted = fit_hypothesis((), FitProblem(model, observation), np.zeros(2))
    chosen = [e for e in model.effects if e.kind != "latent" and e.minima == 1]
    points = [(fitted.u, fitted.jacobian)]
    found = {e.name: SignatureSearch(model, [observation], e, points, 32, 0).run() for e in chosen}
    assert min(found, key=lambda name: found[name].objective) == "velocity.cubic(position)"


def test_wide_ranges_are_divided_in_the_logarithm_on_both_sides(spring):
    model, _ = spring
    effect = next(e for e in model.effects if e.name == "velocity.cubic(position)")
    problem = FitProblem(model.extend(effect), spring[1])
    shares = np.array([[0.0], [0.25], [0.5], [0.75], [1.0]])
    u = spread_over(problem.space, 2, shares, effect)
    values = (problem.space.nominal[2:] + u * problem.space.scales[2:]).ravel()
    least, upper = effect.smallest["a"], effect.strength.upper
    middle = np.sqrt(least * upper)
    assert np.allclose(values, [-upper, -middle, least, middle, upper])


def test_a_relay_is_found_by_a_search_of_all_ranges(relay):
    model, effect, observation = relay
    problem = FitProblem(model.extend(effect), observation)
    found = problem.values(searched(problem, 0))
    assert np.allclose(found, [0.55, 0.22, 0.8, 2.1, 1.1], atol=[0.03, 0.02, 0.1, 0.05, 0.1])
    assert np.array_equal(searched(problem, 0), searched(problem, 0))


def test_escapes_lead_lower_than_a_local_minimum(relay):
    model, effect, observation = relay
    problem = FitProblem(model.extend(effect), observation)
    start = (np.array([0.55, 0.22, 0.5, 2.6, 4.0]) - problem.space.nominal) / problem.space.scales
    stuck = JointFit((effect,), problem, start).run(30).hypothesis()
    ways = escapes(stuck, problem)
    assert ways
    free = JointFit((effect,), problem, ways[:2]).run(30)
    assert free.objective < 0.9 * stuck.objective


def test_no_way_leads_out_of_the_lowest_minimum(spring):
    model, observation = spring
    effect = next(e for e in model.effects if e.name == "velocity.cubic(position)")
    problem = FitProblem(model.extend(effect), observation)
    best = fit_hypothesis((effect,), problem, np.zeros(3))
    for way in escapes(best, problem):
        assert JointFit((effect,), problem, way).run(30).objective > best.objective - 1.0


def test_a_fit_from_all_over_the_ranges_leaves_a_local_minimum(relay):
    model, effect, observation = relay
    problem = FitProblem(model.extend(effect), observation)
    start = (np.array([0.55, 0.22, 0.5, 2.6, 4.0]) - problem.space.nominal) / problem.space.scales
    stuck = JointFit((effect,), problem, start).run(30).hypothesis()
    starts = elsewhere(stuck, problem, 0)
    lower, upper = problem.scaled_bounds
    assert all(np.all(u >= lower) and np.all(u <= upper) for u in starts)
    costs = [float(problem.chi_square(problem.values(u))[0] + ((u / PRIOR) ** 2).sum()) for u in starts]
    assert np.all(np.diff(costs) >= 0)
    assert np.array_equal(starts, elsewhere(stuck, problem, 0))
    assert JointFit((effect,), problem, starts).run(30).objective < 0.9 * stuck.objective


def test_without_effects_starts_are_all_over_the_ranges_too(spring):
    model, observation = spring
    problem = FitProblem(model, observation)
    fitted = fit_hypothesis((), problem, np.zeros(2))
    starts = np.array(elsewhere(fitted, problem, 0))
    assert starts.shape == (len(np.unique(starts, axis=0)), 2)
