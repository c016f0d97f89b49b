"""The stages of the main job: screen, calibrate, find causes, judge."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.processes import in_subprocess
from errorscreen.calibration import CALIBRATORS
from errorscreen.data.observations import Observation
from errorscreen.discovery import Verdict, channel_fits, stage_errors
from errorscreen.events import Playback
from errorscreen.exceptions import InputError, SimulationError
from errorscreen.learning.regressors import require_network
from errorscreen.screening import SCREENERS
from errorscreen.simulators.base import REMEDIES, Simulator, Status
from errorscreen.workflow.calibrate import calibrate, calibrate_map
from errorscreen.workflow.discover import discover_causes
from errorscreen.workflow.screen import Screened, screen
from errorscreen.workflow.search_step import search_simulator
from errorscreen.workflow.stages import StageStore
from errorscreen.workflow.study import Calibrated, Discovered, Outcome, Study


def run_study(
    study: Study,
    out: str | Path,
    *,
    progress: bool = False,
    report: Callable[[str], None] = lambda line: None,
) -> Outcome:
    """Screen, calibrate and judge; finished stages are kept in ``out/stages`` and used again.

    Where a network is to be trained and causes are searched, screening and calibration run beside the search, in a
    process of their own and without bars.

    Parameters
    ----------
    study : Study
    out : str or Path
        Folder; made where it is missing.
    progress : bool
        Show progress bars.
    report : callable
        Takes lines of text while it runs.

    Returns
    -------
    Outcome

    Raises
    ------
    InputError
        If the model cannot be simulated at its nominal parameters and the recorded pre-event values, or the folder
        cannot be used.
    MissingExtraError
        If the network is asked for and torch is not installed.
    """
    start, started = perf_counter(), datetime.now(UTC).isoformat(timespec="seconds")
    store = StageStore(Path(out) / "stages", report)
    before = tuple(_nominal(study.simulator, o) for o in study.observations)
    with _fitting(study, store, progress, report) as (check, fit):
        discovered = None
        if study.discovery.enabled:

            def tell(line: str) -> None:
                check()  # the rest of a long search would be for nothing
                report(line)

            report("discovery: what parameters cannot explain")
            discovered = _discovered(study, store, tell)
        fitted = fit()
    verdict = fitted.verdict if discovered is None else Verdict(**discovered.meta["verdict"])
    return Outcome(
        study,
        before,
        _each(channel_fits, study, before),
        _each(stage_errors, study, before),
        fitted.screened,
        fitted.calibrated,
        discovered,
        verdict,
        perf_counter() - start,
        started,
        [*fitted.reused, *store.reused],
    )


class _Fitted(NamedTuple):
    """What screening and calibration found, and which stages of it were there from an earlier run."""

    screened: list[Screened]
    calibrated: list[Calibrated]
    verdict: Verdict
    reused: list[str]


@contextmanager
def _fitting(
    study: Study, store: StageStore, progress: bool, report: Callable[[str], None]
) -> Iterator[tuple[Callable[[], None], Callable[[], _Fitted]]]:
    """Screen and calibrate, beside the search for causes where a network is to be trained and causes are searched.

    The search takes longer, needs nothing of it, and leaves cores idle while it is in the interpreter. Yields what
    raises errors that have come up by then, and what waits for the result.
    """

    def here() -> _Fitted:
        return _fitted(study, StageStore(store.root, report), progress, report)

    key, methods = study.fingerprint("screening"), study.screening.methods
    training = any(SCREENERS[name].trains and not store.has(f"screening-{name}", key) for name in methods)
    if not training or not study.discovery.enabled:
        fitted = here()
        yield lambda: None, lambda: fitted
        return
    require_network()
    report(f"screening by {', '.join(study.screening.methods)} and calibration, beside what follows")
    with in_subprocess(_fitted, study, StageStore(store.root), False, lambda line: None) as call:

        def rest() -> _Fitted:
            if not call.done:
                report("screening and calibration: what is left of them")
            try:
                return call.result()
            except BrokenExecutor:
                return here()

        yield call.check, rest


def _fitted(study: Study, store: StageStore, progress: bool, report: Callable[[str], None]) -> _Fitted:
    """The published method: rank the parameters, and calibrate what is selected; beside it, all of them together."""
    screened = [_screened(method, study, store, progress, report) for method in study.screening.methods]
    calibrated, verdict = _calibrated_by_all(study, screened, store, progress, report)
    return _Fitted(screened, calibrated, verdict, store.reused)


def _screened(
    method: str, study: Study, store: StageStore, progress: bool, report: Callable[[str], None]
) -> Screened:
    """Rank the parameters by one method, or take over what was found before."""
    report(f"screening: {method}")
    key = study.fingerprint("screening")
    arrays, meta = store.get(
        f"screening-{method}",
        key,
        lambda: screen(
            method,
            study.simulator,
            study.observation,
            study.screening,
            study.run,
            store.folder(key),
            progress,
        ),
    )
    counts = (meta[name] for name in ("seconds", "n_simulations", "n_failed", "threads"))
    return Screened(method, arrays["contributions"], tuple(meta["names"]), *counts)


def _calibrated_by_all(
    study: Study,
    screened: list[Screened],
    store: StageStore,
    progress: bool,
    report: Callable[[str], None],
) -> tuple[list[Calibrated], Verdict]:
    """Calibrate by each method, or take over what was found before; and what follows for the cause of the error."""
    report("calibration: map on all parameters")
    settings = (study.calibration, study.run, progress)
    arrays, meta = store.get(
        "calibration-map",
        study.fingerprint("calibration", study.held_out),
        lambda: calibrate_map(study.simulator, study.observation, study.held_out, *settings),
    )
    verdict = Verdict(**meta["verdict"])
    calibrated = []
    for method in study.calibration.methods:
        if method == "map":
            calibrated.append(_calibrated("map", "all", arrays, meta, study))
            continue
        selections: list[tuple[str, tuple[str, ...] | None]] = [("all", None)]
        if CALIBRATORS[method].selects:
            selections = [(one.method, one.names) for one in screened]
        for selection, names in selections:
            of = "all parameters" if names is None else f"the selection of {selection}: {', '.join(names)}"
            report(f"calibration: {method} on {of}")
            found = store.get(
                f"calibration-{method}-{selection}",
                study.fingerprint("calibration", names),
                lambda method=method, names=names: calibrate(  # type: ignore[misc]
                    method, study.simulator, study.observation, names, *settings
                ),
            )
            calibrated.append(_calibrated(method, selection, *found, study))
    return calibrated, verdict


def _discovered(study: Study, store: StageStore, report: Callable[[str], None]) -> Discovered:
    """Search the causes, or take over what was found before."""
    # the search itself goes on where it stopped, also with other recordings to judge on
    search = store.folder(study.fingerprint("discovery", study.together)) / "search"
    arrays, meta = store.get(
        "discovery",
        study.fingerprint("discovery", study.together, study.held_out),
        lambda: discover_causes(
            search_simulator(study.simulator, study.discovery, study.observations),
            study.searched,
            study.held_out,
            study.discovery,
            study.run,
            report,
            search,
        ),
    )
    numbers = range(len(study.observations))
    alone, responses = (tuple(arrays[f"{kind}-{n}"] for n in numbers) for kind in ("parameters", "response"))
    return Discovered(
        meta["label"],
        tuple(meta["labels"]),
        alone,
        responses,
        _each(channel_fits, study, alone),
        _each(channel_fits, study, responses),
        tuple(arrays[f"waveform-{n}"] for n in range(len(meta["places"]))),
        meta,
    )


def _nominal(simulator: Simulator, observation: Observation) -> NDArray[np.float64]:
    """Response at the nominal parameters; if there is none, the recorded operating point is to be looked at first."""
    event = observation.event
    responses = simulator.simulate(simulator.parameters.nominal, event)
    if responses.ok.all() or not isinstance(event, Playback):
        return responses.require_ok("the simulation at the nominal parameters").values[0]
    point = ", ".join(f"{name} = {value:.4g}" for name, value in event.initial.items())
    raise InputError(
        f"the nominal model cannot be simulated from what was recorded before the event, {point} pu: "
        f"{REMEDIES[Status(responses.status[0])]}",
        where=f"recording {event.name!r}",
        allowed="V near 1 pu, P and Q within the limits of the device on its own base",
        remedy="Correct units, bases and signs of the columns, or the parameters and constants of the device",
    )


def _each(
    describe: Callable[..., Any], study: Study, responses: tuple[NDArray[np.float64], ...]
) -> tuple[Any, ...]:
    """What `describe` says about each recording and its response."""
    return tuple(describe(o, y) for o, y in zip(study.observations, responses, strict=True))


def _calibrated(
    method: str, selection: str, arrays: dict[str, Any], meta: dict[str, Any], study: Study
) -> Calibrated:
    """Simulate every recording with the values found."""
    responses = []
    for observation in study.observations:
        batch = study.simulator.simulate(arrays["theta"], observation.event)
        if not batch.ok.all() and observation is study.observation:
            raise SimulationError(f"the calibrated model cannot be simulated: {batch.failures()}")
        responses.append(batch.values[0])
    return Calibrated(
        method,
        selection,
        tuple(meta["names"]),
        arrays["theta"],
        tuple(responses),
        _each(channel_fits, study, tuple(responses)),
        _each(stage_errors, study, tuple(responses)),
        arrays,
        meta,
    )
