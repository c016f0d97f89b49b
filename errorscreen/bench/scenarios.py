"""What hidden scenarios of discovery have in common: what they hold, how effects are drawn, and how large they are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.hypotheses import PRIOR, linearised
from errorscreen.discovery.noise import by_recording
from errorscreen.discovery.signatures import WIDE
from errorscreen.effects import Effect
from errorscreen.exceptions import InputError, SimulationError, unknown_name
from errorscreen.observations import Observation
from errorscreen.simulators import Simulator

#: kinds of scenarios and their shares; the order is that of results
MIX = (
    ("nothing", 0.25),
    ("effect", 0.3),
    ("two effects", 0.15),
    ("other form", 0.1),
    ("outside", 0.1),
    ("measurement", 0.1),
)
#: kinds whose truth has a structure that the library holds
HELD = ("effect", "two effects", "measurement")
#: an effect is hidden only if what survives a refit of the parameters is at least so many times the noise
LEAST_SIZE = 3.0
#: draws of an effect until one is large enough
TRIES = 200

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scenario:
    """What is hidden, and what was recorded of it.

    Parameters
    ----------
    kind : str
        Of `MIX`.
    device : str
        Where the first effect is hidden; of a plant the device itself.
    effects : tuple of str
        Names that are right; empty where nothing of the library is hidden.
    hidden : tuple of str
        What is hidden, by its own name.
    place : str
        Port or channel of the first hidden effect.
    size : float
        Smallest part of a hidden effect that survives a refit of all parameters, in multiples of the noise, see
        `surviving`; 0 for nothing.
    theta : ndarray of shape (m,)
    simulator : Simulator
        What is fitted: the model without what is hidden.
    recordings : tuple of Observation
        To fit.
    held_out : tuple of Observation
    truths : tuple of ndarray of shape (R, L)
        Responses without noise of the held-out events.
    structure : tuple of str
        Effects of the library that the truth has; empty where it is not the library's.
    values : ndarray
        Parameters of the hidden effects, one after the other.
    """

    kind: str
    device: str
    effects: tuple[str, ...]
    hidden: tuple[str, ...]
    place: str
    size: float
    theta: _Array
    simulator: Simulator
    recordings: tuple[Observation, ...]
    held_out: tuple[Observation, ...]
    truths: tuple[_Array, ...]
    structure: tuple[str, ...]
    values: _Array


@dataclass(frozen=True)
class Setup:
    """What the scenarios of one case have in common.

    Parameters
    ----------
    truth : Simulator
        With every effect of the library and all that only truths have.
    events : sequence of Event
        Those to fit, then those to judge on, on the time axis of the truth.
    n_fit : int
        How many of them are fitted.
    every : int
        Every so many samples of the truth are recorded.
    hide : callable
        ``hide(kind, device, rng)`` draws hidden effects and the names that are right.
    record : callable
        ``record(responses, noise_db, seed)`` gives an observation of each event and the simulator to fit.
    """

    truth: Simulator
    events: Sequence[Any]
    n_fit: int
    every: int
    hide: Callable[..., tuple[tuple[Effect, ...], tuple[str, ...]]]
    record: Callable[..., tuple[list[Observation], Simulator]]


def draw_kind(rng: np.random.Generator, mix: Sequence[tuple[str, float]] = MIX) -> str:
    """Kind of a scenario, by the shares of the kinds."""
    names, shares = zip(*mix, strict=True)
    return str(rng.choice(names, p=shares))


def draw_values(effect: Effect, rng: np.random.Generator) -> _Array:
    """Parameters inside the middle of their ranges; a strength of either sign where both are allowed.

    Time constants and others whose range is wide are drawn by order of magnitude.
    """
    values = []
    for j, p in enumerate(effect.parameters):
        if j == 0:
            share = rng.uniform(0.15, 0.9)
            values.append(share * p.upper if p.lower == 0 or rng.random() < 0.5 else share * p.lower)
        else:
            share = rng.uniform(0.1, 0.9)
            wide = p.lower > 0 and p.upper > WIDE * p.lower
            linear = p.lower + (p.upper - p.lower) * share
            values.append(p.lower * (p.upper / p.lower) ** share if wide else linear)
    return np.array(values)


def pick(rng: np.random.Generator, items: Sequence[Effect]) -> Effect:
    """One of some effects."""
    return items[int(rng.integers(len(items)))]


def draw_scenario(
    setup: Setup,
    rng: np.random.Generator,
    kind: str,
    device: str | None,
    theta: _Array,
    noise_db: float,
    least: float,
) -> Scenario:
    """Draw what is hidden until each effect's own part is at least `least` times the noise, and record it.

    Parameters
    ----------
    setup : Setup
    rng : numpy.random.Generator
    kind : str
        Of `MIX`.
    device : str or None
        Where the first effect is hidden; drawn where not given.
    theta : ndarray of shape (m,)
        Hidden parameters.
    noise_db, least : float
    """
    if kind not in dict(MIX):
        raise unknown_name(kind, dict(MIX), kind="kind")
    for _ in range(TRIES):
        effects, right = _happened(*setup.hide(kind, device, rng), setup, rng)
        own = [draw_values(effect, rng) for effect in effects]
        truth = setup.truth
        for effect in effects:
            truth = truth.extend(effect)
        values = np.concatenate([theta, *own])
        clean = [truth.simulate(values, e) for e in setup.events]
        if not all(r.ok.all() for r in clean):
            continue
        responses = [r.values[0][:, :: setup.every] for r in clean]
        try:
            observations, simulator = setup.record(
                [r.values[0] for r in clean], noise_db, int(rng.integers(2**32))
            )
        except InputError:  # it moves before the event: no such record is accepted
            continue
        n = setup.n_fit
        try:
            sizes = _sizes(setup, truth, simulator, effects, theta, own, observations[:n], responses[:n])
        except SimulationError:  # what cannot be simulated without an effect says nothing about its size
            continue
        if effects and not min(sizes) >= least:
            continue
        where = (effects[0].device or device or effects[0].kind) if effects else device or ""
        return Scenario(
            kind,
            where,
            right,
            tuple(e.name for e in effects),
            effects[0].port if effects else "",
            min(sizes, default=0.0),
            theta,
            simulator,
            tuple(observations[:n]),
            tuple(observations[n:]),
            tuple(responses[n:]),
            right if kind in HELD else (),
            np.concatenate([np.zeros(0), *own]),
        )
    raise InputError(
        f"none of {TRIES} effects drawn is at least {least:g} times the noise at {noise_db:g} dB",
        allowed="less noise, or a smaller least size",
    )


def _sizes(
    setup: Setup,
    truth: Simulator,
    simulator: Simulator,
    effects: Sequence[Effect],
    theta: _Array,
    own: Sequence[_Array],
    observations: Sequence[Observation],
    responses: Sequence[_Array],
) -> list[float]:
    """Size of each effect, with the others as they are, see `surviving`."""
    values, sizes = np.concatenate([theta, *own]), []
    for k in range(len(effects)):
        without = values.copy()
        without[len(theta) + sum(map(len, own[:k]))] = 0.0
        change = []
        for event, response in zip(setup.events[: setup.n_fit], responses, strict=True):
            found = truth.simulate(without, event).require_ok("the truth without an effect")
            change.append(response - found.values[0][:, :: setup.every])
        beside, known = simulator, [theta]  # the parameters of the other effects can make up for it too
        for j, effect in enumerate(effects):
            if j != k:
                beside, known = beside.extend(effect), [*known, own[j]]
        sizes.append(surviving(beside, np.concatenate(known), observations, change))
    return sizes


def _happened(
    effects: Sequence[Effect], right: Sequence[str], setup: Setup, rng: np.random.Generator
) -> tuple[list[Effect], tuple[str, ...]]:
    """Bind what belongs to one recording (`Effect.occasional`) to one of those that are fitted."""
    found, names = [], dict(zip(right, right, strict=True))
    for effect in effects:
        bound = effect
        if effect.occasional:
            bound = effect.during(setup.events[int(rng.integers(setup.n_fit))].name)
            names[effect.name] = bound.name
        found.append(bound)
    return found, tuple(names[name] for name in right)


def surviving(
    simulator: Simulator, theta: _Array, observations: Sequence[Observation], change: Sequence[_Array]
) -> float:
    """Size of a change of the responses after all parameters have been refitted to it, in multiples of the noise.

    The change is projected out of the tangent space of the parameters' sensitivities; the rms over the time after the
    event is taken for each channel and recording, and the largest counts.

    Parameters
    ----------
    simulator : Simulator
    theta : ndarray of shape (m,)
    observations : sequence of Observation
    change : sequence of ndarray of shape (R, L)
        One for each recording.
    """
    problem = FitProblem(simulator, list(observations))
    u = (theta - problem.space.nominal) / problem.space.scales
    _, J = linearised(problem, u)
    z = np.concatenate(
        [o.deviations(o.values + c)[o.mask] for c, o in zip(change, observations, strict=True)]
    )
    A = cho_factor(J.T @ J + np.eye(len(u)) / PRIOR**2)
    left = z - J @ cho_solve(A, J.T @ z)
    return max(
        float(np.sqrt(np.mean(full[:, o.time >= o.event.start] ** 2, axis=1)).max())
        for o, full in by_recording(observations, left)
    )
