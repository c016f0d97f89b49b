"""Fits to an ever longer part of the recordings."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.hypotheses import JointFit, fit_hypothesis
from errorscreen.discovery.search.partwise_fits import PartwiseFit, fit_growing_parts, start_partwise
from errorscreen.events import InputSignal
from errorscreen.parameters import Parameter
from errorscreen.simulators import ODESimulator
from tests.discovery.conftest import recorded
from tests.simulators.models import oscillator_rhs


def test_a_fit_from_all_over_the_ranges_leaves_a_local_minimum(stuck_relay):
    problem, stuck = stuck_relay
    starts = start_partwise(stuck, stuck.effects, problem, 16, 0).run().reached
    lower, upper = problem.scaled_bounds
    assert np.all(starts >= lower)
    assert np.all(starts <= upper)
    assert np.array_equal(starts, start_partwise(stuck, stuck.effects, problem, 16, 0).run().reached)
    assert JointFit(stuck.effects, problem, starts).run(30).objective < 0.9 * stuck.objective


def test_without_effects_the_lowest_minimum_is_found_too(spring):
    model, observation = spring
    problem = FitProblem(model, observation)
    fitted = fit_hypothesis((), problem, np.zeros(2))
    starts = start_partwise(fitted, (), problem, 16, 0).run().reached
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
    np.testing.assert_allclose(
        problem.values(PartwiseFit((), problem, [start]).run().reached), [truth], rtol=0.05
    )


def test_starts_grow_over_a_gap(spring):
    model, observation = spring
    early = observation.time < observation.time[len(observation.time) // 3]
    gap = replace(observation, values=np.where(early, np.nan, observation.values))
    problem = FitProblem(model, gap)
    reached = PartwiseFit((), problem, np.zeros((1, 2))).run().reached
    assert JointFit((), problem, reached).run(20).objective == pytest.approx(
        JointFit((), problem, np.zeros((1, 2))).run(40).objective, rel=1e-3
    )


def late_rhs(t, x, u, p, dx):
    """A store that leaks more, by p[1] times its level's excess over p[2], once it is full enough."""
    dx[0] = p[0] * u[0] - 0.1 * x[0] - p[1] * max(x[0] - p[2], 0.0)


def test_what_shows_late_is_tried_all_over_again_when_it_shows():
    """Of a threshold that is reached late nothing is known before: all starts come to rest at its nominal value."""
    time = np.arange(0.0, 30.0, 0.05)
    event = InputSignal(time, "supply", 0.0, {"supply": np.full(len(time), 1.0)})
    bounds = {"a": (0.5, 0.25, 0.75), "b": (1.0, 0.0, 4.0), "c": (3.5, 1.0, 6.0)}
    parameters = [Parameter(name, *values) for name, values in bounds.items()]
    model = ODESimulator(
        late_rhs, ["level"], parameters, event, inputs=["supply"], outputs=["level"], step=0.01
    )
    truth = model.simulate([0.6, 2.0, 4.5], event).values[0]
    problem = FitProblem(model, model.observe(recorded(truth, event, "level")))
    starts = (
        np.array([[0.5, 1.0, c] for c in (2.0, 3.0, 5.0)]) - problem.space.nominal
    ) / problem.space.scales
    early = problem.until(0.1)
    fit = JointFit((), early, starts).run(3)
    assert np.ptp(fit.reached[:, 2]) < 0.01
    cloud = problem.values(fit.scattered(np.full(64, 1.0), 0)[0])
    assert np.ptp(cloud[:, 0]) < 0.02
    assert np.ptp(cloud[:, 2]) > 1.0


def test_half_of_the_starts_are_near_what_is_fitted_of_an_effect(spring):
    model, observation = spring
    effect = next(e for e in model.effects if e.name == "velocity.cubic(position)")
    problem = FitProblem(model.extend(effect), observation)
    fitted = fit_hypothesis((effect,), problem, np.zeros(3))
    u = start_partwise(fitted, (effect,), problem, 16, 0).reached
    lower, upper = problem.scaled_bounds[:, 2]
    near = np.abs(u[::2, 2] - fitted.u[2]) / (upper - lower)
    far = np.sort((u[1::2, 2] - lower) / (upper - lower))
    assert np.all(near < 0.5)
    assert far[0] < 0.4 < 0.6 < far[-1]
    other = fit_hypothesis((), FitProblem(model, observation), np.zeros(2))
    assert np.ptp(start_partwise(other, (effect,), problem, 16, 0).reached[::2, 2]) > 2 * np.ptp(u[::2, 2])


def test_the_fit_that_grows_best_is_fitted_to_all_of_the_recordings(spring, caplog):
    model, observation = spring
    base = fit_hypothesis((), FitProblem(model, observation), np.zeros(2))
    names = ["offset_position", "lag_position", "velocity.cubic(position)", "force.lag"]
    ended = []
    for threads in (1, 2):  # whose number does not matter
        fits = []
        for effect in (e for e in model.effects if e.name in names):
            problem = FitProblem(model.extend(effect), [observation])
            fits.append(partial(start_partwise, base, (effect,), problem, random_state=0))
        (fit,) = fit_growing_parts(fits, 1, threads)
        assert [e.name for e in fit.effects] == ["velocity.cubic(position)"]
        assert fit.problem.n_values == observation.mask.sum()
        assert fit.hypothesis().chi2_per_sample == pytest.approx(1.0, abs=0.2)
        ended.append(fit.reached)
    assert np.array_equal(*ended)
    assert caplog.messages[0] == "4 of 4 go on from 10% of the recordings"


def test_what_is_hopeless_after_a_fifth_of_the_recordings_goes_no_further(spring, caplog):
    model, observation = spring
    base = fit_hypothesis((), FitProblem(model, observation), np.zeros(2))
    chosen = [e for e in model.effects if e.name in ("velocity.cubic(position)", "force.lag")]
    problems = [FitProblem(model.extend(e), [observation]) for e in chosen]
    fits = [
        partial(start_partwise, base, (e,), problem, random_state=0)
        for e, problem in zip(chosen, problems, strict=True)
    ]
    seen = []

    def hopeful(fit):
        seen.append(fit.part.n_values)
        return fit.effects == (chosen[0],)

    (fit,) = fit_growing_parts(fits, 2, hopeful=hopeful)
    assert fit.effects == (chosen[0],)
    # both in the first round, then what is left, again and again
    asked = [0.2, 0.2, 0.2, 0.33, 0.5, 0.7, 0.85]
    assert seen == [problems[0].until(share).n_values for share in asked]
    assert not fit_growing_parts(fits, 2, hopeful=lambda fit: False)
    assert caplog.messages[-1] == "0 of 2 go on from 20% of the recordings"


def test_what_cannot_be_simulated_does_not_end_a_race(spring, monkeypatch):
    model, observation = spring
    base = fit_hypothesis((), FitProblem(model, observation), np.zeros(2))
    chosen = [e for e in model.effects if e.name in ("velocity.cubic(position)", "force.lag")]
    problems = {e.name: FitProblem(model.extend(e), [observation]) for e in chosen}
    fails = problems["force.lag"]
    fits = [partial(start_partwise, base, (e,), problems[e.name], random_state=0) for e in chosen]
    plain = FitProblem.residuals

    def residuals(self, values):
        z = plain(self, values)
        return np.full_like(z, np.nan) if self.simulator is fails.simulator else z

    monkeypatch.setattr(FitProblem, "residuals", residuals)
    assert [e.name for fit in fit_growing_parts(fits, 2) for e in fit.effects] == ["velocity.cubic(position)"]

    def only_late(self, values):  # the whole recording fails, its parts do not
        return residuals(self, values) if self is fails else plain(self, values)

    monkeypatch.setattr(FitProblem, "residuals", only_late)
    assert [e.name for fit in fit_growing_parts(fits, 2) for e in fit.effects] == ["velocity.cubic(position)"]
