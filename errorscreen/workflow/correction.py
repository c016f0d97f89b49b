"""Correction of the user's model file: the fewest of its numbers that have to change, and parts that it lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from errorscreen.calibration import FitProblem, MAPCalibrator, fewest_parameters
from errorscreen.calibration.result import Calibration, Estimate
from errorscreen.discovery import Diagnosis
from errorscreen.discovery.search_step import search_simulator
from errorscreen.effects.base import Effect
from errorscreen.events import Playback
from errorscreen.models.dyr_text import difference
from errorscreen.models.set_points import SET_POINTS, size_name
from errorscreen.report.result import Correction, NewRecord
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.base import Simulator
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
    """Fewest changes of the model file that reproduce the fitted recordings, and the difference they make.

    Named effects belong to them where the file can hold them: a flag or another constant, or a part with the equations
    of a standard model, which becomes a record. Beside a part that did not act, the other numbers are told: how the
    unit was operated stands in no model file. Where the verdict is unknown, only values that lower the error by far
    are told, because something else is wrong as well; their intervals count the error that remains as noise. None
    without a model file, and where another effect or the measurement is named: values that make up for it would be
    wrong.
    """
    kind, named = diagnosis.final.kind, _named(study, diagnosis)
    if study.model_file is None or not (named or kind in ("parameters", "unknown")):
        return None
    stated = search_simulator(study.simulator, study.discovery.step, study.searched)
    simulator, reached, moved = stated, diagnosis.calibration.chi2_per_sample, list[Estimate]()
    if named:
        reached = next(h.chi2_per_sample for h in diagnosis.hypotheses if h.name == diagnosis.named.name)
        simulator, moved = _with_effects(study, diagnosis, stated, named)
    fit = fewest_parameters(
        simulator,
        list(study.searched),
        factor=_BY_FAR if kind == "unknown" else 1.0,
        enough=_AS_WELL * max(1.0, reached),
        prior_scale=_FLAT,
        level=study.calibration.level,
    )
    left = _chi2(simulator, study) if fit is None else fit.chi2_per_sample_
    if fit is not None:
        wider = float(np.sqrt(max(1.0, left)))
        further = [
            replace(
                one,
                low=max(one.lower, one.value - wider * (one.value - one.low)),
                high=min(one.upper, one.value + wider * (one.high - one.value)),
            )
            for one in Calibration.of(fit, "map").parameters
            if one.name in fit.names_
        ]
        moved = [*(one for one in moved if one.name not in fit.names_), *further]
    operated = {effect.local(p.name) for effect in named if effect.usual for p in effect.parameters}
    moved = [one for one in moved if one.name not in operated]
    values, records = _in_file(study, named, {one.name: one.value for one in moved})
    if not (values or records):
        return None
    file, bus, identifier = study.model_file
    new = file.extended(bus, identifier, [(one.model, one.values) for one in records])
    text = new.changed(bus, identifier, values) if values else new.text
    return Correction(
        CORRECTED,
        str(file.path),
        tuple(moved),
        _chi2(stated, study),
        left,
        difference(file.text, text, (str(file.path), f"{file.path} (changed)")),
        values,
        records,
    )


def _named(study: Study, diagnosis: Diagnosis) -> list[Effect]:
    """Named effects, if the file can hold them all."""
    known = {effect.name: effect for effect in study.simulator.effects}
    named = [known.get(effect.name) for effect in diagnosis.extension]
    found = [
        effect for effect in named if effect and (effect.kind == "constants" or effect.record or effect.usual)
    ]
    return found if len(found) == len(named) else []


def _with_effects(
    study: Study, diagnosis: Diagnosis, stated: Simulator, named: Sequence[Effect]
) -> tuple[Simulator, list[Estimate]]:
    """Model of the file with named effects, fitted alone, and their values; the other numbers are those of the file."""
    fitted = {one.name: one.value for one in diagnosis.parameters}
    simulator, names = stated, []
    for effect in named:
        given = {p.name: fitted[effect.local(p.name)] for p in effect.fitted}
        simulator = simulator.extend(effect, **{name: {"nominal": value} for name, value in given.items()})
        names += [] if effect.usual else [effect.local(name) for name in given]
    switches = [_set(effect) for effect in named if effect.switch]
    if not names:
        return simulator, switches
    fit = MAPCalibrator(
        simulator, names, prior_scale=_FLAT, n_starts=1, library_size=1, level=study.calibration.level
    ).fit(list(study.searched))
    estimates = [one for one in Calibration.of(fit, "map").parameters if one.name in names]
    return simulator.with_nominal(fit.theta_), [*switches, *estimates]


def _set(flag: Effect) -> Estimate:
    """The new value of a flag, which has no interval."""
    new = float(flag.equations(1.0)[0])
    return Estimate(flag.name, new, nominal=1.0 - new, lower=0.0, upper=1.0, symbol=flag.port)


def _in_file(
    study: Study, named: Sequence[Effect], moved: Mapping[str, float]
) -> tuple[dict[str, float], tuple[NewRecord, ...]]:
    """Constants of the file with new values, and new records; the size of a step of a set-point is none of them."""
    no_constants = {size_name(quantity) for quantity in SET_POINTS}
    no_constants |= {effect.local(p.name) for effect in named for p in effect.parameters}
    values = {name: value for name, value in moved.items() if name not in no_constants}
    records, plant, event = [], study.simulator, study.observation.event
    assert isinstance(plant, PlantSimulator)  # a model file is that of a plant
    assert isinstance(event, Playback)
    power = float(event.initial["P"])
    for effect in named:
        if effect.usual:  # how the unit was operated
            continue
        own = {p.name: moved[effect.local(p.name)] for p in effect.fitted}
        if effect.record is not None:
            records.append(NewRecord(*effect.record({**own, "P": power})))
        elif not effect.switch:
            found = effect.equations(*(own[p.name] for p in effect.parameters))
            constants = [*plant.device.candidates.names, *plant.constants]
            for port, new in zip((effect.port, *effect.beside), found, strict=True):
                values[next(name for name in constants if name.rpartition(".")[2] == port)] = float(new)
    return values, tuple(records)


def _chi2(simulator: Simulator, study: Study) -> float:
    """χ²/N of the nominal values on the fitted recordings."""
    problem = FitProblem(simulator, list(study.searched))
    return float(problem.chi_square(problem.space.nominal)[0] / problem.n_values)


def write_corrected(study: Study, correction: Correction, folder: Path) -> Path:
    """Write the user's file with the corrected numbers and new records; all else stays as it is."""
    assert study.model_file is not None
    file, bus, identifier = study.model_file
    new = file.extended(bus, identifier, [(one.model, one.values) for one in correction.records])
    return new.write(folder / correction.path, bus, identifier, correction.values)
