r"""EXST1, static exciter fed by the terminal (IEEE type ST1, 1981).

.. math::

    T_R\,\dot V_m &= V_c - V_m,\quad e = V_{ref} + V_s + V_{UEL} + V_{OEL} - V_m - V_F,\quad
    V_{IMIN} \le e \le V_{IMAX}  & (1)\\
    T_B\,\dot x &= e - x,\quad y = x + (T_C/T_B)(e - x)  & (2)\\
    T_A\,\dot V_A &= K_A y - V_A  & (3)\\
    E_{fd} &= V_A\ \text{within}\ V\,V_{RMIN} - K_C X_{ad}I_{fd},\ V\,V_{RMAX} - K_C X_{ad}I_{fd}  & (4)\\
    T_F\,\dot x_F &= V_A - x_F,\quad V_F = (K_F/T_F)(V_A - x_F)  & (5)

The limits (4) act behind the regulator, which is not held at them.

(PSS/E model library, EXST1; IEEE committee report, *Excitation system models for power system stability studies*,
1981.)
"""

from __future__ import annotations

from typing import Any

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip
from errorscreen.models.blocks import high_frequency_gain, lag, lead_lag, longer, rate
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TR    | s  | 0.02 | -           | >= 0 | time constant of the voltage transducer
    VIMAX | pu | 0.2  | limit       | any  | upper limit of the error
    VIMIN | pu | -0.2 | limit       | any  | lower limit of the error
    TC    | s  | 1    | 0.1 .. 5 unless 0    | >= 0 | lead time constant
    TB    | s  | 10   | 1 .. 20 unless 0     | >= 0 | lag time constant
    KA    | pu | 200  | 50 .. 500   | > 0  | gain of the regulator
    TA    | s  | 0.02 | 0.01 .. 0.2 | >= 0 | time constant of the regulator
    VRMAX | pu | 6    | limit       | any  | upper limit of the field voltage at V = 1
    VRMIN | pu | -5   | limit       | any  | lower limit of the field voltage at V = 1
    KC    | pu | 0.1  | 0 .. 0.4 unless 0    | >= 0 | loading of the rectifier
    KF    | pu | 0    | -           | >= 0 | gain of the rate feedback
    TF    | s  | 1    | -           | >= 0 | time constant of the rate feedback
    """
)


@stage("Efd", "VF", "d_Vm", "d_x", "d_VA", "d_xF")
def exst1(
    Vc: Any,
    Vs: Any,
    VUEL: Any,
    VOEL: Any,
    V: Any,
    If: Any,
    Vm: Any,
    x: Any,
    VA: Any,
    xF: Any,
    Vref: Any,
    lowI: Any,
    highI: Any,
    lowR: Any,
    highR: Any,
    TR: Any,
    TC: Any,
    TB: Any,
    KA: Any,
    TA: Any,
    KC: Any,
    KF: Any,
    TF: Any,
    shortest: Any,
) -> Any:
    """Field voltage and derivatives, (1) to (5)."""
    measured, d_Vm = lag(Vm, Vc, TR, shortest)
    VF, d_xF = rate(xF, VA, KF, TF, shortest)
    y, d_x = lead_lag(x, clip(Vref + Vs - measured - VF + VUEL + VOEL, lowI, highI), TC, TB, shortest)
    # the rate feedback makes the regulator faster by its loop gain; the loop lasts at least the shortest time
    lead = high_frequency_gain(TC, TB, shortest)
    T = longer(TA, shortest * (1.0 + KA * lead * KF / longer(TF, shortest)))
    d_VA = (KA * y - VA) / T
    return clip(VA, V * lowR - KC * If, V * highR - KC * If), VF, d_Vm, d_x, d_VA, d_xF


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0."""
    E, If, V = v["Efd0"], v["If"], v["V"]
    error = E / v["KA"]
    lowI, highI = holding(error, v["VIMIN"], v["VIMAX"])
    relative = (E + v["KC"] * If) / V
    lowR, highR = holding(relative, v["VRMIN"], v["VRMAX"])
    return Start(
        {"Vm": v["Vc"], "x": error, "VA": E, "xF": E},
        {
            "Vref": error + v["Vc"] - v["Vs"],
            "lowI": lowI,
            "highI": highI,
            "lowR": lowR,
            "highR": highR,
        },
        (
            Limit("error of voltage", error, v["VIMIN"], v["VIMAX"], ("VIMIN", "VIMAX")),
            Limit("field voltage with loading", relative, v["VRMIN"], v["VRMAX"], ("VRMIN", "VRMAX")),
        ),
    )


EXST1 = Part(
    name="EXST1",
    slot="exciter",
    title="Static exciter, type ST1 of 1981",
    fields=FIELDS,
    stages=(exst1,),
    ports=("Efd",),
    states=("Vm", "x", "VA", "xF"),
    setpoints=("Vref", "lowI", "highI", "lowR", "highR"),
    start=start,
    rules=("VIMIN < VIMAX", "VRMIN < VRMAX", "TC needs TB", "KF needs TF"),
    formula="Efd = [KA / (1 + s TA) · (1 + s TC) / (1 + s TB) · (Vref + Vs − Vc / (1 + s TR) − VF)] within "
    "V · VRMIN − KC If, V · VRMAX − KC If",
    source="PSS/E model library, EXST1; IEEE type ST1 of 1981",
)
