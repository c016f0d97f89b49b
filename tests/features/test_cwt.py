import numpy as np
import pytest
import pywt
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.utils.estimator_checks import parametrize_with_checks

from errorscreen.exceptions import InputError
from errorscreen.features import ChannelScaler, CWTTransformer, ResponseErrorTransformer
from errorscreen.features import cwt as cwt_module
from errorscreen.features.cwt import column_weights, pool_columns

SMALL = {"n_frequencies": 6, "n_columns": 16}


@parametrize_with_checks(
    [
        CWTTransformer(),
        CWTTransformer(energy="linear", signed="linear", output="flat", dtype="float64", **SMALL),
        CWTTransformer("mexh", spacing="linear", f_min=0.01, f_max=0.2, n_jobs=2, **SMALL),
    ]
)
def test_scikit_learn_contract(estimator, check):
    check(estimator)


def errors_like(seed, n=3, channels=2, length=80):
    return np.random.default_rng(seed).normal(size=(n, channels, length))


@settings(max_examples=25)
@given(
    length=st.integers(2, 120),
    columns=st.integers(1, 60),
    wavelet=st.sampled_from(["cmor2.0-1.0", "morl", "mexh", "gaus1", "cgau2"]),
    spacing=st.sampled_from(["log", "linear"]),
    period=st.floats(1e-4, 100),
    seed=st.integers(0, 999),
)
def test_energy_is_the_mean_of_pywts_squared_coefficients_over_each_column(
    length, columns, wavelet, spacing, period, seed
):
    errors = errors_like(seed, length=length)
    transformer = CWTTransformer(
        wavelet,
        sampling_period=period,
        spacing=spacing,
        n_frequencies=4,
        n_columns=columns,
        energy="linear",
        dtype="float64",
        precision=12,
    )
    images = transformer.fit_transform(errors)
    coefficients, frequencies = pywt.cwt(errors, transformer.scales_, wavelet, sampling_period=period)
    np.testing.assert_allclose(transformer.frequencies_, frequencies)
    energy = np.moveaxis(np.abs(coefficients) ** 2, 0, 2)
    # repeating each sample W times and averaging L at a time is the same mean, written with whole numbers
    expected = np.repeat(energy, columns, axis=-1).reshape(*energy.shape[:-1], columns, length).mean(-1)
    np.testing.assert_allclose(images, expected, rtol=1e-9, atol=1e-12 * expected.max())


@settings(max_examples=100)
@given(length=st.integers(1, 400), columns=st.integers(1, 400))
def test_columns_share_out_every_sample_exactly_once(length, columns):
    index, weight = column_weights(length, columns)
    assert np.all(weight >= 0)
    np.testing.assert_allclose(weight.sum(axis=1), 1)
    per_sample = np.bincount(index.ravel(), weight.ravel(), minlength=length)
    np.testing.assert_allclose(per_sample, columns / length)
    assert pool_columns(np.arange(length)[None], index, weight)[0, 0] >= 0
    assert np.all(np.diff(pool_columns(np.arange(float(length)), index, weight)) >= -1e-9)


@settings(max_examples=20)
@given(factor=st.floats(1e-3, 1e3), seed=st.integers(0, 999))
def test_scaling_a_signal_by_a_scales_its_energy_by_a_squared(factor, seed):
    errors = errors_like(seed)
    linear = CWTTransformer(energy="linear", dtype="float64", **SMALL).fit(errors)
    np.testing.assert_allclose(linear.transform(factor * errors), factor**2 * linear.transform(errors))
    # the floor follows the training set, so log-energy only shifts and compressed parts do not change
    log = CWTTransformer(signed="compressed", dtype="float64", **SMALL)
    expected = log.fit_transform(errors)
    expected[:, :2] += 2 * np.log10(factor)
    np.testing.assert_allclose(log.fit_transform(factor * errors), expected, atol=1e-9)


@pytest.mark.parametrize("wavelet", ["cmor2.0-1.0", "mexh"])
def test_a_delay_of_whole_columns_moves_the_image_by_them(wavelet):
    pulse = np.zeros((1, 1, 400))
    pulse[..., 100:110] = np.hanning(10)
    transformer = CWTTransformer(
        wavelet, n_columns=100, n_frequencies=8, f_min=0.05, energy="linear", dtype="float64"
    ).fit(pulse)
    early = transformer.transform(pulse)
    late = transformer.transform(np.roll(pulse, 4 * 7, axis=-1))
    np.testing.assert_allclose(late[..., 7:], early[..., :-7], rtol=0, atol=1e-9 * early.max())


@pytest.mark.parametrize("spacing", ["log", "linear"])
@pytest.mark.parametrize("row", [4, 10, 20, 27])
def test_an_oscillation_peaks_at_its_frequency_and_a_burst_at_its_time(spacing, row):
    time = np.arange(1000) * 0.005
    transformer = CWTTransformer(
        sampling_period=0.005,
        f_min=1,
        f_max=40,
        n_frequencies=32,
        n_columns=100,
        spacing=spacing,
        energy="linear",
    ).fit(time[None])
    frequency = transformer.frequencies_[row]
    oscillation = np.sin(2 * np.pi * frequency * time + 0.3)
    image = transformer.transform(oscillation[None])[0, 0]
    inside = np.abs(transformer.times_ - time.mean()) < time[-1] / 2 - transformer.cone_of_influence_[row]
    assert set(image[:, inside].argmax(axis=0)) == {row}
    burst = oscillation * np.exp(-(((time - 3.0) / 0.3) ** 2))
    image = transformer.transform(burst[None])[0, 0]
    assert transformer.times_[image[row].argmax()] == pytest.approx(3.0, abs=0.05)


def test_the_cone_of_influence_bounds_where_the_end_of_the_record_shows():
    # a record that stops while the error lasts: the end acts like a step
    transformer = CWTTransformer(n_columns=400, f_min=0.02, f_max=0.2, energy="linear", dtype="float64")
    image = transformer.fit_transform(np.ones((1, 400)))[0, 0]
    end = transformer.times_[-1] - transformer.times_
    for row, reach in zip(image, transformer.cone_of_influence_, strict=True):
        middle = row[(end > 2.5 * reach) & (transformer.times_ > 2.5 * reach)]
        assert row[-1] > 0
        assert np.all(middle < 1e-3 * row.max())


def test_no_row_answers_to_a_tone_far_above_its_frequency():
    time = np.arange(4001) / 400.0
    tone = np.sin(2 * np.pi * 102.0 * time)[None]
    options = {
        "sampling_period": 1 / 400,
        "f_min": 0.4,
        "f_max": 180,
        "n_frequencies": 40,
        "energy": "linear",
    }
    far = {}
    for precision in (None, 12):
        transformer = CWTTransformer(precision=precision, **options)
        image = transformer.fit_transform(tone)[0, 0, :, 64:192]
        far[precision] = image[transformer.frequencies_ < 51].max() / image.max()
    assert far[None] < 1e-3
    # which is no matter of course: PyWavelets samples the wavelet too coarsely
    assert far[12] > 0.5


def test_signed_parts_are_the_real_and_imaginary_coefficients():
    errors = errors_like(1, length=16)
    options = dict(signed="linear", energy="linear", dtype="float64", precision=12, **SMALL)
    transformer = CWTTransformer(**options)
    images = transformer.fit_transform(errors)
    assert transformer.n_images_ == images.shape[1] == 6
    coefficients = np.moveaxis(pywt.cwt(errors, transformer.scales_, transformer.wavelet)[0], 0, 2)
    np.testing.assert_allclose(images[:, 2:4], coefficients.real, atol=1e-12)
    np.testing.assert_allclose(images[:, 4:], coefficients.imag, atol=1e-12)
    np.testing.assert_allclose(images[:, :2], np.abs(coefficients) ** 2, atol=1e-12)
    assert CWTTransformer("morl", **options).fit_transform(errors).shape[1] == 4
    compressed = CWTTransformer(**{**options, "signed": "compressed"}).fit(errors)
    mirrored = -compressed.transform(errors)[:, 2:]
    np.testing.assert_allclose(compressed.transform(-errors)[:, 2:], mirrored, atol=1e-12)


@pytest.mark.parametrize("order", [[2, 0, 1], [1, 0, 2]])
def test_permuted_channels_give_permuted_images(order):
    errors = errors_like(7, channels=3)
    transformer = CWTTransformer(signed="compressed", **SMALL)
    expected = transformer.fit_transform(errors).reshape(3, 3, 3, 6, 16)[:, :, order]
    permuted = transformer.fit_transform(errors[:, order]).reshape(3, 3, 3, 6, 16)
    np.testing.assert_array_equal(permuted, expected)


def test_one_row_of_channels_gives_the_same_images_as_three_axes():
    errors = errors_like(2)
    stacked = CWTTransformer(**SMALL).fit_transform(errors)
    flat = CWTTransformer(n_channels=2, output="flat", **SMALL).fit_transform(errors.reshape(3, -1))
    np.testing.assert_array_equal(flat, stacked.reshape(3, -1))


def test_the_result_depends_neither_on_threads_nor_on_blocks_nor_on_other_samples(monkeypatch):
    errors = errors_like(3, n=11)
    transformer = CWTTransformer(**SMALL).fit(errors)
    expected = transformer.transform(errors)
    assert expected.dtype == np.float32
    np.testing.assert_array_equal(clone(transformer).set_params(n_jobs=2).fit_transform(errors), expected)
    np.testing.assert_allclose(transformer.transform(errors[4:5]), expected[4:5], rtol=1e-5)
    monkeypatch.setattr(cwt_module, "_BLOCK_BYTES", 1)
    np.testing.assert_allclose(transformer.transform(errors), expected, rtol=1e-5)


@pytest.mark.parametrize("rounding", [0.0, 1e-30])
def test_a_silent_channel_gives_a_flat_image(rounding):
    errors = errors_like(4)
    errors[:, 1] *= rounding
    images = CWTTransformer(signed="compressed", **SMALL).fit_transform(errors)
    assert np.all(np.isfinite(images))
    assert np.ptp(images[:, 1]) < 1e-6
    assert np.abs(images[:, [3, 5]]).max() < 1e-6


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"wavelet": "Morlet"}, "wavelet 'Morlet' is unknown"),
        ({"sampling_period": 0}, "sampling_period is 0. Allowed: a number > 0"),
        ({"sampling_period": 0.01, "f_max": 60}, "f_max is 60. Allowed: a number > 0 and <= 50"),
        ({"f_min": 0.3, "f_max": 0.2}, "the frequencies run from 0.3 to 0.2 Hz"),
        ({"f_min": 0.0}, "f_min is 0.0"),
        ({"n_frequencies": 0}, "n_frequencies is 0. Allowed: an integer from 1 on"),
        ({"n_columns": 2.5}, "n_columns is 2.5"),
        ({"spacing": "octave"}, "spacing='octave'. Allowed: 'log', 'linear'"),
        ({"energy": "dB"}, "energy='dB'"),
        ({"floor": np.nan}, "floor is nan"),
        ({"signed": "yes"}, "signed='yes'"),
        ({"output": "table"}, "output='table'"),
        ({"precision": 30}, "precision is 30. Allowed: an integer from 8 to 20"),
        ({"dtype": "float16"}, "dtype='float16'"),
        ({"n_channels": 3}, "X has 2 channels. Allowed: n_channels=3"),
    ],
)
def test_options_that_cannot_be_used_are_input_errors(options, message):
    with pytest.raises(InputError) as caught:
        CWTTransformer(**options).fit(errors_like(0))
    assert message in str(caught.value)


def test_shapes_that_do_not_fit_are_input_errors():
    transformer = CWTTransformer(**SMALL).fit(errors_like(0))
    with pytest.raises(InputError, match=r"X has shape \(3, 2, 70\).*\(n, 2, 80\), as in fit"):
        transformer.transform(errors_like(0, length=70))
    with pytest.raises(InputError, match=r"\(samples, channels, time\) or \(samples, time\)"):
        transformer.fit(np.zeros((2, 2, 2, 2)))
    with pytest.raises(InputError, match="7 values cannot be divided into 2 channels"):
        CWTTransformer(n_channels=2).fit(np.zeros((3, 7)))


def test_composes_in_a_pipeline_from_responses_to_a_prediction():
    rng = np.random.default_rng(5)
    amplitude = rng.uniform(1, 3, size=60)
    responses = 1.0 + amplitude[:, None, None] * np.sin(np.arange(100) / 4)
    pipeline = make_pipeline(
        ResponseErrorTransformer(baseline=np.ones((1, 100))),
        CWTTransformer(output="flat", **SMALL),
        ChannelScaler(),
        Ridge(1e-3),
    )
    clone(pipeline).set_params(cwttransformer__wavelet="mexh").fit(responses[:40], amplitude[:40])
    pipeline.fit(responses[:40], np.log(amplitude[:40]))
    assert pipeline.score(responses[40:], np.log(amplitude[40:])) > 0.99
