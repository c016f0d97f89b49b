"""Diagnosis in one call."""

from __future__ import annotations

from typing import Any

from errorscreen.discovery.diagnosis import Diagnosis
from errorscreen.discovery.finder import CauseFinder
from errorscreen.discovery.search_step import search_simulator
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import as_observations


def diagnose(
    simulator: Simulator,
    recordings: Any,
    held_out: Any = (),
    *,
    step: float | None = None,
    random_state: Any = 0,
    **options: Any,
) -> Diagnosis:
    """Say what a simulation gets wrong, where, and what explains it.

    All parameters are fitted together. If they leave more than noise, missing effects and measurement faults are tried;
    if none explains the error, the port where something unknown enters is located. ``errorscreen diagnose`` does the
    same.

    Parameters
    ----------
    simulator : Simulator
    recordings : Observation, or anything ``simulator.observe`` takes, or a list of them
        Fitted together.
    held_out : Observation, or anything ``simulator.observe`` takes, or a list of them, optional
        Recordings that only confirm or refute the verdict.
    step : float, optional
        Longest integration step of the search in s, see `search_simulator`.
    random_state : None, int, SeedSequence, Generator or RandomState
    **options
        Of `CauseFinder`: ``effects``, ``max_effects`` (0 tries no effect) and others.

    Raises
    ------
    InputError, SimulationError
        If an argument or a recording cannot be used, or nothing can be simulated.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, held_out, truth = demo_recordings(0)
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> diagnose(plant, recording, held_out, random_state=0).final.kind
    'parameters'
    """
    seen = as_observations(simulator, recordings)
    none = isinstance(held_out, list | tuple) and not held_out
    others = [] if none else as_observations(simulator, held_out)
    if options.get("max_effects") != 0:  # a search refines the step where it matters, a fit alone does not
        simulator = search_simulator(simulator, step, [*seen, *others])
    events = options.pop("events", [o.event for o in others])
    finder = CauseFinder(simulator, events=events, random_state=random_state, **options).fit(seen)
    return finder.confirm(others) if others else finder.diagnosis_
