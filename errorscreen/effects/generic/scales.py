"""Ranges of the parameters of generic effects, from the scales of their model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from errorscreen.effects.base import strength, value
from errorscreen.effects.generic.base import Ranges
from errorscreen.parameters import Parameter

#: bounds of a coefficient in multiples of the value that doubles its equation in a nominal run
_WIDE = 50.0
#: smallest strength that matters, as a share of the largest
_LEAST = 1e-3
#: largest rate of a spill times the step: the level rests above the brim by a twentieth of a step's inflow
_STEEPEST = 20.0
#: templates whose strength is drawn evenly: shares, and an offset of either sign
_LINEAR = ("offset", "saturation", "relay_above", "relay_below")


@dataclass(frozen=True)
class Anatomy:
    """Facts about a model that the library needs.

    Parameters
    ----------
    equations : tuple of str
        States whose equations can lack something.
    states : tuple of str
    rates : mapping of str to str
        State that is the derivative of another one, and that one.
    inputs, signals, outputs : tuple of str
    units : mapping of str to str
        Of all of them.
    ranges : mapping of str to (float, float)
        Of all of them, and of derivatives (`Ranges`), in a typical run.
    duration, dt, step : float
        Of that run: its length, the distance of its samples and the step of the integration, in seconds.
    """

    equations: tuple[str, ...]
    states: tuple[str, ...]
    rates: Mapping[str, str]
    inputs: tuple[str, ...]
    signals: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]
    ranges: Ranges
    duration: float
    dt: float
    step: float

    def size(self, name: str) -> float:
        """Largest magnitude of a quantity."""
        return max(abs(bound) for bound in self.ranges[name])

    def span(self, name: str) -> float:
        """Largest less smallest value of a quantity."""
        low, high = self.ranges[name]
        return high - low


@dataclass(frozen=True)
class Scales:
    """Scales of one template at one place: quantity, signal, title of the parameters, and whether a spill arrives."""

    anatomy: Anatomy
    kind: str
    target: str
    signal: str
    of: str
    into: bool

    @property
    def effort(self) -> float:
        """Size of the quantity that the template changes: a derivative, or the span of a signal."""
        at = self.anatomy
        return at.size(f"d_{self.target}") if self.kind == "equation" else at.span(self.target)

    @property
    def unit(self) -> str:
        """Unit of the signal that it depends on."""
        return self.anatomy.units.get(self.signal, "")

    @property
    def rate(self) -> str:
        """Unit of the quantity that it changes."""
        unit = self.anatomy.units.get(self.target, "")
        return per(unit, "s") if self.kind == "equation" else unit

    def parameters(self, template: str) -> tuple[Parameter, ...]:
        """Parameters of a template, the strength first."""
        return _PARAMETERS[template](self)

    def smallest(self, template: str) -> dict[str, float]:
        """Smallest strength that matters, see `Effect.smallest`."""
        if template in _LINEAR:
            return {}
        first = self.parameters(template)[0]
        least = self.anatomy.step if template in ("lag", "delay") else _LEAST * first.upper
        return {first.name: min(least, 0.1 * first.upper)}

    def positive(self, name: str, upper: float, unit: str, text: str, typical: float = 0.03) -> Parameter:
        """Strength of one sign."""
        return strength(name, typical * upper, upper, unit, self.of, name, f"{text}; 0: none")

    def coefficient(self, order: int, lower: float = -1.0, name: str = "a") -> Parameter:
        """Of a term of some order: a nominal run may be far from the truth, so the bounds are wide."""
        size = self.effort / self.anatomy.size(self.signal) ** order
        bounds = lower * _WIDE * size, _WIDE * size
        unit, text = per(self.rate, self.unit, order), "coefficient; 0: none"
        return Parameter(name, 0.1 * size, *bounds, unit, self.of, name, text, scale=4.0 * size)

    def between(
        self, name: str, low: float, high: float, unit: str, symbol: str, text: str, typical: float | None = None
    ) -> Parameter:  # fmt: skip
        """Any other parameter, typically in the middle of its range, or of its logarithm where it is positive."""
        middle = math.sqrt(low * high) if low > 0 else 0.5 * (low + high)
        return value(name, middle if typical is None else typical, low, high, unit, self.of, symbol, text)


def _stribeck(at: Scales) -> tuple[Parameter, ...]:
    size = at.anatomy.size(at.signal)
    return (
        at.positive("F", at.effort, at.rate, "force in motion"),
        at.between("r", 0.0, 3.0, "", "r", "additional force at rest, as a share", 0.5),
        at.between(
            "s0", 0.01 * size, size, at.unit, "s_0", "signal at which that share has fallen to a third"
        ),
    )


def _magnetic_saturation(at: Scales) -> tuple[Parameter, ...]:
    size = at.anatomy.size(at.signal)
    return (
        at.coefficient(2, 0.0, "B"),
        at.between("A", 0.0, size, at.unit, "A", "size of the signal at which it begins", 0.7 * size),
    )


def _offset(at: Scales) -> tuple[Parameter, ...]:
    size = 0.5 * at.effort
    return (strength("b", 0.1 * size, size, at.rate, at.of, "b", "size; 0: none", -size),)


def _forcing(at: Scales) -> tuple[Parameter, ...]:
    duration = at.anatomy.duration
    highest = max(0.2 / at.anatomy.dt, 4.0 / duration)
    return (
        at.positive("A", at.effort, at.rate, "amplitude"),
        at.between("f", 1.0 / duration, highest, "Hz", "f", "frequency", 2.0 / duration),
        at.between("phi", -math.pi, math.pi, "rad", "φ", "phase at t = 0"),
    )


def _hysteresis(at: Scales) -> tuple[Parameter, ...]:
    model = at.anatomy
    position = model.rates.get(at.signal)
    way = model.span(position) if position else 0.05 * model.duration * model.size(at.signal)
    unit = model.units.get(position, "") if position else f"{at.unit} s".strip()
    # a rise within half a step could not be integrated
    shortest = min(max(0.003 * way, 0.5 * model.size(at.signal) * model.step), 0.05 * way)
    return (
        at.positive("F", 2.0 * at.effort, at.rate, "force"),
        at.between("y", shortest, way, unit, "y", "distance over which it rises", 0.1 * way),
    )


def _overflow(at: Scales) -> tuple[Parameter, ...]:
    low, high = at.anatomy.ranges[at.signal]
    most = _STEEPEST / at.anatomy.step
    share = (at.between("r", 0.0, 2.0, "", "r", "share that arrives", 0.5),) if at.into else ()
    return (
        strength("k", 0.3 * most, most, "1/s", at.of, "k", "rate of the outflow; 0: none"),
        at.between("c", low, high, at.unit, "c", "height of the brim", low + 0.7 * (high - low)),
        *share,
    )


def _dead_band(at: Scales) -> tuple[Parameter, ...]:
    low, high = at.anatomy.ranges[at.signal]
    return (
        at.positive("b", 0.5 * (high - low), at.unit, "half width"),
        at.between("c", low, high, at.unit, "c", "centre", 0.5 * (low + high)),
    )


def _saturation(at: Scales) -> tuple[Parameter, ...]:
    low, high = at.anatomy.ranges[at.signal]
    margin = 0.1 * (high - low)  # a nominal run may go far beyond limits that the recordings keep
    return (
        strength("k", 1.0, 1.0, "", at.of, "k", "share of the excess that is cut off; 0: none"),
        at.between("l", low - margin, high - margin, at.unit, "l", "lower limit", low + margin),
        at.between("u", low + margin, high + margin, at.unit, "u", "upper limit", high - margin),
    )


def _relay(at: Scales) -> tuple[Parameter, ...]:
    low, high = at.anatomy.ranges[at.signal]
    step = at.anatomy.step
    longest = max(0.3 * at.anatomy.duration, 4.0 * step)
    return (
        strength("a", 1.0, 1.0, "", at.of, "a", "share that is taken away; 0: none"),
        at.between("theta", low, high, at.unit, "θ", "threshold", 0.5 * (low + high)),
        at.between("T", step, longest, "s", "T", "timer"),
    )


def _slope(at: Scales) -> tuple[Parameter, ...]:
    slowest = 0.3 * at.anatomy.duration / at.anatomy.span(at.signal)
    return (at.positive("k", slowest, per("s", at.unit), "time for one unit", 0.9),)


_PARAMETERS: Mapping[str, Callable[[Scales], tuple[Parameter, ...]]] = {
    "viscous": lambda at: (at.coefficient(1, 0.0, "d"),),
    "quadratic": lambda at: (at.coefficient(2),),
    "cubic": lambda at: (at.coefficient(3),),
    "drag": lambda at: (at.coefficient(2, 0.0),),
    "magnetic_saturation": _magnetic_saturation,
    "coulomb": lambda at: (at.positive("F", at.effort, at.rate, "force"),),
    "stribeck": _stribeck,
    "offset": _offset,
    "forcing": _forcing,
    "hysteresis": _hysteresis,
    "overflow": _overflow,
    "dead_band": _dead_band,
    "saturation": _saturation,
    "rate_limit": _slope,
    "lag": lambda at: (at.positive("T", 0.1 * at.anatomy.duration, "s", "time constant"),),
    "delay": lambda at: (at.positive("d", 0.1 * at.anatomy.duration, "s", "delay"),),
    "backlash": lambda at: (at.positive("b", 0.5 * at.anatomy.span(at.signal), at.unit, "half width"),),
    "relay_above": _relay,
    "relay_below": _relay,
}


def per(unit: str, by: str, order: int = 1) -> str:
    """Unit of one quantity for each unit of another, or its square or cube.

    >>> per("m/s", "s"), per("N", "m", 3), per("", "s")
    ('m/s/s', 'N/m³', '1/s')
    """
    if not by:
        return unit
    power = " ²³"[order - 1].strip()
    compound = any(mark in by for mark in "/ ·") or (power and len(by) > 1)
    return f"{unit or '1'}/{f'({by})' if compound else by}{power}"
