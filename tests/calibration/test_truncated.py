"""The sampler against rejection sampling and closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import truncnorm

from errorscreen.calibration.truncated import sample_truncated_normal
from errorscreen.exceptions import InputError

MEAN = np.array([0.4, -0.2, 1.5])
PRECISION = np.linalg.inv(np.array([[1.0, 0.9, 0.2], [0.9, 1.0, 0.0], [0.2, 0.0, 0.5]]))
LOWER, UPPER = np.array([-0.5, -1.0, -1.0]), np.array([1.0, 0.3, 1.0])


def test_equals_rejection_sampling():
    rng = np.random.default_rng(0)
    raw = rng.multivariate_normal(MEAN, np.linalg.inv(PRECISION), 400_000)
    exact = raw[((raw >= LOWER) & (raw <= UPPER)).all(axis=1)]
    found = sample_truncated_normal(MEAN, PRECISION, LOWER, UPPER, 20_000, random_state=1)
    error = exact.std(axis=0) / np.sqrt(20_000 / 5)  # five sweeps count as one independent one
    assert np.all(np.abs(found.mean(axis=0) - exact.mean(axis=0)) < 4 * error)
    np.testing.assert_allclose(np.cov(found.T), np.cov(exact.T), atol=0.012)


def test_far_bounds_leave_a_normal_distribution():
    wide = np.full(3, 100.0)
    found = sample_truncated_normal(MEAN, PRECISION, -wide, wide, 20_000, random_state=2)
    np.testing.assert_allclose(np.cov(found.T), np.linalg.inv(PRECISION), atol=0.04)
    np.testing.assert_allclose(found.mean(axis=0), MEAN, atol=0.04)


def test_a_thin_distribution_across_the_box_is_crossed():
    # only the sum is known, to 1e-6: the difference is as open as the bounds leave it
    direction = np.array([1.0, 1.0]) / np.sqrt(2)
    precision = 1e12 * np.outer(direction, direction) + 1e-2 * np.eye(2)
    x = sample_truncated_normal([0.0, 0.0], precision, [-1, -1], [1, 1], 4000, random_state=3)
    assert np.abs(x.sum(axis=1)).max() < 1e-5
    np.testing.assert_allclose(np.quantile(x[:, 0], [0.1, 0.5, 0.9]), [-0.8, 0.0, 0.8], atol=0.08)


@pytest.mark.parametrize("start", [np.ones(12), np.full(12, 0.5)])
def test_a_corner_is_left_again(start):
    # along the eigenvectors of a dense matrix there is no way out of a corner of the box
    rng = np.random.default_rng(0)
    A = rng.standard_normal((12, 12))
    precision = A @ A.T + 0.1 * np.eye(12)
    mean = np.full(12, 2.0)
    x = sample_truncated_normal(mean, precision, np.zeros(12), np.ones(12), 4000, start=start, random_state=1)
    other = sample_truncated_normal(
        mean, precision, np.zeros(12), np.ones(12), 4000, start=np.full(12, 0.2), random_state=2
    )
    assert x.std(axis=0).min() > 0.01
    np.testing.assert_allclose(x.mean(axis=0), other.mean(axis=0), atol=0.03)


@settings(max_examples=25)
@given(mean=st.floats(-30, 30), width=st.floats(0.01, 5), seed=st.integers(0, 2**16))
def test_one_dimension_has_the_closed_form(mean, width, seed):
    x = sample_truncated_normal([mean], [[1.0]], [0.0], [width], 2048, random_state=seed)
    law = truncnorm(-mean, width - mean, loc=mean)
    assert np.all((x >= 0) & (x <= width))
    assert abs(x.mean() - law.mean()) < 5 * max(law.std(), 1e-9) / np.sqrt(2048)


def test_same_seed_same_samples():
    first, second = (
        sample_truncated_normal(MEAN, PRECISION, LOWER, UPPER, 70, random_state=5) for _ in range(2)
    )
    assert first.shape == (70, 3)
    assert np.array_equal(first, second)


@pytest.mark.parametrize(
    ("precision", "upper"),
    [
        (-PRECISION, UPPER),
        (PRECISION, LOWER),
        (PRECISION, [np.inf, 1, 1]),
        (PRECISION[:2, :2], UPPER),
        (np.nan * PRECISION, UPPER),
    ],
)
def test_what_cannot_be_sampled_is_an_input_error(precision, upper):
    with pytest.raises(InputError):
        sample_truncated_normal(MEAN, precision, LOWER, upper, 10)
