"""Ways out of local minima."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.hypotheses import CORNER, JointFit, fit_hypothesis
from errorscreen.discovery.starts.restarts import (
    move_off_edge,
    restart_from_neighbours,
    scan_effect_parameters,
    search_all_ranges,
)
from errorscreen.discovery.starts.signatures import objectives


def test_a_relay_is_found_by_a_search_of_all_ranges(relay):
    model, effect, observation = relay
    problem = FitProblem(model.extend(effect), observation)
    found = problem.values(search_all_ranges(problem, 0))
    assert np.allclose(found, [0.55, 0.22, 0.8, 2.1, 1.1], atol=[0.03, 0.02, 0.1, 0.05, 0.1])
    assert np.array_equal(search_all_ranges(problem, 0), search_all_ranges(problem, 0))


def test_escapes_lead_lower_than_a_local_minimum(stuck_relay):
    problem, stuck = stuck_relay
    ways = scan_effect_parameters(stuck, problem)
    assert ways
    free = JointFit(stuck.effects, problem, ways[:2]).run(30)
    assert free.objective < 0.9 * stuck.objective


def test_off_an_edge_an_effect_is_searched_and_the_model_stays(stuck_relay):
    problem, stuck = stuck_relay
    found = move_off_edge(stuck, problem, 0)
    reached = objectives(problem, found)
    assert np.all(np.diff(reached) >= 0)
    assert reached[0] < stuck.objective - 4.0
    assert np.array_equal(found[:, :2], np.tile(stuck.u[:2], (len(found), 1)))
    assert np.array_equal(found, move_off_edge(stuck, problem, 0))


def test_no_way_leads_out_of_the_lowest_minimum(spring):
    model, observation = spring
    effect = next(e for e in model.effects if e.name == "velocity.cubic(position)")
    problem = FitProblem(model.extend(effect), observation)
    best = fit_hypothesis((effect,), problem, np.zeros(3))
    for way in scan_effect_parameters(best, problem):
        assert JointFit((effect,), problem, way).run(30).objective > best.objective - 1.0


def test_a_search_that_stalls_on_a_crease_is_led_on_until_nothing_around_it_is_lower(crease):
    model, observation = crease
    problem = FitProblem(model, observation)
    stalled = fit_hypothesis((), problem, np.zeros(2))
    assert (stalled.state, stalled.ended, stalled.at_rest) == ("stalled", True, False)
    led = restart_from_neighbours(stalled, problem, 4.0, 0)
    assert led.objective < stalled.objective - 4.0
    assert np.array_equal(led.u, restart_from_neighbours(stalled, problem, 4.0, 0).u)
    least = 0.001 * stalled.chi2
    fits = [led]
    while not fits[-1].at_rest:
        fits.append(restart_from_neighbours(fits[-1], problem, least, len(fits)))
        assert len(fits) < 10
    last = fits[-1]
    assert (last.state, last.converged) == (CORNER, False)
    around = last.u + 0.02 * np.random.default_rng(1).standard_normal((500, 2))
    assert np.nanmin(objectives(problem, around)) > last.objective - least


def test_a_smooth_minimum_is_no_corner(spring):
    model, observation = spring
    problem = FitProblem(model, observation)
    best = fit_hypothesis((), problem, np.zeros(2))
    found = restart_from_neighbours(replace(best, state="stalled"), problem, 4.0, 0)
    assert found.state in ("converged", "kink")
    assert found.objective == pytest.approx(best.objective, abs=1.0)
