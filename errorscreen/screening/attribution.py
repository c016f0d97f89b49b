"""Ranking by the share of the error that a fit of all parameters attributes to each."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone
from sklearn.utils.validation import check_is_fitted

from errorscreen._runtime.sampling import generator
from errorscreen.calibration import MAPCalibrator
from errorscreen.exceptions import InputError, SimulationError, check_integer
from errorscreen.learning.generation import contribution_labels
from errorscreen.metrics import channel_weights, ranking
from errorscreen.screening.base import BaseScreener
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import as_observations


class AttributionScreener(BaseScreener):
    r"""Rank parameters by their expected contribution, given a bounded fit of all of them.

    All candidates are calibrated together (`MAPCalibrator`). The contribution is the mean of the label of equations
    (14) and (15) over samples of the posterior distribution and over the recordings:

    .. math:: \hat c_j = \mathrm{E}\left[\,|\theta_j / \theta_{j,0} - 1| \; S_j(\theta)\,\right]

    The calibrated values alone would not do: a parameter that the recording hardly determines stays at its nominal
    value there, with a contribution of 0, although it may have moved.

    Parameters
    ----------
    simulator : Simulator
    calibrator : MAPCalibrator, optional
        For this simulator and all its parameters; ``MAPCalibrator(simulator)`` where not given. A fitted one inside a
        `sklearn.frozen.FrozenEstimator` is not fitted again.
    n_samples : int, default 64
        Number of samples; each costs m + 1 simulations for each recording.
    weights : array-like of shape (R,), optional
        λ of the channels; 1/R each where not given.
    random_state : None, int, SeedSequence, Generator or RandomState
        Of the samples, and of the calibrator where none is given.

    Attributes
    ----------
    contributions_, names_, ranking_, ranked_names_
        See `BaseScreener`.
    samples_ : ndarray of shape (n, m)
        Contributions of each parameter in each sample that could be simulated.
    calibrator_ : MAPCalibrator
        The fit.
    n_simulations_, n_failed_ : int
        Simulations of fit and samples; failed simulations of the fit plus samples left out after a failure.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, _ = demo_recordings(random_state=0)
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> calibrator = MAPCalibrator(plant, n_starts=1)
    >>> screener = AttributionScreener(plant, calibrator, n_samples=16, random_state=0).fit(recording)
    >>> float(screener.inclusion_probability(3).sum())
    3.0
    """

    samples_: NDArray[np.float64]
    calibrator_: MAPCalibrator

    def __init__(
        self,
        simulator: Simulator,
        calibrator: MAPCalibrator | None = None,
        *,
        n_samples: int = 64,
        weights: ArrayLike | None = None,
        random_state: Any = None,
    ) -> None:
        self.simulator = simulator
        self.calibrator = calibrator
        self.n_samples = n_samples
        self.weights = weights
        self.random_state = random_state

    def fit(self, X: Any, y: None = None) -> AttributionScreener:
        """Calibrate all parameters and rank them; see `BaseScreener.fit`."""
        observations = as_observations(self.simulator, X)
        space = self.simulator.parameters
        n_samples = check_integer(self.n_samples, "n_samples")
        channel_weights(self.weights, len(self.simulator.channels))
        for_fit, for_samples = generator(self.random_state).integers(2**31, size=2).tolist()
        default = MAPCalibrator(self.simulator, random_state=for_fit)
        calibrator = clone(default if self.calibrator is None else self.calibrator)
        self.calibrator_ = calibrator.fit(observations, None)
        names, own = tuple(self.calibrator_.names_), space.names
        if names != own or self.calibrator_.simulator.parameters.names != own:
            raise InputError(
                f"the calibrator fitted {', '.join(names)}",
                where="AttributionScreener",
                allowed=f"a fit of all parameters of the simulator: {', '.join(own)}",
            )
        theta = self.calibrator_.sample_posterior(n_samples, for_samples)
        labels = np.mean(
            [
                contribution_labels(self.simulator, theta, o.event, weights=self.weights, mask=o.mask)
                for o in observations
            ],
            axis=0,
        )
        self.samples_ = labels[np.isfinite(labels).all(axis=1)]
        if not len(self.samples_):
            raise SimulationError("no sample around the calibrated values could be simulated.")
        labelling = n_samples * (len(space) + 1) * len(observations)
        self._store(
            self.samples_.mean(axis=0),
            space.names,
            self.calibrator_.n_simulations_ + labelling,
            self.calibrator_.n_failed_ + len(labels) - len(self.samples_),
        )
        return self

    def inclusion_probability(self, k: int) -> NDArray[np.float64]:
        """Share of the samples in which each parameter has one of the k largest contributions, shape (m,)."""
        check_is_fitted(self, "samples_")
        k = check_integer(k, "k", high=self.samples_.shape[1])
        chosen = np.zeros(self.samples_.shape)
        np.put_along_axis(chosen, ranking(self.samples_)[:, :k], 1.0, axis=1)
        return np.asarray(chosen.mean(axis=0))
