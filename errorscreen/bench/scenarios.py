"""What hidden scenarios of discovery have in common: what they hold, how effects are drawn, and how large they are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.hypotheses import JointFit
from errorscreen.discovery.fits.noise import by_recording
from errorscreen.discovery.starts.signatures import WIDE
from errorscreen.effects import Effect
from errorscreen.exceptions import InputError, SimulationError, unknown_name
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
#: how near a size is brought to the one that was drawn for it, as a factor, and in how many steps at most
_NEAR, _SCALINGS = 1.1, 15
#: iterations of the refit that measures a size: in none of 15 draws of plants more of them led lower
_REFIT = 30

_Array = NDArray[np.float64]
#: observations of all events, the simulator to fit, responses without noise, and sizes of the effects
_Recorded = tuple[list[Observation], Simulator, list[_Array], list[float]]


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


def check_sizes(least: float, largest: float) -> None:
    """Refuse sizes between which none can be drawn by order of magnitude."""
    if not 0 < least < largest:
        raise InputError(
            f"sizes from {least:g} to {largest:g} times the noise", allowed="0 < least size < largest size"
        )


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
    largest: float | None = None,
) -> Scenario:
    """Draw what is hidden until what survives of each effect is at least `least` times the noise, and record it.

    With `largest`, a size between the two is drawn for each effect, evenly by order of magnitude, and its strength is
    brought to it.

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
    largest : float, optional

    Raises
    ------
    InputError
        If the kind is not known, `largest` is not above `least` and positive, or no effect drawn is large enough.
    """
    if kind not in dict(MIX):
        raise unknown_name(kind, dict(MIX), kind="kind")
    if largest is not None:
        check_sizes(least, largest)
    for _ in range(TRIES):
        effects, right = _happened(*setup.hide(kind, device, rng), setup, rng)
        own: Sequence[_Array] = [draw_values(effect, rng) for effect in effects]
        hidden = _Hidden(setup, effects, theta)
        responses = hidden.responses(own)
        if responses is None:
            continue
        noise = (noise_db, int(rng.integers(2**32)))
        recorded = hidden.record(own, responses, noise)
        if effects and recorded is not None and largest is not None:
            aims = np.exp(rng.uniform(np.log(least), np.log(largest), len(effects)))
            own, recorded = hidden.scale(own, recorded, noise, aims)
        if recorded is None:
            continue
        observations, simulator, responses, sizes = recorded
        n = setup.n_fit
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


class _Hidden:
    """Effects that are hidden in a model with some parameters.

    Parameters
    ----------
    setup : Setup
    effects : sequence of Effect
    theta : ndarray of shape (m,)
    """

    def __init__(self, setup: Setup, effects: Sequence[Effect], theta: _Array) -> None:
        self.setup, self.effects, self.theta = setup, effects, theta
        self.truth = setup.truth
        for effect in effects:
            self.truth = self.truth.extend(effect)

    def responses(self, own: Sequence[_Array]) -> list[_Array] | None:
        """To all events, with some parameters of the effects; none where they cannot be simulated."""
        values = np.concatenate([self.theta, *own])
        found = [self.truth.simulate(values, event) for event in self.setup.events]
        return [r.values[0] for r in found] if all(r.ok.all() for r in found) else None

    def record(
        self, own: Sequence[_Array], responses: list[_Array], noise: tuple[float, int]
    ) -> _Recorded | None:
        """What is recorded of responses, with noise of a level in dB and a seed; none where nobody would accept it."""
        try:
            observations, simulator = self.setup.record(responses, *noise)
        except InputError:  # it moves before the event: no such record is accepted
            return None
        sampled = [r[:, :: self.setup.every] for r in responses]
        try:
            sizes = self._sizes(own, simulator, observations, sampled)
        except SimulationError:  # what cannot be simulated without an effect says nothing about its size
            return None
        return observations, simulator, sampled, sizes

    def scale(
        self, own: Sequence[_Array], recorded: _Recorded, noise: tuple[float, int], aims: _Array
    ) -> tuple[Sequence[_Array], _Recorded | None]:
        """Parameters by which effects have the sizes `aims`, and what is recorded then; none where they cannot.

        A size is proportional to a small strength of most effects. Others, which act beyond a threshold only, are
        bracketed.
        """
        below, above = np.zeros(len(aims)), np.full(len(aims), np.inf)
        for _ in range(_SCALINGS):
            sizes = np.array(recorded[-1])
            if np.all(np.abs(np.log(np.maximum(sizes, 1e-300) / aims)) <= np.log(_NEAR)):
                return own, recorded
            strengths = np.array([abs(values[0]) for values in own])
            below = np.where(sizes < aims, strengths, below)
            above = np.where(sizes < aims, above, strengths)
            own = [
                np.array([np.sign(values[0]) * _between(*known), *values[1:]])
                for values, known in zip(
                    own, np.transpose([strengths, sizes, aims, below, above]), strict=True
                )
            ]
            inside = [
                e.parameters[0].lower <= values[0] <= e.parameters[0].upper
                for e, values in zip(self.effects, own, strict=True)
            ]
            responses = self.responses(own) if all(inside) else None
            found = None if responses is None else self.record(own, responses, noise)
            if found is None:
                break
            recorded = found
        return own, None

    def _sizes(
        self,
        own: Sequence[_Array],
        simulator: Simulator,
        observations: Sequence[Observation],
        responses: Sequence[_Array],
    ) -> list[float]:
        """Size of each effect, with the others as they are, see `surviving`."""
        n = self.setup.n_fit
        values, sizes = np.concatenate([self.theta, *own]), []
        for k in range(len(self.effects)):
            without = values.copy()
            without[len(self.theta) + sum(map(len, own[:k]))] = 0.0
            change = []
            for event, response in zip(self.setup.events[:n], responses[:n], strict=True):
                found = self.truth.simulate(without, event).require_ok("the truth without an effect")
                change.append(response - found.values[0][:, :: self.setup.every])
            beside, known = simulator, [self.theta]  # parameters of the other effects can make up for it too
            for j, effect in enumerate(self.effects):
                if j != k:
                    beside, known = beside.extend(effect), [*known, own[j]]
            sizes.append(surviving(beside, np.concatenate(known), observations[:n], change))
        return sizes


def _between(strength: float, size: float, aim: float, below: float, above: float) -> float:
    """Next strength to try: proportional if that is between two whose sizes are below and above `aim`."""
    if size > 0 and below < strength * aim / size < above:
        return strength * aim / size
    return float(np.sqrt(below * above)) if below > 0 else 0.1 * above


def _happened(
    effects: Sequence[Effect], right: Sequence[str], setup: Setup, rng: np.random.Generator
) -> tuple[list[Effect], tuple[str, ...]]:
    """Bind what belongs to one recording (`Effect.event_specific`) to one of those that are fitted."""
    found, names = [], dict(zip(right, right, strict=True))
    for effect in effects:
        bound = effect
        if effect.event_specific:
            bound = effect.during(setup.events[int(rng.integers(setup.n_fit))].name)
            names[effect.name] = bound.name
        found.append(bound)
    return found, tuple(names[name] for name in right)


def surviving(
    simulator: Simulator, theta: _Array, observations: Sequence[Observation], change: Sequence[_Array]
) -> float:
    """Size of a change of the responses after all parameters have been refitted to it, in multiples of the noise.

    The simulator is fitted to its own responses with the change and without noise, by a local search from `theta` on: a
    minimum elsewhere may leave less. Of what is left, the rms over the time after the event is taken for each channel
    and recording, and the largest counts.

    Parameters
    ----------
    simulator : Simulator
    theta : ndarray of shape (m,)
    observations : sequence of Observation
    change : sequence of ndarray of shape (R, L)
        One for each recording.

    Raises
    ------
    SimulationError
        If `theta` cannot be simulated.
    """
    changed = []
    for o, c in zip(observations, change, strict=True):
        response = simulator.simulate(theta, o.event).require_ok("the model without an effect").values[0]
        changed.append(replace(o, values=np.where(o.mask, response + c, np.nan)))
    problem = FitProblem(simulator, changed)
    u = (theta - problem.space.nominal) / problem.space.scales
    best = JointFit(simulator.extensions, problem, u).run(_REFIT).reached[0]
    left = problem.residuals(problem.values(best))[0]
    return max(
        float(np.sqrt(np.mean(full[:, o.time >= o.event.start] ** 2, axis=1)).max())
        for o, full in by_recording(changed, left)
    )
