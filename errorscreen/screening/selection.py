"""Selection of the parameters to calibrate by their contributions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.feature_selection import SelectorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from errorscreen.exceptions import InputError, check_integer, check_real
from errorscreen.metrics import ranking


class ContributionSelector(SelectorMixin, BaseEstimator, ABC):
    """Base class of selectors: `select` of a subclass picks from one score for each parameter.
    As a scikit-learn feature selector it is fitted on the contributions of many samples; `transform` then keeps the
    columns of the selected parameters of any table (n, m).
    """

    @abstractmethod
    def select(self, scores: ArrayLike) -> NDArray[np.int64]:
        """Indices (k,) of the selected parameters for scores (m,), largest first; equal scores keep their order."""

    def fit(self, X: ArrayLike, y: Any = None) -> ContributionSelector:
        """Select by the mean of contributions X (n, m) over the samples."""
        contributions = validate_data(self, X, dtype=float)
        self.scores_ = np.asarray(contributions).mean(axis=0)
        self.selected_ = self.select(self.scores_)
        return self

    def _get_support_mask(self) -> NDArray[np.bool_]:
        check_is_fitted(self)
        return np.isin(np.arange(len(self.scores_)), self.selected_)


class TopKSelector(ContributionSelector):
    """The K parameters with the largest contributions.

    Parameters
    ----------
    k : int, optional
        Number of parameters; 10 where not given, or all if there are fewer.

    Raises
    ------
    InputError
        If k is not between 1 and m, or a score is not finite.

    Examples
    --------
    >>> TopKSelector(2).select([0.1, 0.7, 0.1, 0.3])
    array([1, 3])
    >>> TopKSelector(2).fit_transform([[0.1, 0.7, 0.1, 0.3]])
    array([[0.7, 0.3]])
    """

    def __init__(self, k: int | None = None) -> None:
        self.k = k

    def select(self, scores: ArrayLike) -> NDArray[np.int64]:  # noqa: D102 (inherited)
        scores = _check_scores(scores)
        k = min(10, len(scores)) if self.k is None else check_integer(self.k, "k", high=len(scores))
        return ranking(scores)[:k]


class RelativeThresholdSelector(ContributionSelector):
    """The parameters whose contribution is at least a given share of the largest one.

    The largest is always selected. Where no contribution is positive, all that equal the largest are selected.

    Parameters
    ----------
    threshold : float, default 0.1
        The share, from 0 to 1.

    Raises
    ------
    InputError
        If the threshold is outside [0, 1], or a score is not finite.

    Examples
    --------
    >>> RelativeThresholdSelector(0.3).select([0.1, 0.7, 0.1, 0.3])
    array([1, 3])
    """

    def __init__(self, threshold: float = 0.1) -> None:
        self.threshold = threshold

    def select(self, scores: ArrayLike) -> NDArray[np.int64]:  # noqa: D102 (inherited)
        scores = _check_scores(scores)
        threshold = check_real(self.threshold, "threshold", low=0, high=1)
        largest = scores.max()
        order = ranking(scores)
        return order[scores[order] >= largest * (threshold if largest > 0 else 1)]


def _check_scores(scores: ArrayLike) -> NDArray[np.float64]:
    values = np.asarray(scores, dtype=float)
    if values.ndim != 1 or not len(values) or not np.all(np.isfinite(values)):
        raise InputError(
            f"scores have shape {values.shape}"
            + ("" if np.all(np.isfinite(values)) else " and hold values that are not finite"),
            allowed="one finite number for each parameter",
        )
    return values
