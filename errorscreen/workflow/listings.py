"""Tables of what exists, for the command line: effects of the library, and models that a file may name."""

from __future__ import annotations

from errorscreen._runtime.display import aligned
from errorscreen.effects import EFFECTS
from errorscreen.effects.base import Effect
from errorscreen.exceptions import unknown_name
from errorscreen.models import DEVICES
from errorscreen.models.standard import PARTS


def effects_table(name: str | None = None) -> str:
    """All effects with the port at which they act, or one effect in full.

    Raises
    ------
    InputError
        If there is no effect of that name.

    Examples
    --------
    >>> print(effects_table("stabiliser_acting").splitlines()[0])
    stabiliser_acting: The stabiliser did not act
    """
    effects = [e for e in EFFECTS.values() if e.kind != "latent"]
    if name is None:
        rows = dict.fromkeys((e.name, e.port, e.title) for e in effects)
        return aligned([("name", "acts at", "what the model lacks"), *rows])
    found = [e for e in effects if e.name == name]
    if not found:
        raise unknown_name(name, dict.fromkeys(e.name for e in effects), kind="effect")
    return "\n\n".join(map(_in_full, found))


def _in_full(effect: Effect) -> str:
    lines = [f"{effect.name}: {effect.title}", effect.description, f"Equation: {effect.formula}"]
    lines += [
        f"  {p.name}: {p.description}; {p.lower:g} to {p.upper:g} {p.unit}".rstrip()
        for p in effect.parameters
    ]
    lines.append(f"Acts at {effect.port}. Offered for: {', '.join(effect.devices) or 'any model'}.")
    lines += [f"Easily confused with: {'; '.join(effect.confused_with)}."] if effect.confused_with else []
    return "\n".join([*lines, f"Source: {effect.source}"])


def models_table(name: str | None = None) -> str:
    """All models, or the constants of one standard model in the order of its record.

    Raises
    ------
    InputError
        If there is no standard model of that name.

    Examples
    --------
    >>> print(models_table("TGOV1").splitlines()[0])
    TGOV1: Steam turbine with governor (governor)
    """
    if name is None:
        rows = [("name", "slot", "model")]
        rows += [(part.name, part.slot.replace("_", " "), part.title) for part in PARTS.values()]
        rows += [(key, "whole plant", device.title) for key, device in DEVICES.items()]
        return aligned(rows)
    if name not in PARTS:
        raise unknown_name(name, [*PARTS, *DEVICES], kind="standard model")
    part = PARTS[name]
    rows = [("constant", "unit", "meaning")]
    rows += [(one.symbol, one.unit, one.description) for one in part.fields]
    return f"{part.name}: {part.title} ({part.slot.replace('_', ' ')})\n{aligned(rows)}"
