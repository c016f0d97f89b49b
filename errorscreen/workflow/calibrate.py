"""Calibration stage: fit a selection of parameters, and measure every recording before and after."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

from errorscreen.calibration import CALIBRATORS, MAPCalibrator
from errorscreen.cases.case_models import CalibrationSection, RunSection
from errorscreen.data.observations import Observation
from errorscreen.discovery import judge
from errorscreen.simulators.base import Simulator


def calibrate_map(
    simulator: Simulator,
    observation: Observation,
    held_out: Sequence[Observation],
    section: CalibrationSection,
    run: RunSection,
    progress: bool,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """All parameters by bounded least squares with a prior, and the verdict that follows from it."""
    start = perf_counter()
    calibrator = MAPCalibrator.from_case(simulator, None, section, run, progress).fit(observation)
    verdict = judge([observation], [simulator.baseline(observation.event)], calibrator, held_out)
    arrays = {
        "theta": calibrator.theta_,
        "intervals": calibrator.intervals_,
        "at_bound": calibrator.at_bound_,
        "identifiable": calibrator.identifiable_,
    }
    meta = {
        "names": list(calibrator.names_),
        "groups": [list(group) for group in calibrator.groups_],
        "converged": bool(calibrator.converged_),
        "chi2_per_sample": calibrator.chi2_per_sample_,
        "inflation": calibrator.inflation_,
        "n_simulations": calibrator.n_simulations_,
        "n_failed": calibrator.n_failed_,
        "verdict": {"kind": verdict.kind, "text": verdict.text},
        "seconds": perf_counter() - start,
    }
    return arrays, meta


def calibrate(
    method: str,
    simulator: Simulator,
    observation: Observation,
    names: Sequence[str] | None,
    section: CalibrationSection,
    run: RunSection,
    progress: bool,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Selected parameters, or all, by a method of `CALIBRATORS`."""
    start = perf_counter()
    calibrator = CALIBRATORS[method].from_case(simulator, names, section, run, progress).fit(observation)
    meta = {
        "names": list(calibrator.names_),
        "n_simulations": calibrator.n_simulations_,
        "n_failed": calibrator.n_failed_,
        "seconds": perf_counter() - start,
    }
    return {"theta": calibrator.theta_}, meta
