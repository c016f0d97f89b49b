r"""ESAC6A, alternator with diode rectifier, lead-lag regulator and a limiter of the field current.

.. math::

    T_R\,\dot V_m &= V_c - V_m                                                                         & (1)\\
    y &= \frac{1 + sT_K}{1 + sT_A}K_A(V_{ref} + V_s + V_{UEL} + V_{OEL} - V_m)                      & (2)\\
    V_A &= \frac{1 + sT_C}{1 + sT_B}y,\quad V_{AMIN} \le V_A \le V_{AMAX}\ \text{(non-windup)}               & (3)\\
    V_H &= \frac{1 + sT_J}{1 + sT_H}\,h,\quad h = K_H(V_{FE} - V_{FELIM})\ \text{within}\ 0, V_{HMAX}          & (4)\\
    V_R &= V_A - V_H\ \text{within}\ V\,V_{RMIN}, V\,V_{RMAX}                                             & (5)

with the terminal voltage V. Alternator and rectifier are those of `errorscreen.models.exciters.alternator`.

(PSS/E model library, ESAC6A; IEEE Std 421.5-2005, type AC6A.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip
from errorscreen.models.blocks import lag, lead_lag, limited_lead_lag
from errorscreen.models.exciters.alternator import alternator, at_rest, excited
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TR          | s  | 0.02  | -             | >= 0 | time constant of the voltage transducer
    KA          | pu | 536   | 50 .. 1000    | > 0  | gain of the regulator
    TA          | s  | 0.086 | 0.02 .. 0.3   | >= 0 | first lag of the regulator
    TK          | s  | 0.18  | 0 .. 0.5      | >= 0 | first lead of the regulator
    TB          | s  | 9     | 2 .. 20       | >= 0 | second lag of the regulator
    TC          | s  | 3     | 0.5 .. 8      | >= 0 | second lead of the regulator
    VAMAX       | pu | 75    | limit         | any  | upper limit of the regulator
    VAMIN       | pu | -75   | limit         | any  | lower limit of the regulator
    VRMAX       | pu | 44    | limit         | any  | upper limit of the field voltage of the exciter, at 1 pu
    VRMIN       | pu | -36   | limit         | any  | lower limit of the field voltage of the exciter, at 1 pu
    TE          | s  | 1     | 0.2 .. 2      | > 0  | time constant of the exciter
    VFELIM      | pu | 19    | limit         | any  | field current at which the limiter acts
    KH          | pu | 92    | -             | >= 0 | gain of the limiter of the field current
    VHMAX       | pu | 75    | limit         | >= 0 | upper limit of the limiter
    TH          | s  | 0.08  | -             | >= 0 | lag of the limiter
    TJ          | s  | 0.02  | -             | >= 0 | lead of the limiter
    KC          | pu | 0.173 | -             | >= 0 | loading factor of the rectifier
    KD          | pu | 1.91  | 0.3 .. 3      | >= 0 | demagnetisation by the field current of the machine
    KE          | pu | 1.6   | -             | any  | constant of the exciter
    E1          | pu | 7.4   | -             | >= 0 | first point of the saturation
    S1 = SE(E1) | -  | 0.214 | -             | >= 0 | saturation at E1
    E2          | pu | 5.55  | -             | >= 0 | second point of the saturation
    S2 = SE(E2) | -  | 0.044 | -             | >= 0 | saturation at E2
    """
)


@stage("VA", "d_Vm", "d_xA", "d_xB")
def regulator(
    Vc: Any, Vs: Any, VUEL: Any, VOEL: Any, Vm: Any, xA: Any, xB: Any, Vref: Any, low: Any, high: Any, TR: Any,
    KA: Any, TA: Any, TK: Any, TB: Any, TC: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Output of the regulator, (1) to (3)."""
    measured, d_Vm = lag(Vm, Vc, TR, shortest)
    y, d_xA = lead_lag(xA, KA * (Vref + Vs - measured + VUEL + VOEL), TK, TA, shortest)
    VA, d_xB = limited_lead_lag(xB, y, TC, TB, low, high, shortest)
    return VA, d_Vm, d_xA, d_xB


@stage("VR", "d_xH")
def limiter(
    V: Any, VA: Any, VFE: Any, xH: Any, lowR: Any, highR: Any, VFELIM: Any, KH: Any, VHMAX: Any, TH: Any, TJ: Any,
    shortest: Any,
) -> Any:  # fmt: skip
    """Field voltage of the exciter, (4) and (5)."""
    VH, d_xH = lead_lag(xH, clip(KH * (VFE - VFELIM), 0.0, VHMAX), TJ, TH, shortest)
    return clip(VA - VH, V * lowR, V * highR), d_xH


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0; the limiter may act."""
    rest = at_rest(v)
    VH = np.clip(v["KH"] * (rest.VFE - v["VFELIM"]), 0.0, v["VHMAX"])
    VA = rest.VFE + VH
    low, high = holding(VA, v["VAMIN"], v["VAMAX"])
    relative = rest.VFE / v["V"]
    lowR, highR = holding(relative, v["VRMIN"], v["VRMAX"])
    return Start(
        {"VE": rest.VE, "Vm": v["Vc"], "xA": VA, "xB": VA, "xH": VH},
        {
            "Vref": VA / v["KA"] + v["Vc"] - v["Vs"],
            "low": low,
            "high": high,
            "lowR": lowR,
            "highR": highR,
            **rest.setpoints,
        },
        (
            Limit("output of the regulator", VA, v["VAMIN"], v["VAMAX"], ("VAMIN", "VAMAX")),
            Limit(
                "field voltage of the exciter over terminal voltage",
                relative,
                v["VRMIN"],
                v["VRMAX"],
                ("VRMIN", "VRMAX"),
            ),
            rest.limit,
        ),
    )


ESAC6A = Part(
    name="ESAC6A",
    slot="exciter",
    title="Alternator with diode rectifier and field current limiter (IEEE AC6A)",
    fields=FIELDS,
    stages=(alternator, regulator, limiter, excited),
    ports=("Efd",),
    states=("VE", "Vm", "xA", "xB", "xH"),
    setpoints=("Vref", "low", "high", "lowR", "highR", "lowE", "satA", "satB"),
    start=start,
    rules=("VAMIN < VAMAX", "VRMIN < VRMAX", "TK needs TA", "TC needs TB", "TJ needs TH"),
    formula="(1) to (5), (X1) to (X3)",
    source="PSS/E model library, ESAC6A",
)
