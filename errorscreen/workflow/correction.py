"""Correction of the user's model file: the fewest of its numbers that have to change."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from errorscreen.calibration import FitProblem, fewest_parameters
from errorscreen.calibration.result import Calibration, Estimate
from errorscreen.discovery import Diagnosis
from errorscreen.discovery.search_step import search_simulator
from errorscreen.effects.base import Effect
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

    Flags that are named belong to them. Where the verdict is unknown, only values that lower the error by far are told,
    because something else is wrong as well; their intervals count the error that remains as noise. None without a model
    file, and where another effect or the measurement is named: values that make up for it would be wrong.
    """
    kind, flags = diagnosis.final.kind, _flags(study, diagnosis)
    if study.model_file is None or not (flags or kind in ("parameters", "unknown")):
        return None
    stated = search_simulator(study.simulator, study.discovery.step, study.searched)
    simulator, reached = stated, diagnosis.calibration.chi2_per_sample
    if flags:
        reached = next(h.chi2_per_sample for h in diagnosis.hypotheses if h.name == diagnosis.causes[0].name)
    for flag in flags:
        simulator = simulator.extend(flag)
    fit = fewest_parameters(
        simulator,
        list(study.searched),
        factor=_BY_FAR if kind == "unknown" else 1.0,
        enough=_AS_WELL * max(1.0, reached),
        prior_scale=_FLAT,
        level=study.calibration.level,
    )
    problem = FitProblem(simulator, list(study.searched))
    left = _chi2(problem) if fit is None else fit.chi2_per_sample_
    moved = tuple(map(_set, flags))
    if fit is not None:
        wider = float(np.sqrt(max(1.0, left)))
        moved += tuple(
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
    return Correction(
        CORRECTED,
        str(file.path),
        moved,
        _chi2(FitProblem(stated, list(study.searched))),
        left,
        file.diff(bus, identifier, _values(moved)),
    )


def _flags(study: Study, diagnosis: Diagnosis) -> list[Effect]:
    """Flags of the file that are named, if nothing else is."""
    switches = {effect.name: effect for effect in study.simulator.effects if effect.switch}
    named = [switches.get(effect.name) for effect in diagnosis.extension]
    return [] if None in named else [effect for effect in named if effect is not None]


def _set(flag: Effect) -> Estimate:
    """The new value of a flag, which has no interval."""
    new = float(flag.equations(1.0)[0])
    return Estimate(flag.name, new, nominal=1.0 - new, lower=0.0, upper=1.0, symbol=flag.port)


def _chi2(problem: FitProblem) -> float:
    """χ²/N of the nominal values."""
    return float(problem.chi_square(problem.space.nominal)[0] / problem.n_values)


def write_corrected(study: Study, correction: Correction, folder: Path) -> Path:
    """Write the user's file with the corrected numbers; all else stays as it is."""
    assert study.model_file is not None
    file, bus, identifier = study.model_file
    return file.write(folder / correction.path, bus, identifier, _values(correction.parameters))


def _values(parameters: tuple[Estimate, ...]) -> dict[str, float]:
    """New constants of the file; the size of a step of a set-point is none of them."""
    sizes = {size_name(quantity) for quantity in SET_POINTS}
    return {one.name: one.value for one in parameters if one.name not in sizes}
