"""Differences between a unit of standard models and its file: hidden truths of the cases ``andes`` and ``models``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.bench.scenarios import draw_values, pick
from errorscreen.effects import Effect, common_skew, measurement_effects
from errorscreen.models.device import Device
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.parameters import Parameter, ParameterSpace

#: constants of each record of a unit, by its model
Records = dict[str, dict[str, float]]
Channels = dict[str, NDArray[np.float64]]

#: effect for a missing part, by its model
_MISSING = {
    "SEXS": "exciter", "TGOV1": "governor", "IEEEG1": "governor", "HYGOV": "hydro_governor", "GGOV1": "gas_governor",
    "IEEEST": "stabiliser",
}  # fmt: skip
#: effect for a part that does not act, by its slot
_ACTING = {"exciter": "regulator_acting", "governor": "governor_acting", "stabiliser": "stabiliser_acting"}
#: effects that are right for a missing part of another family, by its slot
_NEAREST = {"exciter": ("exciter",), "governor": ("governor", "hydro_governor", "gas_governor")}
#: least and greatest number of true parameters that deviate, and how far
_DEVIATING, _SPREAD = (12, 20), 0.25
#: how far the user lets parameters move: a stabiliser that may be turned off by its gain is no missing part
_RANGE = 0.5
#: factors of the base of P and Q
_BASES = ((-0.2, -0.08), (0.08, 0.35))


@dataclass(frozen=True)
class Difference:
    """One thing in which a unit differs from its file.

    Parameters
    ----------
    name : str
        For tables.
    right : tuple of str
        Effects of the library, each of which is a right name.
    slot : str
        Where it is: a slot of the unit, or a measured channel.
    true, stated : callable
        Records of the unit, and those of its file, from those of a complete unit.
    distort : callable, optional
        Recorded channels from the true ones.
    """

    name: str
    right: tuple[str, ...]
    slot: str
    true: Callable[[Records], Records] = dict
    stated: Callable[[Records], Records] = dict
    distort: Callable[[Channels, float], Channels] | None = None


def device_of(records: Mapping[str, Mapping[str, float]]) -> Device:
    """Device of a unit of records."""
    return unit([Record(PARTS[model], values) for model, values in records.items()], identifier="1", bus=1)


def candidates_of(device: Device) -> ParameterSpace:
    """Candidates of a unit with half of their values to each side, inside the ranges of its models."""

    def narrowed(p: Parameter) -> Parameter:
        if p.nominal == 0:
            return p
        room = _RANGE * abs(p.nominal)
        return replace(p, lower=max(p.lower, p.nominal - room), upper=min(p.upper, p.nominal + room))

    return ParameterSpace(narrowed(p) for p in device.candidates)


def deviated(records: Records, rng: np.random.Generator, kept: Mapping[str, Sequence[str]]) -> Records:
    """Records with 12 to 20 parameters, or all where there are fewer, up to a quarter off; `kept` stay."""
    space = device_of(records).candidates
    pairs = [(p.name.split("."), p.nominal) for p in space]
    names = [(model, one) for (model, one), value in pairs if value and one not in kept.get(model, ())]
    number = min(len(names), int(rng.integers(_DEVIATING[0], _DEVIATING[1] + 1)))
    found = {model: dict(values) for model, values in records.items()}
    for k in rng.choice(len(names), number, replace=False):
        model, constant = names[k]
        found[model][constant] *= float(rng.uniform(1 - _SPREAD, 1 + _SPREAD))
    for model, values in found.items():
        PARTS[model].check(values, model)
    return found


def missing(model: str) -> Difference:
    """A part that the file lacks."""
    slot = PARTS[model].slot
    return Difference(f"{model} missing", (_MISSING[model],), slot, stated=_without(slot))


def other_family(model: str) -> Difference:
    """A part that the file lacks, of a family that the library does not offer."""
    slot = PARTS[model].slot
    return Difference(f"{model} missing", _NEAREST[slot], slot, stated=_without(slot))


def off(model: str) -> Difference:
    """A part of the file that does not act; without an exciter a stabiliser has nothing to act on."""
    slot = PARTS[model].slot
    gone = ("exciter", "stabiliser") if slot == "exciter" else (slot,)
    return Difference(f"{model} off", (_ACTING[slot],), slot, true=_without(*gone))


def saturation(machine: str) -> Difference:
    """A file without the saturation of a machine that saturates much: a little one is made up for by parameters."""
    true, stated = _with(machine, {"S10": 0.25, "S12": 0.9}), _with(machine, {"S10": 0.0, "S12": 0.0})
    return Difference("saturation missing", ("saturation",), "machine", true=true, stated=stated)


def flag(effect: Effect) -> Difference:
    """A flag that is set otherwise than the file says."""
    model, _, constant = effect.name.partition(".")

    def true(records: Records) -> Records:
        return _with(model, {constant: 1.0 - records[model][constant]})(records)

    return Difference(f"{effect.name} wrong", (effect.name,), model, true=true)


def other_base(rng: np.random.Generator) -> Difference:
    """P and Q in pu of another base."""
    factor = 1.0 + float(rng.uniform(*pick(rng, _BASES)))

    def distort(channels: Channels, h: float) -> Channels:
        return channels | {name: factor * channels[name] for name in ("P", "Q")}

    return Difference("MVA base", ("mva_base",), "P and Q", distort=distort)


def fault_of_measurement(rng: np.random.Generator) -> Difference:
    """An error of scale, offset, clock or filter of P or Q, or the clock of both."""
    effect: Effect = pick(rng, (*measurement_effects(("P", "Q")), common_skew()))
    values = draw_values(effect, rng)

    def distort(channels: Channels, h: float) -> Channels:
        changed = {}
        for name in effect.channels or ("P", "Q"):
            own = [np.array([value]) for value in values]
            changed[name] = effect.equations(channels[name][None], h, *own)[0]
        return channels | changed

    return Difference(effect.name, (effect.name,), ", ".join(effect.channels or ("P", "Q")), distort=distort)


def file_of(records: Records, differences: Sequence[Difference]) -> Records:
    """Records of the file."""
    for one in differences:
        records = one.stated(records)
    return records


def truth_of(records: Records, differences: Sequence[Difference]) -> Records:
    """Records of the unit."""
    for one in differences:
        records = one.true(records)
    return records


def fit_together(differences: Sequence[Difference]) -> bool:
    """Whether two differences can be told apart: at places of their own, and not a stabiliser without its exciter."""
    slots = [one.slot for one in differences]
    channels = [one for one in differences if one.distort is not None]
    return len(set(slots)) == len(slots) and len(channels) < 2 and {*slots} != {"exciter", "stabiliser"}


def _without(*slots: str) -> Callable[[Records], Records]:
    return lambda records: {name: row for name, row in records.items() if PARTS[name].slot not in slots}


def _with(model: str, changes: Mapping[str, float]) -> Callable[[Records], Records]:
    def changed(records: Records) -> Records:
        return records | {model: {**records[model], **changes}}

    return changed


def typical(models: Sequence[str], own: Mapping[str, Mapping[str, Any]] | None = None) -> Records:
    """Typical constants of some models, or those of `own`."""
    return {model: {**PARTS[model].typical, **(own or {}).get(model, {})} for model in models}
