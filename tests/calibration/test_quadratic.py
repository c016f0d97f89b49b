import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from errorscreen.calibration import quadratic as module
from errorscreen.calibration.quadratic import bounded_minimum
from errorscreen.exceptions import InputError


@given(
    seed=st.integers(0, 10**6),
    k=st.integers(1, 40),
    damping=st.floats(-9, 1),
    guesses=st.sampled_from([0, 2, 30]),
)
@settings(max_examples=60, deadline=None)
def test_the_minimum_inside_bounds_meets_the_optimality_conditions(seed, k, damping, guesses):
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((k + 5, k)) * 10 ** rng.uniform(-3, 3, k)
    A, g = J.T @ J, 3 * rng.standard_normal(k)
    A = A / np.sqrt(np.outer(np.diag(A), np.diag(A))) + 10**damping * np.eye(k)
    low, high = -rng.uniform(0, 2, k), rng.uniform(0, 2, k)
    for near in (None, np.clip(rng.choice([-9.0, 0.0, 9.0], k), low, high)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "_GUESSES", guesses)  # few of them: what cannot cycle takes over
            d = bounded_minimum(A, g, low, high, near)
        assert np.all((low <= d) & (d <= high))
        pull = -(A @ d + g)  # outwards at a bound, zero inside
        assert np.all(pull[d == low] <= 1e-6)
        assert np.all(pull[d == high] >= -1e-6)
        inside = (d > low + 1e-9) & (d < high - 1e-9)
        np.testing.assert_allclose(pull[inside], 0, atol=1e-5)


@pytest.mark.parametrize(
    ("matrix", "slope"),
    [
        ([[1.0, 2.0], [2.0, 1.0]], [1.0, 1.0]),
        ([[np.nan, 0.0], [0.0, 1.0]], [1.0, 1.0]),
        ([[1.0, 0.0], [0.0, 1.0]], [np.nan, 1.0]),
    ],
)
def test_a_matrix_that_is_not_positive_definite_or_finite_has_no_minimum(matrix, slope):
    with pytest.raises(np.linalg.LinAlgError):
        bounded_minimum(matrix, slope, [-1.0, -1.0], [1.0, 1.0])


@pytest.mark.parametrize(("k", "slope", "upper"), [(3, 2, 2), (2, 3, 3), (2, 2, 1), (2, 2, 3)])
def test_shapes_that_do_not_fit_are_refused(k, slope, upper):
    with pytest.raises(InputError, match="shape"):
        bounded_minimum(np.eye(k), np.ones(slope), -np.ones(slope), np.ones(upper))
