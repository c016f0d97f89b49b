r"""Priority of the current limit: active current first, where the model gives it to the reactive current.

With priority π for the active current (0: reactive current first, as in (PV10); 1: active current first)

.. math::

    I_q^a &= [I_q^u]_{\pm\sqrt{I_{max}^2 - I_p^2}},\quad I_p = [I_p^u]_0^{I_{max}}             & (Y1)\\
    I_p^* &= (1 - \pi) I_p^r + \pi I_p^a,\quad I_q^* = (1 - \pi) I_q^r + \pi I_q^a              & (Y2)

with the commands r and a under either priority, and u without a limit. The device's own current limit holds these
equations; the effect sets π.
"""

from __future__ import annotations

from typing import Any

from errorscreen.effects.base import Effect, strength


def priority(value: Any, share: Any) -> Any:
    """Priority for the active current, (Y2)."""
    return (value + share,)


CURRENT_PRIORITY = Effect(
    name="priority",
    title="Current limit with priority for active current",
    port="priority",
    devices=("pv_plant",),
    formula="Ip first up to Imax, |Iq| ≤ √(Imax² − Ip²), by the given share",
    equations=priority,
    parameters=(
        strength("share", 1.0, 1.0, "", "current limit", "π", "0: reactive current first; 1: active first"),
    ),
    description="When the limit binds, the converter keeps its active current and gives up reactive current, where the "
    "model does the opposite: more P and less Q during and just after the dip.",
    source="WECC Solar Plant Dynamic Modeling Guidelines, 2014 (REEC_B, Pqflag)",
    confused_with=("another current limit", "other ride-through coefficients"),
)
