"""Recordings of a grid beside what happened in it, from a case file."""

from __future__ import annotations

from dataclasses import replace

from errorscreen.cases import Case
from errorscreen.cases.model_sections import GridSection
from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.events import GridEvent
from errorscreen.exceptions import ErrorscreenError, InputError
from errorscreen.simulators import PowerSystemSimulator


def observed_grid(
    case: Case, grid: GridSection, recordings: tuple[Recording, ...]
) -> tuple[PowerSystemSimulator, tuple[Observation, ...]]:
    """Simulator of a grid, and each recording beside its event; `InputError` if one of these is impossible in it."""
    events, notes = [], []
    for section, recording in zip(case.recordings.values(), recordings, strict=True):
        where = f"recording {recording.name!r}"
        ((key, happened),) = section.events.items()
        time = recording.resample(case.simulation.dt).time
        event, note = happened.on_steps(
            time, recording.name, section, case.simulation.step, f"{where}, {key}"
        )
        events.append(event)
        notes.append(note)
        missing = [name for name in grid.channels if name not in recording.channels]
        if missing:
            raise InputError(
                f"channel {missing[0]!r} of [grid] is not in it",
                where=where,
                allowed=", ".join(recording.channels),
                remedy="Read it with [recording.columns], or leave it out of grid.channels",
            )
    quiet = GridEvent(events[0].time, events[0].name, events[0].start)
    try:
        simulator = grid.simulator(quiet, case.simulation.step)
    except InputError as error:
        raise InputError(error.what, where="grid.channels", allowed=error.allowed) from error
    for event, recording in zip(events, recordings, strict=True):
        _check_grid(simulator, event, recording)
    first, *together = events[: 1 + len(case.together)]
    simulator = grid.simulator(first, case.simulation.step, together)
    observed = []
    for event, note, recording in zip(events, notes, recordings, strict=True):
        observation = simulator.observe(recording, event)
        observed.append(replace(observation, assumptions=(*observation.assumptions, *note)))
    return simulator, tuple(observed)


def _check_grid(simulator: PowerSystemSimulator, event: GridEvent, recording: Recording) -> None:
    """Refuse a recording on another base, and an event that the grid cannot have."""
    where = f"recording {recording.name!r}"
    for key, own in (("base_mva", simulator.network.base_mva), ("f_nominal", simulator.f0)):
        if getattr(recording, key) != own:
            raise InputError(
                f"{key} is {getattr(recording, key):g}", where=where, allowed=f"{own:g}, that of the grid"
            )
    try:
        simulator.baseline(event)
    except ErrorscreenError as error:
        raise InputError(
            f"what happened cannot be simulated: {error}",
            where=where,
            remedy="Correct the buses, the load level or the circuit of the event",
        ) from error
