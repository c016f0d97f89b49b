"""Base class of calibrators: a fitted simulator, its prediction, score, table and figure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_is_fitted

from errorscreen._runtime.display import Displayed, aligned
from errorscreen._runtime.estimators import RecordingEstimator
from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.events import Event
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import with_initial_states

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


def by_column(names: Sequence[str], rows: Sequence[tuple[float, ...]]) -> dict[str, NDArray[np.float64]]:
    """Columns of a history by name."""
    return dict(zip(names, np.array(rows, dtype=float).reshape(-1, len(names)).T, strict=True))


class BaseCalibrator(Displayed, RecordingEstimator, ABC):
    """Base class of calibrators; `fit` of a subclass calls `_store`.

    Attributes
    ----------
    theta_ : ndarray of shape (m,)
        All parameters after calibration.
    names_ : tuple of k str
        Calibrated parameters.
    values_ : dict of str to float
        Their values.
    simulator_ : Simulator
        The simulator with the calibrated values as nominal ones.
    observations_ : list of Observation
        Fitted recordings.
    n_simulations_, n_failed_ : int
        Simulations of the fit, and how many of them failed.
    selects : bool
        Whether a case file calibrates each screener's selection with it; otherwise all parameters.
    case_keys : mapping of str to str
        Key of a case file's section of calibration for each argument that it sets.
    """

    selects: ClassVar[bool] = True
    case_keys: ClassVar[Mapping[str, str]] = {}

    simulator: Simulator
    theta_: NDArray[np.float64]
    names_: tuple[str, ...]
    values_: dict[str, float]
    simulator_: Simulator
    observations_: list[Observation]
    n_simulations_: int
    n_failed_: int

    @abstractmethod
    def fit(self, X: Any, y: None = None) -> BaseCalibrator:
        """Calibrate on one recording, or on several together.

        Parameters
        ----------
        X : Observation, or anything ``simulator.observe`` takes, or a list of them
        y : None
            Not used, present for scikit-learn.
        """

    @classmethod
    def from_case(
        cls, simulator: Simulator, names: Sequence[str] | None, section: Any, run: Any, progress: bool = False
    ) -> Self:
        """Unfitted calibrator for a case file.

        Parameters
        ----------
        simulator : Simulator
        names : sequence of str or None
            Parameters to calibrate; None for all.
        section, run : CalibrationSection, RunSection
            Sections of the case file, of which `case_keys` and `run.random_state` are used.
        progress : bool
            Show progress bars.
        """
        options = {"names": names, "random_state": run.random_state, "progress": progress}
        options = {name: value for name, value in options.items() if name in cls._get_param_names()}
        return cls(
            simulator, **options, **{name: getattr(section, key) for name, key in cls.case_keys.items()}
        )

    def predict(self, event: Any = None) -> NDArray[np.float64]:
        """Response of the calibrated simulator.

        Parameters
        ----------
        event : Event, Observation or what ``simulator.observe`` takes, optional
            Event to simulate, or a recording of it; the simulator's own event where not given.

        Returns
        -------
        ndarray of shape (R, L)

        Raises
        ------
        SimulationError
            If the simulation fails.
        """
        check_is_fitted(self, "simulator_")
        if event is not None and not isinstance(event, Event):
            event = with_initial_states(self.simulator_, event)[0].event
        return self.simulator_.baseline(event)

    def score(self, X: Any, y: None = None) -> float:
        """Negative J, equation (24), of the calibrated simulator, summed over recordings.

        Parameters
        ----------
        X : Observation, or anything ``simulator.observe`` takes, or a list of them
        y : None
            Not used, present for scikit-learn.

        Returns
        -------
        float
            0 for a perfect simulation; -inf if a simulation fails.
        """
        check_is_fitted(self, "simulator_")
        problem = FitProblem(self.simulator_, with_initial_states(self.simulator_, X))
        loss = problem.objective(self.theta_, self._score_weights())[0]
        return -float(loss) if np.isfinite(loss) else -np.inf

    def to_frame(self) -> pd.DataFrame:
        """Table of the calibrated parameters, one row each, indexed by name: unit, nominal and fitted value."""
        import pandas as pd

        check_is_fitted(self, "simulator_")
        space = self.simulator.parameters.subset(self.names_)
        columns = {
            "unit": [p.unit for p in space],
            "nominal": space.nominal,
            "value": list(self.values_.values()),
        }
        return pd.DataFrame(columns, index=pd.Index(self.names_, name="name"))

    def summary(self) -> str:
        """Facts of the fit, and the table of `to_frame` as text."""
        frame = self.to_frame()
        table = aligned([["name", *frame.columns], *frame.itertuples()])
        return "\n".join([type(self).__name__, aligned(self._facts().items()), "", table])

    def plot(self, X: Any = None) -> Figure:
        """Measured against simulated channels, before and after calibration.

        Parameters
        ----------
        X : Observation, or anything ``simulator.observe`` takes, or a list of them, optional
            Recordings to show, one column each; the fitted ones where not given.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from errorscreen.plotting import plot_comparison

        check_is_fitted(self, "simulator_")
        seen = self.observations_ if X is None else with_initial_states(self.simulator_, X)
        return plot_comparison(seen, {"before": self.simulator, "after": self.simulator_})

    def _facts(self) -> dict[str, Any]:
        facts = {"simulator": type(self.simulator).__name__}
        if not hasattr(self, "simulator_"):
            return facts | {"state": "not fitted"}
        return facts | {
            "parameters": len(self.names_),
            "recordings": len(self.observations_),
            "simulations": self.n_simulations_,
        }

    def _html_repr(self) -> str:
        return self._repr_html_()

    def _score_weights(self) -> ArrayLike | None:
        """Channel weights of J; equal ones unless a subclass has others."""
        return None

    def _store(self, problem: FitProblem, values: NDArray[np.float64]) -> None:
        """Take over the fitted values (k,)."""
        self.theta_ = problem.embed(values)[0]
        self.names_ = problem.names
        index = [problem.simulator.parameters.index(name) for name in problem.names]
        self.values_ = dict(zip(problem.names, self.theta_[index].tolist(), strict=True))
        self.simulator_ = problem.simulator.with_nominal(self.theta_)
        self.observations_ = problem.observations
        self.n_simulations_ = problem.n_simulations
        self.n_failed_ = problem.n_failed
