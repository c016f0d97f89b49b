"""Correction of the user's model file: the fewest of its numbers that have to change."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from errorscreen.calibration import FitProblem, fewest_parameters
from errorscreen.calibration.result import Calibration, Estimate
from errorscreen.discovery import Diagnosis
from errorscreen.discovery.search_step import search_simulator
from errorscreen.models.set_points import SET_POINTS, size_name
from errorscreen.report.result import Correction
from errorscreen.workflow.study import Study

#: name of the corrected file in the folder of results
CORRECTED = "calibrated.dyr"
#: prior that draws no value back to the file's: nothing is known of the size of an error in it
_FLAT = 100.0
#: factor on χ² of a value that is wrong beside something unknown; parameters that make up for a wrong form of a model
#: lower it by 1.2 to 1.7 each
_BY_FAR = 2.0
#: χ² over that of all parameters together at which a few are as good
_AS_WELL = 1.1


def correction_of(study: Study, diagnosis: Diagnosis) -> Correction | None:
    """Fewest constants of the model file that reproduce the fitted recordings, and the difference they make.

    Where the verdict is unknown, only values that lower the error by far are told, because something else is wrong as
    well; their intervals count the error that remains as noise. None without a model file, and where an effect or the
    measurement is named: values that make up for it would be wrong.
    """
    kind = diagnosis.final.kind
    if study.model_file is None or kind not in ("parameters", "unknown"):
        return None
    simulator = search_simulator(study.simulator, study.discovery.step, study.searched)
    fit = fewest_parameters(
        simulator,
        list(study.searched),
        factor=_BY_FAR if kind == "unknown" else 1.0,
        enough=_AS_WELL * max(1.0, diagnosis.calibration.chi2_per_sample),
        prior_scale=_FLAT,
        level=study.calibration.level,
    )
    if fit is None:
        return None
    wider = float(np.sqrt(max(1.0, fit.chi2_per_sample_)))
    moved = tuple(
        replace(
            one,
            low=max(one.lower, one.value - wider * (one.value - one.low)),
            high=min(one.upper, one.value + wider * (one.high - one.value)),
        )
        for one in Calibration.of(fit, "map").parameters
        if one.name in fit.names_
    )
    if not _values(moved):
        return None
    file, bus, identifier = study.model_file
    problem = FitProblem(simulator, list(study.searched))
    return Correction(
        CORRECTED,
        str(file.path),
        moved,
        float(problem.chi_square(problem.space.nominal)[0] / problem.n_values),
        fit.chi2_per_sample_,
        file.diff(bus, identifier, _values(moved)),
    )


def write_corrected(study: Study, correction: Correction, folder: Path) -> Path:
    """Write the user's file with the corrected numbers; all else stays as it is."""
    assert study.model_file is not None
    file, bus, identifier = study.model_file
    return file.write(folder / correction.path, bus, identifier, _values(correction.parameters))


def _values(parameters: tuple[Estimate, ...]) -> dict[str, float]:
    """New constants of the file; the size of a step of a set-point is none of them."""
    sizes = {size_name(quantity) for quantity in SET_POINTS}
    return {one.name: one.value for one in parameters if one.name not in sizes}
