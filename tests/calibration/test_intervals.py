import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from errorscreen.calibration.intervals import (
    collinear_groups,
    correlation,
    noise_inflation,
    posterior_covariance,
)


@given(seed=st.integers(0, 10**6), n=st.integers(1, 20), k=st.integers(1, 6), inflation=st.floats(1, 50))
@settings(max_examples=40)
def test_covariance_is_the_inverse_of_the_posterior_precision(seed, n, k, inflation):
    J = np.random.default_rng(seed).standard_normal((n, k))
    expected = np.linalg.inv(J.T @ J / inflation + np.eye(k) / 0.3**2)
    np.testing.assert_allclose(posterior_covariance(J, 0.3, inflation), expected, rtol=1e-8, atol=1e-10)


def test_covariance_of_parameters_that_recordings_cannot_separate_is_the_prior():
    J = 1e6 * np.ones((5, 2))
    covariance = posterior_covariance(J, 2.0)
    assert [1, -1] @ covariance @ [1, -1] == pytest.approx(2 * 4.0)
    assert [1, 1] @ covariance @ [1, 1] == pytest.approx(4 / (4 * 5e12 / 2), rel=1e-3)


def test_white_residuals_at_the_noise_need_no_inflation_and_larger_ones_their_square():
    z = np.random.default_rng(0).standard_normal((2, 20000))
    assert noise_inflation([z], 3) == pytest.approx(1.0, abs=0.03)
    assert noise_inflation([3 * z[:, :9000], 3 * z[:, 9000:]], 3) == pytest.approx(9.0, rel=0.03)
    assert noise_inflation([0 * z], 3) == 1.0
    assert noise_inflation([0.1 * z], 3) == 1.0


def test_smooth_residuals_count_as_fewer_samples():
    # a first-order autoregression has the integrated autocorrelation time (1 + φ) / (1 - φ)
    rng, phi, n = np.random.default_rng(1), 0.8, 200_000
    noise, z = rng.standard_normal(n), np.empty(n)
    z[0] = noise[0]
    for i in range(1, n):
        z[i] = phi * z[i - 1] + np.sqrt(1 - phi**2) * noise[i]
    assert noise_inflation([z[None]], 0) == pytest.approx(9.0, rel=0.05)
    z[1000:1400] = np.nan
    assert noise_inflation([z[None]], 0) == pytest.approx(9.0, rel=0.05)


def test_correlation_has_a_unit_diagonal():
    covariance = posterior_covariance(np.random.default_rng(0).standard_normal((9, 4)), 0.5)
    found = correlation(covariance)
    np.testing.assert_allclose(np.diag(found), 1)
    assert np.all(np.abs(found) <= 1 + 1e-12)
    np.testing.assert_allclose(
        found * np.sqrt(np.outer(np.diag(covariance), np.diag(covariance))), covariance
    )


def groups(J, prior=1.0):
    return collinear_groups(posterior_covariance(np.asarray(J, dtype=float), prior), np.ones(np.shape(J)[1]))


def test_independent_pairs_are_separate_groups():
    J = np.zeros((6, 5))
    J[0, [0, 3]] = 50.0, 40.0
    J[1, [1, 4]] = 20.0, -20.0
    J[2, 2] = 30.0
    assert groups(J) == [(0, 3), (1, 4)]


def test_a_sum_of_many_is_one_group_and_a_chain_too():
    assert groups(100 * np.ones((1, 6))) == [(0, 1, 2, 3, 4, 5)]
    assert groups([[50, 50, 0], [0, 50, 50]]) == [(0, 1, 2)]


def test_no_group_where_all_is_determined_or_nothing_is():
    assert groups(50 * np.eye(4)) == []
    assert groups(np.zeros((3, 4))) == []
    assert groups([[50.0, 50.0], [50.0, 35.0]]) == []  # similar, but both determined


@given(st.permutations(range(5)))
def test_groups_do_not_depend_on_the_order_of_parameters(order):
    J = np.zeros((6, 5))
    J[0, [0, 3]] = 50.0, 40.0
    J[1, [1, 4]] = 20.0, -20.0
    found = {frozenset(order[j] for j in group) for group in groups(J[:, order])}
    assert found == {frozenset({0, 3}), frozenset({1, 4})}
