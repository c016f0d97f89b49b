r"""Ramp limit of active power: after a fault the current command comes back with a limited slope.

.. math::

    I &= \min(u,\ x + \tau/T_r)                                                             & (U1)\\
    \dot x &= \min\big((u - x)/\tau,\ 1/T_r\big)                                               & (U2)

with the command u and the limited one I. While u rises faster than :math:`1/T_r`, I rises with exactly :math:`1/T_r`; a
fall is followed at once, and so is a rise that is slower. The state x follows I with the short time constant τ = 10 ms,
but at least two steps of the integration, so that the return begins where the command was down to. The limit stands
behind the outer loops, like the device's own limit of the rise: they integrate meanwhile, so that the power overshoots
at the end of the ramp.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values, strength
from errorscreen.engine.vmath import select

_TAU = 0.01


def ramp_limit(value: Any, x: Any, Tr: Any, tau: Any, rate: Any) -> Any:
    """Command with a limited slope upwards and derivative of the memory, (U1), (U2)."""
    reached, rise = x + tau * rate, (value - x) / tau
    return (
        select((Tr > 0.0) & (reached < value), reached, value),
        select(rise > rate, rate, rise),
    )


def _start(values: Values, h: float) -> Values:
    Tr = values["Tr"]
    on = Tr > 0.0
    return {
        "x": values["P"] / values["V"] * np.ones_like(Tr),
        "tau": np.full_like(Tr, max(_TAU, 2.0 * h)),
        # simulations without the effect must not divide by 0
        "rate": np.where(on, 1.0 / np.where(on, Tr, 1.0), 0.0),
    }


RAMP_LIMIT = Effect(
    name="ramp",
    title="Ramp limit of active power after the fault",
    port="Ip_cmd",
    devices=("dfig_plant", "pv_plant"),
    equations=ramp_limit,
    parameters=(
        strength(
            "Tr", 1.0, 30.0, "s", "ramp limit", "T_r", "time for a rise of the current by 1 pu; 0: none"
        ),
    ),
    states=("x",),
    derived=("tau", "rate"),
    initialise=_start,
    formula="dIp*/dt ≤ 1 / Tr",
    description="Active power comes back over seconds and in a straight line after a fault, because the plant "
    "controller or a setting of the inverters limits the rise of its current; it falls at once. The model returns as "
    "fast as its current regulator allows, which limits the rise too: a ramp faster than that shows nothing.",
    source="WECC Solar Plant Dynamic Modeling Guidelines, 2014 (REGC_A, rrpwr)",
    confused_with=(
        "momentary cessation with a ramp",
        "a smaller limit of the current regulator's rise",
        "a lag in the control of active current",
    ),
    smallest={"Tr": 0.05},
)
