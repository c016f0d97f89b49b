r"""A quick first look: one network ranks parameters and missing effects together, before any search.

The network of the published method is trained on samples of which a part has one effect. The label of an effect is

.. math:: c_k = \sum_r \lambda_r \| y_r(\theta, s_k) - y_r(\theta, 0) \|_2                              \qquad (D5)

in the unit of the contributions (14) of parameters. It says nothing about noise, places or values: `CauseFinder` does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.utils.validation import check_is_fitted

from errorscreen._runtime.estimators import RecordingEstimator
from errorscreen._runtime.sampling import generator
from errorscreen._runtime.typed import Real
from errorscreen.data.observations import Observation
from errorscreen.discovery.starts.signatures import spread_over
from errorscreen.events import Event
from errorscreen.exceptions import InputError, check_integer, check_real
from errorscreen.learning.datasets import ErrorDataset
from errorscreen.learning.generation import generate_dataset
from errorscreen.metrics import channel_weights, ranking
from errorscreen.screening import ContributionScreener, contribution_pipeline
from errorscreen.simulators.base import Simulator, Status
from errorscreen.simulators.observations import as_observations

#: smallest strength that is drawn, in multiples of the largest
_LEAST = 0.05
#: epochs of the default network: fewer than for parameters alone, because there are more samples
_EPOCHS = 20


@dataclass(frozen=True)
class Contribution:
    """Contribution of one parameter or effect to the error, as a network reads it off.

    Parameters
    ----------
    name : str
    kind : {"parameter", "effect"}
    value : float
        In the channels' unit times the root of a second.
    """

    name: str
    kind: Literal["parameter", "effect"]
    value: Real


def effect_dataset(
    simulator: Simulator,
    n_samples: int,
    event: Event | None = None,
    *,
    effects: Sequence[str] | None = None,
    share: float = 0.7,
    random_state: Any = None,
    n_jobs: int | None = None,
    progress: bool = False,
) -> ErrorDataset:
    """Samples of deviating parameters, part of them with one effect, labelled for both.

    Parameters
    ----------
    simulator : Simulator
    n_samples : int
    event : Event, optional
        The simulator's own where not given.
    effects : sequence of str, optional
        All of the simulator's, but for unknown signals, where not given.
    share : float
        Of the samples with an effect; each effect is as frequent as any other.
    random_state : None, int, SeedSequence, Generator or RandomState
    n_jobs, progress
        See `generate_dataset`.

    Returns
    -------
    ErrorDataset
        Its columns are the parameters, then the strengths of the effects by the effects' names.

    Raises
    ------
    InputError
        If the simulator has no effects, or an argument cannot be used.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> plant = PlantSimulator("synchronous_machine", demo_recordings(0)[0])
    >>> data = effect_dataset(plant, 10, effects=["exciter", "lag_P"], random_state=0)
    >>> data.names[-2:], data.contributions.shape
    (('exciter', 'lag_P'), (10, 10))
    """
    check_integer(n_samples, "n_samples")
    check_real(share, "share", low=0.0, high=1.0)
    chosen = simulator.addable(simulator.effects_named(effects), asked=effects is not None)
    if not chosen:
        raise InputError(f"{simulator!r} has no effects to add", allowed="at least one effect")
    event = simulator.event if event is None else event
    rng = generator(random_state)
    data = generate_dataset(
        simulator, n_samples, event, random_state=rng.integers(2**31), n_jobs=n_jobs, progress=progress
    )
    m, lambdas = len(simulator.parameters), channel_weights(None, len(simulator.channels))
    responses, status = data.responses.copy(), data.status.copy()
    strengths, labels = np.zeros((2, n_samples, len(chosen)))
    which = np.where(rng.random(n_samples) < share, rng.integers(len(chosen), size=n_samples), -1)
    count = n_samples * (m + 1)
    for k, effect in enumerate(chosen):
        rows = np.flatnonzero((which == k) & data.ok)
        if not len(rows):
            continue
        extended = simulator.extend(effect)
        own = _drawn(extended, m, len(rows), rng)
        count += len(rows)
        result = extended.simulate(np.hstack([data.theta[rows], own]), event)
        change = result.values - data.responses[rows]
        responses[rows], strengths[rows, k] = result.values, own[:, 0]
        labels[rows, k] = np.sqrt((change**2).sum(axis=-1) * event.dt) @ lambdas
        status[rows] = result.status
    labels[status != Status.OK] = np.nan
    contributions = np.hstack([data.contributions, labels])
    contributions[status != Status.OK] = np.nan
    names = [effect.name for effect in chosen]
    return replace(
        data,
        theta=np.hstack([data.theta, strengths]),
        responses=responses,
        contributions=contributions,
        status=status,
        names=(*data.names, *names),
        metadata={**data.metadata, "effects": names, "share": share, "n_simulations": count},
    )


class FirstLook(RecordingEstimator):
    """Rank parameters and missing effects by what each contributes to the error of a recording.

    Parameters
    ----------
    simulator : Simulator
    effects : sequence of str, optional
        See `effect_dataset`.
    n_samples : int, default 4000
        Of the training set; each costs a simulation for every parameter.
    estimator : regressor, optional
        From errors (n, R, L) to contributions; a small convolutional network on wavelet images where not given.
    random_state : None, int, SeedSequence, Generator or RandomState
    n_jobs : int, optional
    progress : bool, default False

    Attributes
    ----------
    names_ : tuple of str
        Parameters, then effects.
    contributions_ : ndarray of shape (m + e,)
        Predicted for the recording that was fitted to.
    ranking_, effects_ : tuple of str
        All names, and those of effects, the largest contribution first.
    screener_ : ContributionScreener
        The trained network; its errors have the time axis of the recording.
    dataset_ : ErrorDataset
        What it was trained on.

    Examples
    --------
    >>> from sklearn.neighbors import KNeighborsRegressor
    >>> from sklearn.pipeline import make_pipeline
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.features import CWTTransformer
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording = demo_recordings(random_state=0)[0]
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> quick = make_pipeline(CWTTransformer(n_frequencies=8, n_columns=16, output="flat"), KNeighborsRegressor())
    >>> look = FirstLook(plant, ["exciter", "governor"], n_samples=60, estimator=quick, random_state=0).fit(recording)
    >>> sorted(look.effects_)
    ['exciter', 'governor']
    """

    def __init__(
        self,
        simulator: Simulator,
        effects: Sequence[str] | None = None,
        *,
        n_samples: int = 4000,
        estimator: Any = None,
        random_state: Any = None,
        n_jobs: int | None = None,
        progress: bool = False,
    ) -> None:
        self.simulator = simulator
        self.effects = effects
        self.n_samples = n_samples
        self.estimator = estimator
        self.random_state = random_state
        self.n_jobs = n_jobs
        self.progress = progress

    def fit(self, X: Any, y: None = None) -> FirstLook:
        """Train for the event of one recording, and read its error.

        Parameters
        ----------
        X : Observation, or anything ``simulator.observe`` takes
        y : None
            Not used, present for scikit-learn.

        Raises
        ------
        InputError
            If an argument or the recording cannot be used, or there is more than one recording.
        MissingExtraError
            If the default network is asked for and torch is not installed.
        """
        observation = self._one(X)
        rng = generator(self.random_state)
        seed = int(rng.integers(2**31))
        estimator = self._estimator(observation.event.dt, seed)
        self.dataset_ = effect_dataset(
            self.simulator,
            self.n_samples,
            observation.event,
            effects=self.effects,
            random_state=rng,
            n_jobs=self.n_jobs,
            progress=self.progress,
        ).valid()
        self.names_ = self.dataset_.names
        self.screener_ = ContributionScreener(
            estimator,
            self.names_,
            noise=np.where(observation.mask, observation.sigma, 0.0),
            random_state=seed,
        )
        self.screener_.fit(np.where(observation.mask, self.dataset_.errors, 0.0), self.dataset_.contributions)
        self.contributions_ = self.contributions(observation)
        self.ranking_ = tuple(self.names_[j] for j in ranking(self.contributions_))
        effects = set(self.dataset_.metadata["effects"])
        self.effects_ = tuple(name for name in self.ranking_ if name in effects)
        return self

    @property
    def ranked_(self) -> tuple[Contribution, ...]:
        """All contributions, the largest first."""
        found = dict(zip(self.names_, self.contributions_.tolist(), strict=True))
        return tuple(
            Contribution(name, "effect" if name in self.effects_ else "parameter", found[name])
            for name in self.ranking_
        )

    def contributions(self, recording: Any) -> NDArray[np.float64]:
        """Contributions (m + e,) to the error of a recording with the time axis of the one that was fitted to."""
        check_is_fitted(self, "screener_")
        observation = self._one(recording)
        error = observation.values - self.simulator.baseline(observation.event)
        found = self.screener_.predict(np.where(observation.mask, error, 0.0)[None])
        return np.asarray(found)[0]

    def _one(self, recording: Any) -> Observation:
        observations = as_observations(self.simulator, recording)
        if len(observations) != 1:
            raise InputError(f"{len(observations)} recordings were given", allowed="one: it has one event")
        return observations[0]

    def _estimator(self, dt: float, seed: int) -> Any:
        if self.estimator is not None:
            return clone(self.estimator)
        return contribution_pipeline(dt, seed).set_params(
            cnncontributionregressor__max_epochs=_EPOCHS, cnncontributionregressor__verbose=self.progress
        )


def _drawn(extended: Simulator, first: int, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Values (n, d) of an effect's parameters; a strength has either sign where both are allowed."""
    space = extended.parameters
    own = space.nominal[first:] + space.scales[first:] * spread_over(
        space, first, rng.random((n, len(space) - first))
    )
    lower, upper = space.bounds[first]
    size = rng.uniform(_LEAST, 1.0, n)
    own[:, 0] = np.where((lower < 0) & (rng.random(n) < 0.5), size * lower, size * upper)
    return np.asarray(own)
