import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import sqrtm
from sklearn.utils.estimator_checks import parametrize_with_checks

from errorscreen.exceptions import InputError
from errorscreen.features import ErrorWhitener


@parametrize_with_checks([ErrorWhitener(), ErrorWhitener(noise=0.1), ErrorWhitener(n_components=2)])
def test_scikit_learn_contract(estimator, check):
    check(estimator)


def errors_like(seed, n=300, rank=6):
    """Errors of two channels in which few directions of very different size are mixed."""
    rng = np.random.default_rng(seed)
    shapes = rng.normal(size=(rank, 2, 10)) * np.array([1.0, 30.0])[:, None]
    return np.einsum("nk,krl->nrl", rng.normal(size=(n, rank)) * np.logspace(0, -3, rank), shapes)


def test_equals_the_wiener_filter_and_the_inverse_root_of_the_covariance():
    errors, noise = errors_like(0), np.array([0.01, 0.2])
    x = (errors / noise[:, None]).reshape(len(errors), -1)
    signal = np.cov(x, rowvar=False)
    measured = signal + np.eye(20)
    expected = (x - x.mean(axis=0)) @ np.real(
        sqrtm(np.linalg.inv(measured)) @ np.linalg.inv(measured) @ signal
    ).T
    found = ErrorWhitener(noise).fit(errors).transform(errors)
    np.testing.assert_allclose(
        found.reshape(len(errors), -1),
        expected,
        atol=1e-6,  # the root of an inverse loses digits
    )


def test_directions_above_the_noise_are_white_and_others_fade():
    errors = errors_like(1, n=20_000)
    white = ErrorWhitener(noise=1e-6).fit(errors).transform(errors).reshape(len(errors), -1)
    sizes = np.linalg.eigvalsh(np.cov(white, rowvar=False))[::-1]
    np.testing.assert_allclose(sizes[:6], 1.0, rtol=1e-3)
    assert sizes[6] < 1e-6
    assert np.std(ErrorWhitener(noise=1e6).fit(errors).transform(errors)) < 1e-3


def test_a_measured_error_is_filtered_as_well_as_a_linear_filter_can():
    errors, noise = errors_like(2, n=20_000), 0.05
    measured = errors + noise * np.random.default_rng(0).standard_normal(errors.shape)
    whitener = ErrorWhitener(noise).fit(errors)
    # before the gain of the whitening: coefficients of the noise-free part, in units of the noise
    coefficients, seen = (
        ((e / noise).reshape(len(e), -1) - whitener.mean_) @ whitener.components_[:6].T
        for e in (errors, measured)
    )
    shrink = (whitener.gains_[:6] ** -2 / coefficients.var(axis=0)) ** -0.5  # gain times deviation
    best = np.sqrt([np.polyfit(s, c, 1)[0] ** 3 for s, c in zip(seen.T, coefficients.T, strict=True)])
    np.testing.assert_allclose(shrink, best, rtol=0.05, atol=1e-3)


@settings(max_examples=20)
@given(factors=st.tuples(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3)), given_noise=st.booleans())
def test_the_units_of_the_channels_do_not_matter(factors, given_noise):
    errors, noise = errors_like(3), np.array([0.01, 0.2])
    factors = np.array(factors)
    plain = ErrorWhitener(noise if given_noise else None).fit(errors).transform(errors)
    other = factors[:, None] * errors
    scaled = ErrorWhitener(factors * noise if given_noise else None).fit(other).transform(other)
    np.testing.assert_allclose(scaled, plain, atol=1e-6)


def test_the_order_of_samples_and_channels_does_not_matter():
    errors = errors_like(4)
    plain = ErrorWhitener(0.1).fit(errors).transform(errors)
    order = np.random.default_rng(0).permutation(len(errors))
    np.testing.assert_allclose(ErrorWhitener(0.1).fit(errors[order]).transform(errors), plain, atol=1e-8)
    swapped = errors[:, ::-1]
    np.testing.assert_allclose(ErrorWhitener(0.1).fit(swapped).transform(swapped)[:, ::-1], plain, atol=1e-8)


def test_what_was_not_measured_stays_zero():
    errors, noise = errors_like(5), np.full((2, 10), 0.1)
    errors[:, 1, 4:7], noise[1, 4:7] = 0.0, 0.0
    white = ErrorWhitener(noise).fit(errors).transform(errors)
    np.testing.assert_allclose(white[:, 1, 4:7], 0.0, atol=1e-10)
    constant = ErrorWhitener().fit(np.zeros((5, 1, 4))).transform(np.zeros((5, 1, 4)))
    np.testing.assert_array_equal(constant, 0.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"noise": [0.1, 0.1, 0.1]}, "for each of 2 channels"),
        ({"noise": -1.0}, "noise is -1.0"),
        ({"noise": np.nan}, "noise is nan"),
        ({"floor": 0.0}, "floor"),
        ({"n_components": 0}, "n_components"),
    ],
)
def test_options_that_cannot_be_used_are_input_errors(options, message):
    with pytest.raises(InputError, match=message.replace("[", r"\[")):
        ErrorWhitener(**options).fit(errors_like(0))
