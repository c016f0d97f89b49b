from dataclasses import replace

import numpy as np
import pytest

from errorscreen._runtime.sampling import latin_hypercube
from errorscreen.calibration import problem as module
from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.metrics import objective, response_error
from tests.plants import dip, plant
from tests.toys import TIME, Pulse, oscillator

SIMULATOR = oscillator()
SHORT = Pulse(TIME[:100], name="short", start=0.5, duration=0.3)


def recordings():
    first = SIMULATOR.record({"omega": 7.0}, 0.02, seed=0)
    first.values[0, 30:50] = np.nan
    second = SIMULATOR.record({"omega": 7.0}, 0.05, seed=1, event=SHORT)
    second.values[1] = np.nan
    return first, second


def test_residuals_are_the_measured_errors_in_multiples_of_the_noise():
    first, second = recordings()
    problem = FitProblem(SIMULATOR, [first, second], ["gain", "omega"])
    values = [[1.1, 6.5], [0.9, 8.0]]
    found = problem.residuals(values)
    assert found.shape == (2, problem.n_values) == (2, 2 * 161 - 20 + 100)
    theta = SIMULATOR.parameters.embed(values, ["gain", "omega"])
    expected = []
    for observation in (first, second):
        errors = SIMULATOR.simulate(theta, observation.event).values - observation.values
        expected.append((errors / observation.noise[:, None])[:, np.isfinite(observation.values)])
    np.testing.assert_array_equal(found, np.concatenate(expected, axis=1))
    np.testing.assert_allclose(problem.chi_square(values), (found**2).sum(axis=1))
    assert problem.n_simulations == 2 * 2 * 2
    assert [np.isnan(z).sum() for z in problem.deviations(values)] == [40, 200]


def test_at_the_truth_chi_square_per_value_is_one():
    observation = SIMULATOR.record({"omega": 7.0}, 0.02, seed=3)
    problem = FitProblem(SIMULATOR, observation)
    theta = SIMULATOR.parameters.embed([7.0], ["omega"])
    # standard deviation of χ²/N is sqrt(2/N)
    assert problem.chi_square(theta)[0] / problem.n_values == pytest.approx(1, abs=4 * np.sqrt(2 / 322))


def test_objective_sums_recordings_and_leaves_out_what_was_not_measured():
    first, second = recordings()
    problem = FitProblem(SIMULATOR, [first, second], ["omega"])
    simulated = [SIMULATOR.simulate(SIMULATOR.parameters.nominal, o.event).values[0] for o in (first, second)]
    quiet = TIME < 0.5
    levels = [np.nanmean(first.values[:, quiet], axis=1), second.values[:1, quiet[:100]].mean(axis=1)]
    expected = objective(response_error(simulated[0], first.values, levels[0]), [0.3, 0.7])
    expected += 0.3 * response_error(simulated[1][:1], second.values[:1], levels[1])[0]
    assert problem.objective([[6.0]], [0.3, 0.7]) == pytest.approx(expected)


def test_recordings_side_by_side_give_what_they_give_one_after_the_other():
    events = [dip(), replace(dip(depth=0.1), name="shallow")]
    found, counts = [], []
    for threads in (1, 2):
        simulator = plant("synchronous_machine", n_threads=threads)
        theta = latin_hypercube(simulator.parameters, 7, 0)
        seen = [
            Observation(
                e, simulator.simulate(theta[:1], e).values[0], np.full(2, 1e-3), ("P", "Q"), ("pu", "pu")
            )
            for e in events
        ]
        problem = FitProblem(simulator, seen)
        found.append(np.hstack([problem.residuals(theta), problem.objective(theta)[:, None]]))
        counts.append(problem.n_simulations)
    np.testing.assert_array_equal(*found)
    assert counts == [2 * 2 * 7] * 2


def test_failed_rows_are_nan_and_counted():
    simulator = oscillator(fail_above=8.0)
    problem = FitProblem(simulator, recordings()[0], ["omega"])
    values = [[7.0], [9.0], [6.0]]
    for result in (
        problem.chi_square(values),
        problem.objective(values),
        problem.residuals(values).sum(axis=1),
    ):
        np.testing.assert_array_equal(np.isnan(result), [False, True, False])
    assert (problem.n_failed, problem.n_simulations) == (3, 9)
    assert "DIVERGED" in str(problem.no_success())


def test_values_outside_the_bounds_never_reach_the_simulator():
    problem = FitProblem(SIMULATOR, recordings()[0], ["omega"])
    np.testing.assert_array_equal(problem.embed([[99.0], [-1.0]])[:, 0], [12.0, 3.0])


def test_chunks_change_nothing(monkeypatch):
    problem = FitProblem(SIMULATOR, list(recordings()), ["omega"])
    values = np.linspace(4, 11, 23)[:, None]
    whole = problem.chi_square(values)
    monkeypatch.setattr(module, "_CHUNK", 4 * 2 * 2 * 161)
    simulator = oscillator()
    chunked = FitProblem(simulator, list(recordings()), ["omega"])
    np.testing.assert_array_equal(chunked.chi_square(values), whole)
    assert simulator.calls == 2 * 6


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 1.0])
def test_a_part_of_the_recordings_is_what_it_is_in_the_whole(share):
    whole = FitProblem(SIMULATOR, recordings())
    part = whole.until(share)
    values = [SIMULATOR.parameters.nominal]
    assert part.names == whole.names
    for cut, full in zip(part.observations, whole.observations, strict=True):
        measured = [o.mask.any(axis=0) & (o.time >= o.event.start) for o in (full, cut)]
        after, kept = (int(m.sum()) for m in measured)
        assert kept == max(8, np.ceil(share * after))
        assert cut.event.start == full.event.start
        assert cut.event.name == full.event.name
    for early, all_of_it in zip(part.deviations(values), whole.deviations(values), strict=True):
        np.testing.assert_allclose(early, all_of_it[..., : early.shape[-1]], atol=1e-9)


def test_simulations_of_a_part_and_with_another_step_count_in_the_whole():
    whole = FitProblem(SIMULATOR, recordings())
    part = whole.until(0.5).with_step(0.1)
    part.chi_square([SIMULATOR.parameters.nominal] * 3)
    assert part.n_simulations == whole.n_simulations == 3 * len(whole.observations)
