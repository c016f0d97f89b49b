"""Scaling of images by statistics of the training set."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from errorscreen.exceptions import check_real
from errorscreen.features.checks import as_images, check_choice, check_stack

# samples handled at a time, so that float64 sums of float32 images need no second copy of them all
_BLOCK = 64
# axes that share a mean and a deviation
_POOLED = {"channel": (0, 2, 3), "row": (0, 3), "pixel": (0,)}


class ChannelScaler(TransformerMixin, BaseEstimator):
    r"""Standardise each channel by mean and standard deviation of the training set, equation (9).

    :math:`\tilde X_r = (X_r - \mu_r) / \sigma_r`. The statistics run over samples, rows and columns; they are
    set in fit and frozen afterwards, so measured images are scaled like the training images.

    Parameters
    ----------
    by : {"channel", "row", "pixel"}, default "channel"
        One mean and deviation for each channel, for each row (frequency) of each channel, or for each pixel. Where the
        images are coefficients, pixels of small size carry what the strong parameters have in common with no other,
        and a network learns from them only if they are not small.
    floor : float, default 1e-3
        Smallest deviation that is divided by, in multiples of the channel's largest, so that what is next to nothing
        in all images stays small.

    Attributes
    ----------
    mean_, scale_ : ndarray of shape (R, 1, 1), (R, H, 1) with ``by="row"``, or (R, H, W) with ``by="pixel"``
        Where the training set is constant, the scale is 1.
    shape_in_ : tuple
        Shape of one sample in fit.
    n_features_in_ : int
        Length of the axis after the samples.

    Notes
    -----
    Input is (n, R, H, W); (n, R, L) is read as images of one row, and (n, F) as one channel of one row. The
    result has the shape and the precision of the input.

    Examples
    --------
    >>> images = np.array([[[[1.0, 3.0]], [[10.0, 10.0]]]])
    >>> ChannelScaler().fit_transform(images)
    array([[[[-1.,  1.]],
    <BLANKLINE>
            [[ 0.,  0.]]]])
    """

    def __init__(self, by: str = "channel", *, floor: float = 1e-3) -> None:
        self.by = by
        self.floor = floor

    def fit(self, X: ArrayLike, y: Any = None) -> ChannelScaler:
        """Compute the statistics.

        Parameters
        ----------
        X : array-like of shape (n, R, H, W), (n, R, L) or (n, F)
        y : ignored
        """
        check_choice("by", self.by, tuple(_POOLED), type(self).__name__)
        floor = check_real(self.floor, "floor", low=0.0, high=1.0)
        images = as_images(check_stack(self, X, reset=True, max_ndim=4))
        axes = _POOLED[self.by]
        count = np.prod([images.shape[axis] for axis in axes])

        def sums(blocks: Iterator[NDArray[np.float64]]) -> NDArray[np.float64]:
            return sum(block.sum(axis=axes, keepdims=True)[0] for block in blocks)

        def blocks() -> Iterator[NDArray[np.float64]]:
            return (images[i : i + _BLOCK].astype(float) for i in range(0, len(images), _BLOCK))

        self.mean_ = sums(blocks()) / count
        scale = np.sqrt(sums((block - self.mean_) ** 2 for block in blocks()) / count)
        # below the rounding of the mean there is no deviation to speak of
        constant = scale <= 10 * np.finfo(images.dtype).eps * np.abs(self.mean_)
        scale = np.maximum(scale, floor * scale.max(axis=(1, 2), keepdims=True))
        self.scale_ = np.where(constant, 1.0, scale)
        return self

    def transform(self, X: ArrayLike) -> NDArray[Any]:
        """Scale images by the statistics of the training set.

        Parameters
        ----------
        X : array-like of shape (n, R, H, W), (n, R, L) or (n, F)

        Returns
        -------
        ndarray of the shape of X
        """
        check_is_fitted(self)
        stack = check_stack(self, X, reset=False, max_ndim=4)
        mean, scale = self.mean_.astype(stack.dtype), self.scale_.astype(stack.dtype)
        return ((as_images(stack) - mean) / scale).reshape(stack.shape)

    def inverse_transform(self, X: ArrayLike) -> NDArray[Any]:
        """Undo `transform`.

        Parameters
        ----------
        X : array-like of shape (n, R, H, W), (n, R, L) or (n, F)

        Returns
        -------
        ndarray of the shape of X
        """
        check_is_fitted(self)
        stack = check_stack(self, X, reset=False, max_ndim=4)
        mean, scale = self.mean_.astype(stack.dtype), self.scale_.astype(stack.dtype)
        return (as_images(stack) * scale + mean).reshape(stack.shape)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags
