"""All generic effects of a model: templates times places, with ranges from the model's own scales."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from errorscreen.effects.base import Effect, nothing
from errorscreen.effects.generic.base import TEMPLATES, GenericEffect
from errorscreen.effects.generic.scales import Anatomy, Scales, per
from errorscreen.effects.latent_input import latent_input
from errorscreen.effects.measurement import measurement_effects
from errorscreen.exceptions import unknown_name

_FRICTION = "Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30, 1994"
#: title, formula, source, description and look-alikes of each template; s is the signal it depends on, v its quantity
TEXTS: dict[str, tuple[str, str, str, str, tuple[str, ...]]] = {
    "viscous": (
        "Linear drag or viscous friction", "− d s", "Stokes; Batchelor, An Introduction to Fluid Dynamics, section 4.9",
        "A resistance grows in proportion to {s} and opposes it.", ("quadratic drag", "Coulomb friction"),
    ),
    "quadratic": (
        "Quadratic term", "+ a s²", "Taylor's theorem, second order",
        "The model is linear in {s}, but the plant is not symmetrical: the error grows with the square of {s} "
        "and has the same sign on both sides.", ("an offset", "quadratic drag, where {s} has one sign"),
    ),
    "cubic": (
        "Cubic term", "+ a s³", "Duffing's spring; Taylor's theorem, third order",
        "The model is linear in {s}, but the plant hardens or softens: the error grows with the cube of {s}.",
        ("saturation", "quadratic drag"),
    ),
    "drag": (
        "Quadratic drag", "− a |s| s", "Batchelor, An Introduction to Fluid Dynamics, section 5.11",
        "A resistance grows with the square of {s} and always opposes it, as in air, water or a turbulent pipe.",
        ("a cubic term", "more viscous friction"),
    ),
    "magnetic_saturation": (
        "Magnetic saturation", "− B max(|s| − A, 0)² sgn(s)", "Kundur, Power System Stability and Control, section 3.8",
        "Iron saturates where the flux {s} is beyond A: it needs more magnetising current than the model says.",
        ("saturation of the input", "a cubic term"),
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
        "Constant offset", "+ b", "Taylor's theorem, order zero",
        "Something constant acts that the model does not know: a load, a leak, a bias.",
        ("another operating point", "an offset of the measurement"),
    ),
    "forcing": (
        "Periodic forcing", "+ A sin(2π f t + φ)", "definition: one harmonic",
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
        "{s} cannot rise much beyond a brim at c: the excess flows away{into}.",
        ("saturation of the measurement", "saturation of the input"),
    ),
    "dead_band": (
        "Dead band", "v − clip(v − c, −b, b)", "Gelb and Vander Velde, Multiple-Input Describing Functions, 1968",
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
        "Delay", "v(t − d)", "definition: a dead time",
        "{v} arrives late and otherwise unchanged.", ("lag", "clock skew of a measurement"),
    ),
    "backlash": (
        "Backlash", "play of half width b", "Nordin and Gutman, Automatica 38, 2002",
        "After each reversal {v} moves for a while without effect.", ("dead band", "hysteresis", "lag"),
    ),
    "relay_above": (
        "Relay with timer", "v (1 − a) once s > θ for T", "IEEE Std C37.2, function 59 with a definite time",
        "A protection takes {v} away once {s} has been above a threshold for some time, until it is below again.",
        ("saturation", "another threshold with another timer"),
    ),
    "relay_below": (
        "Relay with timer", "v (1 − a) once s < θ for T", "IEEE Std C37.2, function 27 with a definite time",
        "A protection takes {v} away once {s} has been below a threshold for some time, until it is above again.",
        ("saturation", "another threshold with another timer"),
    ),
}  # fmt: skip
#: templates that a state equation can lack, one for each signal that it could depend on
_OF_STATES = ("cubic", "quadratic")
#: those that resist motion: for rates of change, where the model has any, because nothing drags at a position
_OF_RATES = ("viscous", "drag", "coulomb", "stribeck", "hysteresis")
_OF_EQUATIONS = ("offset", "forcing")
#: templates for inputs and internal signals
_OF_SIGNALS = (
    "offset", "quadratic", "cubic", "dead_band", "saturation", "rate_limit", "lag", "delay", "backlash",
)  # fmt: skip
#: templates for measured channels, in addition to `measurement_effects`
_OF_OUTPUTS = ("quadratic", "cubic", "dead_band", "saturation", "rate_limit", "backlash")


def generic_effects(anatomy: Anatomy, templates: Iterable[str] | None = None) -> tuple[Effect, ...]:
    """Every template at every place where it makes sense.

    A quantity that is constant in the typical run has no scale, and gets no effects.

    Parameters
    ----------
    anatomy : Anatomy
    templates : iterable of str, optional
        Only these; all where not given. Errors of measured channels and unknown signals are offered in any case.

    Returns
    -------
    tuple of Effect
        Structural effects, then measurement effects, then unknown signals.

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
            yield _effect(anatomy, "magnetic_saturation", "equation", target, target)
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
    """Unknown signals at every place that moves."""
    at = [("equation", name, anatomy.size(f"d_{name}")) for name in anatomy.equations]
    for kind, names in (("input", anatomy.inputs), ("signal", anatomy.signals)):
        at += [(kind, name, anatomy.size(name)) for name in _moving(anatomy, names)]
    for kind, target, size in at:
        if size > 0:
            unit = anatomy.units[target]
            made = latent_input(_port(kind, target), size, per(unit, "s") if kind == "equation" else unit)
            changed = {"name": f"latent_{target}", "states": (), "derived": (), "initialise": nothing}
            yield GenericEffect(**{**vars(made), **changed}, template="latent", acts_on=kind, target=target)


def _port(kind: str, target: str) -> str:
    return f"channel.{target}" if kind == "output" else f"{kind} {target}" if kind != "equation" else (
        f"equation of {target}"
    )  # fmt: skip


def _effect(
    anatomy: Anatomy, template: str, kind: str, target: str, reads: str = "", into: str = ""
) -> GenericEffect:
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
    own = Scales(anatomy, kind, target, signal, title, bool(into))
    return GenericEffect(
        name=name if not reads else f"{name}({reads})",
        title=f"{title}{on}{',' if on and kind == 'equation' else ''} {where}{words['into']}",
        port=_port(kind, target),
        equations=TEMPLATES[template],
        parameters=own.parameters(template),
        states=("z",) if template == "hysteresis" else (),
        kind="measurement" if kind == "output" else "mechanism",
        description=description.format(**words),
        formula=formula,
        source=source,
        confused_with=tuple(text.format(**words) for text in confused),
        minima=8 if template == "forcing" else 6 if template.startswith("relay") else 1,
        smallest=own.smallest(template),
        template=template,
        acts_on=kind,
        target=target,
        reads=reads if kind == "equation" or reads != target else "",
        size=anatomy.size(signal),
    )
