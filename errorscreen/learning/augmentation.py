r"""Cheap labels: a regression of the sensitivities labels responses that cost one simulation each.

An exact label (14), (15) costs m + 1 simulations. The regression of exact labels is

.. math:: \hat c_j = r_j \, \hat S_j(\theta), \qquad \ln(\hat S_j + \epsilon_j) = f_j(\theta)              \qquad (A1)

with the known deviation :math:`r_j = |\theta_j / \theta_{j,0} - 1|` and :math:`\epsilon_j`, a thousandth of the mean of
:math:`S_j`.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor
from sklearn.utils.validation import check_is_fitted

from errorscreen._runtime.sampling import generator, latin_hypercube
from errorscreen.events import Event
from errorscreen.exceptions import InputError, check_integer
from errorscreen.learning.datasets import ErrorDataset
from errorscreen.learning.generation import batch_length
from errorscreen.parameters import ParameterSpace
from errorscreen.simulators.base import Simulator, Status

#: ε of (A1) in multiples of the mean sensitivity
_LEAST = 1e-3
#: deviation of the logarithm below which a sensitivity counts as constant
_CONSTANT = 1e-9
#: fewest samples to learn from, and fewest of which a tenth is set aside
_FEWEST, _ENOUGH = 10, 100
#: layers, batch and most passes of the regression; it stops when the tenth set aside is not predicted better
_LAYERS, _BATCH, _PASSES = (256, 256), 128, 60


class LabelRegressor(BaseEstimator):
    """Contributions of parameter vectors without their simulations, (A1).

    Parameters
    ----------
    space : ParameterSpace
        The m parameters.
    random_state : None, int, SeedSequence, Generator or RandomState

    Attributes
    ----------
    regressor_ : MLPRegressor
        From parameters, as shares of their ranges from -1 to 1, to the standardised logarithm of the sensitivities.
    offset_, scale_, least_ : ndarray of shape (m,)
        Mean and deviation of that logarithm, and ε.

    Examples
    --------
    >>> from errorscreen.parameters import Parameter
    >>> space = ParameterSpace([Parameter("a", 1.0, 0.7, 1.3), Parameter("b", 2.0, 1.4, 2.6)])
    >>> theta = latin_hypercube(space, 500, 0)
    >>> labels = space.deviation(theta) * np.exp(theta @ [[1.0, 0.0], [0.0, -1.0]])
    >>> model = LabelRegressor(space, random_state=0).fit(theta[:400], labels[:400])
    >>> bool(np.median(np.abs(model.predict(theta[400:]) / labels[400:] - 1)) < 0.05)
    True
    """

    def __init__(self, space: ParameterSpace, *, random_state: Any = None) -> None:
        self.space = space
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: ArrayLike) -> LabelRegressor:
        """Learn sensitivities from parameters X (n, m) in their units and their contributions y (n, m).

        Raises `InputError` if there are fewer than 10 samples, or labels do not fit or are not finite.
        """
        theta = self.space.validate(X)
        labels = np.asarray(y, dtype=float)
        if labels.shape != theta.shape or len(labels) < _FEWEST or not np.all(np.isfinite(labels)):
            raise InputError(
                f"labels have shape {labels.shape}, and {np.isfinite(labels).sum()} of them are finite",
                where="LabelRegressor",
                allowed=f"finite labels of shape {theta.shape}, of at least {_FEWEST} samples",
            )
        deviation = self.space.deviation(theta)
        # a parameter at its nominal value contributes nothing, whatever its sensitivity
        known = deviation > 0
        sensitivity = np.divide(labels, deviation, out=np.zeros_like(labels), where=known)
        mean = sensitivity.sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        self.least_ = np.where(mean > 0, _LEAST * mean, 1.0)
        logs = np.log(np.where(known, sensitivity, mean) + self.least_)
        self.offset_, scale = logs.mean(axis=0), logs.std(axis=0)
        self.scale_ = np.where(scale > _CONSTANT, scale, 0.0)
        targets = np.divide(logs - self.offset_, scale, out=np.zeros_like(logs), where=self.scale_ > 0)
        seed = int(generator(self.random_state).integers(2**31))
        regressor = MLPRegressor(
            hidden_layer_sizes=_LAYERS,
            activation="tanh",
            batch_size=min(_BATCH, len(theta) // 2),
            learning_rate_init=2e-3,
            max_iter=_PASSES,
            early_stopping=len(theta) >= _ENOUGH,
            n_iter_no_change=5,
            random_state=seed,
        )
        with warnings.catch_warnings():  # the number of passes is limited on purpose
            warnings.simplefilter("ignore", ConvergenceWarning)
            self.regressor_ = regressor.fit(self._shares(theta), targets)
        return self

    def predict(self, X: ArrayLike) -> NDArray[np.float64]:
        """Contributions (n, m) of parameter vectors (n, m)."""
        check_is_fitted(self)
        theta = self.space.validate(X)
        found = self.regressor_.predict(self._shares(theta)).reshape(theta.shape)
        sensitivity = np.exp(found * self.scale_ + self.offset_) - self.least_
        return np.asarray(self.space.deviation(theta) * np.maximum(sensitivity, 0.0))

    def _shares(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        lower, upper = self.space.bounds.T
        return np.asarray((2.0 * theta - lower - upper) / (upper - lower))


def enlarge_dataset(
    dataset: ErrorDataset,
    simulator: Simulator,
    n_samples: int,
    event: Event | None = None,
    *,
    random_state: Any = None,
    n_jobs: int | None = None,
) -> ErrorDataset:
    """Add samples whose labels come from a regression of a dataset's exact labels.

    Parameters
    ----------
    dataset : ErrorDataset
        From `generate_dataset`.
    simulator : Simulator
        The dataset's.
    n_samples : int
        Samples to add, each with a single simulation; 0 changes nothing.
    event : Event, optional
        The dataset's; the simulator's own where not given.
    random_state : None, int, SeedSequence, Generator or RandomState
    n_jobs : int, optional
        Number of joblib workers.

    Returns
    -------
    ErrorDataset
        The samples of `dataset`, then the new ones. ``metadata["regression"]`` has their number and ``label_error``,
        the median relative error of the regression on a tenth of the exact labels, which it has not seen.

    Raises
    ------
    InputError
        If the dataset belongs to another event or other parameters, or has too few valid samples.
    """
    n_samples = check_integer(n_samples, "n_samples", low=0)
    event = simulator.event if event is None else event
    space = simulator.parameters
    if (
        dataset.names != space.names
        or dataset.event != event.name
        or not np.array_equal(dataset.time, event.time)
    ):
        raise InputError(
            f"the dataset has {len(dataset.names)} parameters and the event {dataset.event!r}",
            where="enlarge_dataset",
            allowed=f"the simulator's {len(space)} parameters and the event {event.name!r}, with its time axis",
        )
    if not n_samples:
        return dataset
    rng = generator(random_state)
    model, label_error = _regression(dataset.valid(), space, rng)
    theta = latin_hypercube(space, n_samples, rng)
    rows = batch_length(simulator, event)
    blocks = [theta[start : start + rows] for start in range(0, n_samples, rows)]
    found = Parallel(n_jobs=n_jobs)(delayed(simulator.simulate)(block, event) for block in blocks)
    status = np.concatenate([r.status for r in found])
    contributions = np.where((status == Status.OK)[:, None], model.predict(theta), np.nan)
    return replace(
        dataset,
        theta=np.concatenate([dataset.theta, theta]),
        responses=np.concatenate([dataset.responses, *(r.values for r in found)]),
        contributions=np.concatenate([dataset.contributions, contributions]),
        status=np.concatenate([dataset.status, status]),
        metadata={**dataset.metadata, "regression": {"samples": n_samples, "label_error": label_error}},
    )


def _regression(
    exact: ErrorDataset, space: ParameterSpace, rng: np.random.Generator
) -> tuple[LabelRegressor, float]:
    """Regression of the labels, and its median relative error on a tenth of the samples, which it has not seen."""
    model = LabelRegressor(space, random_state=int(rng.integers(2**31)))
    unseen = rng.permutation(len(exact)) < len(exact) // 10
    model.fit(exact.theta[~unseen], exact.contributions[~unseen])
    labels = exact.contributions[unseen]
    counted = labels > 0
    error = np.abs(model.predict(exact.theta[unseen]) - labels)[counted] / labels[counted]
    return model, float(np.median(error))
