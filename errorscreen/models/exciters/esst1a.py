r"""ESST1A, static exciter fed by the terminal, with two lead-lags and limiter of the field current (IEEE type ST1A).

.. math::

    T_R\,\dot V_m &= V_c - V_m,\quad e_0 = V_{ref} + V_{s1} + V_L - V_m - V_F\ \text{within}\ V_{IMIN}, V_{IMAX},\quad
    e = \max(e_0, V_{UEL2})  & (1)\\
    T_B\,\dot x &= e - x,\quad y = x + (T_C/T_B)(e - x),\quad
    T_{B1}\,\dot x_1 = y - x_1,\quad y_1 = x_1 + (T_{C1}/T_{B1})(y - x_1)  & (2)\\
    T_A\,\dot V_A &= K_A y_1 - V_A,\quad V_{AMIN} \le V_A \le V_{AMAX}\ \text{(non-windup)}  & (3)\\
    u &= \min(\max(V_A + V_{s2} - K_{LR}[X_{ad}I_{fd} - I_{LR}]^+, V_{UEL3}), V_{OEL}),\quad
    E_{fd} = u\ \text{within}\ V\,V_{RMIN},\ V\,V_{RMAX} - K_C X_{ad}I_{fd}  & (4)\\
    T_F\,\dot x_F &= u - x_F,\quad V_F = (K_F/T_F)(u - x_F)  & (5)

The signal of the stabiliser is :math:`V_{s1}` with VOS = 1, and :math:`V_{s2}` with VOS = 2. That of an
under-excitation limiter is part of :math:`V_L` with UEL = 0 or 1, :math:`V_{UEL2}` with UEL = 2, and :math:`V_{UEL3}`
with UEL = 3. Signals that do not enter at a gate are part of :math:`V_L` (`errorscreen.models.limiters.gates`).

(IEEE Std 421.5-2005, type ST1A; PSS/E model library, ESST1A.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, select
from errorscreen.models.blocks import high_frequency_gain, lag, lead_lag, limited_lag, longer, rate
from errorscreen.models.limiters.gates import (
    OPEN,
    high_value,
    low_value,
    over_excitation_gate,
    summed,
    under_excitation_gate,
)
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    UEL   | code | 1    | -            | 0, 1, 2, 3 | entry of the signal of under-excitation
    VOS   | code | 1    | -            | 1, 2 | entry of the stabiliser: 1 error of voltage, 2 output of regulator
    TR    | s    | 0.02 | -            | >= 0 | time constant of the voltage transducer
    VIMAX | pu   | 99   | limit        | any  | upper limit of the error
    VIMIN | pu   | -99  | limit        | any  | lower limit of the error
    TC    | s    | 1    | 0.1 .. 5 unless 0     | >= 0 | lead time constant
    TB    | s    | 10   | 1 .. 20 unless 0      | >= 0 | lag time constant
    TC1   | s    | 0    | -            | >= 0 | second lead time constant
    TB1   | s    | 0    | -            | >= 0 | second lag time constant
    KA    | pu   | 200  | 50 .. 500    | > 0  | gain of the regulator
    TA    | s    | 0.01 | -            | >= 0 | time constant of the regulator
    VAMAX | pu   | 99   | limit        | any  | upper limit of the regulator
    VAMIN | pu   | -99  | limit        | any  | lower limit of the regulator
    VRMAX | pu   | 6    | limit        | any  | upper limit of the field voltage at V = 1
    VRMIN | pu   | -5   | limit        | any  | lower limit of the field voltage at V = 1
    KC    | pu   | 0.1  | 0 .. 0.4 unless 0     | >= 0 | loading of the rectifier
    KF    | pu   | 0    | -            | >= 0 | gain of the rate feedback
    TF    | s    | 1    | -            | >= 0 | time constant of the rate feedback
    KLR   | pu   | 0    | -            | >= 0 | gain of the limiter of the field current
    ILR   | pu   | 0    | limit        | any  | field current at which the limiter begins
    """
)


@stage("Efd", "VF", "d_Vm", "d_x", "d_x1", "d_VA", "d_xF")
def esst1a(
    Vc: Any,
    Vs: Any,
    VUEL: Any,
    VOEL: Any,
    V: Any,
    If: Any,
    Vm: Any,
    x: Any,
    x1: Any,
    VA: Any,
    xF: Any,
    Vref: Any,
    lowI: Any,
    highI: Any,
    lowA: Any,
    highA: Any,
    lowR: Any,
    highR: Any,
    gateI: Any,
    gateA: Any,
    gateO: Any,
    VOS: Any,
    TR: Any,
    TC: Any,
    TB: Any,
    TC1: Any,
    TB1: Any,
    KA: Any,
    TA: Any,
    KC: Any,
    KF: Any,
    TF: Any,
    KLR: Any,
    ILR: Any,
    shortest: Any,
) -> Any:
    """Field voltage and derivatives, (1) to (5)."""
    at_error = select(VOS == 2.0, 0.0 * Vs, Vs)
    measured, d_Vm = lag(Vm, Vc, TR, shortest)
    output = clip(VA, lowA, highA) + (Vs - at_error) - KLR * clip(If - ILR, 0.0, 1e9)
    output = low_value(high_value(output, VUEL, gateA), VOEL, gateO)
    VF, d_xF = rate(xF, output, KF, TF, shortest)
    # of two gates one is open; a signal at the other has no share here
    limiters = summed(summed(VUEL, gateI), gateA) + summed(VOEL, gateO)
    e = clip(Vref + at_error - measured - VF + limiters, lowI, highI)
    y, d_x = lead_lag(x, high_value(e, VUEL, gateI), TC, TB, shortest)
    y1, d_x1 = lead_lag(x1, y, TC1, TB1, shortest)
    # the rate feedback makes the regulator faster by its loop gain; the loop lasts at least the shortest time
    lead = high_frequency_gain(TC, TB, shortest) * high_frequency_gain(TC1, TB1, shortest)
    T = longer(TA, shortest * (1.0 + KA * lead * KF / longer(TF, shortest)))
    _, d_VA = limited_lag(VA, KA * y1, T, lowA, highA, shortest)
    return clip(output, V * lowR, V * highR - KC * If), VF, d_Vm, d_x, d_x1, d_VA, d_xF


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0."""
    E, If, V = v["Efd0"], v["If"], v["V"]
    at_output = np.where(v["VOS"] == 2, v["Vs"], 0.0)
    VA = E - at_output + v["KLR"] * np.maximum(If - v["ILR"], 0.0)
    error = VA / v["KA"]
    lowI, highI = holding(error, v["VIMIN"], v["VIMAX"])
    lowA, highA = holding(VA, v["VAMIN"], v["VAMAX"])
    relative, loaded = E / V, (E + v["KC"] * If) / V
    gateI, at_error = under_excitation_gate(v, error)
    gateA, under = under_excitation_gate(v, E)
    gateO, over = over_excitation_gate(v, E)
    return Start(
        {"Vm": v["Vc"], "x": error, "x1": error, "VA": VA, "xF": E},
        {
            "Vref": error + v["Vc"] - (v["Vs"] - at_output),
            "lowI": lowI,
            "highI": highI,
            "lowA": lowA,
            "highA": highA,
            "lowR": np.minimum(relative, v["VRMIN"]),
            "highR": np.maximum(loaded, v["VRMAX"]),
            "gateI": np.where(v["UEL"] == 2, gateI, -OPEN),
            "gateA": np.where(v["UEL"] == 3, gateA, -OPEN),
            "gateO": gateO,
        },
        (
            Limit("error of voltage", error, v["VIMIN"], v["VIMAX"], ("VIMIN", "VIMAX")),
            Limit("regulator", VA, v["VAMIN"], v["VAMAX"], ("VAMIN", "VAMAX")),
            Limit("field voltage at V = 1", relative, v["VRMIN"], np.inf, ("VRMIN", "infinity")),
            Limit("field voltage at V = 1 with loading", loaded, -np.inf, v["VRMAX"], ("-infinity", "VRMAX")),
            at_error._replace(lower=np.where(v["UEL"] == 2, at_error.lower, -OPEN)),
            under._replace(lower=np.where(v["UEL"] == 3, under.lower, -OPEN)),
            over,
        ),
    )


ESST1A = Part(
    name="ESST1A",
    slot="exciter",
    title="Static exciter, type ST1A",
    fields=FIELDS,
    stages=(esst1a,),
    ports=("Efd",),
    states=("Vm", "x", "x1", "VA", "xF"),
    setpoints=("Vref", "lowI", "highI", "lowA", "highA", "lowR", "highR", "gateI", "gateA", "gateO"),
    start=start,
    rules=("VIMIN < VIMAX", "VAMIN < VAMAX", "VRMIN < VRMAX", "TC needs TB", "TC1 needs TB1", "KF needs TF"),
    formula="VA = [KA / (1 + s TA) · (1 + s TC) / (1 + s TB) · (1 + s TC1) / (1 + s TB1) · "
    "(Vref + Vs − Vc / (1 + s TR) − VF)] within VAMIN, VAMAX; "
    "Efd = [VA − KLR [If − ILR]⁺] within V · VRMIN, V · VRMAX − KC If",
    source="IEEE Std 421.5-2005, type ST1A; PSS/E model library, ESST1A",
    checked="OpenIPSL (one machine, with and without stabiliser)",
)
