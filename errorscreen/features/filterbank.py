"""Continuous wavelet transform of many signals at once, equal to `pywt.cwt`.

`pywt.cwt` convolves the signal with the integral of the wavelet and differentiates. Both are linear, so each scale is
one filter, built once and applied by FFT.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pywt
import scipy.fft
from numpy.typing import ArrayLike, NDArray

from errorscreen.exceptions import InputError

# pywt.cwt's own default: the mother wavelet is sampled on 2**12 points
PRECISION = 12


def read_wavelet(name: str) -> Any:
    """Return the continuous wavelet of this name in PyWavelets, or raise `InputError`."""
    allowed = ", ".join(pywt.wavelist(kind="continuous"))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a family name without its numbers is deprecated in PyWavelets
            wavelet = pywt.DiscreteContinuousWavelet(name)
    except (ValueError, TypeError, AttributeError, FutureWarning) as error:
        raise InputError(
            f"wavelet {name!r} is unknown or incomplete",
            allowed=allowed,
            remedy="Give cmor, shan and fbsp with their numbers, for example 'cmor2.0-1.0'",
        ) from error
    if not isinstance(wavelet, pywt.ContinuousWavelet):
        raise InputError(f"wavelet {name!r} is a discrete wavelet", allowed=allowed)
    return wavelet


def central_frequency(wavelet: Any, precision: int = PRECISION) -> float:
    """Frequency of the mother wavelet in cycles per sample at scale 1, as `pywt.cwt` reports it."""
    return float(pywt.scale2frequency(wavelet, 1.0, precision))


def effective_radius(wavelet: Any) -> float:
    r"""Half-width of the mother wavelet in samples at scale 1: two standard deviations of :math:`|\psi|^2`.
    For a Morlet wavelet it is the cone of influence of Torrence and Compo (1998, table 1).
    """
    psi, x = wavelet.wavefun(PRECISION)
    weight = np.abs(psi) ** 2 / np.sum(np.abs(psi) ** 2)
    return float(2 * np.sqrt(np.sum(weight * x**2) - np.sum(weight * x) ** 2))


class FilterBank:
    r"""One filter per scale, for real signals of one length.

    Parameters
    ----------
    scales : array-like of shape (H,)
        Positive; in samples.
    wavelet : str
        Continuous wavelet, by PyWavelets' name.
    n_times : int
        Length L of the signals.
    dtype : {float64, float32}, default float64
        Precision of the transform. The filters themselves are always computed in float64.
    precision : int, default 12
        The mother wavelet is sampled on 2**precision points, as in `pywt.cwt`.

    Attributes
    ----------
    n_parts : int
        2 (real and imaginary part) for a complex wavelet, 1 for a real one.

    Raises
    ------
    InputError
        If the wavelet is unknown or a scale is too small to be sampled.

    Notes
    -----
    Equation (6), :math:`W(a, b) = \int e(t)\, \psi^*_{a,b}(t)\, dt`, with (5),
    :math:`\psi_{a,b}(t) = a^{-1/2}\, \psi((t - b) / a)`, in the discrete form that `pywt.cwt` gives them.
    The signal counts as zero outside the record.

    Examples
    --------
    >>> signals = np.random.default_rng(0).normal(size=(3, 50))
    >>> bank = FilterBank([2, 4, 8], "cmor2.0-1.0", 50)
    >>> expected, _ = pywt.cwt(signals, [2, 4, 8], "cmor2.0-1.0")
    >>> np.allclose(bank.transform(signals), expected.transpose(1, 0, 2))
    True
    """

    def __init__(
        self,
        scales: ArrayLike,
        wavelet: str,
        n_times: int,
        dtype: Any = np.float64,
        precision: int = PRECISION,
    ) -> None:
        mother = read_wavelet(wavelet)
        self.scales = np.atleast_1d(np.asarray(scales, dtype=float))
        if not np.all(self.scales > 0):
            raise InputError(f"the smallest scale is {self.scales.min():g}", allowed="positive scales")
        self.n_times = n_times
        self.n_parts = 2 if mother.complex_cwt else 1
        # circular convolution of this length is exact for the first L outputs, see `_taps`
        self._n_fft = scipy.fft.next_fast_len(2 * n_times - 1, real=True)
        integral, x = pywt.integrate_wavelet(mother, precision=precision)
        filters = np.zeros((self.n_parts, len(self.scales), self._n_fft))
        for row, scale in enumerate(self.scales):
            taps = self._taps(np.conj(integral), x, scale)
            for part, values in enumerate([taps.real, taps.imag][: self.n_parts]):
                filters[part, row, :n_times] = values[n_times - 1 :]
                if n_times > 1:
                    filters[part, row, 1 - n_times :] = values[: n_times - 1]
        spectra = scipy.fft.rfft(filters, axis=-1)
        self._spectra = spectra.astype(np.result_type(dtype, np.complex64))

    def _taps(self, integral: NDArray[Any], x: NDArray[np.float64], scale: float) -> NDArray[Any]:
        """Impulse response at the delays -(L - 1) ... L - 1; others lead out of the record."""
        # which samples of the integral pywt.cwt takes at this scale, by its own formula
        index = (np.arange(scale * (x[-1] - x[0]) + 1) / (scale * (x[1] - x[0]))).astype(int)
        index = index[index < integral.size]
        if len(index) < 2:
            raise InputError(
                f"scale {scale:g} is too small to sample the wavelet",
                remedy="Lower the highest frequency (f_max) or use a shorter sampling period",
            )
        taps = -np.sqrt(scale) * np.diff(integral[index][::-1], prepend=0, append=0)
        # pywt.cwt keeps the middle of the convolution; this is the tap at delay zero
        centre = 1 + (len(index) - 2) // 2
        delays = np.arange(1 - self.n_times, self.n_times) + centre
        inside = (delays >= 0) & (delays < len(taps))
        out = np.zeros(len(delays), dtype=taps.dtype)
        out[inside] = taps[delays[inside]]
        return out

    def parts(self, signals: NDArray[Any]) -> NDArray[Any]:
        """Real and, for a complex wavelet, imaginary parts of the coefficients of signals (n, L): (parts, n, H, L)."""
        spectrum = scipy.fft.rfft(signals, self._n_fft, axis=-1).astype(self._spectra.dtype)
        product = spectrum[None, :, None, :] * self._spectra[:, None, :, :]
        values = scipy.fft.irfft(product, self._n_fft, axis=-1, overwrite_x=True)
        return values[..., : self.n_times]

    def transform(self, signals: NDArray[Any]) -> NDArray[Any]:
        """Coefficients W(a, b) of signals (n, L), shape (n, H, L), complex for a complex wavelet."""
        parts = self.parts(signals)
        return parts[0] + 1j * parts[1] if self.n_parts == 2 else parts[0]
