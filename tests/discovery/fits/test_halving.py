"""Fits side by side."""

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.halving import fit_to_end, try_all
from errorscreen.discovery.fits.hypotheses import JointFit, fit_hypothesis
from errorscreen.exceptions import SimulationError


@pytest.mark.parametrize("threads", [1, 2])
def test_what_cannot_be_simulated_leaves_a_gap_and_other_errors_are_told(threads):
    def fail(error):
        raise error("meant")

    assert try_all([lambda: 1, lambda: fail(SimulationError), lambda: 3], threads) == [1, None, 3]
    with pytest.raises(ValueError, match="meant"):
        try_all([lambda: 1, lambda: fail(ValueError)], threads)


def test_a_race_of_none_is_over():
    assert fit_to_end([], 2) == fit_to_end([None], 2) == []


def test_a_fit_at_rest_far_above_the_best_is_not_led_to_its_end(hidden):
    """What a race leaves alone is what cannot win: the winner gets as far as it does by itself."""
    base, theta, values, observation = hidden
    problems = [FitProblem(base.extend(name), observation) for name in ("exciter", "lag_P")]
    starts = [
        (np.concatenate([theta * 1.03, own]) - p.space.nominal) / p.space.scales
        for p, own in zip(problems, (values, problems[1].space.nominal[8:]), strict=True)
    ]
    fits = [JointFit(p.simulator.extensions, p, u).run(5) for p, u in zip(problems, starts, strict=True)]
    assert fit_to_end([fits[0], None, fits[1]], 1) == fits
    winner, loser = fits
    alone = fit_hypothesis(winner.effects, FitProblem(winner.problem.simulator, observation), starts[0])
    assert winner.objective == pytest.approx(alone.objective, rel=1e-12)
    assert loser.objective > 10 * winner.objective
    assert not loser.may_reach(winner.objective)
