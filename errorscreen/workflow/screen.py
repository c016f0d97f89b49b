"""Screening stage: rank the parameters by each method of the case file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.calibration.problem import FitProblem
from errorscreen.cases.case_models import RunSection, ScreeningSection
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.rough_step import rough_step
from errorscreen.screening import SCREENERS, RelativeThresholdSelector, TopKSelector
from errorscreen.screening.network import THREADS
from errorscreen.simulators.base import Simulator


@dataclass(frozen=True)
class Screened:
    """Result of one screener.

    Parameters
    ----------
    method : str
        Name in `SCREENERS`.
    contributions : ndarray of shape (m,)
    names : tuple of str
        Selected parameters, the most suspicious first.
    seconds : float
    n_simulations, n_failed : int
    threads : int or None
        Of the training; None without one.
    """

    method: str
    contributions: NDArray[np.float64]
    names: tuple[str, ...]
    seconds: float
    n_simulations: int
    n_failed: int
    threads: int | None


def selector(section: ScreeningSection) -> TopKSelector | RelativeThresholdSelector:
    """Rule that selects parameters by their contributions."""
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
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Compute one screener, as arrays and JSON values for the store."""
    start = perf_counter()
    kind, searched = SCREENERS[method], 0
    if kind.trains:
        # errors far below the noise do not change a ranking, so the training errors take a longer step
        problem = FitProblem(simulator, observation)
        step = rough_step(problem, np.zeros(len(problem.names)), run.random_state)
        simulator, searched = problem.with_step(step).simulator, problem.n_simulations
    screener = kind.from_case(simulator, section, run, folder, progress).fit(observation)
    meta = {
        "names": list(screener.select(selector(section))),
        "seconds": perf_counter() - start,
        "n_simulations": screener.n_simulations_ + searched,
        "n_failed": screener.n_failed_,
        "threads": THREADS if kind.trains else None,
    }
    return {"contributions": screener.contributions_}, meta
