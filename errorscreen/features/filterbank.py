r"""Continuous wavelet transform of many signals at once.

Each scale is one filter, built once and applied by FFT. Its taps are means of the wavelet over one sample each,

.. math:: h_d = \frac1{\sqrt a}\int_{-d-1/2}^{-d+1/2} \psi^*(s/a)\,ds                                  \qquad (6a)

with the integral of a spline through the wavelet. `pywt.cwt` has the same integral as a table of 2**precision points
and takes the nearest one below. Where a sample of the signal is shorter than the table's step, its taps repeat, so that
a row of low frequency answers to a tone of high frequency as well; and it is half a sample late. With `precision`
stated, the filters are those of `pywt.cwt`.
"""

from __future__ import annotations

import warnings
from functools import partial
from typing import Any

import numpy as np
import pywt
import scipy.fft
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from errorscreen.exceptions import InputError

# points of the mother wavelet as a power of 2, pywt.cwt's own default: their spline is exact to 1e-7
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


def central_frequency(wavelet: Any, precision: int | None = None) -> float:
    """Frequency of the mother wavelet in cycles per sample at scale 1, as `pywt.cwt` reports it."""
    return float(pywt.scale2frequency(wavelet, 1.0, precision or PRECISION))


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
    precision : int, optional
        Take the filters of `pywt.cwt` with this precision. Where not given, they are (6a).

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
    :math:`\psi_{a,b}(t) = a^{-1/2}\, \psi((t - b) / a)`, of a signal that is constant over each sample, and zero
    outside the record.

    Examples
    --------
    >>> signals = np.random.default_rng(0).normal(size=(3, 50))
    >>> bank = FilterBank([2, 4, 8], "cmor2.0-1.0", 50, precision=12)
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
        precision: int | None = None,
    ) -> None:
        mother = read_wavelet(wavelet)
        self.scales = np.atleast_1d(np.asarray(scales, dtype=float))
        if not np.all(self.scales > 0):
            raise InputError(f"the smallest scale is {self.scales.min():g}", allowed="positive scales")
        self.n_times = n_times
        self.n_parts = 2 if mother.complex_cwt else 1
        # circular convolution of this length is exact for the first L outputs, see `_taps`
        self._n_fft = scipy.fft.next_fast_len(2 * n_times - 1, real=True)
        if precision is None:
            psi, x = mother.wavefun(PRECISION)
            taps_at = partial(self._taps, CubicSpline(x, np.conj(psi)).antiderivative(), x)
        else:
            integral, x = pywt.integrate_wavelet(mother, precision=precision)
            taps_at = partial(self._taps_of_pywt, np.conj(integral), x)
        filters = np.zeros((self.n_parts, len(self.scales), self._n_fft))
        for row, scale in enumerate(self.scales):
            if scale * (x[-1] - x[0]) < 1:
                raise InputError(
                    f"scale {scale:g} is too small to sample the wavelet",
                    remedy="Lower the highest frequency (f_max) or use a shorter sampling period",
                )
            taps = taps_at(scale)
            for part, values in enumerate([taps.real, taps.imag][: self.n_parts]):
                filters[part, row, :n_times] = values[n_times - 1 :]
                if n_times > 1:
                    filters[part, row, 1 - n_times :] = values[: n_times - 1]
        spectra = scipy.fft.rfft(filters, axis=-1)
        self._spectra = spectra.astype(np.result_type(dtype, np.complex64))

    def _taps(self, integral: CubicSpline, x: NDArray[np.float64], scale: float) -> NDArray[Any]:
        """Impulse response at the delays -(L - 1) ... L - 1, (6a); others lead out of the record."""
        edges = (np.arange(1 - self.n_times, self.n_times + 1) - 0.5) / scale
        return np.asarray(np.sqrt(scale) * np.diff(integral(np.clip(edges, x[0], x[-1]))))[::-1]

    def _taps_of_pywt(self, integral: NDArray[Any], x: NDArray[np.float64], scale: float) -> NDArray[Any]:
        """The same of `pywt.cwt`."""
        # which samples of the integral pywt.cwt takes at this scale, by its own formula
        index = (np.arange(scale * (x[-1] - x[0]) + 1) / (scale * (x[1] - x[0]))).astype(int)
        index = index[index < integral.size]
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
