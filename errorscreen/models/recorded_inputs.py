r"""Recorded field voltage or mechanical power that drives a unit in place of its controllers.

A recorded level and the model's own equilibrium never agree exactly, and a unit that starts at another field voltage
than that of its equilibrium drifts. So the level is the model's, and the course is the recorded one, in pu of the
model's base:

.. math::

    E_{fd}(t) &= E_{fd0} + \big(E_{fd}^{rec}(t) - \bar E_{fd}^{rec}\big)                          & (1)\\
    P_m(t) &= P_{m0} + \big(P_m^{rec}(t) - \bar P_m^{rec}\big)                                    & (2)

with the bar for the mean before the event. A factor between the two levels instead would be right for a record on
another base only, and wrong for a model with, say, another :math:`X_d`, which needs another level for the same course.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from errorscreen.engine.stages import reads_of, stage
from errorscreen.exceptions import InputError, unknown_name
from errorscreen.models.part import SLOTS, Part


@stage("Efd")
def recorded_field(Efd0: Any, dEfd: Any) -> Any:
    """Field voltage from its recorded deviation, (1)."""
    return (Efd0 + dEfd,)


@stage("Pm")
def recorded_power(Pm0: Any, dPm: Any) -> Any:
    """Mechanical power from its recorded deviation, (2)."""
    return (Pm0 + dPm,)


#: parts that take a recorded quantity, by its name
RECORDED = {
    "Efd": Part("recorded field", "exciter", "recorded field voltage", (), (recorded_field,), ("Efd",)),
    "Pm": Part("recorded power", "governor", "recorded mechanical power", (), (recorded_power,), ("Pm",)),
}
#: slots whose parts a recorded quantity replaces
REPLACED = {
    "Efd": ("exciter", *(slot for slot in SLOTS[0] if slot not in ("machine", "exciter", "governor"))),
    "Pm": ("governor",),
}


def take_replaced(slots: dict[str, Any], inputs: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Recorded quantities that drive a unit, each with the models that it replaces, which are taken out of `slots`."""
    driven = {}
    for name in inputs:
        if name not in RECORDED:
            raise unknown_name(name, RECORDED, kind="input", where="inputs of the unit")
        frame: Part = next(slots[family[0]].part for family in SLOTS if family[0] in slots)
        read = {quantity for one in (*frame.stages, *frame.closing) for quantity in reads_of(one)}
        if frame.slot != "machine" or name not in read:
            raise InputError(
                f"{name} cannot drive {frame.name}, which has none",
                where="inputs of the unit",
                allowed="Efd of a machine with a field winding, Pm of a machine",
                remedy=f"Leave {name} out of inputs",
            )
        driven[name] = tuple(slots.pop(slot).part.name for slot in REPLACED[name] if slot in slots)
    return driven
