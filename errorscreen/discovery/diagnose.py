"""Diagnosis in one call."""

from __future__ import annotations

from typing import Any

from errorscreen.discovery.diagnosis import Diagnosis
from errorscreen.discovery.finder import CauseFinder
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import as_observations


def diagnose(simulator: Simulator, recordings: Any, held_out: Any = (), **options: Any) -> Diagnosis:
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
    **options
        Of `CauseFinder`: ``random_state``, ``effects``, ``max_effects`` (0 tries no effect) and others.

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
    others = (
        [] if isinstance(held_out, list | tuple) and not held_out else as_observations(simulator, held_out)
    )
    events = options.pop("events", [o.event for o in others])
    finder = CauseFinder(simulator, events=events, **options).fit(recordings)
    return finder.confirm(others) if others else finder.diagnosis_
