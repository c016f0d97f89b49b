"""Screening stage: which parameters carry the error, by each method asked for."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from errorscreen.calibration.problem import FitProblem
from errorscreen.cases.case_models import RunSection, ScreeningSection
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.rough_step import rough_step
from errorscreen.features import ResponseErrorTransformer
from errorscreen.learning.generation import generate_dataset
from errorscreen.learning.regressors import import_network
from errorscreen.metrics import ranking
from errorscreen.report.result import Screening
from errorscreen.screening import (
    ContributionScreener,
    RandomScreener,
    RelativeThresholdSelector,
    SensitivityScreener,
    TopKSelector,
    contribution_pipeline,
)
from errorscreen.simulators.base import Simulator

#: of the training
_THREADS = 1


def selector(section: ScreeningSection) -> TopKSelector | RelativeThresholdSelector:
    """Rule that turns contributions into a selection."""
    if section.threshold is not None or section.top_k is None:
        return RelativeThresholdSelector(0.1 if section.threshold is None else section.threshold)
    return TopKSelector(section.top_k)


def screen(
    method: str,
    simulator: Simulator,
    observation: Observation,
    section: ScreeningSection,
    run: RunSection,
    folder: Path,
    progress: bool,
) -> Screening:
    """Rank the parameters by one screener, and select."""
    start = perf_counter()
    n_failed = 0
    space = simulator.parameters
    if method == "cnn":
        contributions, n_simulations, n_failed = _network(
            simulator, observation, section, run, folder, progress
        )
    elif method == "sensitivity":
        contributions = SensitivityScreener(simulator).fit(observation).contributions_
        n_simulations = len(space) + 1
    else:
        contributions = (
            RandomScreener(simulator, random_state=run.random_state).fit(observation).contributions_
        )
        n_simulations = 0
    rule = selector(section)
    selected = set(rule.select(contributions).tolist())
    words = (
        f"the {rule.k} largest" if hasattr(rule, "k") else f"those above {rule.threshold:g} of the largest"
    )
    return Screening(
        method,
        dict(zip(space.names, contributions.tolist(), strict=True)),
        tuple(space.names[j] for j in ranking(contributions) if j in selected),
        words,
        n_simulations=n_simulations,
        n_failed=n_failed,
        seconds=perf_counter() - start,
        threads=_THREADS if method == "cnn" else None,
    )


def error_pipeline(
    observation: Observation, section: ScreeningSection, random_state: int, verbose: bool
) -> Any:
    """Images, scaling and network for errors on the time grid of an observation."""
    pipeline = contribution_pipeline(observation.event.dt, random_state)
    return pipeline.set_params(
        cwttransformer__n_frequencies=section.frequencies,
        cwttransformer__n_columns=section.columns,
        cnncontributionregressor__max_epochs=section.epochs,
        cnncontributionregressor__verbose=verbose,
    )


def _network(
    simulator: Simulator,
    observation: Observation,
    section: ScreeningSection,
    run: RunSection,
    folder: Path,
    progress: bool,
) -> tuple[NDArray[np.float64], int, int]:
    """Simulate labelled errors, train, and read the measured error: the paper's method."""
    import_network()  # what is missing must be told before the simulations, not after them
    error, training, contributions, n_simulations, n_failed = _training_set(
        simulator, observation, section, run, folder, progress
    )
    screener = ContributionScreener(
        error_pipeline(observation, section, run.random_state, progress),
        simulator.parameters.names,
        noise=np.where(observation.mask, observation.noise[:, None], 0.0),
        random_state=run.random_state,
    )
    # on another number of threads sums are rounded differently, and training amplifies that
    with threadpool_limits(limits=_THREADS):
        screener.fit(training, contributions)
        predicted = screener.predict(error.transform(observation.values[None]))[0]
    return predicted, n_simulations, n_failed


def _training_set(
    simulator: Simulator,
    observation: Observation,
    section: ScreeningSection,
    run: RunSection,
    folder: Path,
    progress: bool,
) -> tuple[ResponseErrorTransformer, NDArray[np.float64], NDArray[np.float64], int, int]:
    """Errors with labels; the responses themselves are let go of, because those of a fast recorder are large.

    Parameters are only ranked by them, so a longer step that adds less than half the noise is good enough.
    """
    problem = FitProblem(simulator, observation)
    step = rough_step(problem, np.zeros(len(problem.names)), run.random_state)
    dataset = generate_dataset(
        problem.with_step(step).simulator,
        section.samples,
        observation.event,
        random_state=run.random_state,
        n_jobs=run.n_jobs,
        progress=progress,
        checkpoint=folder / "dataset",
    )
    usable = dataset.valid()
    error = ResponseErrorTransformer(dataset.baseline, missing="zero").fit(usable.responses)
    training = error.transform(usable.responses)
    training[:, ~observation.mask] = 0.0  # what was not measured must not be learned from
    n_simulations = section.samples * (len(problem.names) + 1) + problem.n_simulations
    return error, training, usable.contributions, n_simulations, dataset.n_failed
