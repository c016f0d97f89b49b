"""Hidden scenarios of the modified 39-bus system: three plants with 40 deviating parameters, and something missing."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
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
    LEAST_SIZE,
    Scenario,
    Setup,
    draw_kind,
    draw_scenario,
    pick,
)
from errorscreen.cases import ieee39_events, load_ieee39
from errorscreen.data.observations import Observation
from errorscreen.effects import Effect
from errorscreen.events import GridEvent
from errorscreen.models import DEVICES
from errorscreen.simulators import PowerSystemSimulator, Simulator

_Array = NDArray[np.float64]


def draw_grid_scenario(
    seed: Any,
    noise_db: float,
    *,
    kind: str | None = None,
    device: str | None = None,
    least_size: float = LEAST_SIZE,
    largest_size: float | None = None,
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
    largest_size : float, optional
        Where given, strengths are scaled to sizes drawn between the two, evenly by order of magnitude.
    """
    rng = np.random.default_rng(seed)
    drawn = draw_kind(rng)
    kind = kind or drawn
    setup = _setup()
    lower, upper = setup.truth.parameters.bounds.T
    theta = rng.uniform(lower, upper)
    return draw_scenario(setup, rng, kind, device, theta, noise_db, least_size, largest_size)


@cache
def _setup() -> Setup:
    named = ieee39_events()
    events = [named[name] for name in FIT_EVENTS] + [e for name, e in named.items() if name not in FIT_EVENTS]
    return Setup(_truth(), events, len(FIT_EVENTS), 1, _draw_effects, partial(_record, events))


def _record(
    events: Sequence[GridEvent], responses: Sequence[_Array], noise_db: float, seed: int
) -> tuple[list[Observation], Simulator]:
    """Add noise to each channel."""
    rng = np.random.default_rng(seed)
    model = _model()
    observations = []
    for event, response in zip(events, responses, strict=True):
        noise = noise_of(response, event, noise_db)
        measured = response + noise[:, None] * rng.standard_normal(response.shape)
        extra = _step_errors()[event.name]
        observations.append(Observation(event, measured, noise, model.channels, model.units, extra=extra))
    return observations, model


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
