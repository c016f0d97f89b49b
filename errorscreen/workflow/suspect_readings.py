"""Readings of a plant that are suspect: told before anything else, because a wrong reading can look like any cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from errorscreen.data.observations import Observation
from errorscreen.data.plausibility import Doubt
from errorscreen.data.recordings import Recording
from errorscreen.discovery.readings import better_readings
from errorscreen.events import Playback
from errorscreen.exceptions import SuspectReadingsError
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.base import Simulator


def observed(simulator: Simulator, recording: Recording | Observation) -> Observation:
    """Observation of a recording; another reading that explains its error better is one of its assumptions."""
    observation = simulator.observe(recording)
    if (
        not isinstance(simulator, PlantSimulator)
        or not isinstance(recording, Recording)
        or doubts([observation])
    ):
        return observation
    better = better_readings(simulator, recording)
    return replace(observation, assumptions=(*observation.assumptions, *better))


def doubts(observations: Sequence[Observation]) -> list[str]:
    """Doubts about units, bases and signs of the recordings of a plant; in a grid no power of a line is implausible."""
    played = [o for o in observations if isinstance(o.event, Playback)]
    return [f"{o.event.name}: {text}" for o in played for text in o.assumptions if isinstance(text, Doubt)]


def refuse_suspects(observations: Sequence[Observation]) -> None:
    """Raise `SuspectReadingsError` with all doubts, if there are any."""
    found = doubts(observations)
    if found:
        raise SuspectReadingsError(found)
