"""Traps: systems in which a mechanism is easily taken for another, or for a parameter that is wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.bench import trap_truths
from errorscreen.bench.scenarios import LEAST_SIZE, TRIES, Scenario, draw_kind, surviving
from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.events import InputSignal
from errorscreen.exceptions import InputError, unknown_name
from errorscreen.parameters import Parameter
from errorscreen.simulators import ODESimulator

#: samples of each record, and records that are fitted before the one that is kept back
_LENGTH, _FITTED = 400, 2
#: kinds of scenarios and their shares
TRAP_MIX = (("nothing", 0.25), ("effect", 0.75))
#: hidden parameters lie this far from the nominal values
_SPREAD = 0.25
#: steps of the fitted model between two samples
_STEPS = 4

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Hidden:
    """One mechanism of a trap.

    Parameters
    ----------
    effect : str
        Name of the library's effect that is right.
    draw : callable
        ``draw(rng)`` gives its values: those of the truth, and those of the library's effect.
    """

    effect: str
    draw: Callable[[np.random.Generator], tuple[tuple[float, ...], tuple[float, ...]]]


@dataclass(frozen=True)
class Trap:
    """One system with the mechanisms that are hidden in it.

    Parameters
    ----------
    rhs : callable
        Of the model that is fitted.
    states, inputs, outputs : tuple of str
    parameters : tuple of (str, float)
        With their nominal values.
    dt : float
        Seconds between samples.
    hold : bool
        Whether inputs are held between samples.
    initial : mapping of str to float
    truth : callable
        ``truth(u, dt, theta, which, values)`` with the number of what is hidden, -1 for nothing.
    inflow : callable
        ``inflow(rng)`` draws an input (L,).
    hidden : tuple of Hidden
    """

    rhs: Callable[..., None]
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[tuple[str, float], ...]
    dt: float
    hold: bool
    initial: Mapping[str, float]
    truth: Callable[..., _Array]
    inflow: Callable[[np.random.Generator], _Array]
    hidden: tuple[Hidden, ...]


def mass_rhs(t: Any, x: Any, u: Any, p: Any, dx: Any) -> None:
    """Velocity of a mass with viscous friction."""
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


def store_rhs(t: Any, x: Any, u: Any, p: Any, dx: Any) -> None:
    """Level of a leaking store."""
    dx[0] = p[0] * u[0] - p[1] * x[0]


def steps(rng: np.random.Generator, low: float, high: float, shortest: int, longest: int) -> _Array:
    """Random steps of random length."""
    values: list[float] = []
    while len(values) < _LENGTH:
        values += [rng.uniform(low, high)] * int(rng.integers(shortest, longest))
    return np.array(values[:_LENGTH])


def waves(rng: np.random.Generator, dt: float) -> _Array:
    """Sum of three sines of random frequency and phase, that begins at zero."""
    time = dt * np.arange(_LENGTH)
    u = np.zeros(_LENGTH)
    for _ in range(3):
        u += rng.uniform(0.4, 1.0) * np.sin(
            2 * np.pi * rng.uniform(0.05, 0.6) * time + rng.uniform(0, 2 * np.pi)
        )
    return np.asarray(u * np.minimum(time / 0.5, 1.0))


def _mass_truth(u: _Array, dt: float, theta: _Array, which: int, values: Sequence[float]) -> _Array:
    F, r, s = (0.0, 0.0, 1.0) if which < 0 else (*values, 0.0, 1.0)[:3]
    return np.asarray(trap_truths.mass(u, dt, theta[0], theta[1], F, r, s))


def _actuator_truth(kinds: Sequence[int]) -> Callable[..., _Array]:
    def truth(u: _Array, dt: float, theta: _Array, which: int, values: Sequence[float]) -> _Array:
        a, low, high = (1.0, 0.0, 0.0) if which < 0 else (*values, 0.0, 0.0)[:3]
        kind = 0 if which < 0 else kinds[which]
        return np.asarray(trap_truths.actuator(u, dt, theta[0], theta[1], theta[2], kind, a, low, high))

    return truth


def _tanks_truth(u: _Array, dt: float, theta: _Array, which: int, values: Sequence[float]) -> _Array:
    kind, brim, share = (0, 1.0, 0.0) if which < 0 else (1 if which < 2 else 2, *values)
    return np.asarray(trap_truths.tanks(u, dt, theta[0], theta[1], kind, brim, share))


def _relay_truth(u: _Array, dt: float, theta: _Array, which: int, values: Sequence[float]) -> _Array:
    share, threshold, timer = (0.0, 0.0, 1.0) if which < 0 else values
    return np.asarray(trap_truths.relay(u, dt, theta[0], theta[1], which + 1, share, threshold, timer))


def _same(*ranges: tuple[float, float]) -> Callable[[np.random.Generator], Any]:
    """Draw values that truth and library share."""

    def draw(rng: np.random.Generator) -> Any:
        values = tuple(float(rng.uniform(*r)) for r in ranges)
        return values, values

    return draw


def _saturated(rng: np.random.Generator) -> Any:
    low, high = -float(rng.uniform(0.3, 1.2)), float(rng.uniform(0.3, 1.2))
    return (1.0, low, high), (1.0, low, high)


def _brim(into: bool, sensor: bool = False) -> Callable[[np.random.Generator], Any]:
    def draw(rng: np.random.Generator) -> Any:
        brim = float(rng.uniform(1.3, 2.6))
        if sensor:
            return (brim, 0.0), (1.0, -0.5, brim)
        share = float(rng.uniform(0.6, 1.0)) if into else 0.0
        # a spill at once is the steepest that the library allows
        k = 19.0 * _STEPS / 0.25
        return (brim, share), (k, brim, share) if into else (k, brim)

    return draw


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
}
TRAPS: dict[str, Trap] = {
    "friction": Trap(
        mass_rhs, ("velocity",), ("force",), ("velocity",), (("b", 1.0), ("c", 0.8)), 0.05, True, {}, _mass_truth,
        lambda rng: steps(rng, -2.0, 2.0, 10, 40),
        (
            Hidden("velocity.coulomb(velocity)", _same((0.05, 0.6))),
            Hidden("velocity.stribeck(velocity)", _same((0.1, 0.4), (0.8, 2.5), (0.1, 0.6))),
        ),
    ),
    "play": Trap(
        **_OSCILLATOR, truth=_actuator_truth((1, 2)),
        hidden=(
            Hidden("command.dead_band", _same((0.05, 0.6), (-0.2, 0.2))),
            Hidden("command.backlash", _same((0.05, 0.6))),
        ),
    ),
    "limits": Trap(
        **_OSCILLATOR, truth=_actuator_truth((3, 4)),
        hidden=(Hidden("command.saturation", _saturated), Hidden("command.rate_limit", _same((0.3, 1.5)))),
    ),
    "late": Trap(
        **_OSCILLATOR, truth=_actuator_truth((5, 6)),
        hidden=(Hidden("command.delay", _same((0.05, 0.6))), Hidden("command.lag", _same((0.05, 0.8)))),
    ),
    "overflow": Trap(
        tanks_rhs, ("upper", "lower"), ("flow",), ("lower",), (("a", 0.8), ("b", 0.75)), 0.25, True,
        {"upper": 1.0, "lower": 1.0}, _tanks_truth, lambda rng: steps(rng, 0.2, 2.0, 15, 60),
        (
            Hidden("upper.overflow(upper)", _brim(False)),
            Hidden("upper.overflow_into_lower", _brim(True)),
            Hidden("saturation_lower", _brim(False, sensor=True)),
        ),
    ),
    "relay": Trap(
        store_rhs, ("level",), ("supply",), ("level",), (("a", 0.5), ("b", 0.25)), 0.1, True, {}, _relay_truth,
        lambda rng: steps(rng, 0.0, 2.0, 20, 80),
        (
            Hidden("supply.relay_above(level)", _same((0.5, 1.0), (1.5, 2.5), (0.3, 2.0))),
            Hidden("supply.relay_above(supply)", _same((0.5, 1.0), (0.8, 1.8), (0.3, 2.0))),
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
    """Draw a trap, hide one of its mechanisms or none, and record three events, the last of which is kept back.

    Parameters
    ----------
    seed : int, SeedSequence or Generator
    noise_db : float
        Level of the output's deviation from its first value over that of the noise, both rms.
    kind : {"nothing", "effect"}, optional
        Drawn where not given.
    device : str, optional
        Key of `TRAPS`; drawn where not given.
    least_size : float
        Effects whose size is less are drawn again, and inputs with them.
    """
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
    which = int(rng.integers(len(trap.hidden))) if kind == "effect" else -1
    for _ in range(TRIES):
        inputs = [trap.inflow(rng) for _ in range(_FITTED + 1)]
        values, own = trap.hidden[which].draw(rng) if which >= 0 else ((), ())
        clean = [trap.truth(u, trap.dt, theta, which, values) for u in inputs]
        plain = [trap.truth(u, trap.dt, theta, -1, ()) for u in inputs]
        sigma = _level(clean) * 10 ** (-noise_db / 20)
        observations, simulator = _record(trap, inputs, clean, sigma, rng)
        size = 0.0
        if which >= 0:
            change = [(y - o)[None] for y, o in zip(clean, plain, strict=True)][:_FITTED]
            size = surviving(simulator, theta, observations[:_FITTED], change)
            if size < least_size:
                continue
        right = (trap.hidden[which].effect,) if which >= 0 else ()
        return Scenario(
            kind, name, right, right, right[0].split(".")[0] if right else "", size, theta, simulator,
            tuple(observations[:_FITTED]), tuple(observations[_FITTED:]),
            tuple(y[None] for y in clean[_FITTED:]), right, np.array(own, dtype=float),
        )  # fmt: skip
    raise InputError(
        f"none of {TRIES} effects drawn in the trap {name!r} is at least {least_size:g} times the noise at "
        f"{noise_db:g} dB",
        allowed="less noise, or a smaller least size",
    )


def _level(responses: Sequence[_Array]) -> float:
    """Rms deviation from the first value."""
    return float(np.sqrt(np.mean([np.mean((y - y[0]) ** 2) for y in responses])))


def _record(
    trap: Trap, inputs: Sequence[_Array], clean: Sequence[_Array], sigma: float, rng: np.random.Generator
) -> tuple[list[Observation], ODESimulator]:
    """Noisy recordings, and the model that is fitted to the first of them."""
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
