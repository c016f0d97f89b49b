"""Scaling of images by statistics of the training set."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_is_fitted

from errorscreen.exceptions import check_real
from errorscreen.features.checks import StackTransformer, as_images, check_choice, check_stack

# samples handled at a time, so that float64 sums of float32 images need no second copy of all images
_BLOCK = 64
# axes that share a mean and a deviation
_POOLED = {"channel": (0, 2, 3), "row": (0, 3), "pixel": (0,)}


class ChannelScaler(StackTransformer):
    r"""Standardise each channel by mean and standard deviation of the training set, equation (9).

    :math:`\tilde X_r = (X_r - \mu_r) / \sigma_r`. The statistics run over samples, rows and columns. They are set in
    fit and then frozen, so that measured images are scaled like the training images.

    Parameters
    ----------
    by : {"channel", "row", "pixel"}, default "channel"
        One mean and deviation for each channel, for each row (frequency) of each channel, or for each pixel. With
        signed coefficients choose ``"pixel"``: small pixels distinguish similar parameters, and a network learns from
        them only if they are not small.
    floor : float, default 1e-3
        Smallest deviation that is divided by, in multiples of the channel's largest. It keeps pixels small that are
        nearly constant in all images.

    Attributes
    ----------
    mean_, scale_ : ndarray of shape (R, 1, 1), (R, H, 1) with ``by="row"``, or (R, H, W) with ``by="pixel"``
        Where the training set is constant, the scale is 1.
    shape_in_ : tuple
        Shape of one sample in fit.

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
        """Compute the statistics of images X of shape (n, R, H, W), (n, R, L) or (n, F)."""
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
        # a deviation below the rounding of the mean is rounding
        constant = scale <= 10 * np.finfo(images.dtype).eps * np.abs(self.mean_)
        scale = np.maximum(scale, floor * scale.max(axis=(1, 2), keepdims=True))
        self.scale_ = np.where(constant, 1.0, scale)
        return self

    def transform(self, X: ArrayLike) -> NDArray[Any]:
        """Scale images X by the statistics of the training set; the result has their shape."""
        stack, mean, scale = self._read(X)
        return ((as_images(stack) - mean) / scale).reshape(stack.shape)

    def inverse_transform(self, X: ArrayLike) -> NDArray[Any]:
        """Undo `transform`."""
        stack, mean, scale = self._read(X)
        return (as_images(stack) * scale + mean).reshape(stack.shape)

    def _read(self, X: ArrayLike) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Images, and the statistics in their precision."""
        check_is_fitted(self)
        stack = check_stack(self, X, reset=False, max_ndim=4)
        return stack, self.mean_.astype(stack.dtype), self.scale_.astype(stack.dtype)
