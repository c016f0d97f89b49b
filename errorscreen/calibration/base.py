"""What all calibrators share: a fitted simulator, its prediction and its score."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from errorscreen.calibration.problem import FitProblem
from errorscreen.events import Event
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import with_initial_states


class BaseCalibrator(BaseEstimator):
    """Base class of calibrators; `fit` of a subclass calls `_store`.

    Attributes
    ----------
    theta_ : ndarray of shape (m,)
        All parameters after calibration.
    names_ : tuple of k str
        Parameters that were calibrated.
    values_ : dict of str to float
        Their values.
    simulator_ : Simulator
        The simulator with the calibrated values as its nominal ones.
    n_simulations_, n_failed_ : int
        Simulations that the fit used, and how many of them failed.
    selects : bool
        Whether a case file calibrates each screener's selection with it; otherwise all parameters.
    """

    selects: ClassVar[bool] = True

    theta_: NDArray[np.float64]
    names_: tuple[str, ...]
    values_: dict[str, float]
    simulator_: Simulator
    n_simulations_: int
    n_failed_: int

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
            Sections of the case file. Without an override only `run.random_state` is used.
        progress : bool
            Show progress bars.
        """
        options = {"names": names, "random_state": run.random_state, "progress": progress}
        return cls(simulator, **{k: v for k, v in options.items() if k in cls._get_param_names()})

    def predict(self, event: Any = None) -> NDArray[np.float64]:
        """Response of the calibrated simulator.

        Parameters
        ----------
        event : Event, Observation or what ``simulator.observe`` takes, optional
            What to simulate: an event, or that of a recording. The simulator's own event where not given.

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

    def _score_weights(self) -> ArrayLike | None:
        """Channel weights of J; equal ones unless a subclass has others."""
        return None

    def _store(self, problem: FitProblem, values: NDArray[np.float64]) -> None:
        """Take over the values (k,) that were found."""
        self.theta_ = problem.embed(values)[0]
        self.names_ = problem.names
        index = [problem.simulator.parameters.index(name) for name in problem.names]
        self.values_ = dict(zip(problem.names, self.theta_[index].tolist(), strict=True))
        self.simulator_ = problem.simulator.with_nominal(self.theta_)
        self.n_simulations_ = problem.n_simulations
        self.n_failed_ = problem.n_failed

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False  # what is fitted is a recording
        tags.target_tags.required = False
        return tags
