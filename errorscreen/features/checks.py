"""Checks of signals and images, and data frames of tables: the base of the transformers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, OneToOneFeatureMixin, TransformerMixin
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import validate_data

from errorscreen.exceptions import InputError, check_integer


def has_columns(transformer: Any) -> bool:
    """Condition of `get_feature_names_out` for `available_if`."""
    if not transformer._is_table():
        raise AttributeError("Only a table has named columns; stacks of signals and images stay arrays.")
    return True


class StackTransformer(OneToOneFeatureMixin, TransformerMixin, BaseEstimator, ABC):
    """Base class of transformers of tables (n, F), stacks of signals (n, R, L) and images (n, R, H, W).
    `set_output` makes data frames of tables; stacks stay arrays, so that a whole pipeline can be set.
    """

    @abstractmethod
    def fit(self, X: ArrayLike, y: Any = None) -> Any:  # noqa: D102 (said by each subclass)
        ...

    def set_output(self, *, transform: str | None = None) -> Any:
        """Choose "default", "pandas" or "polars" for tables that `transform` returns; other results stay arrays."""
        if transform is not None:
            self._sklearn_output_config = {"transform": transform}
        return self

    @available_if(has_columns)
    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Names of the columns of a table: those of X, else ``x0``, ``x1`` and so on."""
        names: NDArray[np.object_] = super().get_feature_names_out(input_features)
        return names

    def _is_table(self) -> bool:
        """Whether `transform` returns a table; assumed before `fit`."""
        return len(getattr(self, "shape_in_", (0,))) == 1

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = True
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags


def check_stack(
    estimator: Any,
    X: ArrayLike,
    *,
    reset: bool,
    max_ndim: int = 3,
    dtype: Any = (np.float64, np.float32),
    **checks: Any,
) -> Any:
    """Validate samples (n, ...) of 2 to `max_ndim` axes; set (`reset`) or compare ``shape_in_``, the shape of one.
    Other arguments go to `validate_data`. Returns X, or (X, y) where ``y`` is among them.
    """
    checked = validate_data(estimator, X, reset=reset, allow_nd=True, dtype=dtype, **checks)
    stack: NDArray[Any] = checked[0] if isinstance(checked, tuple) else checked
    name = type(estimator).__name__
    if stack.ndim > max_ndim:
        axes = "samples, channels, frequencies, time" if max_ndim == 4 else "samples, channels, time"
        raise InputError(f"X has shape {stack.shape}", where=name, allowed=f"({axes}) or (samples, time)")
    if reset:
        estimator.shape_in_ = stack.shape[1:]
    elif stack.shape[1:] != estimator.shape_in_:
        expected = ", ".join(map(str, estimator.shape_in_))
        raise InputError(f"X has shape {stack.shape}", where=name, allowed=f"(n, {expected}), as in fit")
    return checked


def split_channels(X: NDArray[Any], n_channels: int | None, where: str) -> NDArray[Any]:
    """View a stack as (n, R, L): a row of 2-D input holds one channel, or `n_channels` one after another."""
    if X.ndim == 3:
        if n_channels not in (None, X.shape[1]):
            raise InputError(f"X has {X.shape[1]} channels", where=where, allowed=f"n_channels={n_channels}")
        return X
    count = 1 if n_channels is None else check_integer(n_channels, "n_channels")
    if X.shape[1] % count:
        raise InputError(
            f"rows of {X.shape[1]} values cannot be divided into {count} channels",
            where=where,
            remedy="Change n_channels, or give X as (samples, channels, time)",
        )
    return X.reshape(len(X), count, -1)


def check_noise(noise: ArrayLike | None, shape: tuple[int, ...], where: str) -> NDArray[np.float64]:
    """Standard deviation of the noise (R, L), from a scalar, (R,) or (R, L), or 0 for None, or `InputError`."""
    given = np.asarray(0.0 if noise is None else noise, dtype=float)
    if given.shape not in ((), shape[:1], shape) or not np.all(np.isfinite(given) & (given >= 0)):
        raise InputError(
            f"noise is {noise!r}",
            where=where,
            allowed=f"a finite number >= 0 for each of {shape[0]} channels, or an array {shape}",
        )
    return np.broadcast_to(given[:, None] if given.ndim == 1 else given, shape)


def check_choice(name: str, value: Any, allowed: Sequence[Any], where: str) -> Any:
    """Return `value` if it is one of `allowed`, else raise `InputError`."""
    if value not in allowed:
        raise InputError(f"{name}={value!r}", where=where, allowed=", ".join(map(repr, allowed)))
    return value


def as_images(X: NDArray[Any]) -> NDArray[Any]:
    """View a stack of 2 to 4 axes as (n, R, H, W): signals are images of one row, 2-D input is one channel."""
    if X.ndim == 4:
        return X
    return X.reshape(len(X), X.shape[1] if X.ndim == 3 else 1, 1, X.shape[-1])
