"""Whitening of response errors: weak directions are amplified as far as they stand above the noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.decomposition import PCA
from sklearn.utils.validation import check_is_fitted

from errorscreen.exceptions import check_integer, check_real
from errorscreen.features.checks import StackTransformer, check_noise, check_stack, split_channels


class ErrorWhitener(StackTransformer):
    r"""Whiten errors by their covariance in the training set, after a Wiener filter has removed the noise.

    A few strong parameters shape nearly all of a response error. The effects of the others are small and lie on top.
    The whitener makes them visible. With errors x in units of the noise, all channels and instants in one vector, and
    the eigenvectors u and eigenvalues λ of the covariance of noise-free simulated errors,

    .. math:: z = \sum_i \frac{\lambda_i}{\lambda_i + 1} \, \frac{u_i^T (x - \bar x)}{\sqrt{\lambda_i + 1}} \, u_i

    The first factor is the Wiener filter: the expected noise-free part of a measured error. The second one whitens
    (ZCA), so that every direction above the noise counts alike. Each value stays at its channel and instant, so z has
    wavelet images like x.

    Parameters
    ----------
    noise : float or array-like of shape (R,) or (R, L), optional
        Standard deviation of the noise of measured errors, in the channel's unit; 0 where nothing was measured. None
        means no noise.
    floor : float, default 1e-4
        Noise assumed in a channel without noise, in multiples of the rms of its errors.
    n_components : int, default 256
        Largest number of directions.

    Attributes
    ----------
    scale_ : ndarray of shape (R, L)
        Divisor of the errors.
    mean_ : ndarray of shape (R·L,)
    components_ : ndarray of shape (k, R·L)
        Directions u, by falling λ.
    gains_ : ndarray of shape (k,)
        Factor of each direction.
    shape_in_ : tuple
        Shape of one sample in fit.

    Raises
    ------
    InputError
        If an option does not fit the data.

    Notes
    -----
    Wiener filter: N. Wiener, *Extrapolation, Interpolation, and Smoothing of Stationary Time Series*, 1949. ZCA: Kessy,
    Lewin and Strimmer, The American Statistician 72, 2018.

    Examples
    --------
    Two parameters with similar effects, one a hundred times stronger. The weak one is amplified:

    >>> t = np.linspace(0, 1, 50)
    >>> rng = np.random.default_rng(0)
    >>> strength = rng.normal(size=(400, 2)) * [100.0, 1.0]
    >>> errors = (strength @ [np.sin(6 * t), np.sin(7 * t)])[:, None]
    >>> white = ErrorWhitener(noise=0.1).fit(errors)
    >>> bool(white.gains_[1] > 100 * white.gains_[0])
    True
    """

    def __init__(
        self, noise: ArrayLike | None = None, *, floor: float = 1e-4, n_components: int = 256
    ) -> None:
        self.noise = noise
        self.floor = floor
        self.n_components = n_components

    def fit(self, X: ArrayLike, y: Any = None) -> ErrorWhitener:
        """Learn directions and gains from noise-free errors X of shape (n, R, L), or (n, L) for one channel."""
        n_components = check_integer(self.n_components, "n_components")
        floor = check_real(self.floor, "floor", low=0.0, above=True)
        stack = check_stack(self, X, reset=True, ensure_min_samples=2)
        errors = split_channels(stack, None, type(self).__name__)
        noise = check_noise(self.noise, errors.shape[1:], type(self).__name__)
        rms = np.sqrt(np.mean(errors.astype(float) ** 2, axis=(0, 2)))[:, None]
        quiet = ~noise.any(axis=1, keepdims=True)
        scale = np.where(quiet, floor * rms, noise)
        self.scale_ = np.where(scale > 0, scale, 1.0)  # errors are 0 where nothing was measured
        x = self._scaled(errors)
        with np.errstate(invalid="ignore"):  # PCA divides by the total variance, which may be 0
            pca = PCA(min(n_components, *x.shape), random_state=0).fit(x)
        self.mean_, self.components_ = pca.mean_, pca.components_
        variances = pca.explained_variance_
        self.gains_ = variances / (variances + 1.0) ** 1.5
        return self

    def transform(self, X: ArrayLike) -> NDArray[Any]:
        """Whiten errors X; the result has their shape."""
        check_is_fitted(self)
        stack = check_stack(self, X, reset=False)
        x = self._scaled(split_channels(stack, None, type(self).__name__)) - self.mean_
        white = ((x @ self.components_.T) * self.gains_) @ self.components_
        return np.asarray(white.astype(stack.dtype).reshape(stack.shape))

    def _scaled(self, errors: NDArray[Any]) -> NDArray[Any]:
        return (errors / self.scale_.astype(errors.dtype)).reshape(len(errors), -1)
