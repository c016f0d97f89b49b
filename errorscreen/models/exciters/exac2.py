r"""EXAC2, alternator with diode rectifier, field current feedback and a fast limiter of the field current.

.. math::

    T_R\,\dot V_m &= V_c - V_m                                                                        & (1)\\
    V_F &= \frac{sK_F}{1 + sT_F}V_{FE},\quad e = V_{ref} + V_s + V_{UEL} + V_{OEL} - V_m - V_F            & (2)\\
    T_B\,\dot x &= e - x,\quad y = x + (T_C/T_B)(e - x)                                                  & (3)\\
    T_A\,\dot V_A &= K_A y - V_A,\quad V_{AMIN} \le V_A \le V_{AMAX}\ \text{(non-windup)}                   & (4)\\
    V_R &= K_B\min(V_A - K_H V_{FE},\; K_L(V_{LR} - V_{FE}))\ \text{within}\ V_{RMIN}, V_{RMAX}              & (5)

Alternator and rectifier are those of `errorscreen.models.exciters.alternator`.

(PSS/E model library, EXAC2; IEEE committee report 1981, type AC2.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, select
from errorscreen.models.exciters.ac1 import added, regulator
from errorscreen.models.exciters.alternator import alternator, at_rest, excited, rate_feedback
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TR          | s  | 0.02  | -            | >= 0 | time constant of the voltage transducer
    TB          | s  | 0     | -            | >= 0 | lag of the regulator
    TC          | s  | 0     | -            | >= 0 | lead of the regulator
    KA          | pu | 400   | 50 .. 1000   | > 0  | gain of the regulator
    TA          | s  | 0.02  | 0.01 .. 0.2  | >= 0 | time constant of the regulator
    VAMAX       | pu | 8     | limit        | any  | upper limit of the regulator
    VAMIN       | pu | -8    | limit        | any  | lower limit of the regulator
    KB          | pu | 25    | 5 .. 100     | > 0  | gain of the second stage
    VRMAX       | pu | 105   | limit        | any  | upper limit of the field voltage of the exciter
    VRMIN       | pu | -95   | limit        | any  | lower limit of the field voltage of the exciter
    TE          | s  | 0.6   | 0.2 .. 2     | > 0  | time constant of the exciter
    KL          | pu | 10    | -            | > 0  | gain of the limiter of the field current
    KH          | pu | 1     | -            | >= 0 | gain of the field current feedback
    KF          | pu | 0.03  | 0.005 .. 0.1 | >= 0 | gain of the rate feedback
    TF          | s  | 1     | 0.3 .. 2     | >= 0 | time constant of the rate feedback
    KC          | pu | 0.28  | -            | >= 0 | loading factor of the rectifier
    KD          | pu | 0.35  | 0.1 .. 1     | >= 0 | demagnetisation by the field current of the machine
    KE          | pu | 1     | -            | any  | constant of the exciter
    VLR         | pu | 4.4   | limit        | any  | field current at which the limiter acts
    E1          | pu | 4.4   | -            | >= 0 | first point of the saturation
    S1 = SE(E1) | -  | 0.037 | -            | >= 0 | saturation at E1
    E2          | pu | 3.3   | -            | >= 0 | second point of the saturation
    S2 = SE(E2) | -  | 0.012 | -            | >= 0 | saturation at E2
    """
)


@stage("VR")
def second_stage(VA: Any, VFE: Any, lowR: Any, highR: Any, limitL: Any, KB: Any, KL: Any, KH: Any) -> Any:
    """Field voltage of the exciter, (5)."""
    regulated, limiter = VA - KH * VFE, KL * (limitL - VFE)
    return (clip(KB * select(limiter < regulated, limiter, regulated), lowR, highR),)


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0; the limiter rests."""
    rest = at_rest(v)
    VA = rest.VFE / v["KB"] + v["KH"] * rest.VFE
    least = rest.VFE + rest.VFE / (v["KB"] * v["KL"])
    low, high = holding(VA, v["VAMIN"], v["VAMAX"])
    lowR, highR = holding(rest.VFE, v["VRMIN"], v["VRMAX"])
    x = VA / v["KA"]
    return Start(
        {"VE": rest.VE, "xF": rest.VFE, "Vm": v["Vc"], "x": x, "A": VA},
        {
            "Vref": x + v["Vc"] - v["Vs"],
            "low": low,
            "high": high,
            "lowR": lowR,
            "highR": highR,
            "limitL": np.maximum(v["VLR"], least),
            **rest.setpoints,
        },
        (
            Limit("output of the regulator", VA, v["VAMIN"], v["VAMAX"], ("VAMIN", "VAMAX")),
            Limit("field voltage of the exciter", rest.VFE, v["VRMIN"], v["VRMAX"], ("VRMIN", "VRMAX")),
            Limit("field current of the exciter, limited", least, -np.inf, v["VLR"], ("-infinity", "VLR")),
            rest.limit,
        ),
    )


EXAC2 = Part(
    name="EXAC2",
    slot="exciter",
    title="Alternator with diode rectifier and field current limiter (IEEE AC2)",
    fields=FIELDS,
    stages=(alternator, rate_feedback, added, regulator, second_stage, excited),
    ports=("Efd",),
    states=("VE", "xF", "Vm", "x", "A"),
    setpoints=("Vref", "low", "high", "lowR", "highR", "limitL", "lowE", "satA", "satB"),
    start=start,
    rules=("VAMIN < VAMAX", "VRMIN < VRMAX", "TC needs TB", "KF needs TF"),
    formula="(1) to (5), (X1) to (X3)",
    source="PSS/E model library, EXAC2",
)
