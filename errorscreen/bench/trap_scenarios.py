"""Traps: systems in which one mechanism is easily taken for another, or for a wrong parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.bench import trap_truths
from errorscreen.bench.scenarios import LEAST_SIZE, TRIES, Scenario, draw_kind, pick, surviving, too_small
from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.events import InputSignal
from errorscreen.exceptions import unknown_name
from errorscreen.parameters import Parameter
from errorscreen.simulators import ODESimulator

#: samples of each recording, and recordings to fit; one more is held out
_LENGTH, _FITTED = 400, 2
#: kinds of scenarios and their shares
TRAP_MIX = (("nothing", 0.25), ("effect", 0.75))
#: hidden parameters lie this far from the nominal values
_SPREAD = 0.25
#: steps of the fitted model between two samples
_STEPS = 4
#: steepest overflow of the library, which comes nearest to the spill at once of the truth
_SPILL = 19.0 * _STEPS / 0.25

_Array = NDArray[np.float64]
_Values = tuple[float, ...]


@dataclass(frozen=True)
class Hidden:
    """Mechanism of a trap: the right `effect`, and ``draw(rng)`` of values for `Trap.truth` and of the effect's own."""

    effect: str
    draw: Callable[[np.random.Generator], tuple[_Values, _Values]]


@dataclass(frozen=True)
class Trap:
    """A system and the mechanisms that may be hidden in it.

    ``inflow(rng)`` draws an input (L,), and ``truth(u, dt, *parameters, *values)`` of `trap_truths` gives the output,
    with the values `nothing` where nothing is hidden.
    """

    rhs: Callable[..., None]
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[tuple[str, float], ...]
    dt: float
    hold: bool
    initial: Mapping[str, float]
    inflow: Callable[[np.random.Generator], _Array]
    truth: Callable[..., _Array]
    nothing: _Values
    hidden: tuple[Hidden, ...]


def lag_rhs(t: Any, x: Any, u: Any, p: Any, dx: Any) -> None:
    """Velocity of a mass with viscous friction, or level of a leaking store."""
    dx[0] = p[0] * u[0] - p[1] * x[0]


def oscillator_rhs(t: Any, x: Any, u: Any, p: Any, dx: Any) -> None:
    """Position and velocity of a damped oscillator."""
    dx[0] = x[1]
    dx[1] = p[0] * u[0] - p[1] * x[1] - p[2] * x[0]


def tanks_rhs(t: Any, x: Any, u: Any, p: Any, dx: Any) -> None:
    """Levels of two tanks."""
    flow = p[0] * math.sqrt(max(x[0], 0.0))
    dx[0] = u[0] - flow
    dx[1] = flow - p[1] * math.sqrt(max(x[1], 0.0))


def steps(rng: np.random.Generator, low: float, high: float, shortest: int, longest: int) -> _Array:
    """Random steps of random length."""
    values: list[float] = []
    while len(values) < _LENGTH:
        values += [rng.uniform(low, high)] * int(rng.integers(shortest, longest))
    return np.array(values[:_LENGTH])


def waves(rng: np.random.Generator, dt: float) -> _Array:
    """Sum of three random sines that begins at zero."""
    time = dt * np.arange(_LENGTH)
    u = np.zeros(_LENGTH)
    for _ in range(3):
        size, frequency, phase = rng.uniform(0.4, 1.0), rng.uniform(0.05, 0.6), rng.uniform(0, 2 * np.pi)
        u += size * np.sin(2 * np.pi * frequency * time + phase)
    return np.asarray(u * np.minimum(time / 0.5, 1.0))


def _uniform(
    *ranges: tuple[float, float], kind: _Values = (), more: _Values = ()
) -> Callable[[np.random.Generator], tuple[_Values, _Values]]:
    """Draw values that truth and library share; the truth takes its `kind` before and `more` behind."""

    def draw(rng: np.random.Generator) -> tuple[_Values, _Values]:
        values = tuple(float(rng.uniform(*r)) for r in ranges)
        return (*kind, *values, *more), values

    return draw


def _saturation(rng: np.random.Generator) -> tuple[_Values, _Values]:
    low, high = -float(rng.uniform(0.3, 1.2)), float(rng.uniform(0.3, 1.2))
    return (3, 1.0, low, high), (1.0, low, high)


def _overflow(rng: np.random.Generator) -> tuple[_Values, _Values]:
    brim = float(rng.uniform(1.3, 2.6))
    return (1, brim, 0.0), (_SPILL, brim)


def _overflow_into(rng: np.random.Generator) -> tuple[_Values, _Values]:
    brim, share = float(rng.uniform(1.3, 2.6)), float(rng.uniform(0.6, 1.0))
    return (1, brim, share), (_SPILL, brim, share)


def _sensor(rng: np.random.Generator) -> tuple[_Values, _Values]:
    brim = float(rng.uniform(1.3, 2.6))
    return (2, brim, 0.0), (1.0, -0.5, brim)


_OSCILLATOR: dict[str, Any] = {
    "rhs": oscillator_rhs,
    "states": ("position", "velocity"),
    "inputs": ("command",),
    "outputs": ("position",),
    "parameters": (("b", 4.0), ("c", 1.2), ("k", 4.0)),
    "dt": 0.05,
    "hold": False,
    "initial": {},
    "inflow": lambda rng: waves(rng, 0.05),
    "truth": trap_truths.actuator,
    "nothing": (0, 1.0, 0.0, 0.0),
}
TRAPS: dict[str, Trap] = {
    "friction": Trap(
        lag_rhs, ("velocity",), ("force",), ("velocity",), (("b", 1.0), ("c", 0.8)), 0.05, True, {},
        lambda rng: steps(rng, -2.0, 2.0, 10, 40), trap_truths.mass, (0.0, 0.0, 1.0),
        (
            Hidden("velocity.coulomb(velocity)", _uniform((0.05, 0.6), more=(0.0, 1.0))),
            Hidden("velocity.stribeck(velocity)", _uniform((0.1, 0.4), (0.8, 2.5), (0.1, 0.6))),
        ),
    ),
    "play": Trap(
        **_OSCILLATOR,
        hidden=(
            Hidden("command.dead_band", _uniform((0.05, 0.6), (-0.2, 0.2), kind=(1,), more=(0.0,))),
            Hidden("command.backlash", _uniform((0.05, 0.6), kind=(2,), more=(0.0, 0.0))),
        ),
    ),
    "limits": Trap(
        **_OSCILLATOR,
        hidden=(
            Hidden("command.saturation", _saturation),
            Hidden("command.rate_limit", _uniform((0.3, 1.5), kind=(4,), more=(0.0, 0.0))),
        ),
    ),
    "late": Trap(
        **_OSCILLATOR,
        hidden=(
            Hidden("command.delay", _uniform((0.05, 0.6), kind=(5,), more=(0.0, 0.0))),
            Hidden("command.lag", _uniform((0.05, 0.8), kind=(6,), more=(0.0, 0.0))),
        ),
    ),
    "overflow": Trap(
        tanks_rhs, ("upper", "lower"), ("flow",), ("lower",), (("a", 0.8), ("b", 0.75)), 0.25, True,
        {"upper": 1.0, "lower": 1.0}, lambda rng: steps(rng, 0.2, 2.0, 15, 60), trap_truths.tanks, (0, 1.0, 0.0),
        (
            Hidden("upper.overflow(upper)", _overflow),
            Hidden("upper.overflow_into_lower", _overflow_into),
            Hidden("saturation_lower", _sensor),
        ),
    ),
    "relay": Trap(
        lag_rhs, ("level",), ("supply",), ("level",), (("a", 0.5), ("b", 0.25)), 0.1, True, {},
        lambda rng: steps(rng, 0.0, 2.0, 20, 80), trap_truths.relay, (0, 0.0, 0.0, 1.0),
        (
            Hidden("supply.relay_above(level)", _uniform((0.5, 1.0), (1.5, 2.5), (0.3, 2.0), kind=(1,))),
            Hidden("supply.relay_above(supply)", _uniform((0.5, 1.0), (0.8, 1.8), (0.3, 2.0), kind=(2,))),
        ),
    ),
}  # fmt: skip


def draw_trap_scenario(
    seed: Any,
    noise_db: float,
    *,
    kind: str | None = None,
    device: str | None = None,
    least_size: float = LEAST_SIZE,
) -> Scenario:
    """Draw a trap with one hidden mechanism or none, and record three events, the last of which is held out."""
    rng = np.random.default_rng(seed)
    drawn, name = draw_kind(rng, TRAP_MIX), str(rng.choice(list(TRAPS)))
    kind, name = kind or drawn, device or name
    if kind not in dict(TRAP_MIX):
        raise unknown_name(kind, dict(TRAP_MIX), kind="kind")
    if name not in TRAPS:
        raise unknown_name(name, TRAPS, kind="trap")
    trap = TRAPS[name]
    nominal = np.array([value for _, value in trap.parameters])
    theta = nominal * rng.uniform(1.0 - _SPREAD, 1.0 + _SPREAD, len(nominal))
    hidden = pick(rng, trap.hidden) if kind == "effect" else None
    for _ in range(TRIES):
        inputs = [trap.inflow(rng) for _ in range(_FITTED + 1)]
        values, own = hidden.draw(rng) if hidden else (trap.nothing, ())
        clean = [trap.truth(u, trap.dt, *theta, *values) for u in inputs]
        level = float(np.sqrt(np.mean([np.mean((y - y[0]) ** 2) for y in clean])))
        sigma = level * 10 ** (-noise_db / 20)
        observations, simulator = _record(trap, inputs, clean, sigma, rng)
        fitted, size = observations[:_FITTED], 0.0
        if hidden:
            plain = [trap.truth(u, trap.dt, *theta, *trap.nothing) for u in inputs[:_FITTED]]
            change = [(y - o)[None] for y, o in zip(clean, plain, strict=False)]
            size = surviving(simulator, theta, fitted, change)
            if size < least_size:
                continue
        right = (hidden.effect,) if hidden else ()
        return Scenario(
            kind, name, right, right, right[0].split(".")[0] if right else "", size, theta, simulator,
            tuple(fitted), tuple(observations[_FITTED:]), tuple(y[None] for y in clean[_FITTED:]), right,
            np.array(own, dtype=float),
        )  # fmt: skip
    raise too_small(f" in the trap {name!r}", least_size, noise_db, TRIES)


def _record(
    trap: Trap, inputs: Sequence[_Array], clean: Sequence[_Array], sigma: float, rng: np.random.Generator
) -> tuple[list[Observation], ODESimulator]:
    """Observations of noisy recordings, and the model to fit."""
    time = trap.dt * np.arange(_LENGTH)
    recordings = [
        Recording.from_signals(
            time,
            {trap.inputs[0]: u, trap.outputs[0]: y + sigma * rng.standard_normal(_LENGTH)},
            name=f"record {number + 1}",
            noise={trap.inputs[0]: sigma, trap.outputs[0]: sigma},
        )
        for number, (u, y) in enumerate(zip(inputs, clean, strict=True))
    ]
    simulator = ODESimulator(
        trap.rhs,
        trap.states,
        [Parameter(name, value, 0.5 * value, 1.5 * value) for name, value in trap.parameters],
        recordings[:_FITTED],
        inputs=trap.inputs,
        outputs=trap.outputs,
        initial=dict(trap.initial),
        step=trap.dt / _STEPS,
        interpolation="hold" if trap.hold else "linear",
        n_threads=1,
    )
    assert isinstance(simulator.event, InputSignal)
    return [simulator.observe(recording) for recording in recordings], simulator
