r"""IEEET1, rotating exciter with continuously acting regulator (IEEE type 1, 1968).

.. math::

    T_R\,\dot V_m &= V_c - V_m  & (1)\\
    T_A\,\dot V_R &= K_A(V_{ref} + V_s + V_{UEL} + V_{OEL} - V_m - V_F) - V_R,\quad
    V_{RMIN} \le V_R \le V_{RMAX}\ \text{(non-windup)}  & (2)\\
    T_E\,\dot E_{fd} &= V_R - K_E E_{fd} - S_E(E_{fd})E_{fd}  & (3)\\
    T_F\,\dot x_F &= E_{fd} - x_F,\quad V_F = (K_F/T_F)(E_{fd} - x_F)  & (4)

Zero as KE or VRMAX means a computed value (`errorscreen.models.exciters.rotating`). The field ``Switch`` of the record
is a place holder.

(PSS/E model library, IEEET1; type DC1 of IEEE Std 421.5-2016 without lead-lag.)
"""

from __future__ import annotations

from typing import Any

from errorscreen.engine.stages import stage
from errorscreen.models.blocks import lag, limited_lag, rate
from errorscreen.models.exciters.rotating import computed, rotating
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TR          | s    | 0.02 | -            | >= 0 | time constant of the voltage transducer
    KA          | pu   | 100  | 10 .. 400    | > 0  | gain of the regulator
    TA          | s    | 0.05 | 0.01 .. 0.3  | >= 0 | time constant of the regulator
    VRMAX       | pu   | 4    | limit unless 0 | any  | upper limit of the regulator; 0: computed
    VRMIN       | pu   | -4   | limit        | any  | lower limit of the regulator
    KE          | pu   | 1    | - unless 0   | any  | constant of the exciter; 0: computed
    TE          | s    | 0.5  | 0.1 .. 1.5   | > 0  | time constant of the exciter
    KF          | pu   | 0.05 | 0.005 .. 0.2 unless 0 | >= 0 | gain of the rate feedback
    TF          | s    | 1    | 0.3 .. 2     | >= 0 | time constant of the rate feedback
    Switch      | code | 0    | -            | any  | place holder
    E1          | pu   | 3    | -            | >= 0 | first point of the saturation
    S1 = SE(E1) | -    | 0.05 | -            | >= 0 | saturation at E1
    E2          | pu   | 4    | -            | >= 0 | second point of the saturation
    S2 = SE(E2) | -    | 0.3  | -            | >= 0 | saturation at E2
    """
)


@stage("Efd", "VF", "d_Vm", "d_VR", "d_E", "d_xF")
def ieeet1(
    Vc: Any,
    Vs: Any,
    VUEL: Any,
    VOEL: Any,
    Vm: Any,
    VR: Any,
    E: Any,
    xF: Any,
    Vref: Any,
    low: Any,
    high: Any,
    gain: Any,
    satA: Any,
    satB: Any,
    TR: Any,
    KA: Any,
    TA: Any,
    TE: Any,
    KF: Any,
    TF: Any,
    shortest: Any,
) -> Any:
    """Field voltage and derivatives, (1) to (4); ``gain`` is KE, computed where the record has 0."""
    measured, d_Vm = lag(Vm, Vc, TR, shortest)
    VF, d_xF = rate(xF, E, KF, TF, shortest)
    regulator, d_VR = limited_lag(VR, KA * (Vref + Vs - measured - VF + VUEL + VOEL), TA, low, high, shortest)
    return E, VF, d_Vm, d_VR, rotating(E, regulator, gain, TE, satA, satB, shortest), d_xF


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0."""
    E, found = v["Efd0"], computed(v)
    low, high = holding(found.VR, found.VRMIN, found.VRMAX)
    return Start(
        {"Vm": v["Vc"], "VR": found.VR, "E": E, "xF": E},
        {
            "Vref": found.VR / v["KA"] + v["Vc"] - v["Vs"],
            "low": low,
            "high": high,
            "gain": found.KE,
            "satA": found.satA,
            "satB": found.satB,
        },
        (Limit("regulator", found.VR, found.VRMIN, found.VRMAX, ("VRMIN", "VRMAX")),),
    )


IEEET1 = Part(
    name="IEEET1",
    slot="exciter",
    title="Rotating exciter, IEEE type 1",
    fields=FIELDS,
    stages=(ieeet1,),
    ports=("Efd",),
    states=("Vm", "VR", "E", "xF"),
    setpoints=("Vref", "low", "high", "gain", "satA", "satB"),
    start=start,
    rules=("VRMIN <= VRMAX", "KF needs TF"),
    formula="VR = [KA / (1 + s TA) · (Vref + Vs − Vc / (1 + s TR) − s KF / (1 + s TF) · Efd)] within VRMIN, VRMAX; "
    "TE dEfd/dt = VR − (KE + SE(Efd)) Efd",
    source="PSS/E model library, IEEET1",
    checked="OpenIPSL (one machine, two records)",
)
