import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from errorscreen.calibration import quadratic as module
from errorscreen.calibration.quadratic import bounded_minimum, damped_minima
from errorscreen.exceptions import InputError


def drawn(seed, k, damping):
    """Matrix of unit diagonal, slope and bounds."""
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((k + 5, k)) * 10 ** rng.uniform(-3, 3, k)
    A, g = J.T @ J, 3 * rng.standard_normal(k)
    A = A / np.sqrt(np.outer(np.diag(A), np.diag(A))) + 10**damping * np.eye(k)
    return A, g, -rng.uniform(0, 2, k), rng.uniform(0, 2, k)


@given(
    seed=st.integers(0, 10**6),
    k=st.integers(1, 40),
    damping=st.floats(-9, 1),
    # few guesses: another algorithm takes over; no patience: one at a time
    patience=st.sampled_from([0, 3, 1000]),
    guesses=st.sampled_from([0, 1, 10]),
)
@settings(max_examples=60)
def test_the_minimum_inside_bounds_meets_the_optimality_conditions(seed, k, damping, patience, guesses):
    A, g, low, high = drawn(seed, k, damping)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_ROUNDS", guesses)
        patch.setattr(module, "_PATIENCE", patience)
        d = bounded_minimum(A, g, low, high)
    assert np.all((low <= d) & (d <= high))
    pull = -(A @ d + g)  # outwards at a bound, zero inside
    assert np.all(pull[d == low] <= 1e-6)
    assert np.all(pull[d == high] >= -1e-6)
    inside = (d > low + 1e-9) & (d < high - 1e-9)
    np.testing.assert_allclose(pull[inside], 0, atol=1e-5)


@given(
    seed=st.integers(0, 10**6),
    k=st.integers(1, 30),
    dampings=st.lists(st.floats(0, 9), min_size=1, max_size=7),
)
@settings(max_examples=40)
def test_minima_for_several_dampings_are_those_for_each_of_them(seed, k, dampings):
    A, g, low, high = drawn(seed, k, -6.0)
    alone = [bounded_minimum(A + damping * np.eye(k), g, low, high) for damping in dampings]
    np.testing.assert_array_equal(damped_minima(A, g, low, high, dampings), alone)


def test_of_nothing_there_is_a_minimum():
    assert damped_minima(np.zeros((0, 0)), [], [], [], [0.0, 1.0]).shape == (2, 0)


def test_what_takes_over_finds_the_minimum_of_a_nearly_singular_function(monkeypatch):
    """A constant in its cost is far larger than what is left to gain."""
    for seed in range(100):
        rng = np.random.default_rng(seed)
        k = int(rng.integers(2, 31))
        n = max(1, k // 2)
        J = rng.standard_normal((k, n)) @ rng.standard_normal((n, k))
        A, g = J.T @ J + 1e-6 * np.eye(k), 3 * rng.standard_normal(k)
        low, high = -rng.uniform(0.1, 2, k), rng.uniform(0.1, 2, k)
        values = []
        for guesses in (300, 0):
            monkeypatch.setattr(module, "_ROUNDS", guesses)
            d = bounded_minimum(A, g, low, high)
            values.append(0.5 * d @ A @ d + g @ d)
        assert values[1] == pytest.approx(values[0], rel=1e-9)


def test_guessing_goes_on_behind_what_another_algorithm_finds(monkeypatch):
    A, g, low, high = drawn(0, 6, -3.0)
    dampings = [0.0, 0.1, 1.0]
    expected = damped_minima(A, g, low, high, dampings)
    guessed, begun = module._minima, []

    def not_the_second(*args):
        first, d = args[5:7]
        begun.append(first)
        found = guessed(*args)
        if first > 1:
            return found
        d[1:] = np.nan
        return 1, module._NOT_FOUND

    monkeypatch.setattr(module, "_minima", not_the_second)
    minima = damped_minima(A, g, low, high, dampings)
    assert begun == [0, 2]
    np.testing.assert_array_equal(minima[[0, 2]], expected[[0, 2]])
    np.testing.assert_allclose(minima[1], expected[1], atol=1e-9)


def refuse(*args, **kwargs):
    raise AssertionError("guessing has not ended")


@pytest.mark.parametrize(
    ("matrix", "slope"),
    [
        ([[13.1, 15, 10], [15, 18.1, 12], [10, 12, 8.1]], [-1, 5, -6]),
        ([[18.1, 6, 8, -6], [6, 4.1, 2, 0], [8, 2, 4.1, -2], [-6, 0, -2, 14.1]], [6, -4, 6, 3]),
    ],
)
def test_what_would_cycle_is_guessed_one_at_a_time(monkeypatch, matrix, slope):
    one = np.ones(len(slope))
    expected = lsq_linear(*square_root(matrix, slope), bounds=(-one, one), method="bvls").x
    with monkeypatch.context() as patch:
        patch.setattr(module, "lsq_linear", refuse)
        np.testing.assert_allclose(bounded_minimum(matrix, slope, -one, one), expected, atol=1e-9)
        patch.setattr(module, "_PATIENCE", 10**6)
        with pytest.raises(AssertionError, match="guessing"):
            bounded_minimum(matrix, slope, -one, one)


def square_root(matrix, slope):
    """C and b of |C d - b|² / 2, the same function but for a constant."""
    C = np.linalg.cholesky(matrix).T
    return C, -np.linalg.solve(C.T, slope)


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
