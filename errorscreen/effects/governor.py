r"""Turbine and governor TGOV1 with a dead band: speed control of a machine whose mechanical power is constant.

The steam turbine-governor TGOV1 of the PSS/E model library, in deviations from the equilibrium, with the dead band of
IEEE Std 1207 (type without a step at its edge):

.. math::

    e &= -\,\mathrm{db}(\omega - 1),\quad \mathrm{db}(x) = x - [x]_{-d}^{d}               & (G1)\\
    T_1\,\dot g &= K e - g,\quad 0 \le P_{m0} + g \le P_{max}                           & (G2)\\
    T_3\,\dot x &= g - x,\quad P_m = P_{m0} + x + (T_2/T_3)(g - x)                        & (G3)

K is the reciprocal of the droop R. The damping term of TGOV1 is left out, because the machine has one.

Of a unit from a model file, the steam chest stands between valve and reheater, as in IEEEG1 and Kundur, *Power System
Stability and Control*, 1994, section 9.2:

.. math:: T_{CH}\,\dot c = g - c                                                            \qquad (G4)

with c in place of g in (G3).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from errorscreen.effects.base import Effect, strength, value
from errorscreen.engine.vmath import clip, hold_at_limits

_P_MAX = 1.2
#: pu/s: limit of a gate's rate that is not reached
_FREE_RATE = 10.0
#: pu: least dead band that matters. It is drawn in the logarithm from there, because a fit that begins with a wide one
#: and a high gain ends in a wrong minimum.
SMALLEST_DEAD_BAND = 2e-5


def tgov1(
    value: Any, omega: Any, Pm0: Any, g: Any, x: Any, K: Any, db: Any, T1: Any, T2_T3: Any, T3: Any
) -> Any:
    """Mechanical power and derivatives of valve and turbine, (G1) to (G3)."""
    speed = omega - 1.0
    e = clip(speed, -db, db) - speed
    # the limits hold the equilibrium, so that K = 0 is an identity at any loading
    low, high = clip(-Pm0, -1e9, 0.0), clip(_P_MAX - Pm0, 0.0, 1e9)
    gate = clip(g, low, high)
    return (
        value + x + T2_T3 * (gate - x),
        hold_at_limits(g, (K * e - g) / T1, low, high),
        (gate - x) / T3,
    )


def steam(
    value: Any,
    omega: Any,
    Pm0: Any,
    g: Any,
    c: Any,
    x: Any,
    K: Any,
    db: Any,
    T1: Any,
    TCH: Any,
    T2_T3: Any,
    T3: Any,
) -> Any:
    """Mechanical power and derivatives of valve, steam chest and turbine, (G1) to (G4)."""
    speed = omega - 1.0
    e = clip(speed, -db, db) - speed
    low, high = clip(-Pm0, -1e9, 0.0), clip(_P_MAX - Pm0, 0.0, 1e9)
    gate = clip(g, low, high)
    return (
        value + x + T2_T3 * (c - x),
        hold_at_limits(g, (K * e - g) / T1, low, high),
        (gate - c) / TCH,
        (c - x) / T3,
    )


def ieeeg1_record(values: Mapping[str, float]) -> tuple[str, dict[str, float]]:
    """Record IEEEG1 with these equations, without dead band: the share of the first stage has no reheat delay."""
    share = values["T2_T3"]
    return "IEEEG1", {
        **{"JBUS": 0.0, "M": 0.0, "K": values["K"], "T1": 0.0, "T2": 0.0, "T3": values["T1"]},
        **{"UO": _FREE_RATE, "UC": -_FREE_RATE, "PMAX": _P_MAX, "PMIN": 0.0, "T4": values["TCH"]},
        **{"K1": share, "T5": values["T3"], "K3": 1.0 - share, "T6": 0.0, "T7": 0.0},
        **{f"K{k}": 0.0 for k in (2, 4, 5, 6, 7, 8)},
    }


GOVERNOR = Effect(
    name="governor",
    title="Turbine-governor (TGOV1) with dead band",
    port="Pm",
    devices=("synchronous_machine",),
    equations=tgov1,
    parameters=(
        strength("K", 20.0, 50.0, "pu", "governor", "K", "gain, reciprocal of the droop; 0: constant power"),
        value("db", 0.0006, 0.0, 0.004, "pu", "governor", "d", "half width of the dead band of speed"),
        value("T1", 0.3, 0.05, 1.0, "s", "governor", "T_1", "time constant of the valve"),
        value("T2_T3", 0.3, 0.0, 1.0, "", "governor", "T_2/T_3", "share of the power without reheat delay"),
        value("T3", 5.0, 0.5, 12.0, "s", "governor", "T_3", "time constant of the turbine"),
    ),
    smallest={"db": SMALLEST_DEAD_BAND},
    states=("g", "x"),
    formula="Pm = Pm0 + (1 + s T2) / (1 + s T3) · 1 / (1 + s T1) · K · (−db(ω − 1)), 0 ≤ Pm ≤ 1.2 pu",
    description="The governor lowers the mechanical power when the speed rises. A model with constant mechanical power "
    "swings about another mean after the fault and is damped differently; below the dead band nothing happens.",
    source="PSS/E model library, TGOV1; IEEE Std 1207, dead band",
    confused_with=("a larger damping coefficient D", "a power system stabiliser", "a forced oscillation"),
)
STEAM_GOVERNOR = replace(
    GOVERNOR,
    title="Steam turbine-governor with dead band",
    told="The file of {unit} has no governor; one of a steam turbine acted",
    devices=("without governor",),
    equations=steam,
    record=ieeeg1_record,
    parameters=(
        *GOVERNOR.parameters[:3],
        value("TCH", 0.25, 0.02, 0.6, "s", "governor", "T_CH", "time constant of the steam chest"),
        *GOVERNOR.parameters[3:],
    ),
    states=("g", "c", "x"),
    formula="Pm = Pm0 + (1 + s T2) / (1 + s T3) · 1 / (1 + s TCH) · 1 / (1 + s T1) · K · (−db(ω − 1)), 0 ≤ Pm ≤ 1.2 pu",
    source="Kundur, Power System Stability and Control, 1994, section 9.2; PSS/E model library, TGOV1 and IEEEG1",
)
