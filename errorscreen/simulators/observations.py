"""Recordings on a simulator's channels and time grid, checked."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.events import Event
from errorscreen.exceptions import InputError
from errorscreen.parameters import ParameterSpace
from errorscreen.simulators.base import Simulator


def as_observations(simulator: Simulator, recordings: Any) -> list[Observation]:
    """Bring one recording or several, or observations, onto a simulator's channels and time grid."""
    if not isinstance(simulator, Simulator):
        raise InputError(
            f"simulator is a {type(simulator).__name__}", allowed="an object of a subclass of Simulator"
        )
    items = recordings if isinstance(recordings, list | tuple) else [recordings]
    if not items:
        raise InputError("the list of recordings is empty", allowed="at least one recording")
    observations = []
    for number, item in enumerate(items, start=1):
        observation = item if isinstance(item, Observation) else simulator.observe(item)
        _check(observation, simulator, f"recording {number} ({observation.event.name})")
        observations.append(observation)
    return observations


def held_out_observations(
    simulator: Simulator, recordings: Any, fitted: Iterable[Observation]
) -> list[Observation]:
    """Recordings as `as_observations`, if none of them was fitted: else it raises `InputError`."""
    others, seen = as_observations(simulator, recordings), [o.values for o in fitted]
    for other in others:
        if any(np.array_equal(other.values, values, equal_nan=True) for values in seen):
            raise InputError(
                f"the recording {other.event.name!r} is held out and was fitted: it confirms nothing",
                allowed="recordings that were not fitted",
            )
    return others


def check_recording(item: Any) -> Recording:
    """Return a recording as it is; anything else raises `InputError`."""
    if isinstance(item, Recording):
        return item
    raise InputError(f"a {type(item).__name__} is not a recording", allowed="Recording, Observation")


def observed_after(
    recording: Any, event: Event, channels: tuple[str, ...], units: tuple[str, ...]
) -> Observation:
    """Observation of a recording on some channels and the time axis of an event; a missing channel is all NaN."""
    recording = check_recording(recording)
    where = f"recording {recording.name!r}"
    found = [name for name in channels if name in recording.channels]
    if not found:
        raise InputError(
            f"its channels are {', '.join(recording.channels)}", where=where, allowed=", ".join(channels)
        )
    for name in found:
        if recording.channels[name].unit != "pu":
            raise InputError(
                f"channel {name!r} is in {recording.channels[name].unit!r}", where=where, allowed="pu"
            )
    source = recording.resample(time=event.time)
    values, noise = np.full((len(channels), len(event.time)), np.nan), np.ones(len(channels))
    for name in found:
        r = channels.index(name)
        values[r], noise[r] = source.channels[name].values, source.channels[name].noise
    return Observation(
        replace(event, name=recording.name), values, noise, channels, units, tuple(source.assumptions)
    )


def with_initial_states(simulator: Simulator, recordings: Any) -> list[Observation]:
    """Observations to judge a fitted simulator on, each with its best initial state, see `as_observations`."""
    return [simulator.fit_initial_state(seen) for seen in as_observations(simulator, recordings)]


def check_names(parameters: ParameterSpace, names: Iterable[str] | None) -> tuple[str, ...]:
    """Names of a selection of parameters, all for None; an unknown or repeated name, or none, raises `InputError`."""
    if isinstance(names, str):
        raise InputError(f"names is the text {names!r}", allowed="a list of parameter names")
    if names is None:
        return parameters.names
    space = parameters.subset(names)
    if not len(space):
        raise InputError("the selection of parameters is empty", allowed="at least one name")
    return space.names


def _check(observation: Observation, simulator: Simulator, where: str) -> None:
    if tuple(observation.channels) != tuple(simulator.channels):
        raise InputError(
            f"the channels are {', '.join(observation.channels)}",
            where=where,
            allowed=f"the simulator's: {', '.join(simulator.channels)}",
            remedy="Use simulator.observe(recording)",
        )
    shape, found = (len(simulator.channels), len(observation.time)), np.shape(observation.values)
    if found != shape:
        raise InputError(f"the values have shape {found}", where=where, allowed=f"{shape}")
    noise = np.asarray(observation.noise, dtype=float)
    if noise.shape != shape[:1] or not np.all(np.isfinite(noise) & (noise > 0)):
        raise InputError(
            f"the noise of the channels is {noise}",
            where=where,
            allowed="one positive standard deviation for each channel",
            remedy="Give the noise of each channel in its unit",
        )
    if not observation.mask.any():
        raise InputError("no value was measured in any channel", where=where, allowed="at least one value")
