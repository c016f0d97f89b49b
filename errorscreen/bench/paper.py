"""The paper's case study on many hidden draws: rankings, calibrations and their gain on held-out events."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from tqdm import tqdm

from errorscreen._runtime.store import Store, digest, program
from errorscreen.bench.paper_draw import (
    CALIBRATED,
    FIT_EVENTS,
    RANKINGS,
    STEP,
    TRUE_STEP,
    Effort,
    Setting,
    hidden,
    noise_of,
    run_draw,
    step_error,
)
from errorscreen.bench.paper_output import write_paper
from errorscreen.bench.timing import machine
from errorscreen.cases import load_ieee39
from errorscreen.exceptions import InputError, check_integer, check_real, unknown_name
from errorscreen.features import ResponseErrorTransformer
from errorscreen.learning.augmentation import enlarge_dataset
from errorscreen.learning.generation import generate_dataset
from errorscreen.learning.regressors import import_network
from errorscreen.metrics import reduction
from errorscreen.screening import ContributionScreener, contribution_pipeline

SCHEMA_VERSION = 1
#: the paper's result on its one draw, equation (23): reduction of E_U and E_P by the network's ten
PUBLISHED = (0.8534, 0.9009)
#: largest χ²/N of a fit at the noise floor
FLOOR = 1.05
#: resampled sets of draws for intervals, and their probability
_BOOTSTRAP, _LEVEL = 2000, 0.95

#: differences from `contribution_pipeline`. "whitened": small images, which leave time for more samples; "published":
#: the paper's form, energies alone and one scale for each channel, on errors that are not whitened
NETWORKS: dict[str, dict[str, Any]] = {
    "whitened": {
        "cwttransformer__n_frequencies": 16,
        "cwttransformer__n_columns": 32,
        "cwttransformer__n_jobs": -1,
        "cnncontributionregressor__n_filters": (16, 32, 32),
        "cnncontributionregressor__n_hidden": 512,
        "cnncontributionregressor__batch_size": 64,
    },
    "published": {
        "cwttransformer__n_frequencies": 64,
        "cwttransformer__n_columns": 256,
        "cwttransformer__signed": False,
        "cwttransformer__n_jobs": -1,
        "channelscaler__by": "channel",
    },
}
_PUBLISHED_EFFORT = Effort(samples=2500, enlarged=0, epochs=25)

_log = logging.getLogger(__name__)
_Array = NDArray[np.float64]
_Draw = dict[str, NDArray[Any]]


def paper_study(
    out: str | Path,
    *,
    draws: int = 100,
    seed: int = 0,
    noise_db: float | None = None,
    network: str = "whitened",
    effort: Effort | None = None,
    n_jobs: int | None = None,
    progress: bool = False,
) -> dict[str, Any]:
    """Run the case study, write result, tables and figures into ``out``, and return the result.

    Each draw hides 40 parameters, uniform inside their bounds, in a simulation with a tenth of the step, and measures
    all events. Rankings see the paper's event alone. The first ten parameters of each are calibrated on it by particle
    swarm, as in the paper. All 40 are calibrated by bounded least squares too, on that event and on three. Finished
    stages stay in ``out/stages``: the same call goes on from there.

    Parameters
    ----------
    out : str or Path
        Folder; made where it is missing.
    draws : int
    seed : int
        Of hidden parameters, noise, samples, network and searches. A draw does not depend on the number of draws.
    noise_db : float or None
        See `Setting`; None is without noise.
    network : {"whitened", "published"}
        Form of ``cnn``: whitened errors and many samples, see `ContributionScreener` and `enlarge_dataset`, or the
        paper's: energies alone, 64 x 256, of the errors as they are.
    effort : Effort, optional
        That of `effort_of` where not given.
    n_jobs : int, optional
        Processes that share the draws. They do not change the result, only the times.
    progress : bool
        Whether to show progress bars.

    Returns
    -------
    dict
        ``methods.<name>`` for the rankings ``random``, ``sensitivity``, ``identifiability``, ``cnn``, ``map`` and
        ``oracle`` and for the fit ``map_all`` of all parameters: overlap of the first ten parameters with the truly
        first ten, reductions of E, equation (23), on fitted and held-out events, and cost. ``map_all`` also tells
        about χ², convergence and the coverage of the intervals. The guide page on the case study lists all keys.

    Raises
    ------
    InputError
        If an argument cannot be used, or ``out/stages`` belongs to another run.
    MissingExtraError
        If torch is not installed.
    """
    draws = check_integer(draws, "the number of draws", low=1)
    seed = check_integer(seed, "the seed", low=0, high=2**32 - 1)
    if n_jobs == 0:  # joblib would refuse it only after the training
        raise InputError("the number of jobs is 0", allowed="None, a positive number, or -1 for all cores")
    if noise_db is not None:
        noise_db = check_real(noise_db, "noise_db", low=0.0, high=100.0)
    import_network()
    usual = effort_of(network)  # refuses an unknown network even where an effort is given
    out, effort = Path(out), usual if effort is None else effort
    setting = Setting(seed, noise_db, effort)
    started = perf_counter()
    fingerprint = {
        "program": program(),
        "seed and noise": digest(seed, noise_db),
        "effort": digest(effort),
        "study": digest(FIT_EVENTS, RANKINGS, STEP, TRUE_STEP, NETWORKS[network], [*setting.events.values()]),
        "simulator": digest(setting.simulator.settings()),
        "parameters": digest(list(setting.simulator.parameters)),
    }
    step_errors = step_error(setting)
    read, trained = _read(setting, draws, network, step_errors, out, fingerprint, progress)
    store = Store(out / "stages" / "draws", fingerprint)
    done = store.load(range(draws))
    _log.info("%d draws, %d of them finished before", draws, len(done))
    missing = [i for i in range(draws) if i not in done]
    tasks = (delayed(run_draw)(setting, i, step_errors, read[i]) for i in missing)
    finished = Parallel(n_jobs=n_jobs, return_as="generator")(tasks)
    with tqdm(total=draws, initial=len(done), desc="draws", disable=not progress) as bar:
        for i, found in zip(missing, finished, strict=True):
            store.save(i, found)
            done[i] = found
            bar.update()
    table = {name: np.array([done[i][name] for i in range(draws)]) for name in done[0]}
    result: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "kind": "bench-paper",
        "draws": draws,
        "seed": seed,
        "noise_db": noise_db,
        "effort": asdict(effort),
        "events": {"fit": list(FIT_EVENTS), "held_out": list(setting.events)[len(FIT_EVENTS) :]},
        "true_step": TRUE_STEP,
        "step": setting.simulator.step,
        "training": trained,
        "network": {"form": network}
        | {key: list(v) if isinstance(v, tuple) else v for key, v in NETWORKS[network].items()},
        "methods": summarise(table, setting.simulator.parameters.names, seed),
        "by_event": _by_event(table, list(setting.events)),
        "seconds": perf_counter() - started,
        "machine": machine(),
    }
    write_paper(result, table, setting, step_errors, out)
    return result


def effort_of(network: str) -> Effort:
    """Effort of the study with a network of `NETWORKS`; the paper's learns from 2500 samples.

    Examples
    --------
    >>> effort_of("published").samples
    2500
    """
    if network not in NETWORKS:
        raise unknown_name(network, NETWORKS, kind="network")
    return Effort() if network == "whitened" else _PUBLISHED_EFFORT


def study_screener(
    network: str, sampling_period: float, noise: _Array | None, random_state: int, epochs: int
) -> ContributionScreener:
    """Network of the case study, with its images and scaling."""
    pipeline = contribution_pipeline(sampling_period, random_state).set_params(
        **NETWORKS[network], cnncontributionregressor__max_epochs=epochs
    )
    return ContributionScreener(
        pipeline, noise=noise, whiten=network == "whitened", random_state=random_state
    )


def _read(
    setting: Setting,
    draws: int,
    network: str,
    step_errors: dict[str, _Array],
    out: Path,
    fingerprint: dict[str, str],
    progress: bool,
) -> tuple[_Array, dict[str, Any]]:
    """Contributions (draws, m) by the network from the calibration event, and the cost of its training."""
    effort, event = setting.effort, setting.events[FIT_EVENTS[0]]
    store = Store(out / "stages" / f"network-{draws}", fingerprint)
    stored = store.load([0])
    if not stored:
        simulator = load_ieee39(step=STEP)
        _log.info("%d simulations for the training set", _simulations(effort, setting))
        started = perf_counter()
        dataset = generate_dataset(
            simulator, effort.samples, event,
            random_state=setting.seed, progress=progress, checkpoint=out / "stages" / "dataset",
        )  # fmt: skip
        dataset = enlarge_dataset(dataset, simulator, effort.enlarged, event, random_state=setting.seed)
        dataset = dataset.valid()
        simulated = perf_counter() - started
        error = ResponseErrorTransformer(dataset.baseline).fit(dataset.responses)
        found = [hidden(setting, i, step_errors, FIT_EVENTS[:1]) for i in range(draws)]
        noise = None if setting.noise_db is None else noise_of(dataset.baseline, event, setting.noise_db)
        screener = study_screener(network, event.dt, noise, setting.seed, effort.epochs)
        screener.set_params(estimator__cnncontributionregressor__verbose=progress)
        _log.info("training of the network")
        started = perf_counter()
        screener.fit(error.transform(dataset.responses), dataset.contributions)
        trained = perf_counter() - started
        contributions = screener.predict(error.transform([f.observations[event.name].values for f in found]))
        label_error = dataset.metadata.get("regression", {}).get("label_error", np.nan)
        training = np.array([simulated, trained, label_error])
        stored = {0: {"contributions": contributions, "training": training}}
        store.save(0, stored[0])
    simulated, trained, label_error = stored[0]["training"].tolist()
    cost = {
        "simulations": _simulations(effort, setting),
        "simulation_seconds": simulated,
        "training_seconds": trained,
        "label_error": None if np.isnan(label_error) else label_error,
    }
    return stored[0]["contributions"], cost


def _simulations(effort: Effort, setting: Setting) -> int:
    """Simulations of the training set: each exact label needs one for every parameter."""
    return effort.samples * (len(setting.simulator.parameters) + 1) + effort.enlarged


def summarise(table: _Draw, names: Sequence[str], seed: int) -> dict[str, Any]:
    """Return ``methods`` of the result from the arrays of `run_draw`, stacked over draws first."""
    rng = np.random.default_rng(seed)
    resampled = rng.integers(len(table["overlap"]), size=(_BOOTSTRAP, len(table["overlap"])))
    methods: dict[str, Any] = {}
    for k, name in enumerate(CALIBRATED):
        methods[name] = entry = _gains(table, k, resampled)
        if name in RANKINGS:
            entry |= _overlap(table["overlap"][:, k], resampled)
        else:
            entry |= _fit_quality(table, k - len(RANKINGS), names, resampled)
    three = methods.pop("map_all_three")
    methods["map_all"] |= {"overlap_at_10": None, "three_events": three}  # no ranking
    methods["map"]["three_events"] = _overlap(table["overlap_three"], resampled)
    for k, entry in enumerate((methods["map"], methods["map"]["three_events"])):
        entry["expected_overlap_at_10"] = float(table["expected_overlap"][:, k].mean())
    return methods


def _overlap(values: _Array, resampled: NDArray[np.int64]) -> dict[str, Any]:
    return {
        "overlap_at_10": float(values.mean()),
        "overlap_at_10_interval": _interval(values[resampled].mean(axis=1)),
    }


def _gains(table: _Draw, k: int, resampled: NDArray[np.int64]) -> dict[str, Any]:
    gains = reduction(table["before"], table["errors"][:, k])  # (draws, events, R)
    measured = reduction(table["measured_before"], table["measured"][:, k])
    failed = np.isnan(gains).any(axis=-1)
    gains, measured = np.nan_to_num(gains, nan=0.0), np.nan_to_num(measured, nan=0.0)
    fit, held_out = gains[:, :1], gains[:, len(FIT_EVENTS) :]
    return {
        "fit": _channels(fit, resampled),
        "fit_measured": _channels(measured[:, None], resampled),
        "held_out": _channels(held_out, resampled),
        "reaches_paper": float((gains[:, 0] >= PUBLISHED).all(axis=-1).mean()),
        "reaches_paper_measured": float((measured >= PUBLISHED).all(axis=-1).mean()),
        "failed": int(failed.sum()),
        "simulations": float(table["simulations"][:, k].sum(axis=1).mean()),
        "seconds": float(table["seconds"][:, k].sum(axis=1).mean()),
    }


def _channels(gains: _Array, resampled: NDArray[np.int64]) -> dict[str, Any]:
    """Median and tenth percentile over (draws, events) for each channel."""
    found = {}
    for r, channel in enumerate("UP"):
        values = gains[:, :, r]
        again = values[resampled].reshape(len(resampled), -1)
        found[channel] = {
            "median": float(np.median(values)),
            "median_interval": _interval(np.median(again, axis=1)),
            "p10": float(np.quantile(values, 0.1)),
            "p10_interval": _interval(np.quantile(again, 0.1, axis=1)),
        }
    return found


def _fit_quality(
    table: _Draw, which: int, names: Sequence[str], resampled: NDArray[np.int64]
) -> dict[str, Any]:
    """Quality of the fit of all parameters on one event (0) or on three (1)."""
    chi2, truth = table["chi2"][:, which].T
    found, true = table["objective"][:, which].T
    identifiable, covered = table["identifiable"][:, which], table["covered"][:, which]
    hits, counts = (covered & identifiable).sum(axis=1), identifiable.sum(axis=1)
    with np.errstate(invalid="ignore"):  # NaN where no parameter is identifiable
        again = hits[resampled].sum(axis=1) / counts[resampled].sum(axis=1)
        coverage = float(np.divide(hits.sum(), counts.sum()))
    seconds = table["seconds"][:, len(RANKINGS) + which].sum(axis=1)
    return {
        "noise_floor_share": float(np.mean(chi2 <= FLOOR)),
        "noise_floor_share_of_truth": float(np.mean(truth <= FLOOR)),
        "search_share": float(np.mean(found <= true)),
        "chi2_median": float(np.median(chi2)),
        "chi2_largest": float(chi2.max()),
        "converged_share": float(table["converged"][:, which].mean()),
        "identifiable": float(counts.mean()),
        "coverage": coverage,
        "coverage_interval": _interval(again),
        "coverage_by_parameter": {
            name: {"identifiable": int(identifiable[:, j].sum()), "covered": int(hit)}
            for j, (name, hit) in enumerate(zip(names, (covered & identifiable).sum(axis=0), strict=True))
        },
        "starts": float(table["starts"][:, which].mean()),
        "p90_seconds": float(np.quantile(seconds, 0.9)),
        "largest_seconds": float(seconds.max()),
    }


def _by_event(table: _Draw, names: list[str]) -> dict[str, Any]:
    """Median reduction of each channel in each event, over the draws that can be simulated there."""
    gains = np.nanmedian(reduction(table["before"][:, None], table["errors"]), axis=0)  # (fits, events, R)
    return {
        method: {event: dict(zip("UP", gains[k, i].tolist(), strict=True)) for i, event in enumerate(names)}
        for k, method in enumerate(CALIBRATED)
    }


def _interval(values: _Array) -> list[float]:
    """Quantiles of the resampled values that are numbers; NaN where none is."""
    known = values[~np.isnan(values)]
    limits = [(1 - _LEVEL) / 2, (1 + _LEVEL) / 2]
    return [float(v) for v in np.quantile(known, limits)] if len(known) else [np.nan, np.nan]
