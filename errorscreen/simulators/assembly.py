"""Joins a device and the effects of the library to one model for the engine."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from errorscreen.effects.base import Effect
from errorscreen.engine.stages import Call, Equations, Model, reads_of, stage, writes_of
from errorscreen.exceptions import InputError, unknown_name
from errorscreen.power.device import Device


@stage("channel")
def channel(signal: Any) -> Any:
    """Perfect measurement: what is recorded, before measurement effects, is the signal itself."""
    return (signal,)


def assemble(device: Device, effects: Iterable[Effect]) -> Model:
    """Model of a device at a terminal, with every effect compiled in and switched by its strength.

    Effects on the same port act one after the other in the order given, directly behind the equations that write
    the port.

    Parameters
    ----------
    device : Device
    effects : iterable of Effect

    Returns
    -------
    Model
        Its constants are the candidates, constants and set-points of the device, then the parameters and derived
        constants of each effect, prefixed by the effect's name; its outputs are the measured channels.

    Raises
    ------
    InputError
        If an effect acts on a port, or reads a quantity, that the device does not have, or acts on a measured
        channel without being sampled.
    """
    effects = tuple(effects)
    calls: list[Call] = []

    def add(
        function: Equations, reads: tuple[str, ...], writes: tuple[str, ...], each_step: bool = False
    ) -> None:
        calls.append(Call(function, reads, writes, each_step=each_step))
        calls.extend(_effect_call(effect) for name in writes for effect in effects if effect.port == name)

    for function in device.stages:
        add(function, reads_of(function), writes_of(function))
    for name in device.outputs:
        add(channel, (name,), (f"channel.{name}",), each_step=True)

    ports = (*device.ports, *(f"channel.{name}" for name in device.outputs))
    for effect in effects:
        if effect.port not in ports:
            raise unknown_name(
                effect.port, ports, kind="port", where=f"effect {effect.name!r} on device {device.name!r}"
            )
        if effect.port.startswith("channel.") and not effect.sampled:
            raise InputError(
                f"it acts on the measured channel {effect.port!r}, which exists once a step, but is not sampled",
                where=f"effect {effect.name!r}",
                allowed="sampled=True for a channel",
            )
    constants = (*device.candidates.names, *(c.name for c in device.constants), *device.setpoints)
    return Model(
        name=device.name,
        inputs=device.inputs,
        states=(*device.states, *(e.local(s) for e in effects for s in e.states)),
        constants=(
            *constants,
            *(e.local(name) for e in effects for name in (*(p.name for p in e.parameters), *e.derived)),
        ),
        calls=tuple(calls),
        outputs=tuple(f"channel.{name}" for name in device.outputs),
        memories=tuple(e.local(m) for e in effects for m in e.memories),
        gated=tuple(
            (e.local(e.strength.name), tuple(e.local(s) for s in e.states)) for e in effects if e.states
        ),
    )


def _effect_call(effect: Effect) -> Call:
    """Bind the equations of an effect to the names of the model."""
    own = set(effect.own)
    reads = tuple(
        effect.port if name == "value" else effect.local(name) if name in own else name
        for name in reads_of(effect.equations)
    )
    written = (
        [effect.local(m) for m in effect.memories]
        if effect.sampled
        else [f"d_{effect.local(s)}" for s in effect.states]
    )
    return Call(
        effect.equations, reads, (effect.port, *written), effect.local(effect.strength.name), effect.sampled
    )
