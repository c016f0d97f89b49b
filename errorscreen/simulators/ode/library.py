"""What a user's model could lack: its anatomy, found by running it, and the generic effects that fit it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

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
from errorscreen.simulators.user_functions import selection

#: templates of dry friction
_DRY = ("coulomb", "stribeck")
#: points at which it is tried whether a derivative is another state
_TRIALS = 8

_Array = NDArray[np.float64]


class Model(Protocol):
    """What the library asks of an `ODESimulator`."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    signals: tuple[str, ...]
    channels: tuple[str, ...]
    constants: dict[str, float]
    event: InputSignal
    extensions: tuple[Effect, ...]
    interpolation: str
    parameters: ParameterSpace
    _functions: tuple[Any, ...]
    _n_own: int

    def acting(self, theta: _Array, event: InputSignal) -> _Array: ...  # noqa: D102
    def baseline(self) -> _Array: ...  # noqa: D102
    def pointer(self, function: Any) -> int: ...  # noqa: D102
    def run(  # noqa: D102
        self, theta: _Array, event: InputSignal, readout: Any, n_outputs: int, *, each_step: bool = False
    ) -> tuple[_Array, float, int]: ...


def library(
    simulator: Model,
    units: Mapping[str, str],
    measurements: Sequence[Observation],
    templates: Iterable[str] | None,
) -> tuple[Effect, ...]:
    """Generic effects of a model, with ranges from a run at its nominal parameters and from what was measured.

    Parameters
    ----------
    simulator : ODESimulator
        Complete but for its effects.
    units : mapping of str to str
        Of states, inputs, signals and outputs.
    measurements : sequence of Observation
    templates : iterable of str, optional

    Raises
    ------
    SimulationError
        If it cannot be simulated at its nominal parameters.
    """
    ranges, step = _ranges(simulator)
    for observation in measurements:
        seen = dict(zip(observation.channels, observation.values, strict=True))
        if isinstance(observation.event, InputSignal):
            seen |= {name: observation.event.signals[name] for name in simulator.inputs}
        for name, row in seen.items():
            if np.isfinite(row).any():
                low, high = ranges[name]
                ranges[name] = (min(low, float(np.nanmin(row))), max(high, float(np.nanmax(row))))
    derivatives = _rates(simulator, ranges)
    rates = {derivative: state for state, derivative in derivatives.items()}
    event = simulator.event
    anatomy = Anatomy(
        tuple(name for name in simulator.states if name not in derivatives),
        simulator.states, rates, simulator.inputs, simulator.signals, simulator.channels, units, ranges,
        float(event.time[-1] - event.time[0]), event.dt, step,
    )  # fmt: skip
    return generic_effects(anatomy, templates)


def effect_table(
    simulator: Model, theta: _Array, event: InputSignal
) -> tuple[NDArray[np.int64], _Array, _Array, int]:
    """Rows of the effects that were added, for `ode_kernel.integrate`.

    Parameters
    ----------
    simulator : ODESimulator
    theta : ndarray of shape (n, m)
    event : InputSignal

    Returns
    -------
    table : ndarray of shape (rows, 7), int
    owns : ndarray of shape (rows, 4)
    q : ndarray of shape (n, l)
        Parameters of the effects.
    extra : int
        Number of states that the effects have.
    """
    rows: list[list[int]] = []
    owns: list[list[float]] = []
    columns: list[int] = []
    extra = 0
    readable = (*simulator.states, *simulator.inputs, *simulator.signals)
    lists = {
        "equation": simulator.states,
        "input": simulator.inputs,
        "signal": simulator.signals,
        "output": simulator.channels,
    }
    # an event that begins with the record's last sample still leaves an unknown signal a window
    begin = min(event.start, event.time[-1] - event.dt)
    effects = [e for e in simulator.extensions if isinstance(e, GenericEffect)]
    # dry friction balances all that acts beside it, (G10)
    for effect in sorted(effects, key=lambda e: e.template in _DRY):
        row = {
            "template": NUMBERS[effect.template],
            "place": PLACES.index(effect.acts_on),
            "target": lists[effect.acts_on].index(effect.target),
            "reads": readable.index(effect.reads) if effect.reads else -1,
            "into": simulator.states.index(effect.into) if effect.into else -1,
            "state": len(simulator.states) + extra if effect.states else -1,
            "first": len(columns),
        }
        rows.append([row[name] for name in ROW])
        held = simulator.interpolation == "hold" and effect.acts_on == "input"
        constants = {
            "size": effect.size,
            "begin": begin,
            "rate": KNOTS**2 / (event.time[-1] - begin),
            "held": float(held),
        }
        owns.append([constants[name] for name in ROW_CONSTANTS])
        columns += [simulator.parameters.index(effect.local(p.name)) for p in effect.parameters]
        extra += len(effect.states)
    return (
        np.array(rows, dtype=np.int64).reshape(-1, len(ROW)),
        np.array(owns, dtype=float).reshape(-1, len(ROW_CONSTANTS)),
        np.ascontiguousarray(theta[:, columns]),
        extra,
    )


def states_of(simulator: Model, theta: _Array, event: InputSignal) -> dict[str, _Array]:
    """States on the time axis of an event (L,) by name, for one parameter vector (1, m)."""
    names = simulator.states
    readout = simulator.pointer(selection(tuple(range(len(names))), len(names)))
    out, _, _ = simulator.run(simulator.acting(theta, event), event, readout, len(names))
    return dict(zip(names, out[0], strict=True))


def _ranges(simulator: Model) -> tuple[dict[str, tuple[float, float]], float]:
    """Smallest and largest value of everything in a nominal run, and its step in seconds."""
    names = (*simulator.states, *simulator.inputs, *simulator.signals)
    readout = simulator.pointer(selection(tuple(range(len(names))), len(simulator.states)))
    nominal = simulator.parameters.nominal[None]
    out, h, _ = simulator.run(nominal, simulator.event, readout, len(names), each_step=True)
    if not np.isfinite(out).all():
        last = int(np.argmin(np.isfinite(out[0]).all(axis=0)))
        raise SimulationError(
            f"the model diverges at its nominal parameters, {simulator.event.time[0] + h * last:.4g} s into "
            f"{simulator.event.name!r}: check the signs in rhs, the nominal values and the initial state, or give a "
            "smaller step."
        )
    found = {name: (float(row.min()), float(row.max())) for name, row in zip(names, out[0], strict=True)}
    for name, row in zip(simulator.states, out[0], strict=False):
        slope = np.gradient(row, h)
        found[f"d_{name}"] = (float(slope.min()), float(slope.max()))
    responses = simulator.baseline()
    found |= {
        name: (float(row.min()), float(row.max()))
        for name, row in zip(simulator.channels, responses, strict=True)
    }
    return found, h


def _rates(simulator: Model, ranges: Mapping[str, tuple[float, float]]) -> dict[str, str]:
    """States that are by definition the derivative of another one, by that one: such an equation lacks nothing."""
    rng = np.random.default_rng(0)
    rhs = simulator._functions[0]
    others = (*simulator.inputs, *simulator.signals)
    p = np.r_[simulator.parameters.nominal[: simulator._n_own], list(simulator.constants.values())]
    equal = np.ones((len(simulator.states), len(simulator.states)), dtype=bool)
    tried = 0
    for _ in range(_TRIALS):
        x, u = _drawn(rng, simulator.states, ranges), _drawn(rng, others, ranges)
        t, dx = float(rng.uniform(*simulator.event.time[[0, -1]])), np.full(len(x), np.nan)
        try:
            with np.errstate(all="ignore"):
                rhs(t, x.copy(), u, p * rng.uniform(0.9, 1.1, len(p)), dx)
        except Exception:
            continue
        tried += 1
        equal &= dx[:, None] == x[None, :]
    if not tried:
        return {}
    return {
        simulator.states[i]: simulator.states[j] for i, j in zip(*np.nonzero(equal), strict=True) if i != j
    }


def _drawn(
    rng: np.random.Generator, names: Sequence[str], ranges: Mapping[str, tuple[float, float]]
) -> _Array:
    """Values inside the ranges."""
    return np.array([rng.uniform(low, high + 1e-9) for low, high in (ranges[name] for name in names)])
