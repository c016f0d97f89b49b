"""Hidden scenarios of the discovery studies: their parts, how effects are drawn, and the size of an effect."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
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

#: kinds of scenarios and their shares, in the order of the results
MIX = (
    ("nothing", 0.25),
    ("effect", 0.3),
    ("two effects", 0.15),
    ("other form", 0.1),
    ("outside", 0.1),
    ("measurement", 0.1),
)
#: kinds whose hidden effects are in the library
HELD = ("effect", "two effects", "measurement")
#: kinds that hide nothing but deviating parameters, if any
NOTHING = ("nothing", "healthy")
#: least size of a hidden effect, see `Scenario`
LEAST_SIZE = 3.0
#: draws of an effect until one is large enough
TRIES = 200
#: scaling of strengths ends within this factor of the wanted size, or after so many steps
_NEAR, _SCALINGS = 1.1, 15
#: iterations of the refit that measures a size: more of them led no lower in 15 draws of plants
_REFIT = 30

_Array = NDArray[np.float64]
#: observations of all events, the simulator to fit, responses without noise, and sizes of the effects
_Recorded = tuple[list[Observation], Simulator, list[_Array], list[float]]


@dataclass(frozen=True)
class Scenario:
    """A hidden truth and its recordings.

    `effects` names effects of the library that are right, `hidden` the hidden ones, of which those of the library are
    the `structure`; `values` are their parameters. Where several names are right for a hidden effect, `alternatives`
    has them all, for each hidden one. `size` is the smallest size of the hidden effects, see `surviving`. `simulator`
    is the model to fit, and `truths` (R, L) are the responses to the held-out events without noise.
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
    alternatives: tuple[tuple[str, ...], ...] = ()

    @property
    def answers(self) -> set[frozenset[str]]:
        """Sets of names that are right; none where nothing of the library is."""
        right = self.alternatives or tuple((name,) for name in self.effects)
        return {frozenset(names) for names in product(*right)} if right else set()

    @property
    def hides_nothing(self) -> bool:
        """Whether parameters alone are right."""
        return self.kind in NOTHING


@dataclass(frozen=True)
class Setup:
    """Common parts of the scenarios of one case.

    `truth` has all effects of the library and of `errorscreen.bench.hidden_effects`. Of `events`, `n_fit` are to fit
    and the others to judge on; one of `every` samples is recorded. ``hide(kind, device, rng)`` draws hidden effects
    and the names that are right, and ``record(responses, noise_db, seed)`` gives observations and the simulator to
    fit.
    """

    truth: Simulator
    events: Sequence[Any]
    n_fit: int
    every: int
    hide: Callable[..., tuple[tuple[Effect, ...], tuple[str, ...]]]
    record: Callable[..., tuple[list[Observation], Simulator]]


def check_sizes(least: float, largest: float) -> None:
    """Refuse limits between which no size can be drawn by order of magnitude."""
    if not 0 < least < largest:
        raise InputError(
            f"sizes from {least:g} to {largest:g} times the noise", allowed="0 < least size < largest size"
        )


def draw_kind(rng: np.random.Generator, mix: Sequence[tuple[str, float]] = MIX) -> str:
    """Draw the kind of a scenario by the shares of the kinds."""
    names, shares = zip(*mix, strict=True)
    return str(rng.choice(names, p=shares))


def draw_values(effect: Effect, rng: np.random.Generator) -> _Array:
    """Draw parameters from the middle of their ranges, wide ones by order of magnitude, strengths of either sign."""
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


def pick(rng: np.random.Generator, items: Sequence[Any]) -> Any:
    """Draw one of some items."""
    return items[int(rng.integers(len(items)))]


def draw_scenario(
    setup: Setup,
    rng: np.random.Generator,
    kind: str,
    device: str | None,
    theta: _Array,
    noise_db: float,
    *,
    least_size: float = LEAST_SIZE,
    largest_size: float | None = None,
) -> Scenario:
    """Draw hidden effects until each has at least the size `least_size`, and record them.

    With `largest_size`, strengths are scaled to sizes drawn between the two, evenly by order of magnitude. `device` is
    where the first effect is hidden, drawn where it is None. `noise_db` is the level of each channel's deviation from
    its value before the event over that of the noise, both rms.
    """
    if kind not in dict(MIX):
        raise unknown_name(kind, dict(MIX), kind="kind")
    if largest_size is not None:
        check_sizes(least_size, largest_size)
    for _ in range(TRIES):
        effects, right = _bound(*setup.hide(kind, device, rng), setup, rng)
        own: Sequence[_Array] = [draw_values(effect, rng) for effect in effects]
        hidden = _Hidden(setup, effects, theta)
        responses = hidden.responses(own)
        if responses is None:
            continue
        noise = (noise_db, int(rng.integers(2**32)))
        recorded = hidden.record(own, responses, noise)
        if effects and recorded is not None and largest_size is not None:
            aims = np.exp(rng.uniform(np.log(least_size), np.log(largest_size), len(effects)))
            own, recorded = hidden.scale(own, recorded, noise, aims)
        if recorded is None:
            continue
        observations, simulator, responses, sizes = recorded
        if effects and not min(sizes) >= least_size:
            continue
        n = setup.n_fit
        return Scenario(
            kind=kind,
            device=((effects[0].device or device or effects[0].kind) if effects else device) or "",
            effects=right,
            hidden=tuple(e.name for e in effects),
            place=effects[0].port if effects else "",
            size=min(sizes, default=0.0),
            theta=theta,
            simulator=simulator,
            recordings=tuple(observations[:n]),
            held_out=tuple(observations[n:]),
            truths=tuple(responses[n:]),
            structure=right if kind in HELD else (),
            values=np.concatenate([np.zeros(0), *own]),
        )
    raise too_small("", least_size, noise_db, TRIES)


def too_small(where: str, least: float, noise_db: float, tries: int) -> InputError:
    """Error of draws without a large enough effect."""
    return InputError(
        f"none of {tries} effects drawn{where} is at least {least:g} times the noise at {noise_db:g} dB",
        allowed="less noise, or a smaller least size",
    )


class _Hidden:
    """Effects hidden in a model with the parameters `theta`."""

    def __init__(self, setup: Setup, effects: Sequence[Effect], theta: _Array) -> None:
        self.setup, self.effects, self.theta = setup, effects, theta
        self.truth = setup.truth
        for effect in effects:
            self.truth = self.truth.extend(effect)

    def responses(self, own: Sequence[_Array]) -> list[_Array] | None:
        """Responses to all events with the effects' parameters `own`; None where a simulation fails."""
        values = np.concatenate([self.theta, *own])
        found = [self.truth.simulate(values, event) for event in self.setup.events]
        return [r.values[0] for r in found] if all(r.ok.all() for r in found) else None

    def record(
        self, own: Sequence[_Array], responses: list[_Array], noise: tuple[float, int]
    ) -> _Recorded | None:
        """Record responses with noise (level in dB, seed); None where that cannot be a scenario."""
        try:
            observations, simulator = self.setup.record(responses, *noise)
        except InputError:  # the response moves before the event: no such recording is accepted
            return None
        sampled = [r[:, :: self.setup.every] for r in responses]
        try:
            sizes = self._sizes(own, simulator, observations, sampled)
        except SimulationError:  # the model without an effect fails, so the effect has no size
            return None
        return observations, simulator, sampled, sizes

    def scale(
        self, own: Sequence[_Array], recorded: _Recorded, noise: tuple[float, int], aims: _Array
    ) -> tuple[Sequence[_Array], _Recorded | None]:
        """Scale strengths until the effects have the sizes `aims`, and record them; None where that fails.

        The size of most effects is proportional to a small strength; others act beyond a threshold, so strengths are
        bracketed too.
        """
        below, above = np.zeros(len(aims)), np.full(len(aims), np.inf)
        for _ in range(_SCALINGS):
            sizes = np.array(recorded[-1])
            if np.all(np.abs(np.log(np.maximum(sizes, 1e-300) / aims)) <= np.log(_NEAR)):
                return own, recorded
            strengths = np.array([abs(values[0]) for values in own])
            below = np.where(sizes < aims, strengths, below)
            above = np.where(sizes < aims, above, strengths)
            known = np.transpose([strengths, sizes, aims, below, above])
            own = [
                np.array([np.sign(values[0]) * _between(*row), *values[1:]])
                for values, row in zip(own, known, strict=True)
            ]
            bounds = [effect.parameters[0] for effect in self.effects]
            if not all(p.lower <= values[0] <= p.upper for p, values in zip(bounds, own, strict=True)):
                break
            responses = self.responses(own)
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
        """Size of each effect with the other effects in place, see `surviving`."""
        n = self.setup.n_fit
        values, sizes = np.concatenate([self.theta, *own]), []
        for k in range(len(self.effects)):
            without = values.copy()
            without[len(self.theta) + sum(map(len, own[:k]))] = 0.0
            change = []
            for event, response in zip(self.setup.events[:n], responses[:n], strict=True):
                found = self.truth.simulate(without, event).require_ok("the truth without an effect")
                change.append(response - found.values[0][:, :: self.setup.every])
            others, known = simulator, [self.theta]  # parameters of the other effects are refitted too
            for j, effect in enumerate(self.effects):
                if j != k:
                    others, known = others.extend(effect), [*known, own[j]]
            sizes.append(surviving(others, np.concatenate(known), observations[:n], change))
        return sizes


def _between(strength: float, size: float, aim: float, below: float, above: float) -> float:
    """Next strength to try: in proportion to the size where that lies inside the bracket, else inside of it."""
    if size > 0 and below < strength * aim / size < above:
        return strength * aim / size
    return float(np.sqrt(below * above)) if below > 0 else 0.1 * above


def _bound(
    effects: Sequence[Effect], right: Sequence[str], setup: Setup, rng: np.random.Generator
) -> tuple[list[Effect], tuple[str, ...]]:
    """Bind event-specific effects (`Effect.event_specific`) to one of the fitted recordings."""
    found, names = [], dict(zip(right, right, strict=True))
    for effect in effects:
        bound = effect
        if effect.event_specific:
            bound = effect.during(setup.events[int(rng.integers(setup.n_fit))].name)
            names[effect.name] = bound.name
        found.append(bound)
    return found, tuple(names[name] for name in right)


def surviving(
    simulator: Simulator,
    theta: _Array,
    observations: Sequence[Observation],
    change: Sequence[_Array],
    *others: _Array,
) -> float:
    """Size of a change (R, L) of the responses: the part that a refit leaves, in multiples of the noise.

    It is the largest rms of the residuals after the event, over all channels and recordings, in a local minimum near
    `theta` (m,), or near `others` if one is lower. `SimulationError` if `theta` cannot be simulated.
    """
    changed = []
    for o, c in zip(observations, change, strict=True):
        response = simulator.simulate(theta, o.event).require_ok("the model without an effect").values[0]
        changed.append(replace(o, values=np.where(o.mask, response + c, np.nan)))
    problem = FitProblem(simulator, changed)
    u = (np.array([theta, *others]) - problem.space.nominal) / problem.space.scales
    best = JointFit(simulator.extensions, problem, u).run(_REFIT).reached[0]
    left = problem.residuals(problem.values(best))[0]
    return max(
        float(np.sqrt(np.mean(full[:, o.time >= o.event.start] ** 2, axis=1)).max())
        for o, full in by_recording(changed, left)
    )
