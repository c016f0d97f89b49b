"""Response errors: responses minus the baseline response."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_is_fitted

from errorscreen.exceptions import InputError
from errorscreen.features.checks import StackTransformer, check_choice, check_stack, split_channels


class ResponseErrorTransformer(StackTransformer):
    r"""Error of responses against a baseline response, equations (2)–(4): :math:`e^{(i)} = y^{(i)} - y_0`.

    Parameters
    ----------
    baseline : array-like of shape (R, L), optional
        The response y₀ in the channels' units: in training the response at the nominal parameters; in use the
        simulated response, so that e = y_meas − y_sim. The mean of the responses seen in fit where not given.
    missing : {"raise", "zero"}, default "raise"
        What to do with NaN in the responses. ``"zero"`` sets the error to zero where nothing was measured. That is
        bearable for single lost samples and misleading for long gaps.
    n_channels : int, optional
        Number of channels R where a row of X holds the channels one after another; 1 where not given.

    Attributes
    ----------
    baseline_ : ndarray of shape (R, L)
    shape_in_ : tuple
        Shape of one sample in fit.

    Raises
    ------
    InputError
        If the baseline does not fit the responses or holds values that are not finite.
    ValueError
        If the responses hold infinite values, or NaN with ``missing="raise"``.

    Notes
    -----
    The result has the shape and the precision of the input: (n, R, L), or (n, R·L) for 2-D input.

    Examples
    --------
    >>> y = np.array([[[1.0, 0.5, 1.0]], [[1.0, 0.7, 1.0]]])
    >>> ResponseErrorTransformer(baseline=[[1.0, 0.6, 1.0]]).fit_transform(y).round(3)
    array([[[ 0. , -0.1,  0. ]],
           [[ 0. ,  0.1,  0. ]]])
    """

    def __init__(
        self, baseline: ArrayLike | None = None, *, missing: str = "raise", n_channels: int | None = None
    ) -> None:
        self.baseline = baseline
        self.missing = missing
        self.n_channels = n_channels

    def fit(self, X: ArrayLike, y: Any = None) -> ResponseErrorTransformer:
        """Store the baseline for responses X of shape (n, R, L), or (n, R·L)."""
        name = type(self).__name__
        check_choice("missing", self.missing, ("raise", "zero"), name)
        responses = split_channels(self._read(X, reset=True), self.n_channels, name)
        if self.baseline is None:
            self.baseline_ = _mean_of_measured(responses)
            return self
        baseline = np.atleast_2d(np.asarray(self.baseline, dtype=float))
        if baseline.shape != responses.shape[1:]:
            raise InputError(
                f"baseline has shape {np.shape(self.baseline)}",
                where=name,
                allowed=f"{responses.shape[1:]}, as X",
            )
        if not np.all(np.isfinite(baseline)):
            raise InputError("baseline holds values that are not finite", where=name)
        self.baseline_ = baseline
        return self

    def transform(self, X: ArrayLike) -> NDArray[Any]:
        """Subtract the baseline from responses X; the result has their shape."""
        check_is_fitted(self)
        responses = self._read(X, reset=False)
        error = responses - self.baseline_.reshape(responses.shape[1:]).astype(responses.dtype)
        return np.nan_to_num(error, copy=False, nan=0.0) if self.missing == "zero" else error

    def _read(self, X: ArrayLike, *, reset: bool) -> NDArray[Any]:
        finite = "allow-nan" if self.missing == "zero" else True
        stack: NDArray[Any] = check_stack(self, X, reset=reset, ensure_all_finite=finite)
        return stack

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = self.missing == "zero"
        return tags


def _mean_of_measured(responses: NDArray[Any]) -> NDArray[np.float64]:
    """Mean over the samples that were measured; 0 where none was, because the errors there are zero anyway."""
    measured = np.isfinite(responses)
    total = np.where(measured, responses, 0).sum(axis=0, dtype=float)
    return total / np.maximum(measured.sum(axis=0), 1)
