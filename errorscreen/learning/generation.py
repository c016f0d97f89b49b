"""Labelled datasets from a simulator: samples, responses and contributions, equations (1)–(15)."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import ArrayLike, NDArray
from tqdm import tqdm

from errorscreen._runtime.sampling import latin_hypercube
from errorscreen._runtime.store import Store, digest
from errorscreen.events import Event
from errorscreen.exceptions import DataWarning, InputError, SimulationError, check_integer, check_real
from errorscreen.learning.datasets import ErrorDataset
from errorscreen.metrics import channel_weights
from errorscreen.simulators.base import Simulator, Status

#: bytes of a batch, and arrays of its size: responses, their changes, the squares of these, and one of the engine
_BATCH_BYTES = 64 * 2**20
_COPIES = 4
_Batch = dict[str, NDArray[Any]]


class Sensitivity(NamedTuple):
    """Local sensitivities of n samples.

    Attributes
    ----------
    values : ndarray of shape (n, m)
        S, equation (13); NaN in failed rows.
    responses : ndarray of shape (n, R, L)
        Response at each sample; NaN in failed rows.
    status : ndarray of shape (n,), int
        OK only if the sample and all its perturbed neighbours were simulated.
    """

    values: NDArray[np.float64]
    responses: NDArray[np.float64]
    status: NDArray[np.int64]


def local_sensitivity(
    simulator: Simulator,
    theta: ArrayLike,
    event: Event | None = None,
    *,
    relative: bool = True,
    step: float = 1e-3,
    weights: ArrayLike | None = None,
    mask: ArrayLike | None = None,
) -> Sensitivity:
    r"""Sensitivity of the response to each parameter *at each sample*, equation (13).

    .. math:: S_j = \sum_r \lambda_r \|y_r(\theta + \Delta\theta_j) - y_r(\theta)\|_2 / \|\Delta\theta_j\|

    with the norm over time :math:`\|y\|_2 = \sqrt{\sum_t y(t)^2 \Delta t}`, so that it does not depend on the
    sampling rate. All pairs of sample and perturbed parameter go to the simulator as one flat batch.

    Parameters
    ----------
    simulator : Simulator
    theta : array-like of shape (n, m) or (m,)
    event : Event, optional
        The simulator's own where not given.
    relative : bool, default True
        Measure Δθ_j in multiples of the parameter's scale (its nominal value), the "unit relative variation" of the
        paper's text. S is then in the channels' unit times √s. Otherwise S is per unit of the parameter, as equation
        (13) is printed.
    step : float, default 1e-3
        Δθ_j divided by the parameter's scale. The parameter is increased, or decreased where the increase would leave
        the bounds, because a model need not exist there. In a range narrower than two steps, half the range.
    weights : array-like of shape (R,), optional
        λ of the channels; 1/R each where not given. Give them if the units differ in size.
    mask : array-like of shape (R, L), optional
        Instants that count; all where not given.

    Returns
    -------
    Sensitivity

    Raises
    ------
    InputError
        If `step`, `weights` or the shape of `theta` cannot be used.
    """
    space = simulator.parameters
    theta = space.validate(theta)
    n, m = theta.shape
    delta = _steps(simulator, theta, check_real(step, "step", low=0, above=True))
    rows = np.repeat(theta[:, None, :], m + 1, axis=1)
    rows[:, np.arange(1, m + 1), np.arange(m)] += delta
    # the difference after rounding
    delta = np.abs(rows[:, np.arange(1, m + 1), np.arange(m)] - theta)

    event = simulator.event if event is None else event
    result = simulator.simulate(rows.reshape(n * (m + 1), m), event)
    values = result.values.reshape(n, m + 1, *result.values.shape[1:])
    change = values[:, 1:] - values[:, :1]
    if mask is not None:
        change = np.where(np.asarray(mask, dtype=bool), change, 0.0)
    norms = np.sqrt((change**2).sum(axis=-1) * event.dt) @ channel_weights(weights, values.shape[2])
    sensitivity = norms / (delta / space.scales if relative else delta)

    statuses = result.status.reshape(n, m + 1)
    status = statuses[np.arange(n), np.argmax(statuses != Status.OK, axis=1)]
    failed = status != Status.OK
    sensitivity[failed] = np.nan
    responses = values[:, 0].copy()
    responses[failed] = np.nan
    return Sensitivity(sensitivity, responses, status)


def contribution_labels(
    simulator: Simulator,
    theta: ArrayLike,
    event: Event | None = None,
    *,
    weights: ArrayLike | None = None,
    mask: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """Contributions of given samples, equations (12)–(15): deviation times local sensitivity.

    Parameters
    ----------
    simulator, theta, event, weights, mask
        As in `local_sensitivity`, but for any number of samples: they are simulated in batches.

    Returns
    -------
    ndarray of shape (n, m)
        NaN in rows that failed.

    Raises
    ------
    InputError
        If `weights` or the shape of `theta` cannot be used.

    Examples
    --------
    At the nominal parameters nothing deviates:

    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> plant = PlantSimulator("synchronous_machine", demo_recordings(random_state=0)[0])
    >>> float(contribution_labels(plant, plant.parameters.nominal).max())
    0.0
    """
    event = simulator.event if event is None else event
    theta = simulator.parameters.validate(theta)
    rows = batch_length(simulator, event, simulations=len(simulator.parameters) + 1)
    found = [
        local_sensitivity(simulator, theta[i : i + rows], event, weights=weights, mask=mask).values
        for i in range(0, len(theta), rows)
    ]
    return np.asarray(simulator.parameters.deviation(theta) * np.concatenate(found))


def batch_length(simulator: Simulator, event: Event, batch_size: int = 1024, *, simulations: int = 1) -> int:
    """Number of samples of a batch: at most `batch_size` simulations and about 64 MB."""
    response_bytes = len(simulator.channels) * len(event.time) * np.dtype(float).itemsize
    length = max(1, min(batch_size, _BATCH_BYTES // (_COPIES * response_bytes)))
    return max(1, length // simulations)


def generate_dataset(
    simulator: Simulator,
    n_samples: int,
    event: Event | None = None,
    *,
    random_state: Any = None,
    relative: bool = True,
    step: float = 1e-3,
    weights: ArrayLike | None = None,
    n_jobs: int | None = None,
    batch_size: int = 1024,
    progress: bool = False,
    checkpoint: str | os.PathLike[str] | None = None,
) -> ErrorDataset:
    r"""Sample a simulator and label each sample with the contribution of each parameter.

    The samples are a Latin hypercube, equation (1). The label is the deviation times the local sensitivity at the
    sample, equations (12)–(15): :math:`c_j = r_j S_j`, see `local_sensitivity`. This costs n·(m + 1) simulations.

    Parameters
    ----------
    simulator : Simulator
        Must be picklable where `n_jobs` is not 1.
    n_samples : int
    event : Event, optional
        The simulator's own where not given.
    random_state : None, int, SeedSequence, Generator or RandomState
    relative, step, weights
        As in `local_sensitivity`.
    n_jobs : int, optional
        Number of joblib workers; ``None`` follows ``joblib.parallel_config``, which also chooses the backend. The
        result does not depend on it.
    batch_size : int, default 1024
        Largest number of simulations of a batch; fewer where the responses are long, so that a batch takes about
        64 MB.
    progress : bool, default False
        Show a progress bar.
    checkpoint : path-like, optional
        Folder for finished batches. An interrupted call resumes when it is repeated with the same arguments and a
        `random_state` that is not ``None``.

    Returns
    -------
    ErrorDataset
        With the failed samples; `ErrorDataset.valid` leaves them out.

    Raises
    ------
    InputError
        If an argument cannot be used, or the checkpoint belongs to another run.
    SimulationError
        If the simulation at the nominal parameters or that of every sample fails.

    Warns
    -----
    DataWarning
        If some samples failed: their number, and the remedy.
    """
    event = simulator.event if event is None else event
    batch_size = check_integer(batch_size, "batch_size")
    lambdas = channel_weights(weights, len(simulator.channels))
    check_real(step, "step", low=0, above=True)
    baseline = simulator.baseline(event)
    theta = latin_hypercube(simulator.parameters, n_samples, random_state)

    # batches depend on the arguments alone, so that n_jobs changes nothing
    rows = batch_length(simulator, event, batch_size, simulations=len(simulator.parameters) + 1)
    batches = [theta[start : start + rows] for start in range(0, len(theta), rows)]
    options = {"relative": bool(relative), "step": step, "weights": lambdas.tolist()}
    store = None
    if checkpoint is not None:
        if random_state is None:
            raise InputError(
                "random_state is None, so the samples differ in each call",
                where="checkpoint",
                remedy="Give random_state, for example 0",
            )
        settings = (type(simulator).__qualname__, simulator.channels, simulator.settings(), baseline)
        fingerprint = {
            "simulator": digest(*settings),
            "parameters": digest(list(simulator.parameters)),
            "event": digest(event),
            "samples": digest(theta, rows),
            "options": digest(options),
        }
        store = Store(checkpoint, fingerprint)
    done = _run(simulator, batches, event, options, n_jobs, progress, store)
    data = ErrorDataset(
        theta=theta,
        **done,
        baseline=baseline,
        names=simulator.parameters.names,
        channels=tuple(simulator.channels),
        time=event.time,
        event=event.name,
        metadata=options,
    )
    if data.n_failed == len(data):
        raise SimulationError(f"every sample failed: {data.failures()}.")
    if data.n_failed:
        warnings.warn(
            DataWarning(f"{data.n_failed} of {len(data)} samples are masked: {data.failures()}."),
            stacklevel=2,
        )
    return data


def _run(
    simulator: Simulator,
    batches: list[NDArray[np.float64]],
    event: Event,
    options: dict[str, Any],
    n_jobs: int | None,
    progress: bool,
    store: Store | None,
) -> _Batch:
    """Simulate and label the batches that are not stored; return all in one, in order.

    Each is put in its place as it comes: the responses of a fast recorder fit into the memory only once.
    """
    starts = np.cumsum([0, *map(len, batches)])
    done: set[int] = set()
    whole: _Batch = {}

    def keep(i: int, batch: _Batch) -> None:
        for name, part in batch.items():
            if name not in whole:
                whole[name] = np.empty((starts[-1], *part.shape[1:]), dtype=part.dtype)
            whole[name][starts[i] : starts[i + 1]] = part
        done.add(i)

    for i, stored in ({} if store is None else store.load(range(len(batches)))).items():
        keep(i, stored)
    missing = [i for i in range(len(batches)) if i not in done]
    tasks = (delayed(_label)(simulator, batches[i], event, options) for i in missing)
    results: Iterator[_Batch] = Parallel(n_jobs=n_jobs, return_as="generator")(tasks)
    total = sum(map(len, batches))
    with tqdm(total=total, desc="samples", unit="", disable=not progress) as bar:
        bar.update(sum(len(batches[i]) for i in done))
        try:
            for i, result in zip(missing, results, strict=True):
                keep(i, result)
                if store is not None:
                    store.save(i, result)
                bar.update(len(batches[i]))
        except KeyboardInterrupt as interrupt:
            if store is None:
                raise
            raise KeyboardInterrupt(
                f"{len(done)} of {len(batches)} batches are stored in {store.folder}; "
                "the same call resumes from there"
            ) from interrupt
    return whole


def _label(simulator: Simulator, theta: NDArray[np.float64], event: Event, options: dict[str, Any]) -> _Batch:
    """Responses, labels (equations (12)–(15)) and status of one batch of samples."""
    found = local_sensitivity(simulator, theta, event, **options)
    contributions = simulator.parameters.deviation(theta) * found.values
    return {"responses": found.responses, "contributions": contributions, "status": found.status}


def _steps(simulator: Simulator, theta: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Δθ of each sample and parameter, (n, m): positive unless that leaves the bounds."""
    lower, upper = simulator.parameters.bounds.T
    size = np.minimum(step * simulator.parameters.scales, (upper - lower) / 2)
    return np.where(theta + size <= upper, size, -size)
