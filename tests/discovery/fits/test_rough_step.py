"""A longer step of the integration for what is only ranked."""

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.cases import load_ieee39
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.hypotheses import JointFit, linearised
from errorscreen.discovery.fits.rough_step import good_enough, rough_step
from errorscreen.discovery.search.partwise_fits import PartwiseFit
from errorscreen.discovery.starts.signatures import SignatureSearch
from errorscreen.events import InputSignal, LineTrip
from errorscreen.parameters import Parameter
from errorscreen.simulators import ODESimulator
from tests.discovery.conftest import recorded


def added(problem, step, values):
    """Largest root mean square that a step adds to the deviations of a recording, for each row."""
    pairs = zip(problem.with_step(step).deviations(values), problem.deviations(values), strict=True)
    masks = (o.mask for o in problem.observations)
    return np.max(
        [np.sqrt(np.mean((r - e)[:, m] ** 2, axis=1)) for (r, e), m in zip(pairs, masks, strict=True)], axis=0
    )


def test_what_it_adds_is_well_below_noise_also_where_it_was_not_asked(hidden):
    base, *_, observation = hidden
    problem = FitProblem(base, observation)
    step = rough_step(problem, np.zeros(8), 0)
    assert base.step < step <= 4 * base.step
    assert np.quantile(added(problem, step, problem.values(problem.drawn(64, 1))), 0.9) < 0.5


def lag_rhs(t, x, u, p, dx):
    dx[0] = (u[0] - x[0]) / p[0]


@pytest.mark.parametrize(("lag", "times"), [(2.0, 4), (0.1, 2), (0.04, None)])
def test_the_faster_a_model_the_shorter_its_longest_step(lag, times):
    time = np.arange(0.0, 5.0, 0.2)
    event = InputSignal(time, "jump", 0.5, {"u": np.where(time < 0.5, 0.0, 1.0)})
    space = [Parameter("T", lag, 0.8 * lag, 1.2 * lag)]
    model = ODESimulator(lag_rhs, ["x"], space, event, inputs=["u"], outputs=["x"], step=0.05)
    observation = model.observe(recorded(model.simulate([lag], event).values[0], event, "x"))
    step = rough_step(FitProblem(model, observation), [0.0])
    assert step == (times and pytest.approx(times * model.step))


def test_a_step_that_is_that_of_the_recording_cannot_be_longer(hidden):
    base, *_, observation = hidden
    problem = FitProblem(base.with_step(observation.event.dt), observation)
    assert rough_step(problem, np.zeros(8), 0) is None


def test_without_a_step_there_is_no_longer_one(crease):
    model, observation = crease
    problem = FitProblem(model, observation)
    assert rough_step(problem, np.zeros(2)) is None
    assert problem.with_step(None) is problem
    assert problem.n_simulations == 0


@pytest.mark.parametrize(("instant", "longest"), [(1.0, 0.01), (1.005, None)])
def test_a_grid_that_changes_between_two_longer_steps_keeps_its_own(instant, longest):
    system = load_ieee39().with_step(0.005)
    event = LineTrip(np.arange(0.0, 3.0, 0.01), "line out", instant, ends=(2, 3))
    noise = 0.01 * np.ones(len(system.channels))
    observation = Observation(event, system.baseline(event), noise, system.channels, system.units)
    problem = FitProblem(system, observation)
    step = rough_step(problem, np.zeros(len(problem.names)))
    assert step is None if longest is None else step >= longest


def test_a_fit_with_a_longer_step_ends_where_that_of_the_simulator_does(hidden):
    base, theta, values, observation = hidden
    effects = base.extend("exciter").extensions
    problems = [FitProblem(base.extend("exciter"), observation) for _ in range(2)]
    space = problems[0].space
    start = (np.concatenate([theta, values]) - space.nominal) / space.scales
    exact = JointFit(effects, problems[0], start).run(30).hypothesis()
    fit = JointFit(effects, problems[1], start, step=4 * base.step).run(30)
    before, found = problems[1].n_simulations, fit.hypothesis()
    assert found.simulator.step == base.step
    assert found.objective == pytest.approx(exact.objective, abs=0.1)
    assert np.array_equal(problems[1].values(found.u), problems[1].values(fit.exact().reached[0]))
    # those of the longer step count in the problem, too
    assert before > 0.5 * problems[0].n_simulations
    assert found.converged


@pytest.fixture(scope="module")
def shaft():
    """A turning mass that dry friction holds at rest, and the model without friction."""
    time, drawn = np.arange(0.0, 12.0, 0.02), np.random.default_rng(7)
    event = InputSignal(time, "torque", 0.0, {"torque": np.repeat(drawn.uniform(-1.5, 1.5, 12), 50)})

    def rhs(t, x, u, p, dx):
        dx[0] = x[1]
        dx[1] = p[0] * u[0] - p[1] * x[1]

    space = [Parameter("gain", 2.0, 1.0, 4.0), Parameter("viscous", 0.8, 0.2, 2.0)]
    model = ODESimulator(
        rhs, ["angle", "speed"], space, event,
        inputs=["torque"], outputs=["angle"], interpolation="hold", step=0.005,
    )  # fmt: skip
    friction = next(e for e in model.effects if e.name == "speed.coulomb(speed)")
    truth = model.refined(5).extend(friction).simulate([2.3, 0.6, 1.0], event)
    return model, friction, model.observe(recorded(truth.values[0], event, "angle"))


def test_a_step_that_is_good_enough_without_an_effect_may_not_be_so_with_it(shaft):
    model, friction, observation = shaft
    problem, extended = FitProblem(model, observation), FitProblem(model.extend(friction), observation)
    step, u = rough_step(problem, [0.0, 0.0]), [0.0, 0.0, 1.0 / extended.space.scales[2]]
    assert step == pytest.approx(4 * model.step)
    assert good_enough(problem, [0.0, 0.0], step) == step
    assert good_enough(extended, u, step) is None
    assert good_enough(extended, u, None) is None


@pytest.mark.parametrize("kind", ["coulomb", "offset"])
def test_each_effect_has_the_longer_step_only_where_it_is_good_enough_with_it(shaft, kind):
    model, friction, observation = shaft
    effect = friction if kind == "coulomb" else next(e for e in model.effects if e.name == "torque.offset")
    longer = None if kind == "coulomb" else 4 * model.step
    points = [(np.zeros(2), linearised(FitProblem(model, observation), np.zeros(2))[1])]

    def search():
        return SignatureSearch(model, [observation], effect, points, 16, 0, 4 * model.step)

    whole, first = search().run(), search().run(1)
    assert whole.step == longer
    # one that is taken up again has the same step
    again = search().restore(first.packed()).run()
    assert again.step == longer
    assert again.objective == whole.objective
    fit = PartwiseFit([effect], whole.problem, whole.starts(), 0, 4 * model.step).run()
    assert fit.step == longer
