"""Assembles a device and its effects to one model for the engine."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.effects import Effect, effects_of
from errorscreen.effects.base import Values
from errorscreen.engine.stages import Call, Equations, Model, reads_of, stage, writes_of
from errorscreen.events import Event
from errorscreen.exceptions import unknown_name
from errorscreen.models.device import Device
from errorscreen.power import elimination
from errorscreen.simulators.base import Status

#: initial states, constants, rows with an equilibrium, all values by name, step, and steps between samples
Prepared = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_], Values, float, int]
#: resistance and reactance between a device and the voltage that drives it
_IMPEDANCE = ("R_grid", "X_grid")


def library_of(device: Device) -> tuple[Effect, ...]:
    """Effects of a device: those of the library, in the words of its file, and its own."""
    known = effects_of(device.name, *device.tags)
    return (*(effect.in_words(device.words) for effect in known), *device.effects)


@stage("channel")
def channel(signal: Any) -> Any:
    """Perfect measurement: measurement effects act later."""
    return (signal,)


def assemble(
    device: Device,
    effects: Iterable[Effect],
    behind_impedance: bool = False,
    point: Equations | None = None,
    further: Iterable[str] = (),
) -> Model:
    """Model of a device at a terminal, with effects compiled in, each behind the equations of its port, in order.

    With `behind_impedance` the inputs ``Er``, ``Ei`` are the voltage behind ``R_grid`` + j ``X_grid``: (G1) to (G5) of
    `errorscreen.power.elimination` for one unit. Equations of a `point` give its outputs from quantities of the model
    and constants of their own. `further` channels of the device are recorded, too. `InputError` for a port or
    quantity that the device does not have.
    """
    effects = check_ports(device, effects)
    inputs, states = device.inputs, device.states
    own = tuple(_call(function) for function in device.stages)
    constants = (
        *device.candidates.names,
        *device.constant_values(in_grid=behind_impedance),
        *device.setpoints,
    )
    calls: list[Call] = []
    if behind_impedance:
        inputs, own = ("Er", "Ei", *inputs[2:]), (*map(_call, device.interface.terminal), *own[1:])
        states = (*states, *(name for name, _ in device.interface.states))
        constants = (*constants, *_IMPEDANCE, "size")
        calls += [_call(function) for function in device.interface.source]
        calls += _behind_impedance(device)
    for call in own:
        calls.append(call)
        calls.extend(effect_call(effect) for name in call.writes for effect in effects if effect.port == name)
    measured: tuple[str, ...] = device.outputs
    if point is not None:
        known = {*inputs, *states, *constants, *(name for call in calls for name in call.writes)}
        constants = (*constants, *(name for name in reads_of(point) if name not in known))
        calls.append(replace(_call(point), recorded=True))
        measured = writes_of(point)
    channels = {
        **dict(zip(device.outputs, measured, strict=True)),
        **{n: device.recordable[n] for n in further},
    }
    for name, output in channels.items():
        calls.append(Call(channel, (output,), (f"channel.{name}",), recorded=True))
    return Model(
        name=device.name,
        inputs=inputs,
        states=(*states, *effect_states(effects)),
        constants=(*constants, *effect_constants(effects)),
        calls=tuple(calls),
        outputs=tuple(f"channel.{name}" for name in channels),
        gated=gates(effects),
    )


def _call(function: Equations | Call) -> Call:
    return function if isinstance(function, Call) else Call(function, reads_of(function), writes_of(function))


def _behind_impedance(device: Device) -> tuple[Call, ...]:
    """Current of a device behind an impedance, and the voltage of its terminal."""
    source, current = ("Er", "Ei"), ("Ir", "Ii")
    terminal = Call(elimination.add_one, (*source, *current, *_IMPEDANCE), ("Vr", "Vi"))
    if device.interface.kind == "solved":
        return (terminal,)
    solved = {
        "current": Call(elimination.injected, ("Cr", "Ci", "size"), current),
        "norton": Call(
            elimination.norton, ("Cr", "Ci", "Xpp", "size", *source, *_IMPEDANCE), (*current, "hr", "hi")
        ),
        "rotor": Call(
            elimination.machine_current,
            (
                *source,
                *_IMPEDANCE,
                *(
                    device.interface.names.get(name, name)
                    for name in reads_of(elimination.machine_current)[4:]
                ),
            ),
            writes_of(elimination.machine_current),
        ),
    }[device.interface.kind]
    return solved, terminal


def check_ports(device: Device, effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Effects inside a device; an unknown port raises `InputError`."""
    found = inside(effects)
    for effect in found:
        for port in (effect.port, *effect.beside):
            if port not in device.ports:
                where = f"effect {effect.name!r} on device {device.name!r}"
                raise unknown_name(port, device.ports, kind="port", where=where)
    return found


def inside(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Effects that are compiled into a model."""
    return tuple(effect for effect in effects if effect.kind in ("mechanism", "latent"))


def effect_call(effect: Effect, qualify: Callable[[str], str] = lambda name: name) -> Call:
    """Bind the equations of an effect to the names of the model; `qualify` names a quantity of its device there."""
    own = set(effect.own)
    reads = tuple(
        qualify(effect.port) if name == "value" else effect.local(name) if name in own else qualify(name)
        for name in reads_of(effect.equations)
    )
    written = [f"d_{effect.local(s)}" for s in effect.states]
    ports = (qualify(port) for port in (effect.port, *effect.beside))
    return Call(effect.equations, reads, (*ports, *written), effect.local(effect.strength.name))


def effect_states(effects: Iterable[Effect]) -> tuple[str, ...]:
    """Names of all states of effects in the model."""
    return tuple(e.local(s) for e in effects for s in e.states)


def effect_constants(effects: Iterable[Effect]) -> tuple[str, ...]:
    """Names of all parameters and derived constants of effects in the model."""
    return tuple(e.local(n) for e in effects for n in (*(p.name for p in e.parameters), *e.derived))


def gates(effects: Iterable[Effect]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Strength of each effect, and the states that exist only while it is not zero."""
    return tuple((e.local(e.strength.name), tuple(e.local(s) for s in e.states)) for e in effects if e.states)


def switched_off(effects: Iterable[Effect]) -> Values:
    """Quantities of effects that are compiled in but off, each of shape ()."""
    values = {e.local(n): np.array(0.0) for e in effects for n in (*e.derived, *e.states)}
    values |= {e.local(p.name): np.array(p.nominal) for e in effects for p in e.parameters}
    return values | {e.local(e.strength.name): np.array(0.0) for e in effects}


def changed_constants(effect: Effect, values: Values) -> Values:
    """Constants that an effect changes, by name in the model; rows in which it is off keep theirs."""
    on = values[effect.local(effect.strength.name)] != 0
    found = effect.equations(*(values[effect.local(p.name)] for p in effect.parameters))
    changed = {}
    for constant, new in zip((effect.port, *effect.beside), found, strict=True):
        name = next(one for one in values if one.rpartition(".")[2] == constant)
        changed[name] = np.where(on, new, values[name])
    return changed


def starting(
    model: Model, values: Values, feasible: NDArray[np.bool_], n: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Initial states (n, n_states), constants (n, n_constants), and rows with an equilibrium among those `feasible`."""
    x0, constants = (
        _columns([values[name] for name in names], n) for names in (model.states, model.constants)
    )
    return x0, constants, feasible & np.isfinite(x0).all(axis=1) & np.isfinite(constants).all(axis=1)


def _columns(values: Sequence[NDArray[np.float64]], n: int) -> NDArray[np.float64]:
    arrays = [np.asarray(value) for value in values]
    out = np.empty((n, len(arrays)))
    out[:] = [0.0 if value.ndim else value.item() for value in arrays]
    for column, value in enumerate(arrays):
        if value.ndim:
            out[:, column] = value
    return out


def start_effects(
    effects: Iterable[Effect], values: Values, own: Callable[[Effect], Values], h: float
) -> Values:
    """Initial states and constants, by name in the model, of effects that are on in some simulation.

    `values` are the effects' parameters, `own` the quantities of their device at its equilibrium, (n,) or ().
    """
    start: Values = {}
    for effect in effects:
        strength = values[effect.local(effect.strength.name)]
        if not strength.any():
            continue
        given = {p.name: values[effect.local(p.name)] for p in effect.parameters}
        found, zero = effect.initialise({**own(effect), **given}, h), np.zeros_like(strength)
        start |= {effect.local(n): found.get(n, 0.0) + zero for n in (*effect.derived, *effect.states)}
    return start


def step_of(event: Event, longest: float) -> tuple[float, int]:
    """Step h in seconds, and steps between two instants of an event, of which h is a part."""
    every = max(1, int(np.ceil(event.dt / longest - 1e-9)))
    return event.dt / every, every


def statuses(out: NDArray[np.float64], most: float, start: Any = True) -> NDArray[np.int64]:
    """Set rows (n, R, L) that are not finite or leave ±`most` to NaN; status of each row, which may `start` or not."""
    with np.errstate(invalid="ignore"):
        well = (out.max(axis=(1, 2)) < most) & (out.min(axis=(1, 2)) > -most)
    out[~well] = np.nan
    ended = np.where(well, Status.OK, Status.DIVERGED)
    return np.where(start, ended, Status.NO_EQUILIBRIUM).astype(np.int64)


def measured(
    out: NDArray[np.float64], channels: tuple[str, ...], effects: Iterable[Effect], values: Values, h: float
) -> NDArray[np.float64]:
    """Simulated channels (n, R, L) after measurement effects, whose parameters (n,) `values` holds by name."""
    out = out.copy()
    for effect in effects:
        on = values[effect.local(effect.strength.name)] != 0
        parameters = [values[effect.local(p.name)][on] for p in effect.parameters]
        for r, channel in enumerate(channels):
            if effect.distorts(channel):
                out[on, r] = effect.equations(out[on, r], h, *parameters)
    return out
