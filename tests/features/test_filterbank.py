import numpy as np
import pytest
import pywt
from hypothesis import given, settings
from hypothesis import strategies as st

from errorscreen.exceptions import InputError
from errorscreen.features import FilterBank
from errorscreen.features.filterbank import central_frequency, effective_radius, read_wavelet

NAMED = [name for name in pywt.wavelist(kind="continuous") if name not in ("cmor", "fbsp", "shan")]
BANDWIDTHS = st.floats(0.5, 5).map(lambda value: f"{value:.3f}")
CENTRES = st.floats(0.5, 3).map(lambda value: f"{value:.3f}")
WAVELETS = st.one_of(
    st.sampled_from(NAMED),
    st.builds("cmor{}-{}".format, BANDWIDTHS, CENTRES),
    st.builds("shan{}-{}".format, BANDWIDTHS, CENTRES),
    st.builds("fbsp{}-{}-{}".format, st.integers(1, 4), BANDWIDTHS, CENTRES),
)


@settings(max_examples=60)
@given(
    wavelet=WAVELETS,
    n_times=st.integers(1, 300),
    scales=st.lists(st.floats(0.4, 400), min_size=1, max_size=4),
    precision=st.sampled_from([12, 10, 15]),
    seed=st.integers(0, 2**32 - 1),
)
def test_coefficients_are_those_of_pywt(wavelet, n_times, scales, precision, seed):
    signals = np.random.default_rng(seed).normal(size=(2, n_times))
    expected = pywt.cwt(signals, scales, wavelet, precision=precision)[0].transpose(1, 0, 2)
    # what PyWavelets itself rounds: it takes differences of a convolution with the integrated wavelet, whose terms are
    # of this size and may cancel (one sample under a wavelet of 274 samples leaves 1e-4 of them)
    integral = np.abs(pywt.integrate_wavelet(wavelet, precision)[0]).max()
    terms = np.sqrt(max(scales)) * integral * np.abs(signals).sum(axis=1).max()
    largest = np.abs(expected).max()
    coefficients = FilterBank(scales, wavelet, n_times, precision=precision).transform(signals)
    assert coefficients.dtype == expected.dtype
    np.testing.assert_allclose(
        coefficients, expected, rtol=0, atol=1e-12 * largest + 4 * np.finfo(np.float64).eps * terms
    )
    single = FilterBank(scales, wavelet, n_times, np.float32, precision).transform(signals.astype(np.float32))
    assert single.dtype == (np.complex64 if np.iscomplexobj(expected) else np.float32)
    np.testing.assert_allclose(
        single, expected, rtol=0, atol=3e-6 * largest + 4 * np.finfo(np.float32).eps * terms
    )


@settings(max_examples=30)
@given(scale=st.floats(0.7, 300), n_times=st.integers(1, 200), seed=st.integers(0, 2**32 - 1))
def test_coefficients_are_the_integral_of_the_definition(scale, n_times, seed):
    """Equation (6) by quadrature, with the Morlet wavelet's own formula and a signal that is constant over a sample."""
    signal = np.random.default_rng(seed).normal(size=n_times)
    found = FilterBank([scale], "cmor2.0-1.0", n_times).transform(signal[None])[0, 0]
    nodes, weights = np.polynomial.legendre.leggauss(40)
    delay = np.arange(n_times)[:, None] - np.arange(n_times)
    u = (delay[..., None] + 0.5 * nodes) / scale
    psi = np.exp(-2j * np.pi * u - u**2 / 2.0) / np.sqrt(2.0 * np.pi)
    expected = (psi @ (0.5 * weights)).T @ signal / np.sqrt(scale)
    # the wavelet ends where it is 1e-14 of its height; the spline through its points is exact to 1e-7
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * np.abs(signal).sum() / np.sqrt(scale))


@pytest.mark.parametrize("wavelet", ["cmor2.0-1.0", "morl", "mexh", "gaus2"])
def test_a_burst_shows_at_its_time_where_pywt_is_half_a_sample_late(wavelet):
    time = np.arange(401) - 200.0
    burst = np.exp(-((time / 6.0) ** 2)) * np.cos(0.3 * time)
    for precision, late in ((None, 0.0), (12, 0.5)):
        energy = (
            np.abs(FilterBank([10.0, 20.0], wavelet, 401, precision=precision).transform(burst[None])[0]) ** 2
        )
        assert (energy * time).sum(axis=1) / energy.sum(axis=1) == pytest.approx(late, abs=0.02)


@pytest.mark.parametrize("wavelet", [*NAMED, "cmor2.0-1.0"])
def test_frequencies_are_those_of_pywt(wavelet):
    scales = np.array([2.0, 7.0])
    expected = pywt.cwt(np.zeros(10), scales, wavelet, sampling_period=0.01)[1]
    np.testing.assert_allclose(central_frequency(read_wavelet(wavelet)) / (scales * 0.01), expected)


def test_the_radius_grows_with_the_width_of_the_wavelet():
    narrow, wide = (effective_radius(read_wavelet(f"cmor{b}-1.0")) for b in (1.0, 4.0))
    assert wide == pytest.approx(2 * narrow, rel=1e-3)


@pytest.mark.parametrize("name", ["cmor", "db2", "Morlet", "nothing", "", None, 3, "cmor1-x"])
def test_a_name_that_is_no_continuous_wavelet_is_an_input_error(name):
    with pytest.raises(InputError, match="Allowed: cgau1"):
        FilterBank([4], name, 10)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan])
def test_scales_must_be_positive(scale):
    with pytest.raises(InputError, match="positive scales"):
        FilterBank([1.0, scale], "morl", 10)


def test_a_scale_too_small_to_sample_the_wavelet_is_an_input_error():
    with pytest.raises(InputError, match="Lower the highest frequency"):
        FilterBank([0.01], "morl", 10)
