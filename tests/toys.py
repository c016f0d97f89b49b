"""Small simulators with closed-form responses that keep the Simulator contract."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.data.observations import Observation
from errorscreen.events import Event
from errorscreen.exceptions import InputError
from errorscreen.parameters import Parameter, ParameterSpace
from errorscreen.simulators.base import Responses, Simulator, Status

TIME = np.linspace(0.0, 4.0, 161)


@dataclass(frozen=True)
class Pulse(Event):
    """A rectangular input of some height and duration."""

    height: float = 1.0
    duration: float = np.inf


class Toy(Simulator):
    """A simulator from a function of (parameters by name, event) that returns (n, R, L).

    Rows for which `fails` is true have status DIVERGED and NaN. `calls` counts simulate calls and `rows`
    their rows, so that tests can check how often a fit simulates.
    """

    def __init__(
        self,
        parameters: ParameterSpace,
        response: Callable[[dict[str, NDArray[np.float64]], Event], NDArray[np.float64]],
        *,
        channels: tuple[str, ...] = ("x", "v"),
        event: Event | None = None,
        fails: Callable[[dict[str, NDArray[np.float64]]], NDArray[np.bool_]] | None = None,
    ) -> None:
        self.parameters = parameters
        self.channels = channels
        self.units = ("pu",) * len(channels)
        self.event = event or Pulse(TIME, start=0.5)
        self.response = response
        self.fails = fails
        self.calls = 0
        self.rows = 0

    def simulate(self, theta: ArrayLike, event: Event | None = None) -> Responses:
        event = event or self.event
        theta = self.parameters.validate(theta)
        self.calls += 1
        self.rows += len(theta)
        named = {name: theta[:, [j]] for j, name in enumerate(self.parameters.names)}
        failed = np.zeros(len(theta), dtype=bool) if self.fails is None else self.fails(named)[:, 0]
        values = self.response(named, event)
        values[failed] = np.nan
        status = np.where(failed, int(Status.DIVERGED), int(Status.OK))
        return Responses(values, status, event.time, self.channels)

    def observe(self, recording: Any) -> Observation:
        """Bring a (R, L) array that was sampled on this simulator's own event."""
        values = np.asarray(recording, dtype=float)
        if values.shape != (len(self.channels), len(self.event.time)):
            raise InputError(f"a recording of shape {values.shape}")
        return Observation(self.event, values, np.full(len(values), 0.01), self.channels, self.units)

    def record(
        self, changes: dict[str, float], noise: float, seed: int, event: Event | None = None
    ) -> Observation:
        """Measure a plant whose parameters differ from nominal by `changes`, with white noise."""
        event = event or self.event
        theta = self.parameters.embed(list(changes.values()), changes)
        values = self.simulate(theta, event).require_ok().values[0]
        values = values + noise * np.random.default_rng(seed).standard_normal(values.shape)
        return Observation(event, values, np.full(len(values), noise), self.channels, self.units)


def _step(t: NDArray[np.float64], omega: Any, zeta: Any) -> NDArray[np.float64]:
    """Position and velocity of x'' + 2ζω x' + ω² x = ω² after a unit step at t = 0, (n, 2, L), ζ < 1."""
    after = np.maximum(t, 0.0)
    damped = omega * np.sqrt(1.0 - zeta**2)
    decay = np.exp(-zeta * omega * after)
    position = 1.0 - decay * (np.cos(damped * after) + zeta * omega / damped * np.sin(damped * after))
    velocity = omega**2 / damped * decay * np.sin(damped * after)
    return np.stack([position, velocity], axis=1) * (t >= 0)


def _oscillate(p: dict[str, NDArray[np.float64]], event: Event) -> NDArray[np.float64]:
    assert isinstance(event, Pulse)
    omega, zeta = p["omega"], np.clip(p["zeta"], 1e-6, 0.999)
    out = _step(event.time - event.start, omega, zeta)
    if np.isfinite(event.duration):
        out = out - _step(event.time - event.start - event.duration, omega, zeta)
    return out * (event.height * p["gain"])[:, :, None] * np.array([1.0, 0.1])[:, None]


def _with_product(p: dict[str, NDArray[np.float64]], event: Event) -> NDArray[np.float64]:
    return _oscillate({**p, "gain": p["a"] * p["b"]}, event)


OMEGA = Parameter("omega", 6.0, 3.0, 12.0, unit="rad/s", description="natural frequency")
ZETA = Parameter("zeta", 0.1, 0.02, 0.3, description="damping ratio")


def oscillator(*, omega: Parameter = OMEGA, fail_above: float | None = None, **options: Any) -> Toy:
    """Damped oscillator; parameters omega, zeta, gain and idle, which has no effect.

    In a wide range of omega the squared error has many local minima, because oscillations that are out of
    step look alike. Rows with omega above `fail_above` fail.
    """
    space = ParameterSpace(
        [omega, ZETA, Parameter("gain", 1.0, 0.5, 2.0), Parameter("idle", 3.0, 2.0, 4.0, unit="s")]
    )
    fails = None if fail_above is None else (lambda p: p["omega"] > fail_above)
    return Toy(space, _oscillate, fails=fails, **options)


def product_oscillator() -> Toy:
    """Damped oscillator whose gain is a·b: only the product of a and b can be identified."""
    return Toy(
        ParameterSpace([OMEGA, Parameter("a", 2.0, 1.0, 4.0), ZETA, Parameter("b", 0.5, 0.25, 1.0)]),
        _with_product,
    )


def linear(matrix: NDArray[np.float64], half_range: float = 100.0) -> Toy:
    """Single channel y = matrix @ theta, parameters p0, p1, … with nominal value 1."""
    names = [f"p{j}" for j in range(matrix.shape[1])]
    space = ParameterSpace(Parameter(name, 1.0, 1.0 - half_range, 1.0 + half_range) for name in names)

    def response(p: dict[str, NDArray[np.float64]], event: Event) -> NDArray[np.float64]:
        theta = np.hstack([p[name] for name in names])
        return (theta @ matrix.T)[:, None, :]

    event = Event(np.arange(len(matrix), dtype=float), start=0.0)
    return Toy(space, response, channels=("y",), event=event)


def tone() -> Toy:
    """Single undamped oscillation gain·sin(omega t): a local minimum for every beat of omega."""
    space = ParameterSpace([Parameter("omega", 6.0, 3.0, 30.0), Parameter("gain", 1.0, 0.5, 2.0)])

    def response(p: dict[str, NDArray[np.float64]], event: Event) -> NDArray[np.float64]:
        return (p["gain"] * np.sin(p["omega"] * np.maximum(event.time - event.start, 0.0)))[:, None, :]

    return Toy(space, response, channels=("y",))
