"""Calibration stage: fit a selection of parameters."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter

from errorscreen.calibration import CALIBRATORS, MAPCalibrator
from errorscreen.calibration.result import Calibration
from errorscreen.cases.case_models import CalibrationSection, RunSection
from errorscreen.data.observations import Observation
from errorscreen.simulators.base import Simulator


def calibrate_map(
    simulator: Simulator,
    observations: Sequence[Observation],
    base: Calibration,
    section: CalibrationSection,
    run: RunSection,
) -> Calibration:
    """Fit of all parameters that begins where that of the diagnosis ended, with step and prior of the case file."""
    start = perf_counter()
    calibrator = MAPCalibrator(
        simulator,
        prior_scale=section.prior_scale,
        n_starts=1,
        starts=base.theta(simulator.parameters),
        level=section.level,
        random_state=run.random_state,
    ).fit(list(observations))
    return Calibration.of(calibrator, "map", seconds=perf_counter() - start)


def calibrate(
    method: str,
    simulator: Simulator,
    observation: Observation,
    names: Sequence[str] | None,
    selection: str,
    section: CalibrationSection,
    run: RunSection,
    progress: bool,
) -> Calibration:
    """Selected parameters, or all, by a method of `CALIBRATORS`."""
    start = perf_counter()
    calibrator = CALIBRATORS[method].from_case(simulator, names, section, run, progress).fit(observation)
    return Calibration.of(calibrator, method, selection, perf_counter() - start)
