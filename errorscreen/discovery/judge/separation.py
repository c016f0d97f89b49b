"""What would tell explanations apart that the recordings do not: another event, or another quantity to record."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
class Group:
    """Explanations, or places of an unknown signal, that these recordings cannot tell apart.

    Parameters
    ----------
    names : tuple of str
    separating : tuple of (str, str, float)
        Event, channel and by how many standard deviations of the noise (root of the sum of squares) the explanations
        would differ there, the best first; empty where no other event was given.
    states : tuple of (str, str, float)
        Device, state inside it that was not recorded, and by what share of its range the explanations differ in it
        during the first recording, the best first; empty where they differ in none, or states cannot be seen.
    """

    names: tuple[str, ...]
    separating: tuple[tuple[str, str, float], ...]
    states: tuple[tuple[str, str, float], ...] = ()


def group_of(members: Sequence[Hypothesis], events: Iterable[Event]) -> Group:
    """Fitted hypotheses as a group, with what would separate them.

    Parameters
    ----------
    members : sequence of Hypothesis
        The most probable first.
    events : iterable of Event
        Those that could be recorded.
    """
    states = [states_of(h.simulator, h.theta, h.observations[0].event) for h in members]
    return Group(tuple(h.name for h in members), separating(members, events), differing(states))


def separating(members: Sequence[Hypothesis], events: Iterable[Event]) -> tuple[tuple[str, str, float], ...]:
    """Events and channels in which hypotheses differ most, see `Group.separating`; of several the mean of all pairs.

    Parameters
    ----------
    members : sequence of Hypothesis
    events : iterable of Event
        One that cannot be simulated with each of them is left out.
    """
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
            found.append((event.name, channel, float(np.sqrt(_difference(rows).sum()) / noise)))
    return tuple(sorted(found, key=lambda item: -item[2]))


def states_of(simulator: Simulator, theta: ArrayLike, event: Event) -> States:
    """States inside all devices in which effects can act, but for those that are recorded.

    Empty where they cannot be seen.

    Parameters
    ----------
    simulator : Simulator
    theta : array-like of shape (m,)
    event : Event
    """
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


def differing(members: Sequence[States]) -> tuple[tuple[str, str, float], ...]:
    """States in which explanations differ most, see `Group.states`.

    Parameters
    ----------
    members : sequence of mapping
        States with each of them; those that only some have are left out.

    Examples
    --------
    >>> t = np.linspace(0.0, 1.0, 101)
    >>> differing([{("unit", "speed"): t, ("unit", "flux"): t}, {("unit", "speed"): 0.0 * t, ("unit", "flux"): t}])
    (('unit', 'speed', 0.58),)
    """
    found = []
    for key in set.intersection(*(set(states) for states in members)):
        rows = np.array([states[key] for states in members])
        width = float(np.ptp(rows, axis=1).max())
        if width > 0:
            found.append((*key, round(float(np.sqrt(_difference(rows).mean()) / width), 2)))
    found.sort(key=lambda item: (-item[2], item[:2]))
    return tuple(item for item in found if item[2] >= _LEAST)[:_TOLD]


def _difference(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Square of what rows (n, L) differ by, mean of all pairs (L,)."""
    return np.asarray(np.mean([(a - b) ** 2 for a, b in combinations(rows, 2)], axis=0))
