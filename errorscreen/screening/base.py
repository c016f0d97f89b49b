"""What all screeners share: a contribution for each parameter and the ranking that follows from it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from errorscreen.exceptions import check_integer
from errorscreen.metrics import ranking


class BaseScreener(BaseEstimator):
    """Base class of screeners; `fit` of a subclass calls `_store`.

    Attributes
    ----------
    contributions_ : ndarray of shape (m,)
        Estimated share of each parameter in the error; larger is more suspicious.
    names_ : tuple of str
        The parameters, in the order of `contributions_`.
    ranking_ : ndarray of shape (m,)
        Indices of the parameters from the most to the least suspicious.
    ranked_names_ : tuple of str
        Their names in that order.
    n_simulations_, n_failed_ : int
        Simulations that the ranking used, and how many of them failed.
    trains : bool
        Whether the screener trains a network: a case file then runs it beside the search, on a coarser step.
    """

    trains: ClassVar[bool] = False

    contributions_: NDArray[np.float64]
    names_: tuple[str, ...]
    ranking_: NDArray[np.int64]
    ranked_names_: tuple[str, ...]
    n_simulations_: int
    n_failed_: int

    @classmethod
    def from_case(
        cls, simulator: Any, section: Any, run: Any, folder: Path | None = None, progress: bool = False
    ) -> Self:
        """Unfitted screener for a case file.

        Parameters
        ----------
        simulator : Simulator
        section, run : ScreeningSection, RunSection
            Sections of the case file. Without an override only `run.random_state` is used.
        folder : Path, optional
            For intermediate results.
        progress : bool
            Show progress bars.
        """
        options = {"random_state": run.random_state, "progress": progress}
        return cls(simulator, **{k: v for k, v in options.items() if k in cls._get_param_names()})

    def select(self, selector: Any) -> tuple[str, ...]:
        """Names of the selected parameters, most suspicious first.

        Parameters
        ----------
        selector : int or object with ``select(contributions)``
            A number K takes the K most suspicious; an object returns their indices.

        Raises
        ------
        InputError
            If K is not between 1 and m.
        """
        check_is_fitted(self, "contributions_")
        if hasattr(selector, "select"):
            chosen = set(np.asarray(selector.select(self.contributions_)).tolist())
            return tuple(self.names_[j] for j in self.ranking_ if j in chosen)
        return self.ranked_names_[
            : check_integer(selector, "the number of parameters", high=len(self.names_))
        ]

    def _store(
        self, contributions: ArrayLike, names: Sequence[str], n_simulations: int = 0, n_failed: int = 0
    ) -> None:
        self.contributions_ = np.asarray(contributions, dtype=float)
        self.names_ = tuple(names)
        self.ranking_ = ranking(self.contributions_)
        self.ranked_names_ = tuple(self.names_[j] for j in self.ranking_)
        self.n_simulations_, self.n_failed_ = n_simulations, n_failed

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False  # what is fitted is a recording
        tags.target_tags.required = False
        return tags
