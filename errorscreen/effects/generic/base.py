"""A generic effect: one row of the table of the integrator for user-written models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from errorscreen.effects.base import Effect
from errorscreen.effects.generic import terms, transforms
from errorscreen.effects.latent_input import latent
from errorscreen.engine.stages import Equations
from errorscreen.exceptions import unknown_name

#: equations of each template, in the order of their numbers in the table
TEMPLATES: dict[str, Equations] = {
    "viscous": terms.viscous,
    "quadratic": terms.quadratic,
    "cubic": terms.cubic,
    "drag": terms.drag,
    "magnetic_saturation": terms.magnetic_saturation,
    "coulomb": terms.coulomb,
    "stribeck": terms.stribeck,
    "offset": terms.offset,
    "forcing": terms.forcing,
    "hysteresis": terms.hysteresis,
    "overflow": terms.spill,
    "dead_band": transforms.dead_band,
    "saturation": transforms.saturation,
    "rate_limit": transforms.rate_limit,
    "lag": transforms.lag,
    "delay": transforms.delay,
    "backlash": transforms.backlash,
    "relay_above": transforms.relay,
    "relay_below": transforms.relay,
    "latent": latent,
}
NUMBERS = {name: number for number, name in enumerate(TEMPLATES)}
#: kinds of quantity that an effect acts on
PLACES = ("equation", "input", "signal", "output")

#: smallest and largest value of each quantity by name; a derivative is called ``"d_"`` + state
Ranges = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class GenericEffect(Effect):
    """A template, the quantity it acts on and the signal it depends on.

    Beside the fields of `Effect`:

    Parameters
    ----------
    template : str
        Key of `TEMPLATES`.
    acts_on : {"equation", "input", "signal", "output"}
    target : str
        Name of the state whose equation it changes, or of the input, internal signal or output.
    reads : str
        State or input that it depends on; empty: the quantity itself, or none.
    into : str
        Of an overflow: state whose equation receives the spill; empty: it is lost.
    size : float
        Size of the signal that it depends on, for (G18).
    """

    template: str = ""
    acts_on: str = "equation"
    target: str = ""
    reads: str = ""
    into: str = ""
    size: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        where = f"effect {self.name!r}"
        if self.template not in TEMPLATES:
            raise unknown_name(self.template, TEMPLATES, kind="template", where=where)
        if self.acts_on not in PLACES:
            raise unknown_name(self.acts_on, PLACES, kind="place", where=where)
