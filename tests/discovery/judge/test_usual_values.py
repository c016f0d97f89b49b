"""Evidence of effects whose strength has a usual value."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from errorscreen.discovery.fits.hypotheses import PRIOR
from errorscreen.discovery.judge.usual_values import usual_evidence
from errorscreen.effects import GOVERNOR, GOVERNOR_ACTING
from errorscreen.parameters import Parameter, ParameterSpace

NAME = "governor_acting.a"


def fitted(value, sigma, effect=GOVERNOR_ACTING):
    """A hypothesis with a strength of nominal 0 and scale 1, known to `sigma`."""
    space = ParameterSpace([Parameter(NAME, 0.0, -5.0, 5.0, scale=1.0)])
    return SimpleNamespace(
        simulator=SimpleNamespace(parameters=space), effects=(effect,), names=(NAME,), u=np.array([value]),
        theta=np.array([value]), covariance=np.array([[sigma**2]]),
    )  # fmt: skip


@pytest.mark.parametrize(("measured", "noise"), [(1.0, 0.02), (1.05, 0.02), (0.4, 0.1), (1.3, 0.5)])
def test_it_is_the_evidence_of_half_the_prior_at_the_value(measured, noise):
    """Against the marginal likelihood of one reading of the strength, integrated numerically."""

    def likelihood(a):
        return norm.pdf(measured, a, noise)

    ends = measured - 12 * noise, measured + 12 * noise
    free = quad(lambda a: likelihood(a) * norm.pdf(a, 0.0, PRIOR), *ends, points=[measured])[0]
    expected = np.log(0.5 * (free + likelihood(1.0)) / free)
    variance = 1.0 / (1.0 / noise**2 + 1.0 / PRIOR**2)
    found = usual_evidence(fitted(measured * variance / noise**2, np.sqrt(variance)))
    assert found == pytest.approx(expected, rel=1e-6)


def test_other_effects_and_strengths_at_a_bound_keep_their_evidence():
    assert usual_evidence(fitted(1.0, 0.1, GOVERNOR)) == 0.0
    assert usual_evidence(fitted(1.0, 0.0)) == 0.0
