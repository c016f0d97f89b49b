"""Generic effects that fit a user's model, and the table of those that were added."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.observations import Observation
from errorscreen.effects.base import Effect
from errorscreen.effects.generic import Anatomy, GenericEffect, generic_effects
from errorscreen.effects.generic.base import NUMBERS, PLACES
from errorscreen.effects.latent_input import KNOTS
from errorscreen.events import InputSignal
from errorscreen.exceptions import SimulationError
from errorscreen.parameters import ParameterSpace
from errorscreen.simulators.ode.effects import ROW, ROW_CONSTANTS

#: templates of dry friction
_DRY = ("coulomb", "stribeck")
#: points at which a derivative is compared with the other states
_TRIALS = 8

_Array = NDArray[np.float64]
_Ranges = dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Quantities:
    """Names of the quantities of a user's model."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    signals: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def readable(self) -> tuple[str, ...]:
        """States, inputs and internal signals, in the order in which effects count them."""
        return (*self.states, *self.inputs, *self.signals)


def library(
    names: Quantities,
    units: Mapping[str, str],
    event: InputSignal,
    nominal: Mapping[str, _Array],
    step: float,
    baseline: Callable[[], _Array],
    rhs: Callable[..., Any],
    p: _Array,
    measurements: Sequence[Observation],
    templates: Iterable[str] | None,
) -> tuple[Effect, ...]:
    """Generic effects of a model, with ranges from its nominal run and the measurements.

    `nominal` holds the nominal course of each state, input and signal, every `step` seconds; `baseline` the nominal
    outputs (R, L).
    """
    ranges = _ranges(names, nominal, step, event)
    ranges |= {name: _range(row) for name, row in zip(names.outputs, baseline(), strict=True)}
    for observation in measurements:
        seen = dict(zip(observation.channels, observation.values, strict=True))
        if isinstance(observation.event, InputSignal):
            seen |= {name: observation.event.signals[name] for name in names.inputs}
        for name, row in seen.items():
            if np.isfinite(row).any():
                low, high = ranges[name]
                ranges[name] = (min(low, float(np.nanmin(row))), max(high, float(np.nanmax(row))))
    integrals = _integrals(names, ranges, event, rhs, p)
    anatomy = Anatomy(
        tuple(name for name in names.states if name not in integrals),
        names.states, {rate: state for state, rate in integrals.items()}, names.inputs, names.signals,
        names.outputs, units, ranges, float(event.time[-1] - event.time[0]), event.dt, step,
    )  # fmt: skip
    return generic_effects(anatomy, templates)


def effect_table(
    names: Quantities, effects: Iterable[Effect], parameters: ParameterSpace, event: InputSignal, held: bool
) -> tuple[NDArray[np.int64], _Array, list[int], int]:
    """Table for `errorscreen.simulators.ode.kernel.integrate` with a row for each generic effect.

    Returned are the table (rows, 7), its constants (rows, 4), the columns of theta with the effects' parameters, and
    the number of states of the effects. `held` tells whether inputs are held between samples.
    """
    rows: list[list[int]] = []
    owns: list[list[float]] = []
    columns: list[int] = []
    extra = 0
    lists = {
        "equation": names.states,
        "input": names.inputs,
        "signal": names.signals,
        "output": names.outputs,
    }
    # an event that begins with the record's last sample still leaves an unknown signal a window
    begin = min(event.start, event.time[-1] - event.dt)
    generic = [e for e in effects if isinstance(e, GenericEffect)]
    # dry friction balances all that acts beside it, (G10)
    for effect in sorted(generic, key=lambda e: e.template in _DRY):
        row = {
            "template": NUMBERS[effect.template],
            "place": PLACES.index(effect.acts_on),
            "target": lists[effect.acts_on].index(effect.target),
            "reads": names.readable.index(effect.reads) if effect.reads else -1,
            "into": names.states.index(effect.into) if effect.into else -1,
            "state": len(names.states) + extra if effect.states else -1,
            "first": len(columns),
        }
        constants = {
            "size": effect.size,
            "begin": begin,
            "rate": KNOTS**2 / (event.time[-1] - begin),
            "held": float(held and effect.acts_on == "input"),
        }
        rows.append([row[name] for name in ROW])
        owns.append([constants[name] for name in ROW_CONSTANTS])
        columns += [parameters.index(effect.local(p.name)) for p in effect.parameters]
        extra += len(effect.states)
    return (
        np.array(rows, dtype=np.int64).reshape(-1, len(ROW)),
        np.array(owns, dtype=float).reshape(-1, len(ROW_CONSTANTS)),
        columns,
        extra,
    )


def _ranges(names: Quantities, nominal: Mapping[str, _Array], step: float, event: InputSignal) -> _Ranges:
    """Smallest and largest value of each quantity, and of each state's derivative ``d_...``, in the nominal run."""
    finite = np.isfinite([nominal[name] for name in names.readable]).all(axis=0)
    if not finite.all():
        raise SimulationError(
            f"the model diverges at its nominal parameters, {event.time[0] + step * int(np.argmin(finite)):.4g} s "
            f"into {event.name!r}: check the signs in rhs, the nominal values and the initial state, or give a "
            "smaller step."
        )
    courses = {**nominal, **{f"d_{name}": np.gradient(nominal[name], step) for name in names.states}}
    return {name: _range(row) for name, row in courses.items()}


def _range(row: _Array) -> tuple[float, float]:
    return float(row.min()), float(row.max())


def _integrals(
    names: Quantities,
    ranges: _Ranges,
    event: InputSignal,
    rhs: Callable[..., Any],
    p: _Array,
) -> dict[str, str]:
    """States whose derivative is by definition another state, by that one: such an equation lacks nothing."""
    rng = np.random.default_rng(0)
    others = (*names.inputs, *names.signals)
    equal = np.ones((len(names.states), len(names.states)), dtype=bool)
    tried = 0
    for _ in range(_TRIALS):
        x, u = _drawn(rng, names.states, ranges), _drawn(rng, others, ranges)
        t, dx = float(rng.uniform(*event.time[[0, -1]])), np.full(len(x), np.nan)
        try:
            with np.errstate(all="ignore"):
                rhs(t, x.copy(), u, p * rng.uniform(0.9, 1.1, len(p)), dx)
        except Exception:
            continue
        tried += 1
        equal &= dx[:, None] == x[None, :]
    if not tried:
        return {}
    return {names.states[i]: names.states[j] for i, j in zip(*np.nonzero(equal), strict=True) if i != j}


def _drawn(rng: np.random.Generator, names: Sequence[str], ranges: _Ranges) -> _Array:
    return np.array([rng.uniform(low, high + 1e-9) for low, high in (ranges[name] for name in names)])
