r"""EXPIC1, exciter with PI regulator and a compound source.

.. math::

    T_R\,\dot V_m &= V_c - V_m,\quad e = V_{ref} + V_s + V_{UEL} + V_{OEL} - V_m - V_F  & (1)\\
    V_A &= K_A T_{A1}\,e + x_A,\quad \dot x_A = K_A\,e,\quad V_{R2} \le V_A \le V_{R1}  & (2)\\
    V_R &= \frac{1 + sT_{A3}}{(1 + sT_{A2})(1 + sT_{A4})}V_A\ \text{within}\ V_{RMIN},\ V_{RMAX}  & (3)\\
    E_0 &= V_R V_B\ \text{within}\ E_{FDMIN},\ E_{FDMAX}  & (4)\\
    T_E\,\dot E_{fd} &= E_0 - K_E E_{fd} - S_E(E_{fd})E_{fd};\quad E_{fd} = E_0\ \text{where}\ T_E = 0  & (5)\\
    V_F &= \frac{sK_F}{(1 + sT_{F1})(1 + sT_{F2})}V_R  & (6)

with the available voltage :math:`V_B` of `errorscreen.models.exciters.compound_source`. The integral (2) holds while
its output is at a limit and the input leads beyond it; the limits (3) and (4) act behind their blocks.

(PSS/E model library, EXPIC1.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, select
from errorscreen.models.blocks import (
    high_frequency_gain,
    lag,
    lead_lag,
    limited_pi,
    longer,
    quadratic_constants,
    quadratic_saturation,
    rate,
)
from errorscreen.models.exciters.compound_source import compound_source
from errorscreen.models.exciters.rotating import rotating
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TR          | s  | 0.02 | -         | >= 0 | time constant of the voltage transducer
    KA          | pu | 5    | 1 .. 30   | > 0  | gain of the regulator
    TA1         | s  | 1    | 0.2 .. 5  | >= 0 | lead time constant of the regulator
    VR1         | pu | 5    | limit     | any  | upper limit of the regulator
    VR2         | pu | -5   | limit     | any  | lower limit of the regulator
    TA2         | s  | 0.05 | -         | >= 0 | lag time constant
    TA3         | s  | 0    | -         | >= 0 | lead time constant
    TA4         | s  | 0    | -         | >= 0 | second lag time constant
    VRMAX       | pu | 5    | limit     | any  | upper limit of the voltage behind the lags
    VRMIN       | pu | -5   | limit     | any  | lower limit of the voltage behind the lags
    KF          | pu | 0    | -         | >= 0 | gain of the rate feedback
    TF1         | s  | 1    | -         | >= 0 | time constant of the rate feedback
    TF2         | s  | 0    | -         | >= 0 | second time constant of the rate feedback
    EFDMAX      | pu | 6    | limit     | any  | upper limit of the field voltage
    EFDMIN      | pu | -5   | limit     | any  | lower limit of the field voltage
    KE          | pu | 1    | -         | any  | constant of the exciter
    TE          | s  | 0    | - unless 0 | >= 0 | time constant of the exciter; 0: no exciter
    E1          | pu | 3    | -         | >= 0 | first point of the saturation
    S1 = SE(E1) | -  | 0    | -         | >= 0 | saturation at E1
    E2          | pu | 4    | -         | >= 0 | second point of the saturation
    S2 = SE(E2) | -  | 0    | -         | >= 0 | saturation at E2
    KP          | pu | 4.5  | 2 .. 10   | >= 0 | gain of the source on the voltage
    KI          | pu | 0    | -         | >= 0 | gain of the source on the current
    KC          | pu | 0.1  | 0 .. 0.4 unless 0  | >= 0 | loading of the rectifier
    """
)


@stage("Efd", "VR", "VF", "d_Vm", "d_xA", "d_x2", "d_x4", "d_xF", "d_xG", "d_E")
def expic1(
    Vc: Any,
    Vs: Any,
    VUEL: Any,
    VOEL: Any,
    Vd: Any,
    Vq: Any,
    Id: Any,
    Iq: Any,
    If: Any,
    Vm: Any,
    xA: Any,
    x2: Any,
    x4: Any,
    xF: Any,
    xG: Any,
    E: Any,
    Vref: Any,
    lowA: Any,
    highA: Any,
    lowR: Any,
    highR: Any,
    lowE: Any,
    highE: Any,
    satA: Any,
    satB: Any,
    TR: Any,
    KA: Any,
    TA1: Any,
    TA2: Any,
    TA3: Any,
    TA4: Any,
    KF: Any,
    TF1: Any,
    TF2: Any,
    KE: Any,
    TE: Any,
    KP: Any,
    KI: Any,
    KC: Any,
    shortest: Any,
) -> Any:
    """Field voltage and derivatives, (1) to (6).

    The lead belongs to the longer lag, whichever it is. In the rate feedback the shorter lag ends the loop: it always
    has a state, and lasts at least the shortest time of the loop.
    """
    slow, fast = select(TA2 > TA4, TA2, TA4), select(TA2 > TA4, TA4, TA2)
    slowF, fastF = select(TF1 > TF2, TF1, TF2), select(TF1 > TF2, TF2, TF1)
    loop = KA * TA1 * high_frequency_gain(TA3, slow, shortest) * KF / longer(slowF, shortest)
    measured, d_Vm = lag(Vm, Vc, TR, shortest)
    VA, d_xA = limited_pi(xA, Vref + Vs - measured - xG + VUEL + VOEL, KA * TA1, KA, lowA, highA)
    y, d_x2 = lead_lag(x2, VA, TA3, slow, shortest)
    z, d_x4 = lag(x4, y, fast, shortest)
    VR = clip(z, lowR, highR)
    u, d_xF = rate(xF, VR, KF, slowF, shortest)
    d_xG = (u - xG) / longer(fastF, shortest * (1.0 + loop))
    E0 = clip(VR * compound_source(Vd, Vq, Id, Iq, If, KP, 0.0 * KP, KI, 0.0 * KP, KC), lowE, highE)
    d_E = rotating(E, E0, KE, TE, satA, satB, shortest)
    return (
        select(TE > 0.0, E, E0),
        VR,
        xG,
        d_Vm,
        d_xA,
        d_x2,
        d_x4,
        d_xF,
        d_xG,
        select(TE > 0.0, d_E, 0.0 * E),
    )


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0; a source without voltage leaves VR beyond its limits."""
    E, zero = v["Efd0"], 0.0 * v["KP"]
    satA, satB = quadratic_constants(v["E1"], v["S1"], v["E2"], v["S2"])
    E0 = np.where(v["TE"] > 0, v["KE"] * E + quadratic_saturation(E, satA, satB), E)
    terminal = (v["Vd"], v["Vq"], v["Id"], v["Iq"], v["If"])
    VB = compound_source(*terminal, v["KP"], zero, v["KI"], zero, v["KC"])
    VR = E0 / np.maximum(VB, 1e-6)
    lowA, highA = holding(VR, v["VR2"], v["VR1"])
    lowR, highR = holding(VR, v["VRMIN"], v["VRMAX"])
    lowE, highE = holding(E0, v["EFDMIN"], v["EFDMAX"])
    return Start(
        {"Vm": v["Vc"], "xA": VR, "x2": VR, "x4": VR, "xF": VR, "xG": 0.0 * VR, "E": E},
        {
            "Vref": v["Vc"] - v["Vs"],
            "lowA": lowA,
            "highA": highA,
            "lowR": lowR,
            "highR": highR,
            "lowE": lowE,
            "highE": highE,
            "satA": satA,
            "satB": satB,
        },
        (
            Limit("regulator", VR, v["VR2"], v["VR1"], ("VR2", "VR1")),
            Limit("voltage behind the lags", VR, v["VRMIN"], v["VRMAX"], ("VRMIN", "VRMAX")),
            Limit("field voltage", E0, v["EFDMIN"], v["EFDMAX"], ("EFDMIN", "EFDMAX")),
        ),
    )


EXPIC1 = Part(
    name="EXPIC1",
    slot="exciter",
    title="Exciter with PI regulator and compound source",
    fields=FIELDS,
    stages=(expic1,),
    ports=("Efd",),
    states=("Vm", "xA", "x2", "x4", "xF", "xG", "E"),
    setpoints=("Vref", "lowA", "highA", "lowR", "highR", "lowE", "highE", "satA", "satB"),
    start=start,
    rules=("VR2 < VR1", "VRMIN < VRMAX", "EFDMIN < EFDMAX", "TA3 needs TA2 or TA4", "KF needs TF1 or TF2"),
    formula="VR = [(1 + s TA3) / ((1 + s TA2) (1 + s TA4)) · KA (1 + s TA1) / s · (Vref + Vs − Vc / (1 + s TR) − VF)] "
    "within VRMIN, VRMAX; E0 = [VR VB] within EFDMIN, EFDMAX; TE dEfd/dt = E0 − (KE + SE(Efd)) Efd",
    source="PSS/E model library, EXPIC1",
)
