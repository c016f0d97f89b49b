"""The ranking of parameters that all screeners give."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_is_fitted

from errorscreen._runtime.display import listed, shortened
from errorscreen._runtime.estimators import RecordingEstimator
from errorscreen.exceptions import check_integer
from errorscreen.metrics import ranking

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class ParameterRanking:
    """Contributions of parameters to an error, most suspicious first.

    Parameters
    ----------
    contributions : ndarray of shape (m,)
        Larger is more suspicious; equal ones keep their order.
    names : tuple of m str

    Examples
    --------
    >>> found = ParameterRanking(np.array([0.5, 2.0]), ("Xd", "H"))
    >>> found
    ParameterRanking(2 parameters: H, Xd)
    >>> print(found.summary())
    parameter  contribution
            H             2
           Xd           0.5
    """

    contributions: NDArray[np.float64]
    names: tuple[str, ...]

    @cached_property
    def order(self) -> NDArray[np.int64]:
        """Indices from the most to the least suspicious, shape (m,)."""
        return ranking(self.contributions)

    @property
    def ranked_names(self) -> tuple[str, ...]:
        """Names from the most to the least suspicious."""
        return tuple(self.names[j] for j in self.order)

    def to_frame(self) -> pd.DataFrame:
        """Data frame with the columns ``parameter`` and ``contribution``, most suspicious first."""
        import pandas as pd

        return pd.DataFrame(
            {"parameter": self.ranked_names, "contribution": self.contributions[self.order]},
            index=pd.RangeIndex(1, len(self.names) + 1, name="rank"),
        )

    def summary(self) -> str:
        """Table of the parameters as text, most suspicious first."""
        return str(self.to_frame().to_string(index=False, float_format="{:.4g}".format))

    def plot(self) -> Figure:
        """Bar chart of the contributions."""
        from errorscreen.plotting import plot_bars  # imports matplotlib

        return plot_bars(dict(zip(self.names, self.contributions.tolist(), strict=True)), "contribution")

    def __repr__(self) -> str:
        return shortened(f"ParameterRanking({len(self.names)} parameters: {listed(self.ranked_names)})")

    def _repr_html_(self) -> str:
        return str(self.to_frame().to_html(float_format="{:.4g}".format))


class BaseScreener(RecordingEstimator, ABC):
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
    case_keys : mapping of str to str
        Key of a case file's section of screening for each argument that it sets.
    """

    trains: ClassVar[bool] = False
    case_keys: ClassVar[Mapping[str, str]] = {}

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
            Sections of the case file, of which `case_keys`, `run.random_state` and `run.n_jobs` are used.
        folder : Path, optional
            For intermediate results, given as `checkpoint`.
        progress : bool
            Show progress bars.
        """
        options = {"random_state": run.random_state, "n_jobs": run.n_jobs, "progress": progress}
        options["checkpoint"] = None if folder is None else folder / "dataset"
        options = {name: value for name, value in options.items() if name in cls._get_param_names()}
        return cls(
            simulator, **options, **{name: getattr(section, key) for name, key in cls.case_keys.items()}
        )

    @abstractmethod
    def fit(self, X: Any, y: None = None) -> Any:
        """Rank the parameters.

        Parameters
        ----------
        X : Observation, or anything ``simulator.observe`` takes, or a list of them
        y : None
            Not used, present for scikit-learn.

        Raises
        ------
        InputError
            If an argument or a recording cannot be used.
        SimulationError
            If simulations fail without which there is no ranking.
        """

    def select(self, selector: Any) -> tuple[str, ...]:
        """Names of the selected parameters, most suspicious first.

        Parameters
        ----------
        selector : int or object with ``select(contributions)``
            A number K from 1 to m takes the K most suspicious; an object returns their indices.
        """
        check_is_fitted(self, "contributions_")
        if hasattr(selector, "select"):
            chosen = set(np.asarray(selector.select(self.contributions_)).tolist())
            return tuple(self.names_[j] for j in self.ranking_ if j in chosen)
        return self.ranked_names_[
            : check_integer(selector, "the number of parameters", high=len(self.names_))
        ]

    def summary(self) -> str:
        """Table of the parameters as text, most suspicious first."""
        return self._result().summary()

    def plot(self) -> Figure:
        """Bar chart of the contributions."""
        return self._result().plot()

    def to_frame(self) -> pd.DataFrame:
        """Data frame with the columns ``parameter`` and ``contribution``, most suspicious first."""
        return self._result().to_frame()

    def _result(self) -> ParameterRanking:
        check_is_fitted(self, "contributions_")
        return ParameterRanking(self.contributions_, self.names_)

    def _store(
        self, contributions: ArrayLike, names: Sequence[str], n_simulations: int = 0, n_failed: int = 0
    ) -> None:
        self.contributions_ = np.asarray(contributions, dtype=float)
        self.names_ = tuple(names)
        found = self._result()
        self.ranking_, self.ranked_names_ = found.order, found.ranked_names
        self.n_simulations_, self.n_failed_ = n_simulations, n_failed

    def __repr__(self, N_CHAR_MAX: int = 700) -> str:
        return shortened(" ".join(super().__repr__(N_CHAR_MAX).split()))

    def _html_repr(self) -> str:
        """Ranking for a notebook, below the name; scikit-learn's diagram before `fit`."""
        if not hasattr(self, "contributions_"):
            return str(super()._html_repr())
        return f"<p>{escape(repr(self))}</p>{self._result()._repr_html_()}"
