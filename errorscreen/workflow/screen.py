"""Screening stage: rank the parameters by each method of the case file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from errorscreen.calibration.problem import FitProblem
from errorscreen.cases.case_models import ScreeningSection
from errorscreen.discovery.fits.rough_step import rough_step
from errorscreen.report.result import Screening
from errorscreen.screening import SCREENERS, RelativeThresholdSelector, TopKSelector
from errorscreen.screening.network import THREADS
from errorscreen.workflow.study import Study


def selector(section: ScreeningSection) -> TopKSelector | RelativeThresholdSelector:
    """Rule that selects parameters by their contributions."""
    if section.threshold is not None or section.top_k is None:
        return RelativeThresholdSelector(0.1 if section.threshold is None else section.threshold)
    return TopKSelector(section.top_k)


def screen(method: str, study: Study, folder: Path, progress: bool) -> Screening:
    """Rank the parameters by one screener, and select."""
    start, simulator, section, run = perf_counter(), study.simulator, study.screening, study.run
    kind, searched = SCREENERS[method], 0
    if kind.trains:
        # errors far below the noise do not change a ranking, so the training errors take a longer step; the noise of
        # single samples judges that, because slow errors of a long recording need much memory
        problem = FitProblem(simulator, replace(study.observation, modes=None))
        step = rough_step(problem, np.zeros(len(problem.names)), run.random_state)
        simulator, searched = problem.with_step(step).simulator, problem.n_simulations
    screener = kind.from_case(simulator, section, run, folder, progress).fit(study.observation)
    rule = selector(section)
    words = (
        f"the {rule.k} largest" if hasattr(rule, "k") else f"those above {rule.threshold:g} of the largest"
    )
    return Screening(
        method,
        dict(zip(screener.names_, screener.contributions_.tolist(), strict=True)),
        screener.select(rule),
        words,
        n_simulations=screener.n_simulations_ + searched,
        n_failed=screener.n_failed_,
        seconds=perf_counter() - start,
        threads=THREADS if kind.trains else None,
    )
