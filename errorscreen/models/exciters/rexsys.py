r"""REXSYS, general rotating excitation system: voltage regulator, field current regulator, alternator with rectifier.

.. math::

    T_R\,\dot V_m &= V_c - V_m,\quad
    e = V_{ref} + V_s + V_{UEL} + V_{OEL} - V_m - V_F\ \text{within}\ \pm V_{IMAX} & (1)\\
    y &= \frac{(1 + sT_{C1})(1 + sT_{C2})}{(1 + sT_{B1})(1 + sT_{B2})}\Big(K_{VP} + \frac{K_{VI}}{s}\Big)e  & (2)\\
    T_A\,\dot V_R &= y - V_R,\quad V_{RMIN} \le V_R \le V_{RMAX}\ \text{(non-windup)}  & (3)\\
    z &= \Big(K_{IP} + \frac{K_{II}}{s}\Big)(V_R - K_H V_{FE})\ \text{within}\ m\,V_{FMIN}, m\,V_{FMAX}  & (4)\\
    V_X &= z/(1 + sT_P),\quad T_E\,\dot V_E = V_X - V_{FE}  & (5)\\
    V_F &= \frac{sK_F(1 + sT_{F1})}{(1 + sT_F)(1 + sT_{F2})}u  & (6)

with m the terminal voltage where F1IMF is 1, else 1, and u after FBF: 0 :math:`V_R`, 1 :math:`V_{FE}`, 2
:math:`E_{fd}`. The integral of (2) stays within the limits of (3), that of (4) stops while z is at a limit. Alternator
and rectifier are those of `errorscreen.models.exciters.alternator`.

(PSS/E model library, REXSYS; PSLF, REXS; IEC 61970-302, ExcREXS, without compounding and V/Hz limiter.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, hold_at_limits, select
from errorscreen.models.blocks import following_lag, lag, lead_lag, limited_pi, rate
from errorscreen.models.exciters.alternator import UNLIMITED, alternator, at_rest, exciter_slope
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TR          | s    | 0.02   | -           | >= 0    | time constant of the voltage transducer
    KVP         | pu   | 200    | 50 .. 3000  | >= 0    | proportional gain of the voltage regulator
    KVI         | pu/s | 0      | -           | >= 0    | integral gain of the voltage regulator
    VIMAX       | pu   | 0.1    | limit       | > 0     | limit of the error of the voltage
    TA          | s    | 0.01   | -           | >= 0    | time constant of the voltage regulator
    TB1         | s    | 0      | -           | >= 0    | first lag
    TC1         | s    | 0      | -           | >= 0    | first lead
    TB2         | s    | 0      | -           | >= 0    | second lag
    TC2         | s    | 0      | -           | >= 0    | second lead
    VRMAX       | pu   | 20     | limit       | any     | upper limit of the voltage regulator
    VRMIN       | pu   | -20    | limit       | any     | lower limit of the voltage regulator
    KF          | pu   | 0.05   | 0.01 .. 0.2 | >= 0    | gain of the rate feedback
    TF          | s    | 1      | 0.3 .. 2    | >= 0    | time constant of the rate feedback
    TF1         | s    | 0      | -           | >= 0    | lead of the rate feedback
    TF2         | s    | 0      | -           | >= 0    | second lag of the rate feedback
    FBF         | code | 1      | -           | 0, 1, 2 | signal of the rate feedback
    KIP         | pu   | 1      | 0.5 .. 10   | >= 0    | proportional gain of the field current regulator
    KII         | pu/s | 0      | -           | >= 0    | integral gain of the field current regulator
    TP          | s    | 0      | -           | >= 0    | time constant of the bridge
    VFMAX       | pu   | 15     | limit       | any     | upper limit of the field voltage of the exciter
    VFMIN       | pu   | -10    | limit       | any     | lower limit of the field voltage of the exciter
    KH          | pu   | 0      | -           | >= 0    | gain of the field current feedback
    KE          | pu   | 1      | -           | any     | constant of the exciter
    TE          | s    | 1.2    | 0.3 .. 2    | > 0     | time constant of the exciter
    KC          | pu   | 0.05   | -           | >= 0    | loading factor of the rectifier
    KD          | pu   | 1      | 0.3 .. 2    | >= 0    | demagnetisation by the field current of the machine
    E1          | pu   | 3      | -           | >= 0    | first point of the saturation
    S1 = SE(E1) | -    | 0.0001 | -           | >= 0    | saturation at E1
    E2          | pu   | 4      | -           | >= 0    | second point of the saturation
    S2 = SE(E2) | -    | 0.001  | -           | >= 0    | saturation at E2
    F1IMF       | code | 0      | -           | 0, 1    | 1: limits of the field voltage follow the terminal voltage
    """
)


@stage("VR", "VF", "d_xF", "d_xF2")
def feedback(
    VFE: Any, Efd: Any, R: Any, xF: Any, xF2: Any, lowR: Any, highR: Any, FBF: Any, KF: Any, TF: Any, TF1: Any,
    TF2: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Rate feedback, (6)."""
    VR = clip(R, lowR, highR)
    u = select(FBF == 0.0, VR, select(FBF == 1.0, VFE, Efd))
    first, d_xF = rate(xF, u, KF, TF, shortest)
    VF, d_xF2 = lead_lag(xF2, first, TF1, TF2, shortest)
    return VR, VF, d_xF, d_xF2


@stage("d_Vm", "d_xV", "d_x1", "d_x2", "d_R")
def voltage_regulator(
    Vc: Any, Vs: Any, VUEL: Any, VOEL: Any, VF: Any, Vm: Any, xV: Any, x1: Any, x2: Any, R: Any, Vref: Any,
    lowI: Any, highI: Any, lowR: Any, highR: Any, TR: Any, KVP: Any, KVI: Any, TA: Any, TB1: Any, TC1: Any, TB2: Any,
    TC2: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Voltage regulator, (1) to (3)."""
    measured, d_Vm = lag(Vm, Vc, TR, shortest)
    e = clip(Vref + Vs - measured - VF + VUEL + VOEL, lowI, highI)
    integral = clip(xV, lowR, highR)
    y1, d_x1 = lead_lag(x1, KVP * e + integral, TC1, TB1, shortest)
    y2, d_x2 = lead_lag(x2, y1, TC2, TB2, shortest)
    _, d_R = following_lag(R, y2, TA, lowR, highR, shortest)
    return d_Vm, hold_at_limits(xV, KVI * e, lowR, highR), d_x1, d_x2, d_R


@stage("VX", "d_xC", "d_xP", "d_VE")
def current_regulator(
    V: Any, VR: Any, VFE: Any, VE: Any, xC: Any, xP: Any, lowF: Any, highF: Any, lowE: Any, F1IMF: Any, KIP: Any,
    KII: Any, KH: Any, TP: Any, TE: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Field current regulator and voltage of the exciter, (4) and (5)."""
    scale = select(F1IMF == 1.0, V, 1.0)
    z, d_xC = limited_pi(xC, VR - KH * VFE, KIP, KII, scale * lowF, scale * highF)
    VX, d_xP = lag(xP, z, TP, shortest)
    return VX, d_xC, d_xP, exciter_slope(VE, VX, VFE, TE, lowE, UNLIMITED, shortest)


def _pi_at_rest(output: Any, KP: Any, KI: Any) -> tuple[Any, Any]:
    """Error and integral of a PI regulator: without an integral the error rests at another value than zero."""
    droops = (KI == 0) & (KP != 0)
    return np.where(droops, output / np.where(KP == 0, 1.0, KP), 0.0), np.where(droops, 0.0, output)


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0."""
    rest = at_rest(v)
    error, integral = _pi_at_rest(rest.VFE, v["KIP"], v["KII"])
    VR = error + v["KH"] * rest.VFE
    e, xV = _pi_at_rest(VR, v["KVP"], v["KVI"])
    scale = np.where(v["F1IMF"] == 1, v["V"], 1.0)
    lowI, highI = holding(e, -v["VIMAX"], v["VIMAX"])
    lowR, highR = holding(VR, v["VRMIN"], v["VRMAX"])
    lowF, highF = holding(rest.VFE / scale, v["VFMIN"], v["VFMAX"])
    signal = np.where(v["FBF"] == 0, VR, np.where(v["FBF"] == 1, rest.VFE, v["Efd0"]))
    states = {
        "VE": rest.VE,
        "Vm": v["Vc"],
        "xV": xV,
        "x1": VR,
        "x2": VR,
        "R": VR,
        "xC": integral,
        "xP": rest.VFE,
        "xF": signal,
        "xF2": np.zeros_like(VR),
    }
    setpoints = {
        "Vref": e + v["Vc"] - v["Vs"],
        "lowI": lowI,
        "highI": highI,
        "lowR": lowR,
        "highR": highR,
        "lowF": lowF,
        "highF": highF,
        **rest.setpoints,
    }
    return Start(
        states,
        setpoints,
        (
            Limit("error of the voltage", e, -v["VIMAX"], v["VIMAX"], ("-VIMAX", "VIMAX")),
            Limit("output of the voltage regulator", VR, v["VRMIN"], v["VRMAX"], ("VRMIN", "VRMAX")),
            Limit(
                "field voltage of the exciter", rest.VFE / scale, v["VFMIN"], v["VFMAX"], ("VFMIN", "VFMAX")
            ),
            rest.limit,
        ),
    )


REXSYS = Part(
    name="REXSYS",
    slot="exciter",
    title="General rotating excitation system",
    fields=FIELDS,
    stages=(alternator, feedback, voltage_regulator, current_regulator),
    ports=("Efd",),
    states=("VE", "Vm", "xV", "x1", "x2", "R", "xC", "xP", "xF", "xF2"),
    setpoints=("Vref", "lowI", "highI", "lowR", "highR", "lowF", "highF", "lowE", "satA", "satB"),
    start=start,
    rules=(
        "VRMIN < VRMAX",
        "VFMIN < VFMAX",
        "TC1 needs TB1",
        "TC2 needs TB2",
        "KF needs TF",
        "TF1 needs TF2",
    ),
    formula="(1) to (6), (X1) to (X3)",
    source="PSS/E model library, REXSYS",
    aliases=("REXS",),
)
