"""Time–frequency images of response errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import check_is_fitted

from errorscreen.exceptions import InputError, check_integer, check_real
from errorscreen.features.checks import (
    StackTransformer,
    check_choice,
    check_stack,
    has_columns,
    split_channels,
)
from errorscreen.features.filterbank import (
    FilterBank,
    central_frequency,
    effective_radius,
    read_wavelet,
)

# bytes of coefficients worked on at a time: a core's cache, which doubled the speed against tens of megabytes
_BLOCK_BYTES = 2**20


class CWTTransformer(StackTransformer):
    r"""Wavelet energy images of response errors, equations (5)–(8), (10), (11) and (16).

    Parameters
    ----------
    wavelet : str, default "cmor2.0-1.0"
        Continuous wavelet, by PyWavelets' name. The default is the Morlet wavelet with unit Gaussian and ω₀ = 2π.
        It is complex, so its energy follows the envelope of an oscillation; the energy of the real ``"morl"`` drops
        to zero twice in each period. At centre frequency 1 the frequency axis is exact; PyWavelets rounds others to
        1/16.
    sampling_period : float, default 1.0
        Time between samples in seconds.
    f_min, f_max : float, optional
        Lowest and highest frequency in hertz. Defaults: one period per record, and half the sampling rate.
    n_frequencies : int, default 64
        Number of rows H.
    spacing : {"log", "linear"}, default "log"
        Spacing of the frequencies.
    n_columns : int, default 256
        Number of time columns W.
    energy : {"log", "linear"}, default "log"
        ``"log"`` gives log₁₀(E + floor of the channel).
    floor : float, default 1e-3
        With ``energy="log"``: the floor of a channel as a multiple of its mean square in fit. Energies far below the
        errors of the training set then look alike.
    signed : {False, "linear", "compressed"}, default False
        Append the real and, for a complex wavelet, the imaginary part of the coefficients as further channels. They
        distinguish a rise from a fall. ``"compressed"`` is asinh(W / √floor). ``"linear"`` leaves them unchanged, so
        that the contributions of several parameters add up.
    output : {"images", "flat"}, default "images"
        (n, C, H, W), or one row of C·H·W values for each sample, for estimators that read tables.
    precision : int, optional
        Take the coefficients of `pywt.cwt`, which samples the mother wavelet on 2**precision points: where these are
        further apart than the samples of the signal, rows of low frequency answer to tones of high frequency, and every
        row is half a sample late. Where not given, the wavelet is integrated over each sample.
    dtype : {"float32", "float64"}, default "float32"
        Precision of transform and result.
    n_channels : int, optional
        Number of channels R where a row of X holds the channels one after another; 1 where not given.
    n_jobs : int, optional
        Threads, as in joblib. The result does not depend on it.

    Attributes
    ----------
    frequencies_ : ndarray of shape (H,)
        Equivalent frequency of each row in hertz, increasing.
    times_ : ndarray of shape (W,)
        Middle of each column in seconds after the first sample.
    scales_ : ndarray of shape (H,)
        Scales a in samples.
    cone_of_influence_ : ndarray of shape (H,)
        Time in seconds from either end of the record that the end distorts: twice the standard deviation of |ψ|² at
        that scale.
    floor_ : ndarray of shape (R,)
        Energy added to each channel before the logarithm.
    n_images_ : int
        Number C of images for each sample: R energies, then R real and R imaginary parts if `signed`.
    shape_in_ : tuple
        Shape of one sample in fit.

    Raises
    ------
    InputError
        If an option, the frequency range or the shape of X cannot be used.

    Notes
    -----
    Coefficients have the sign and normalisation of `pywt.cwt` (:math:`a^{-1/2}` with a in samples). The signal counts
    as zero outside the record. Energy is :math:`E_r(a, b) = |W_r(a, b)|^2` (7). A column stands for the W-th part of
    the record and holds the mean energy of that part. This conserves the total energy; where there are fewer samples
    than columns, it repeats them (8).

    Examples
    --------
    >>> t = np.arange(500) * 0.01
    >>> errors = np.sin(2 * np.pi * 4 * t)[None, None]
    >>> cwt = CWTTransformer(sampling_period=0.01, f_min=1, f_max=16, n_frequencies=5, n_columns=100)
    >>> images = cwt.fit_transform(errors)
    >>> images.shape
    (1, 1, 5, 100)
    >>> print(cwt.frequencies_, images[0, 0, :, 50].argmax())
    [ 1.  2.  4.  8. 16.] 2
    """

    def __init__(
        self,
        wavelet: str = "cmor2.0-1.0",
        *,
        sampling_period: float = 1.0,
        f_min: float | None = None,
        f_max: float | None = None,
        n_frequencies: int = 64,
        spacing: str = "log",
        n_columns: int = 256,
        energy: str = "log",
        floor: float = 1e-3,
        signed: bool | str = False,
        output: str = "images",
        precision: int | None = None,
        dtype: str = "float32",
        n_channels: int | None = None,
        n_jobs: int | None = None,
    ) -> None:
        self.wavelet = wavelet
        self.sampling_period = sampling_period
        self.f_min = f_min
        self.f_max = f_max
        self.n_frequencies = n_frequencies
        self.spacing = spacing
        self.n_columns = n_columns
        self.energy = energy
        self.floor = floor
        self.signed = signed
        self.output = output
        self.precision = precision
        self.dtype = dtype
        self.n_channels = n_channels
        self.n_jobs = n_jobs

    def fit(self, X: ArrayLike, y: Any = None) -> CWTTransformer:
        """Set up axes, filters and floor for errors X of shape (n, R, L), or (n, R·L)."""
        self._check_options()
        errors = self._read(X, reset=True)
        n_times = errors.shape[2]
        self.frequencies_ = self._frequency_axis(n_times)
        mother = read_wavelet(self.wavelet)
        self.scales_ = central_frequency(mother, self.precision) / (self.frequencies_ * self.sampling_period)
        self.cone_of_influence_ = effective_radius(mother) * self.scales_ * self.sampling_period
        width = n_times / self.n_columns
        self.times_ = ((np.arange(self.n_columns) + 0.5) * width - 0.5) * self.sampling_period
        self._bank = FilterBank(self.scales_, self.wavelet, n_times, self.dtype, self.precision)
        mean_square = np.mean(np.square(errors, dtype=float), axis=(0, 2))
        smallest = np.finfo(self.dtype).tiny  # of the rounding that a silent channel may hold
        self.floor_ = np.maximum(self.floor * np.where(mean_square > 0, mean_square, 1.0), smallest)
        self.n_images_ = errors.shape[1] * (1 + self._bank.n_parts * bool(self.signed))
        return self

    def transform(self, X: ArrayLike) -> NDArray[Any]:
        """Images (n, C, H, W) of errors X, or rows (n, C·H·W) with ``output="flat"``."""
        check_is_fitted(self)
        errors = self._read(X, reset=False)
        n, n_channels, n_times = errors.shape
        images = np.empty((n, self.n_images_, self.n_frequencies, self.n_columns), dtype=self.dtype)
        columns = column_weights(n_times, self.n_columns, self.dtype)
        signal_bytes = self._bank.n_parts * self.n_frequencies * 2 * n_times * images.itemsize
        step = max(1, int(_BLOCK_BYTES / (n_channels * signal_bytes)))
        starts = np.arange(0, n, step)

        def fill(share: NDArray[np.int64]) -> None:
            for i in share:
                self._fill(images[i : i + step], errors[i : i + step], columns)

        shares = np.array_split(starts, effective_n_jobs(self.n_jobs))
        Parallel(n_jobs=self.n_jobs, require="sharedmem")(delayed(fill)(share) for share in shares)
        return images.reshape(n, -1) if self.output == "flat" else images

    @available_if(has_columns)
    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Names of the columns with ``output="flat"``: channel, frequency and number of the time column.

        For X of shape (n, R, L), `input_features` are the R channels, ``x0``, ``x1`` and so on where not given.

        Examples
        --------
        >>> cwt = CWTTransformer(f_min=0.1, f_max=0.4, n_frequencies=2, n_columns=2, output="flat")
        >>> cwt.fit(np.zeros((1, 1, 8))).get_feature_names_out(["P"]).tolist()
        ['P:0.1Hz:0', 'P:0.1Hz:1', 'P:0.4Hz:0', 'P:0.4Hz:1']
        """
        names = super().get_feature_names_out(input_features)
        if len(self.shape_in_) == 1:
            names = [f"x{r}" for r in range(len(self.floor_))]
        parts = ["", ".re", ".im"][: self.n_images_ // len(self.floor_)]
        return np.array(
            [
                f"{name}{part}:{frequency:.6g}Hz:{column}"
                for part in parts
                for name in names
                for frequency in self.frequencies_
                for column in range(self.n_columns)
            ],
            dtype=object,
        )

    def _is_table(self) -> bool:
        return self.output == "flat"

    def _fill(self, images: NDArray[Any], errors: NDArray[Any], columns: tuple[Any, Any]) -> None:
        """Write the images of a block of samples."""
        n, n_channels, n_times = errors.shape
        parts = self._bank.parts(errors.reshape(-1, n_times).astype(self.dtype))
        parts = parts.reshape(-1, n, n_channels, *parts.shape[2:])
        energy = pool_columns(np.einsum("p...,p...->...", parts, parts), *columns)
        floor = self.floor_.astype(self.dtype)[:, None, None]
        images[:, :n_channels] = np.log10(energy + floor) if self.energy == "log" else energy
        if self.signed:
            for k, part in enumerate(parts, start=1):
                values = np.arcsinh(part / np.sqrt(floor)) if self.signed == "compressed" else part
                images[:, k * n_channels : (k + 1) * n_channels] = pool_columns(values, *columns)

    def _read(self, X: ArrayLike, *, reset: bool) -> NDArray[Any]:
        name = type(self).__name__
        return split_channels(check_stack(self, X, reset=reset), self.n_channels, name)

    def _check_options(self) -> None:
        name = type(self).__name__
        check_choice("spacing", self.spacing, ("log", "linear"), name)
        check_choice("energy", self.energy, ("log", "linear"), name)
        check_choice("signed", self.signed, (False, "linear", "compressed"), name)
        check_choice("output", self.output, ("images", "flat"), name)
        check_choice("dtype", self.dtype, ("float32", "float64"), name)
        check_integer(self.n_frequencies, "n_frequencies")
        check_integer(self.n_columns, "n_columns")
        if self.precision is not None:
            check_integer(self.precision, "precision", low=8, high=20)
        check_real(self.sampling_period, "sampling_period", low=0, above=True)
        check_real(self.floor, "floor", low=0, above=True)

    def _frequency_axis(self, n_times: int) -> NDArray[np.float64]:
        name = type(self).__name__
        nyquist = 0.5 / self.sampling_period
        f_max = nyquist if self.f_max is None else self.f_max
        check_real(f_max, "f_max", low=0, above=True, high=nyquist)
        # a record of two samples has no period below half its sampling rate
        f_min = min(2 * nyquist / n_times, f_max / 2) if self.f_min is None else self.f_min
        check_real(f_min, "f_min", low=0, above=True)
        if not f_min < f_max:
            raise InputError(
                f"the frequencies run from {f_min:g} to {f_max:g} Hz",
                where=name,
                allowed="f_min < f_max",
                remedy=f"Half the sampling rate is {nyquist:g} Hz",
            )
        axis = np.geomspace if self.spacing == "log" else np.linspace
        return axis(f_min, f_max, self.n_frequencies)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.transformer_tags.preserves_dtype = []
        return tags


def column_weights(n_times: int, n_columns: int, dtype: Any = float) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """Samples that each of W columns overlaps, and their shares of the column, which sum to 1, both of shape (W, q)."""
    # in units in which a sample is W wide and a column L wide, all edges are integers and nothing is rounded
    left = np.arange(n_columns)[:, None] * n_times
    first = left // n_columns
    reach = int(np.max(-(-(left + n_times) // n_columns) - first))
    index = first + np.arange(reach)
    overlap = np.minimum((index + 1) * n_columns, left + n_times) - np.maximum(index * n_columns, left)
    return np.minimum(index, n_times - 1), (np.maximum(overlap, 0) / n_times).astype(dtype)


def pool_columns(values: NDArray[Any], index: NDArray[np.intp], weight: NDArray[Any]) -> NDArray[Any]:
    """Mean of `values` (…, L) over each column's part of the record, shape (…, W), see `column_weights`."""
    out = values[..., index[:, 0]] * weight[:, 0]
    for k in range(1, index.shape[1]):
        out += values[..., index[:, k]] * weight[:, k]
    return out
