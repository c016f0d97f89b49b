"""Every generic effect that makes sense for a model: templates times places, with ranges from its own scales."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from errorscreen.effects.base import Effect, nothing, strength, value
from errorscreen.effects.generic.base import TEMPLATES, GenericEffect, Ranges
from errorscreen.effects.latent_input import latent_input
from errorscreen.effects.measurement import measurement_effects
from errorscreen.exceptions import unknown_name
from errorscreen.parameters import Parameter

_FRICTION = "Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30, 1994"
#: title, formula, source, description and what each template is confused with; s is what it depends on, v its quantity
TEXTS: dict[str, tuple[str, str, str, str, tuple[str, ...]]] = {
    "viscous": (
        "Linear drag or viscous friction", "− d s", "Stokes; Batchelor, An Introduction to Fluid Dynamics, section 4.9",
        "A resistance grows in proportion to {s} and opposes it.", ("quadratic drag", "Coulomb friction"),
    ),
    "quadratic": (
        "Quadratic term", "+ a s²", "Taylor's theorem, second order",
        "The model is linear in {s}, but what it describes is not symmetrical: the error grows with the square of {s} "
        "and has the same sign on both sides.", ("an offset", "quadratic drag, where {s} has one sign"),
    ),
    "cubic": (
        "Cubic term", "+ a s³", "Duffing's spring; Taylor's theorem, third order",
        "The model is linear in {s}, but what it describes hardens or softens: the error grows with the cube of {s}.",
        ("saturation", "quadratic drag"),
    ),
    "drag": (
        "Quadratic drag", "− a |s| s", "Batchelor, An Introduction to Fluid Dynamics, section 5.11",
        "A resistance grows with the square of {s} and always opposes it, as in air, water or a turbulent pipe.",
        ("a cubic term", "more viscous friction"),
    ),
    "coulomb": (
        "Coulomb friction", "− F sgn(s)", _FRICTION,
        "A force of constant size opposes {s}: motion ends in finite time, and small forces move nothing.",
        ("more viscous friction", "a dead band", "Stribeck friction"),
    ),
    "stribeck": (
        "Stribeck friction", "− F (1 + r exp(−(s/s0)²)) sgn(s)", _FRICTION,
        "A force opposes {s} that is larger while it begins to move than afterwards: stick and slip.",
        ("Coulomb friction",),
    ),
    "offset": (
        "Constant offset", "+ b", "equation (G6)",
        "Something constant acts that the model does not know: a load, a leak, a bias.",
        ("another operating point", "an offset of the measurement"),
    ),
    "forcing": (
        "Periodic forcing", "+ A sin(2π f t + φ)", "equation (G7)",
        "Something swings by itself, whatever the inputs do.", ("a badly damped mode",),
    ),
    "hysteresis": (
        "Hysteresis (Bouc–Wen)", "− F z, dz/dt = (s/y)(1 − ½(1 + sgn(s z)) z²)",
        "Ismail, Ikhouane, Rodellar, Arch. Comput. Methods Eng. 16, 2009",
        "A force depends on the way and not only on the position: it rises over the distance y after each reversal of "
        "{s} and then stays.", ("Coulomb friction", "backlash"),
    ),
    "overflow": (
        "Overflow", "− k max(s − c, 0)", "Schoukens and Noël, IFAC-PapersOnLine 50, 2017 (cascaded tanks)",
        "{s} cannot rise much beyond a brim at c: what comes in beyond that flows away{into}.",
        ("saturation of the measurement", "saturation of the input"),
    ),
    "dead_band": (
        "Dead band", "v − clip(v − c, −b, b)", "IEEE Std 421.5, annex on dead bands",
        "Small changes of {v} about c have no effect.", ("backlash", "Coulomb friction"),
    ),
    "saturation": (
        "Saturation", "v + k (clip(v, l, u) − v)", "Khalil, Nonlinear Systems, 3rd ed., section 1.2",
        "{v} does not go beyond limits.", ("rate limit", "a cubic term"),
    ),
    "rate_limit": (
        "Rate limit", "|dv/dt| ≤ 1/k", "Khalil, Nonlinear Systems, 3rd ed., section 1.2",
        "{v} follows slow changes, but fast ones only with a constant slope.", ("lag", "saturation"),
    ),
    "lag": (
        "Lag", "v / (1 + s T)", "Franklin, Powell, Workman, Digital Control of Dynamic Systems, section 6.3.2",
        "{v} is smoothed: steps arrive rounded.", ("delay", "rate limit", "slower parameters"),
    ),
    "delay": (
        "Delay", "v(t − d)", "equation (G15)",
        "{v} arrives late and otherwise unchanged.", ("lag", "clock skew of a measurement"),
    ),
    "backlash": (
        "Backlash", "play of half width b", "Nordin and Gutman, Automatica 38, 2002",
        "After each reversal {v} moves for a while without effect.", ("dead band", "hysteresis", "lag"),
    ),
    "relay_above": (
        "Relay with timer", "v (1 − a) once s > θ for T", "equation (G17)",
        "A protection takes {v} away once {s} has been above a threshold for some time, until it is below again.",
        ("saturation", "another threshold with another timer"),
    ),
    "relay_below": (
        "Relay with timer", "v (1 − a) once s < θ for T", "equation (G17)",
        "A protection takes {v} away once {s} has been below a threshold for some time, until it is above again.",
        ("saturation", "another threshold with another timer"),
    ),
}  # fmt: skip
#: templates that a state equation can lack, one for each signal that it could depend on
_OF_STATES = ("cubic", "quadratic", "drag")
#: the same for rates of change
_OF_RATES = ("viscous", "coulomb", "stribeck", "hysteresis")
_OF_EQUATIONS = ("offset", "forcing")
#: templates for inputs and internal signals
_OF_SIGNALS = (
    "offset", "quadratic", "cubic", "dead_band", "saturation", "rate_limit", "lag", "delay", "backlash",
)  # fmt: skip
#: templates for measured channels, beside those of `measurement_effects`
_OF_OUTPUTS = ("quadratic", "cubic", "dead_band", "saturation", "rate_limit", "backlash")


#: bounds of a coefficient in multiples of what would double its equation in a nominal run
_WIDE = 50.0


@dataclass(frozen=True)
class Anatomy:
    """What the library has to know about a model.

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


def generic_effects(anatomy: Anatomy, templates: Iterable[str] | None = None) -> tuple[Effect, ...]:
    """Every template at every place where it makes sense.

    A quantity that rests in the typical run has no scale; nothing is offered for it.

    Parameters
    ----------
    anatomy : Anatomy
    templates : iterable of str, optional
        Only these; all where not given.

    Returns
    -------
    tuple of Effect
        Structural ones, then those of the measurement, then unknown signals.

    Raises
    ------
    InputError
        If a template is unknown.
    """
    chosen = list(TEXTS) if templates is None else list(templates)
    for name in chosen:
        if name not in TEXTS:
            raise unknown_name(name, TEXTS, kind="template")
    found = [e for e in (*_structural(anatomy), *_measured(anatomy)) if e.template in chosen]
    errors: list[Effect] = []
    for name in _moving(anatomy, anatomy.outputs):
        errors += measurement_effects(
            [name],
            unit=anatomy.units[name],
            size=anatomy.size(name),
            late=min(0.05 * anatomy.duration, 50 * anatomy.dt),
        )
    return (*found, *errors, *_latent(anatomy))


def _moving(anatomy: Anatomy, names: Iterable[str]) -> list[str]:
    return [name for name in names if name in anatomy.ranges and anatomy.span(name) > 0]


def _structural(anatomy: Anatomy) -> Iterator[GenericEffect]:
    sources = _moving(anatomy, anatomy.states)
    rates = [name for name in sources if name in anatomy.rates] or sources
    for target in anatomy.equations:
        if not anatomy.size(f"d_{target}") > 0:
            continue
        for template in _OF_STATES:
            yield from (_effect(anatomy, template, "equation", target, s) for s in sources)
        for template in _OF_RATES:
            yield from (_effect(anatomy, template, "equation", target, s) for s in rates)
        for template in _OF_EQUATIONS:
            yield _effect(anatomy, template, "equation", target)
        if target in sources and target not in anatomy.rates:
            yield _effect(anatomy, "overflow", "equation", target, target)
            for into in (s for s in anatomy.equations if s != target and s not in anatomy.rates):
                yield replace(
                    _effect(anatomy, "overflow", "equation", target, target, into=into),
                    name=f"{target}.overflow_into_{into}",
                    into=into,
                )
    for kind, names in (("input", anatomy.inputs), ("signal", anatomy.signals)):
        for target in _moving(anatomy, names):
            for template in _OF_SIGNALS:
                yield _effect(anatomy, template, kind, target)
            for template in ("relay_above", "relay_below"):
                yield from (_effect(anatomy, template, kind, target, s) for s in (*sources, target))


def _measured(anatomy: Anatomy) -> Iterator[GenericEffect]:
    for target in _moving(anatomy, anatomy.outputs):
        for template in _OF_OUTPUTS:
            yield _effect(anatomy, template, "output", target)


def _latent(anatomy: Anatomy) -> Iterator[GenericEffect]:
    """Unknown signals, for places at which something enters that no effect explains."""
    at = [("equation", name, anatomy.size(f"d_{name}")) for name in anatomy.equations]
    for kind, names in (("input", anatomy.inputs), ("signal", anatomy.signals)):
        at += [(kind, name, anatomy.size(name)) for name in _moving(anatomy, names)]
    for kind, target, size in at:
        if size > 0:
            unit = anatomy.units[target]
            made = latent_input(_port(kind, target), size, _per(unit, "s") if kind == "equation" else unit)
            changed = {"name": f"latent_{target}", "states": (), "derived": (), "initialise": nothing}
            yield GenericEffect(**{**vars(made), **changed}, template="latent", acts_on=kind, target=target)


def _port(kind: str, target: str) -> str:
    return f"channel.{target}" if kind == "output" else f"{kind} {target}" if kind != "equation" else (
        f"equation of {target}"
    )  # fmt: skip


def _effect(
    anatomy: Anatomy, template: str, kind: str, target: str, reads: str = "", into: str = ""
) -> GenericEffect:
    """One template at one place."""
    title, formula, source, description, confused = TEXTS[template]
    signal = reads or target
    where = {
        "equation": f"in the equation of {target}",
        "input": f"of the input {target}",
        "signal": f"of the signal {target}",
        "output": f"of the measured {target}",
    }[kind]
    on = f" on {reads}" if kind == "equation" and reads else f" (watching {reads})" if reads else ""
    words = {"s": signal, "v": target, "into": f" into {into}" if into else ""}
    name = f"{template}_{target}" if kind == "output" else f"{target}.{template}"
    parameters, smallest = _parameters(anatomy, template, kind, target, signal, title, bool(into))
    return GenericEffect(
        name=name if not reads else f"{name}({reads})",
        title=f"{title}{on}{',' if on and kind == 'equation' else ''} {where}{words['into']}",
        port=_port(kind, target),
        equations=TEMPLATES[template],
        parameters=parameters,
        states=("z",) if template == "hysteresis" else (),
        kind="measurement" if kind == "output" else "mechanism",
        description=description.format(**words),
        formula=formula,
        source=source,
        confused_with=tuple(text.format(**words) for text in confused),
        minima=8 if template == "forcing" else 6 if template.startswith("relay") else 1,
        smallest=smallest,
        template=template,
        acts_on=kind,
        target=target,
        reads=reads if kind == "equation" or reads != target else "",
        size=anatomy.size(signal),
    )


def _parameters(
    anatomy: Anatomy, template: str, kind: str, target: str, signal: str, of: str, into: bool
) -> tuple[tuple[Parameter, ...], dict[str, float]]:
    """Parameters of a template with ranges from the scales, and the smallest strength that matters."""
    D = anatomy.size(f"d_{target}") if kind == "equation" else anatomy.span(target)
    S, span = anatomy.size(signal), anatomy.span(signal)
    low, high = anatomy.ranges[signal]
    middle, T = 0.5 * (low + high), anatomy.duration
    unit, time = anatomy.units.get(signal, ""), "s"
    rate = _per(anatomy.units.get(target, ""), "s") if kind == "equation" else anatomy.units.get(target, "")

    def positive(name: str, upper: float, unit: str, text: str, typical: float = 0.03) -> Parameter:
        return strength(name, typical * upper, upper, unit, of, name, f"{text}; 0: none")

    def signed(name: str, size: float, unit: str, text: str) -> Parameter:
        return strength(name, 0.1 * size, size, unit, of, name, f"{text}; 0: none", -size)

    def coefficient(order: int, lower: float = -1.0, name: str = "a") -> Parameter:
        """Of a term of some order: a nominal run may be far from the truth, so the bounds are wide."""
        size = D / S**order
        return Parameter(
            name, 0.1 * size, lower * _WIDE * size, _WIDE * size, _per(rate, unit, order), of, name,
            "coefficient; 0: none", scale=4.0 * size,
        )  # fmt: skip

    made: Sequence[Parameter]
    match template:
        case "quadratic":
            made = [coefficient(2)]
        case "cubic":
            made = [coefficient(3)]
        case "drag":
            made = [coefficient(2, 0.0)]
        case "viscous":
            made = [coefficient(1, 0.0, "d")]
        case "coulomb":
            made = [positive("F", D, rate, "force")]
        case "stribeck":
            made = [
                positive("F", D, rate, "force in motion"),
                value("r", 0.5, 0.0, 3.0, "", of, "r", "by how much more it is at rest"),
                value("s0", 0.1 * S, 0.01 * S, S, unit, of, "s_0", "where it has fallen to a third"),
            ]
        case "offset":
            made = [signed("b", 0.5 * D, rate, "size")]
        case "forcing":
            made = [
                positive("A", D, rate, "amplitude"),
                value("f", 5 / T, 1 / T, 0.2 / anatomy.dt, "Hz", of, "f", "frequency"),
                value("phi", 0.0, -math.pi, math.pi, "rad", of, "φ", "phase at t = 0"),
            ]
        case "hysteresis":
            way = anatomy.span(anatomy.rates[signal]) if signal in anatomy.rates else 0.05 * T * S
            made = [
                positive("F", 2 * D, rate, "force"),
                value("y", 0.1 * way, 0.003 * way, way, "", of, "y", "distance over which it rises"),
            ]
        case "overflow":
            most = 2.0 / anatomy.step  # inside the stability region of the integrator, 2.8
            made = [
                strength("k", 0.3 * most, most, "1/s", of, "k", "how fast it flows away; 0: none"),
                value(
                    "c", 0.3 * low + 0.7 * high, low + 0.2 * span, high, unit, of, "c", "height of the brim"
                ),
            ]
            if into:
                made.append(value("r", 0.5, 0.0, 2.0, "", of, "r", "share that arrives"))
        case "dead_band":
            made = [
                positive("b", 0.5 * span, unit, "half width"),
                value("c", middle, low, high, unit, of, "c", "centre"),
            ]
        case "saturation":
            made = [
                strength("k", 1.0, 1.0, "", of, "k", "share of the excess that is cut off; 0: none"),
                value("l", low + 0.1 * span, low - 0.1 * span, middle, unit, of, "l", "lower limit"),
                value("u", high - 0.1 * span, middle, high + 0.1 * span, unit, of, "u", "upper limit"),
            ]
        case "rate_limit":
            made = [positive("k", 0.3 * T / span, _per("s", unit), "time for one unit", 0.9)]
        case "lag":
            made = [positive("T", 0.1 * T, time, "time constant")]
        case "delay":
            made = [positive("d", 0.1 * T, time, "delay")]
        case "backlash":
            made = [positive("b", 0.5 * span, unit, "half width")]
        case _:
            made = [
                strength("a", 1.0, 1.0, "", of, "a", "share that is taken away; 0: none"),
                value("theta", middle, low, high, unit, of, "θ", "threshold"),
                value("T", 0.03 * T, anatomy.step, 0.3 * T, time, of, "T", "timer"),
            ]
    first = made[0]
    if template in ("offset", "saturation", "overflow", "relay_above", "relay_below"):
        return tuple(made), {}
    least = anatomy.step if template in ("lag", "delay") else 1e-3 * first.upper
    return tuple(made), {first.name: min(least, 0.1 * first.upper)}


def _per(unit: str, by: str, order: int = 1) -> str:
    """Unit of one quantity for each unit of another, or its square or cube."""
    if not by:
        return unit
    return f"{unit or '1'}/{by if order == 1 else f'({by})' + ' ²³'[order - 1]}"
