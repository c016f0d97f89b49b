r"""Dead band of a governor whose record has none.

The governor answers only to a deviation of the speed beyond the half width d, without a step at the edge (IEEE Std
1207, type I):

.. math:: \Delta\omega^* = \mathrm{db}(\omega - \omega_0),\quad \mathrm{db}(x) = x - [x]_{-d}^{d}      \qquad (G5)

with the speed :math:`\omega_0` at the start. The part inside the band is added to the reference that the speed is
compared with, so that the damping of the turbine still acts on the true speed.
"""

from __future__ import annotations

from typing import Any

from errorscreen.effects.base import Effect, Values, strength
from errorscreen.effects.governor import SMALLEST_DEAD_BAND
from errorscreen.engine.vmath import clip


def inside_band(value: Any, omega: Any, w0: Any, d: Any) -> Any:
    """Reference of the speed, moved by the deviation inside the band, (G5)."""
    return (value + clip(omega - w0, -d, d),)


def _start(values: Values, h: float) -> Values:
    return {"w0": values["omega"]}


GOVERNOR_DEAD_BAND = Effect(
    name="governor_dead_band",
    title="Dead band of the governor",
    told="{governor} of {unit}: dead band of the speed",
    port="speed_reference",
    devices=("governor without dead band",),
    equations=inside_band,
    parameters=(strength("d", 6e-4, 0.01, "pu", "governor", "d", "half width of the dead band; 0: none"),),
    derived=("w0",),
    initialise=_start,
    smallest={"d": SMALLEST_DEAD_BAND},
    formula="Δω* = Δω − [Δω] within −d, d",
    description="The governor does not answer to small deviations of the speed: a dead band that the record does not "
    "state, or has no place for. After a small event the mechanical power stays where it was.",
    source="IEEE Std 1207, dead bands of governors",
    confused_with=("a governor that is blocked", "a larger droop"),
)
