"""What effects promise before a joint fit; see also test_hypotheses for a plant."""

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.hypotheses import fit_hypothesis
from errorscreen.discovery.starts.signatures import SignatureSearch, spread_over
from tests.simulators.models import oscillator, push


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


@pytest.mark.parametrize(
    ("name", "value"),
    [("skew_position", 3e-5), ("skew_position", -3e-5), ("lag_position", 3e-5), ("scale_position", -2e-5)],
)
def test_a_strength_that_is_small_against_its_range_is_told_by_the_linear_model(name, value):
    event = push()
    model = oscillator(event)
    y = model.extend(name).simulate([*model.parameters.nominal, value], event).values
    size = np.sqrt(np.mean((y - model.baseline(event)) ** 2))
    noisy = y[0] + size * np.random.default_rng(5).standard_normal(y.shape[1:])
    observation = Observation(event, noisy, np.array([size]), model.channels, model.units)
    effect = next(e for e in model.effects if e.name == name)
    fitted = fit_hypothesis((), FitProblem(model, observation), np.zeros(2))
    search = SignatureSearch(model, [observation], effect, [(fitted.u, fitted.jacobian)], 32, 0).run()
    true = np.append(model.parameters.nominal, value)
    assert search.objective < search.problem.chi_square([true])[0] + 1.0
    found = search.problem.values(search.starts())[0, -1]
    assert 0.5 < found / value < 2.0
