"""Hidden scenarios of the modified 39-bus system: three plants with 40 deviating parameters and hidden effects."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.bench.hidden_effects import OTHER_FORMS, OUTSIDE
from errorscreen.bench.paper_draw import FIT_EVENTS, STEP, TRUE_STEP, Effort, Setting, noise_of, step_error
from errorscreen.bench.scenarios import Scenario, Setup, draw_kind, draw_scenario, pick
from errorscreen.cases import ieee39_events, load_ieee39
from errorscreen.data.observations import Observation
from errorscreen.effects import Effect
from errorscreen.events import GridEvent
from errorscreen.simulators import PowerSystemSimulator, Simulator

_Array = NDArray[np.float64]


def draw_grid_scenario(
    seed: Any, noise_db: float, *, kind: str | None = None, device: str | None = None, **sizes: Any
) -> Scenario:
    """Draw one scenario with the case study's three events to fit and all others to judge on."""
    rng = np.random.default_rng(seed)
    drawn = draw_kind(rng)
    kind = kind or drawn
    setup = _setup()
    lower, upper = setup.truth.parameters.bounds.T
    theta = rng.uniform(lower, upper)
    return draw_scenario(setup, rng, kind, device, theta, noise_db, **sizes)


@cache
def _setup() -> Setup:
    named = ieee39_events()
    events = [named[name] for name in FIT_EVENTS] + [e for name, e in named.items() if name not in FIT_EVENTS]
    return Setup(_truth(), events, len(FIT_EVENTS), 1, _draw_effects, partial(_record, events))


def _record(
    events: Sequence[GridEvent], responses: Sequence[_Array], noise_db: float, seed: int
) -> tuple[list[Observation], Simulator]:
    """Add noise to each channel of the responses."""
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
    """Draw hidden effects and the names that are right."""
    device = device or str(rng.choice(list(OTHER_FORMS)))
    mechanisms = [e for e in _model().effects if e.kind == "mechanism"]
    of_device = [e for e in mechanisms if e.device == device]
    if kind == "other form":
        effect, name = pick(rng, OTHER_FORMS[device])
        return (effect.at(device),), (f"{device}.{name}",)
    if kind == "outside":
        return (pick(rng, OUTSIDE[device]).at(device),), ()
    if kind == "nothing":
        chosen: tuple[Effect, ...] = ()
    elif kind == "two effects":
        first = pick(rng, of_device)
        chosen = (first, pick(rng, [e for e in mechanisms if e is not first]))
    else:
        faults = [e for e in _model().effects if e.kind in ("measurement", "event")]
        chosen = (pick(rng, of_device if kind == "effect" else faults),)
    return chosen, tuple(e.name for e in chosen)


@cache
def _model() -> PowerSystemSimulator:
    """Model to fit."""
    return load_ieee39(step=STEP, n_threads=1)


@cache
def _truth() -> PowerSystemSimulator:
    """Simulator of hidden truths, with all effects of the library and of `hidden_effects`."""
    own = [e.at(d) for d in OTHER_FORMS for e in (*(e for e, _ in OTHER_FORMS[d]), *OUTSIDE[d])]
    library = [e for e in _model().effects if e.kind != "latent"]
    return load_ieee39(step=TRUE_STEP, n_threads=1, effects=(*library, *own))


@cache
def _step_errors() -> dict[str, _Array]:
    return step_error(Setting(0, None, Effort(), _model()))
