import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from errorscreen.exceptions import InputError
from errorscreen.features import ChannelScaler


@parametrize_with_checks([ChannelScaler(), ChannelScaler(by="row"), ChannelScaler(by="pixel")])
def test_scikit_learn_contract(estimator, check):
    check(estimator)


def images_like(seed, n=130):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, 3, 4, 5)) * rng.uniform(0.01, 100, (3, 4, 1)) + rng.normal(size=(3, 4, 1)) * 10


@pytest.mark.parametrize(("by", "axis"), [("channel", 1), ("row", (1, 2)), ("pixel", (1, 2, 3))])
def test_equals_scikit_learns_scaler_on_the_values_of_each_channel_or_row(by, axis):
    images = images_like(0)
    keep = np.moveaxis(images, axis, range(np.size(axis)))
    table = keep.reshape(int(np.prod(keep.shape[: np.size(axis)])), -1).T
    expected = StandardScaler().fit(table)
    scaler = ChannelScaler(by=by, floor=0).fit(images)
    np.testing.assert_allclose(scaler.mean_.ravel(), expected.mean_)
    np.testing.assert_allclose(scaler.scale_.ravel(), expected.scale_)


@settings(max_examples=20)
@given(
    seed=st.integers(0, 999),
    by=st.sampled_from(["channel", "row", "pixel"]),
    axes=st.integers(2, 4),
    dtype=st.sampled_from([np.float32, np.float64]),
)
def test_inverse_transform_brings_images_back(seed, by, axes, dtype):
    images = images_like(seed, n=7).astype(dtype)
    images = images.reshape((*images.shape[: axes - 1], -1))
    scaler = ChannelScaler(by=by)
    scaled = scaler.fit_transform(images)
    assert scaled.shape == images.shape
    assert scaled.dtype == dtype
    back = scaler.inverse_transform(scaled)
    np.testing.assert_allclose(back, images, rtol=0, atol=1e3 * np.finfo(dtype).eps * np.abs(images).max())


@settings(max_examples=20)
@given(factor=st.floats(1e-3, 1e3), offset=st.floats(-100, 100))
def test_the_unit_of_a_channel_does_not_matter(factor, offset):
    images = images_like(1, n=9)
    other = images.copy()
    other[:, 1] = factor * other[:, 1] + offset
    np.testing.assert_allclose(
        ChannelScaler().fit_transform(other), ChannelScaler().fit_transform(images), atol=1e-6
    )


def test_statistics_are_those_of_the_training_set_only():
    training, later = images_like(2), 3 * images_like(3) + 1
    scaler = ChannelScaler().fit(training)
    mean, scale = scaler.mean_.copy(), scaler.scale_.copy()
    np.testing.assert_allclose(scaler.transform(later), (later - mean) / scale)
    np.testing.assert_array_equal(scaler.mean_, mean)


def test_what_is_next_to_nothing_stays_small():
    images = images_like(5)
    images[:, 0, 0] *= 1e-6
    scaler = ChannelScaler(by="pixel", floor=0.01).fit(images)
    assert scaler.scale_[0, 0].max() == pytest.approx(0.01 * scaler.scale_[0].max())
    assert scaler.transform(images)[:, 0, 0].std() < 0.01


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("value", [0.0, 0.1, -1e8])
def test_a_constant_channel_becomes_zero(dtype, value):
    images = images_like(4).astype(dtype)
    images[:, 2] = value
    scaler = ChannelScaler().fit(images)
    assert scaler.scale_[2] == 1
    assert np.abs(scaler.transform(images)[:, 2]).max() <= np.finfo(dtype).eps * abs(value)


def test_an_unknown_option_and_another_shape_are_input_errors():
    with pytest.raises(InputError, match=r"by='column'\. Allowed: 'channel', 'row', 'pixel'"):
        ChannelScaler(by="column").fit(images_like(0))
    scaler = ChannelScaler().fit(images_like(0))
    for method in (scaler.transform, scaler.inverse_transform):
        with pytest.raises(InputError, match=r"\(n, 3, 4, 5\), as in fit"):
            method(np.zeros((2, 3, 4, 6)))
