"""What effects promise before a joint fit; see also test_hypotheses for a plant."""

import numpy as np

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.hypotheses import fit_hypothesis
from errorscreen.discovery.signatures import SignatureSearch, spread_over


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
    u = spread_over(problem.space, 2, shares, [effect])
    values = (problem.space.nominal[2:] + u * problem.space.scales[2:]).ravel()
    least, upper = effect.smallest["a"], effect.strength.upper
    middle = np.sqrt(least * upper)
    assert np.allclose(values, [-upper, -middle, least, middle, upper])
