"""Hidden scenarios of the modified 39-bus system: three plants with 40 deviating parameters, and something missing."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.bench.hidden_effects import OTHER_FORMS, OUTSIDE
from errorscreen.bench.paper_draw import (
    FIT_EVENTS,
    STEP,
    TRUE_STEP,
    Effort,
    Setting,
    noise_of,
    step_error,
)
from errorscreen.bench.scenarios import (
    HELD,
    LEAST_SIZE,
    TRIES,
    Scenario,
    draw_kind,
    draw_values,
    pick,
    smallest_size,
    too_small,
)
from errorscreen.cases import ieee39_events, load_ieee39
from errorscreen.effects import Effect
from errorscreen.observations import Observation
from errorscreen.power import DEVICES
from errorscreen.simulators import PowerSystemSimulator, Simulator

_Array = NDArray[np.float64]


def draw_grid_scenario(
    seed: Any,
    noise_db: float,
    *,
    kind: str | None = None,
    device: str | None = None,
    least_size: float = LEAST_SIZE,
) -> Scenario:
    """Draw one scenario; three events are fitted, those of the case study, and all others held out.

    Parameters
    ----------
    seed : int or SeedSequence
    noise_db : float
        See `Setting`.
    kind, device : str, optional
        Drawn where not given; `device` is where the first effect is hidden.
    least_size : float
        Effects whose size is less are drawn again.
    """
    rng = np.random.default_rng(seed)
    drawn = draw_kind(rng)
    kind = kind or drawn
    truth, simulator = _truth(), _model()
    lower, upper = truth.parameters.bounds.T
    theta = rng.uniform(lower, upper)
    events = ieee39_events()
    names = (*FIT_EVENTS, *(name for name in events if name not in FIT_EVENTS))
    for _ in range(TRIES):
        effects, right = _draw_effects(kind, device, rng)
        own = [draw_values(effect, rng) for effect in effects]
        extended: Simulator = truth
        for effect in effects:
            extended = extended.extend(effect.name)
        values = np.concatenate([theta, *own])
        clean = {name: extended.simulate(values, events[name]) for name in names}
        if not all(r.ok.all() for r in clean.values()):
            continue
        responses = {name: r.values[0] for name, r in clean.items()}
        noise_rng = np.random.default_rng(int(rng.integers(2**32)))
        observations = []
        for name in names:
            noise = noise_of(responses[name], events[name], noise_db)
            measured = responses[name] + noise[:, None] * noise_rng.standard_normal(responses[name].shape)
            extra = _step_errors()[name]
            observations.append(
                Observation(events[name], measured, noise, truth.channels, truth.units, extra=extra)
            )
        changes = []
        for k in range(len(effects)):  # each effect alone, with the others as they are
            without = values.copy()
            without[len(theta) + sum(map(len, own[:k]))] = 0.0
            changes.append(
                [responses[n] - extended.simulate(without, events[n]).values[0] for n in FIT_EVENTS]
            )
        size = smallest_size(simulator, theta, observations[: len(FIT_EVENTS)], changes)
        if effects and not size >= least_size:
            continue
        return Scenario(
            kind,
            effects[0].device or effects[0].kind if effects else "",
            right,
            tuple(e.name for e in effects),
            effects[0].port if effects else "",
            size,
            theta,
            simulator,
            tuple(observations[: len(FIT_EVENTS)]),
            tuple(observations[len(FIT_EVENTS) :]),
            tuple(responses[n] for n in names[len(FIT_EVENTS) :]),
            right if kind in HELD else (),
            np.concatenate([np.zeros(0), *own]),
        )
    raise too_small(noise_db, least_size)


def _draw_effects(
    kind: str, device: str | None, rng: np.random.Generator
) -> tuple[tuple[Effect, ...], tuple[str, ...]]:
    """Hidden effects and the names that are right."""
    device = device or str(rng.choice(list(DEVICES)))
    library = _model().effects
    mechanisms = [e for e in library if e.kind == "mechanism"]
    if kind == "nothing":
        return (), ()
    if kind == "effect":
        chosen = pick(rng, [e for e in mechanisms if e.device == device])
        return (chosen,), (chosen.name,)
    if kind == "two effects":
        first = pick(rng, [e for e in mechanisms if e.device == device])
        second = pick(rng, [e for e in mechanisms if e is not first])
        return (first, second), (first.name, second.name)
    if kind == "other form":
        effect, name = OTHER_FORMS[device][rng.integers(len(OTHER_FORMS[device]))]
        return (effect.at(device),), (f"{device}.{name}",)
    if kind == "outside":
        return (pick(rng, OUTSIDE[device]).at(device),), ()
    chosen = pick(rng, [e for e in library if e.kind in ("measurement", "event")])
    return (chosen,), (chosen.name,)


@cache
def _model() -> PowerSystemSimulator:
    """What is fitted."""
    return load_ieee39(step=STEP, n_threads=1)


@cache
def _truth() -> PowerSystemSimulator:
    """Simulator of hidden truths, with every effect of the library and all that only truths have."""
    own = [e.at(d) for d in DEVICES for e in (*(e for e, _ in OTHER_FORMS[d]), *OUTSIDE[d])]
    library = [e for e in _model().effects if e.kind != "latent"]
    return load_ieee39(step=TRUE_STEP, n_threads=1, effects=(*library, *own))


@cache
def _step_errors() -> dict[str, _Array]:
    return step_error(Setting(0, None, Effort(), _model()))
