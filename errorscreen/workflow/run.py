"""The stages of a study: diagnose, screen, calibrate; and the result that follows."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.log_lines import at_each_line
from errorscreen._runtime.processes import Subprocess, subprocess_importing
from errorscreen._runtime.store import Store
from errorscreen._runtime.typed import from_json, to_json
from errorscreen.calibration import CALIBRATORS, MAPCalibrator
from errorscreen.calibration.result import Calibration
from errorscreen.data.observations import Observation
from errorscreen.discovery import Contribution, Diagnosis, FirstLook, diagnose
from errorscreen.discovery.diagnosis import NOMINAL, simulated
from errorscreen.discovery.fits.hypotheses import PRIOR
from errorscreen.discovery.search_step import search_simulator
from errorscreen.events import Playback
from errorscreen.exceptions import InputError, SimulationError
from errorscreen.learning.regressors import import_network, require_network
from errorscreen.report.result import Correction, Screening
from errorscreen.screening import SCREENERS
from errorscreen.simulators.base import REMEDIES, Simulator, Status
from errorscreen.workflow.correction import correction_of
from errorscreen.workflow.outcome import Outcome, result_of, run_info, validated
from errorscreen.workflow.screen import screen
from errorscreen.workflow.study import Study

#: libraries whose versions decide the result
_PACKAGES = ("numpy", "scipy", "scikit-learn", "numba", "PyWavelets", "torch")
_Responses = tuple[NDArray[np.float64], ...]
_T = TypeVar("_T")
_log = logging.getLogger(__name__)


def run_study(
    study: Study, out: str | Path, *, progress: bool = False, process: Subprocess | None = None
) -> Outcome:
    """Diagnose, screen and calibrate; finished stages are kept in ``out/stages`` and used again.

    Where a network is to be trained, screening and the swarm run in a process of their own, without bars, while this
    one searches the cause.

    Parameters
    ----------
    study : Study
    out : str or Path
        Folder; made where it is missing.
    progress : bool
        Show progress bars.
    process : Subprocess, optional
        The process for the network, where one has begun already; it saves the time of its imports.

    Raises
    ------
    InputError
        If the model cannot be simulated at its nominal parameters and the recorded pre-event values, or the folder
        cannot be used.
    MissingExtraError
        If the network is asked for and torch is not installed.
    """
    start, started = perf_counter(), datetime.now(UTC).isoformat(timespec="seconds")
    store = Store(Path(out) / "stages")
    nominal = tuple(nominal_response(study.simulator, o) for o in study.observations)
    with _selecting(study, store, progress, process) as (check, select):
        with at_each_line(lambda _: check()):  # a long search ends as soon as its result is in vain
            looked = _first_look(study, store)
            diagnosis = _diagnosed(study, store)
        selected = select()
    corrected = _corrected(study, store, diagnosis)
    order: list[str] = list(study.calibration.methods)
    all_of_them = [_calibrated_all(study, store, diagnosis)] if "map" in order else []
    calibrations = [*selected.calibrated, *all_of_them]
    calibrations.sort(key=lambda c: order.index(c.method))
    responses = {NOMINAL: nominal, **{c.label: _simulated(study, c) for c in calibrations}}
    fits = [one for one in calibrations if one is not diagnosis.calibration]
    counts = [(one.n_simulations, one.n_failed) for one in selected.screened]
    counts += [(one.n_simulations, one.n_failed) for one in fits]
    counts += [(looked.n_simulations, looked.n_failed), (0, diagnosis.calibration.n_failed)]
    run = run_info(
        study,
        n_simulations=diagnosis.n_simulations + sum(used for used, _ in counts),
        n_failed=sum(failed for _, failed in counts),
        seconds=perf_counter() - start,
        started=started,
        reused=tuple(dict.fromkeys((*selected.reused, *store.reused))),
    )
    result = result_of(
        study, diagnosis, selected.screened, calibrations, responses, looked.contributions, run
    )
    result = replace(result, correction=corrected, validation=validated(study, diagnosis, responses))
    return Outcome(study, result, responses)


class _Selected(NamedTuple):
    """Results of screening and of the calibration of selections, and which stages were taken over."""

    screened: list[Screening]
    calibrated: list[Calibration]
    reused: list[str]


@contextmanager
def _selecting(
    study: Study, store: Store, progress: bool, process: Subprocess | None
) -> Iterator[tuple[Callable[[], None], Callable[[], _Selected]]]:
    """Screen and calibrate selections, in a process of its own where a network is to be trained, beside the search.
    Yields a function that raises errors of that process, and one that waits for the result.
    """

    def here() -> _Selected:
        return _selected(study, Store(store.folder), progress)

    stages, methods = store.under(study.fingerprint("screening")), study.screening.methods
    if not any(SCREENERS[name].trains and not stages.has(f"screening-{name}") for name in methods):
        found = here()
        yield lambda: None, lambda: found
        return
    require_network()
    _log.info("screening by %s and calibration, beside the search", ", ".join(study.screening.methods))
    with nullcontext(process) if process else subprocess_importing() as own:
        call = own.call(_selected, study, Store(store.folder), False)

        def wait() -> _Selected:
            if not call.done:
                _log.info("waiting for screening and calibration")
            try:
                return call.result()
            except BrokenExecutor:
                return here()

        yield call.check, wait


def _selected(study: Study, store: Store, progress: bool) -> _Selected:
    """The published method: rank the parameters, and calibrate each selection."""
    screened = [_screened(method, study, store, progress) for method in study.screening.methods]
    calibrated = []
    for method in study.calibration.methods:
        if method == "map":
            continue  # the diagnosis holds this fit
        selections: list[tuple[str, tuple[str, ...] | None]] = [("all", None)]
        if CALIBRATORS[method].selects:
            selections = [(one.method, one.selected) for one in screened]
        for selection, names in selections:
            of = "all parameters" if names is None else f"the selection of {selection}: {', '.join(names)}"
            _log.info("calibration: %s on %s", method, of)
            fit = partial(_calibrated, method, selection, names, study, progress)
            stages = store.under(study.fingerprint("calibration", names))
            calibrated.append(_kept(stages, f"calibration-{method}-{selection}", Calibration, fit))
    return _Selected(screened, calibrated, store.reused)


def _calibrated(
    method: str, selection: str, names: Sequence[str] | None, study: Study, progress: bool
) -> Calibration:
    """Fit selected parameters, or all, by a method of `CALIBRATORS`."""
    start, kind = perf_counter(), CALIBRATORS[method]
    fit = kind.from_case(study.simulator, names, study.calibration, study.run, progress)
    return Calibration.of(fit.fit(study.observation), method, selection, perf_counter() - start)


def _led_on(study: Study, base: Calibration) -> Calibration:
    """Fit of all parameters with step and prior of the case file, from where that of the diagnosis ended."""
    start, section = perf_counter(), study.calibration
    calibrator = MAPCalibrator(
        study.simulator,
        prior_scale=section.prior_scale,
        n_starts=1,
        starts=base.theta(study.simulator.parameters),
        level=section.level,
        random_state=study.run.random_state,
    ).fit(list(study.searched))
    return Calibration.of(calibrator, "map", seconds=perf_counter() - start)


def _screened(method: str, study: Study, store: Store, progress: bool) -> Screening:
    """Rank the parameters by one method, or take over an earlier ranking."""
    _log.info("screening: %s", method)
    stages = store.under(study.fingerprint("screening"))
    rank = partial(screen, method, study, stages.folder, progress)
    return _kept(stages, f"screening-{method}", Screening, rank)


@dataclass(frozen=True)
class _Looked:
    """First look of a network, and its simulations."""

    contributions: tuple[Contribution, ...] = ()
    n_simulations: int = 0
    n_failed: int = 0


def _first_look(study: Study, store: Store) -> _Looked:
    """Contributions that a network reads off the error, the largest first."""
    section = study.discovery
    if not (section.first_look and section.enabled):
        return _Looked()
    import_network()  # a missing extra must be told before the simulations
    _log.info("first look: network trained on %d samples", section.first_look)

    def look() -> _Looked:
        found = FirstLook(
            search_simulator(study.simulator, section.step, study.observations),
            section.effects,
            n_samples=section.first_look,
            random_state=study.run.random_state,
            n_jobs=study.run.n_jobs,
        ).fit(study.observation)
        data = found.dataset_
        return _Looked(found.ranked_, data.metadata["n_simulations"], section.first_look - len(data))

    found = _kept(
        store.under(study.fingerprint("diagnosis", section.first_look)), "first-look", _Looked, look
    )
    _log.info("  %s", ", ".join(one.name for one in found.contributions[:3]))
    return found


def _calibrated_all(study: Study, store: Store, diagnosis: Diagnosis) -> Calibration:
    """Fit of all parameters with step and prior of the case file: that of the diagnosis, or led on from there."""
    section, step = study.calibration, getattr(study.simulator, "step", np.nan)
    if section.prior_scale == PRIOR and not diagnosis.base_step > step:
        return diagnosis.calibration
    _log.info("calibration: map on all parameters")
    fit = partial(_led_on, study, diagnosis.calibration)
    key = study.fingerprint("diagnosis", study.together, section.prior_scale)
    return _kept(store.under(key), "calibration-map", Calibration, fit)


def _corrected(study: Study, store: Store, diagnosis: Diagnosis) -> Correction | None:
    """Correction of the user's model file, or take over an earlier one."""
    if study.model_file is None:
        return None
    _log.info("correction of %s: fewest numbers that have to change", study.model_file.file.path.name)
    stages = store.under(
        study.fingerprint("diagnosis", study.together, study.held_out, study.model_file.file.text)
    )

    def compute() -> list[Correction]:
        found = correction_of(study, diagnosis)
        return [] if found is None else [found]

    _, values = stages.get("correction", lambda: ({}, json.loads(to_json(compute()))))
    return next(iter(from_json(list[Correction], json.dumps(values))), None)


def _diagnosed(study: Study, store: Store) -> Diagnosis:
    """Find the cause, or take over an earlier diagnosis; the search itself goes on where it stopped."""
    _log.info("diagnosis: fit of all parameters, and what they cannot explain")
    section, base = study.discovery, study.calibration
    # other held-out recordings leave the search valid
    search = store.under(study.fingerprint("diagnosis", study.together)).folder / "search"

    def compute() -> tuple[dict[str, Any], dict[str, Any]]:
        found = diagnose(
            study.simulator,
            list(study.searched),
            study.held_out,
            step=section.step,
            effects=section.effects,
            max_effects=section.max_effects if section.enabled else 0,
            n_fits=section.fits,
            n_draws=section.draws,
            significance=section.significance,
            n_starts=base.starts,
            library_size=base.library,
            level=base.level,
            random_state=study.run.random_state,
            checkpoint=search,
        )
        arrays = {f"{label}-{n}": y for label, every in found.responses.items() for n, y in enumerate(every)}
        return arrays, json.loads(to_json(found))

    stages = store.under(study.fingerprint("diagnosis", study.together, study.held_out))
    arrays, values = stages.get("diagnosis", compute)
    found = from_json(Diagnosis, json.dumps(values))
    responses = {
        model.label: tuple(arrays[f"{model.label}-{n}"] for n in range(len(study.observations)))
        for model in found.models
    }
    return replace(found, observations=study.observations, responses=responses)


def _kept(store: Store, name: str, kind: type[_T], compute: Callable[[], _T]) -> _T:
    """A result object from the store, computed if it is not there."""
    _, values = store.get(name, lambda: ({}, json.loads(to_json(compute()))))
    return from_json(kind, json.dumps(values))


def nominal_response(simulator: Simulator, observation: Observation) -> NDArray[np.float64]:
    """Response at the nominal parameters; if there is none, the recorded operating point is the first suspect."""
    event = observation.event
    responses = simulator.simulate(simulator.parameters.nominal, event)
    if responses.ok.all() or not isinstance(event, Playback):
        return responses.require_ok("the simulation at the nominal parameters").values[0]
    point = ", ".join(f"{name} = {value:.4g}" for name, value in event.initial.items())
    raise InputError(
        f"the nominal model cannot be simulated from the values recorded before the event, {point} pu: "
        f"{responses.detail or REMEDIES[Status(responses.status[0])]}",
        where=f"recording {event.name!r}",
        allowed="V near 1 pu, P and Q within the limits of the device on its own base",
        remedy="Correct units, bases and signs of the columns, or the parameters and constants of the device",
    )


def _simulated(study: Study, calibration: Calibration) -> _Responses:
    """Responses of a calibrated model to every recording."""
    responses = simulated(
        study.simulator.with_nominal(calibration.theta(study.simulator.parameters)), study.observations
    )
    if np.isnan(responses[0]).any():
        raise SimulationError(f"the model calibrated by {calibration.label} cannot be simulated")
    return responses
