r"""AC8B, alternator with diode rectifier, digital PID regulator and limits of the field current.

.. math::

    T_R\,\dot V_m &= V_c - V_m,\quad e = V_{ref} + V_s + V_{UEL} + V_{OEL} - V_m  & (1)\\
    V_{PID} &= \Big(K_{PR} + \frac{K_{IR}}{s} + \frac{sK_{DR}}{1 + sT_{DR}}\Big)e,
        \quad V_{PIDMIN} \le V_{PID} \le V_{PIDMAX}  & (2)\\
    T_A\,\dot V_R &= K_A V_{PID} - V_R,\quad V_{RMIN} \le V_R \le V_{RMAX}\ \text{(non-windup)}  & (3)\\
    T_E\,\dot V_E &= V_R - V_{FE},\quad V_{EMIN} \le V_E \le V_{EMAX}\ \text{(non-windup)}  & (4)\\
    V_{FEMAX} &= (K_E + S_E(V_{EMAX}))V_{EMAX} + K_D I_{fd}  & (5)

The integral stops while the output of (2) is at a limit. (5), the highest voltage whose field current is allowed, is
solved as the root of a quadratic. Field current and rectifier are those of `errorscreen.models.exciters.alternator`.

(PSS/E model library, AC8B; IEEE Std 421.5-2005, type AC8B.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, select
from errorscreen.models.blocks import following_lag, lag, limited_pi, quadratic_saturation, rate
from errorscreen.models.exciters.alternator import at_rest, exciter_slope, field_voltage
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TR          | s    | 0.02 | -           | >= 0 | time constant of the voltage transducer
    KPR         | pu   | 80   | 10 .. 300   | >= 0 | proportional gain
    KIR         | pu/s | 5    | 1 .. 100    | >= 0 | integral gain
    KDR         | pu s | 10   | 0 .. 40     | >= 0 | derivative gain
    TDR         | s    | 0.1  | -           | >= 0 | lag of the derivative
    VPIDMAX     | pu   | 35   | limit       | any  | upper limit of the PID regulator
    VPIDMIN     | pu   | 0    | limit       | any  | lower limit of the PID regulator
    KA          | pu   | 1    | -           | > 0  | gain of the amplifier
    TA          | s    | 0.02 | -           | >= 0 | time constant of the amplifier
    VRMAX       | pu   | 35   | limit       | any  | upper limit of the amplifier
    VRMIN       | pu   | 0    | limit       | any  | lower limit of the amplifier
    KC          | pu   | 0.3  | -           | >= 0 | loading factor of the rectifier
    KD          | pu   | 0.5  | 0.1 .. 1.5  | >= 0 | demagnetisation by the field current of the machine
    KE          | pu   | 1    | -           | >= 0 | constant of the exciter
    TE          | s    | 1.2  | 0.3 .. 2    | > 0  | time constant of the exciter
    VFEMAX      | pu   | 6    | limit       | any  | upper limit of the field current of the exciter
    VEMIN       | pu   | 0    | limit       | >= 0 | lower limit of the voltage of the exciter
    E1          | pu   | 6.5  | -           | >= 0 | first point of the saturation
    S1 = SE(E1) | -    | 0.3  | -           | >= 0 | saturation at E1
    E2          | pu   | 9    | -           | >= 0 | second point of the saturation
    S2 = SE(E2) | -    | 3    | -           | >= 0 | saturation at E2
    """
)


@register_jitable
def voltage_at(VFE: Any, KE: Any, satA: Any, satB: Any) -> Any:
    """Voltage of an exciter with a field current, without load: (5) solved.

    Examples
    --------
    >>> v = voltage_at(5.0, 1.0, 3.0, 0.2)
    >>> round(float(v + quadratic_saturation(v, 3.0, 0.2)), 12), float(voltage_at(2.0, 1.0, 3.0, 0.2))
    (5.0, 2.0)
    """
    slope = select(KE < 1e-6, 1e-6, KE)
    over = clip(VFE - slope * satA, 0.0, 1e9)
    saturated = satA + 2.0 * over / (slope + np.sqrt(slope * slope + 4.0 * satB * over))
    return select(over > 0.0, saturated, VFE / slope)


@stage("VFE", "Efd", "topE")
def limited_alternator(
    VE: Any, If: Any, lowE: Any, highFE: Any, KC: Any, KD: Any, KE: Any, satA: Any, satB: Any
) -> Any:
    """Field current and field voltage with limits, (5)."""
    top = voltage_at(highFE - KD * If, KE, satA, satB)
    topE = select(top < lowE, lowE, top)
    limited = clip(VE, lowE, topE)
    VFE = KE * limited + quadratic_saturation(limited, satA, satB) + KD * If
    return VFE, field_voltage(limited, If, KC), topE


@stage("VR", "d_Vm", "d_xI", "d_xD", "d_R", "d_VE")
def ac8b(
    Vc: Any, Vs: Any, VUEL: Any, VOEL: Any, VFE: Any, topE: Any, Vm: Any, xI: Any, xD: Any, R: Any, VE: Any,
    Vref: Any, lowP: Any, highP: Any, lowR: Any, highR: Any, lowE: Any, TR: Any, KPR: Any, KIR: Any, KDR: Any,
    TDR: Any, KA: Any, TA: Any, TE: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Regulator and voltage of the exciter, (1) to (4)."""
    measured, d_Vm = lag(Vm, Vc, TR, shortest)
    e = Vref + Vs - measured + VUEL + VOEL
    derivative, d_xD = rate(xD, e, KDR, TDR, shortest)
    pid, d_xI = limited_pi(xI + derivative, e, KPR, KIR, lowP, highP)
    VR, d_R = following_lag(R, KA * pid, TA, lowR, highR, shortest)
    d_VE = exciter_slope(VE, VR, VFE, TE, lowE, topE, shortest)
    return VR, d_Vm, d_xI, d_xD, d_R, d_VE


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0: without an integral the error of the voltage rests at another value."""
    rest = at_rest(v)
    pid = rest.VFE / v["KA"]
    droops = (v["KIR"] == 0) & (v["KPR"] != 0)
    e = np.where(droops, pid / np.where(v["KPR"] == 0, 1.0, v["KPR"]), 0.0)
    lowP, highP = holding(pid, v["VPIDMIN"], v["VPIDMAX"])
    lowR, highR = holding(rest.VFE, v["VRMIN"], v["VRMAX"])
    return Start(
        {"VE": rest.VE, "Vm": v["Vc"], "xI": np.where(droops, 0.0, pid), "xD": e, "R": rest.VFE},
        {
            "Vref": e + v["Vc"] - v["Vs"],
            "lowP": lowP,
            "highP": highP,
            "lowR": lowR,
            "highR": highR,
            **rest.setpoints,
            "lowE": np.minimum(rest.VE, v["VEMIN"]),
            "highFE": np.maximum(rest.VFE, v["VFEMAX"]),
        },
        (
            Limit("output of the PID regulator", pid, v["VPIDMIN"], v["VPIDMAX"], ("VPIDMIN", "VPIDMAX")),
            Limit("output of the amplifier", rest.VFE, v["VRMIN"], v["VRMAX"], ("VRMIN", "VRMAX")),
            Limit("field current of the exciter", rest.VFE, -np.inf, v["VFEMAX"], ("-infinity", "VFEMAX")),
            Limit("voltage of the exciter", rest.VE, v["VEMIN"], np.inf, ("VEMIN", "infinity")),
        ),
    )


AC8B = Part(
    name="AC8B",
    slot="exciter",
    title="Alternator with diode rectifier and PID regulator (IEEE AC8B)",
    fields=FIELDS,
    stages=(limited_alternator, ac8b),
    ports=("Efd",),
    states=("VE", "Vm", "xI", "xD", "R"),
    setpoints=("Vref", "lowP", "highP", "lowR", "highR", "lowE", "highFE", "satA", "satB"),
    start=start,
    rules=("VPIDMIN < VPIDMAX", "VRMIN < VRMAX", "KDR needs TDR"),
    formula="(1) to (5), (X1), (X3)",
    source="PSS/E model library, AC8B",
)
