"""The published ranking: a network that is trained on simulated errors reads the measured one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from errorscreen.features import ResponseErrorTransformer
from errorscreen.learning.generation import generate_dataset
from errorscreen.learning.regressors import import_network
from errorscreen.screening.base import BaseScreener
from errorscreen.screening.contribution import ContributionScreener, contribution_pipeline
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import as_observations

#: Samples of the errors that images are made of; of twice as many and more, means of equal parts.
_MOST_SAMPLES = 2000
#: Another number of threads rounds sums differently, and training amplifies that.
THREADS = 1


class NetworkScreener(BaseScreener):
    """Rank parameters by a network (`ContributionScreener`) that learns from the simulator.

    Parameters
    ----------
    simulator : Simulator
        May have a longer step than is usual: errors well below the noise do not change the ranking.
    n_samples : int, default 600
        Simulated errors with labels; each costs m + 1 simulations.
    epochs : int, default 60
    n_frequencies, n_columns : int, default 16, 32
        Size of the time-frequency images.
    random_state : None, int, SeedSequence, Generator or RandomState
    n_jobs : int, optional
        Processes that simulate; the result is the same for any number.
    checkpoint : path-like, optional
        Folder for finished simulations, see `generate_dataset`.
    progress : bool, default False
        Show progress bars.

    Attributes
    ----------
    contributions_, names_, ranking_, ranked_names_, n_simulations_, n_failed_
        See `BaseScreener`.
    """

    trains = True
    case_keys = {
        "n_samples": "samples",
        "epochs": "epochs",
        "n_frequencies": "frequencies",
        "n_columns": "columns",
    }

    def __init__(
        self,
        simulator: Simulator,
        *,
        n_samples: int = 600,
        epochs: int = 60,
        n_frequencies: int = 16,
        n_columns: int = 32,
        random_state: Any = None,
        n_jobs: int | None = None,
        checkpoint: str | Path | None = None,
        progress: bool = False,
    ) -> None:
        self.simulator = simulator
        self.n_samples = n_samples
        self.epochs = epochs
        self.n_frequencies = n_frequencies
        self.n_columns = n_columns
        self.random_state = random_state
        self.n_jobs = n_jobs
        self.checkpoint = checkpoint
        self.progress = progress

    def fit(self, X: Any, y: None = None) -> NetworkScreener:
        """Simulate labelled errors, train the network, and read the error of one recording; see `BaseScreener.fit`.

        Raises
        ------
        MissingExtraError
            If torch is not installed.
        """
        import_network()  # a missing package is told before the simulations
        (observation,) = as_observations(self.simulator, X)
        dataset = generate_dataset(
            self.simulator,
            self.n_samples,
            observation.event,
            random_state=self.random_state,
            n_jobs=self.n_jobs,
            progress=self.progress,
            checkpoint=self.checkpoint,
        )
        names, n_failed = self.simulator.parameters.names, dataset.n_failed
        usable = dataset.valid()
        error = ResponseErrorTransformer(dataset.baseline, missing="zero").fit(usable.responses)
        every = max(1, len(observation.time) // _MOST_SAMPLES)

        def image_errors(responses: NDArray[np.float64]) -> NDArray[np.float64]:
            # nothing may be learned from unmeasured samples
            return _means(np.where(observation.mask, error.transform(responses[None])[0], 0.0), every)

        training = np.array([image_errors(responses) for responses in usable.responses])
        contributions = usable.contributions
        del dataset, usable  # the responses of a fast recorder are large
        noise = np.where(observation.mask, observation.noise[:, None], 0.0)
        pipeline = contribution_pipeline(every * observation.event.dt, self.random_state).set_params(
            cwttransformer__n_frequencies=self.n_frequencies,
            cwttransformer__n_columns=self.n_columns,
            cnncontributionregressor__max_epochs=self.epochs,
            cnncontributionregressor__verbose=self.progress,
        )
        screener = ContributionScreener(
            pipeline,
            names,
            noise=np.sqrt(_means(noise**2, every) / every),
            random_state=self.random_state,
        )
        with threadpool_limits(limits=THREADS):
            screener.fit(training, contributions)
            predicted = screener.predict(image_errors(observation.values)[None])[0]
        self._store(predicted, names, self.n_samples * (len(names) + 1), n_failed)
        return self


def _means(values: NDArray[np.float64], every: int) -> NDArray[np.float64]:
    """Means (R, L // every) of parts of the rows (R, L)."""
    count = values.shape[1] // every
    return np.asarray(values[:, : count * every].reshape(len(values), count, every).mean(axis=2))
