"""Base of estimators that are fitted to recordings."""

from __future__ import annotations

from typing import Any

from sklearn.base import BaseEstimator


class RecordingEstimator(BaseEstimator):
    """Estimator whose X is a recording, or several, instead of a table."""

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        tags.target_tags.required = False
        return tags
