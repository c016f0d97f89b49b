import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.utils.estimator_checks import parametrize_with_checks

from errorscreen.exceptions import InputError
from errorscreen.features import ResponseErrorTransformer


@parametrize_with_checks([ResponseErrorTransformer(), ResponseErrorTransformer(missing="zero")])
def test_scikit_learn_contract(estimator, check):
    check(estimator)


@settings(max_examples=20)
@given(seed=st.integers(0, 999), shift=st.floats(-1e3, 1e3))
def test_the_error_adds_up_with_the_baseline_and_ignores_a_common_offset(seed, shift):
    rng = np.random.default_rng(seed)
    responses, baseline = rng.normal(size=(4, 2, 9)), rng.normal(size=(2, 9))
    error = ResponseErrorTransformer(baseline).fit_transform(responses)
    np.testing.assert_allclose(error + baseline, responses)
    shifted = ResponseErrorTransformer(baseline + shift).fit_transform(responses + shift)
    np.testing.assert_allclose(shifted, error, atol=1e-9)


def test_the_default_baseline_is_the_training_mean_and_frozen():
    rng = np.random.default_rng(0)
    training, later = rng.normal(size=(5, 2, 9)), rng.normal(size=(3, 2, 9))
    transformer = ResponseErrorTransformer().fit(training)
    np.testing.assert_allclose(transformer.baseline_, training.mean(axis=0))
    np.testing.assert_allclose(transformer.transform(later), later - training.mean(axis=0))


def test_one_row_of_channels_keeps_its_shape():
    responses = np.random.default_rng(1).normal(size=(5, 2, 9))
    expected = ResponseErrorTransformer(responses[0]).fit_transform(responses)
    flat = ResponseErrorTransformer(responses[0], n_channels=2).fit_transform(responses.reshape(5, 18))
    np.testing.assert_array_equal(flat, expected.reshape(5, 18))


def test_missing_values_are_refused_unless_zero_is_asked_for():
    responses = np.random.default_rng(2).normal(size=(5, 2, 9))
    gaps = responses.copy()
    gaps[1:, 0, 3] = np.nan
    gaps[:, 1, 7] = np.nan
    transformer = ResponseErrorTransformer()
    with pytest.raises(ValueError, match="NaN"):
        transformer.fit(gaps)
    error = clone(transformer).set_params(missing="zero").fit_transform(gaps)
    assert error[0, 0, 3] == 0  # the only sample measured there is its own mean
    assert np.all(error[:, 1, 7] == 0)
    assert np.all(error[np.isnan(gaps)] == 0)
    measured = np.isfinite(gaps).all(axis=0)
    np.testing.assert_allclose(
        error[:, measured], transformer.fit_transform(responses)[:, measured], atol=1e-15
    )
    with pytest.raises(ValueError, match="infinity"):
        ResponseErrorTransformer(missing="zero").fit(np.full((2, 3), np.inf))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"baseline": np.zeros((2, 8))}, "baseline has shape (2, 8). Allowed: (2, 9), as X"),
        ({"baseline": np.full((2, 9), np.nan)}, "baseline holds values that are not finite"),
        ({"missing": "drop"}, "missing='drop'. Allowed: 'raise', 'zero'"),
        ({"n_channels": 4}, "X has 2 channels. Allowed: n_channels=4"),
    ],
)
def test_options_that_cannot_be_used_are_input_errors(options, message):
    with pytest.raises(InputError) as caught:
        ResponseErrorTransformer(**options).fit(np.zeros((3, 2, 9)))
    assert message in str(caught.value)
