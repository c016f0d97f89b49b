"""What would tell explanations apart that the recordings do not: another event, or another quantity to record."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.typed import Real
from errorscreen.discovery.fits.hypotheses import Hypothesis
from errorscreen.events import Event
from errorscreen.exceptions import SimulationError
from errorscreen.simulators.base import Simulator

#: states that are told, at most, and the least share of its range by which explanations must differ in one
_TOLD, _LEAST = 3, 0.05
#: a state that differs from a recorded channel by less than this share of its range is the same
_RECORDED = 1e-6

#: states (L,) by device and name
States = Mapping[tuple[str, str], NDArray[np.float64]]


@dataclass(frozen=True)
class Separation:
    """How far explanations would differ in one channel of another event.

    Parameters
    ----------
    event, channel : str
    distance : float
        Standard deviations of the noise (root of the sum of squares); the mean of all pairs.
    """

    event: str
    channel: str
    distance: Real


@dataclass(frozen=True)
class StateDifference:
    """How far explanations differ in a state that was not recorded.

    Parameters
    ----------
    device, state : str
    share : float
        Rms difference during the first recording, over the range of the state.
    """

    device: str
    state: str
    share: Real


@dataclass(frozen=True)
class Group:
    """Explanations, or locations of an unknown input, that the recordings cannot tell apart.

    Parameters
    ----------
    names : tuple of str
    separating : tuple of Separation
        Other events that would tell them apart, the best first; empty where no other event was given.
    states : tuple of StateDifference
        States that would tell them apart if they were recorded, the best first.
    """

    names: tuple[str, ...]
    separating: tuple[Separation, ...] = ()
    states: tuple[StateDifference, ...] = ()


def group_of(members: Sequence[Hypothesis], events: Iterable[Event]) -> Group:
    """Fitted hypotheses, the most probable first, as a group with what would separate them in these events."""
    states = [states_of(h.simulator, h.theta, h.observations[0].event) for h in members]
    return Group(tuple(h.name for h in members), separating(members, events), differing(states))


def separating(members: Sequence[Hypothesis], events: Iterable[Event]) -> tuple[Separation, ...]:
    """Differences of hypotheses in each channel of the events that all of them can simulate, the largest first."""
    found = []
    reference = members[0].observations[0]
    for event in events:
        try:
            responses = np.array([member.predict(event) for member in members])
        except SimulationError:
            continue
        for channel, noise, rows in zip(
            reference.channels, reference.noise, responses.swapaxes(0, 1), strict=True
        ):
            distance = float(np.sqrt(_difference(rows).sum()) / noise)
            found.append(Separation(event.name, channel, distance))
    return tuple(sorted(found, key=lambda item: -item.distance))


def states_of(simulator: Simulator, theta: ArrayLike, event: Event) -> States:
    """States of all devices in which effects can act, but for the recorded ones; empty where they cannot be seen."""
    inside = ("mechanism", "latent")
    devices = dict.fromkeys(effect.device for effect in simulator.effects if effect.kind in inside)
    recorded = simulator.simulate(theta, event).values[0]
    return {
        (device_name(simulator, device), name): row
        for device in devices
        for name, row in simulator.trajectories(theta, event, device).items()
        if not any(
            np.allclose(row, channel, rtol=0.0, atol=_RECORDED * np.ptp(channel)) for channel in recorded
        )
    }


def device_name(simulator: Simulator, device: str) -> str:
    """Name of a device: its own where a simulator has several, else that of the only one, or ``"model"``."""
    return device or getattr(getattr(simulator, "device", None), "name", "model")


def differing(members: Sequence[States]) -> tuple[StateDifference, ...]:
    """States that all explanations have and in which they differ most, the largest difference first."""
    found = []
    for key in set.intersection(*(set(states) for states in members)):
        rows = np.array([states[key] for states in members])
        width = float(np.ptp(rows, axis=1).max())
        if width > 0:
            share = round(float(np.sqrt(_difference(rows).mean()) / width), 2)
            found.append(StateDifference(*key, share))
    found.sort(key=lambda item: (-item.share, item.device, item.state))
    return tuple(item for item in found if item.share >= _LEAST)[:_TOLD]


def _difference(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Square of what rows (n, L) differ by, mean of all pairs (L,)."""
    return np.asarray(np.mean([(a - b) ** 2 for a, b in combinations(rows, 2)], axis=0))
