r"""ST5B, static exciter fed by the terminal, with two limited lead-lags (IEEE type ST5B).

.. math::

    T_R\,\dot V_m &= V_c - V_m,\quad e = \min(\max(V_{ref} - V_m + V_L, V_{UEL}), V_{OEL}) + V_s  & (1)\\
    y &= \frac{1 + sT_{C1}}{1 + sT_{B1}}e,\quad z = \frac{1 + sT_{C2}}{1 + sT_{B2}}y,\quad
    V_{RMIN}/K_R \le y, z \le V_{RMAX}/K_R\ \text{(non-windup)}  & (2)\\
    T_1\,\dot E &= K_R z - K_C X_{ad}I_{fd} - E,\quad
    V\,V_{RMIN} \le E_{fd} = E \le V\,V_{RMAX}\ \text{(non-windup)} & (3)

:math:`V_L` are the signals of limiters that do not enter at the gates of (1) (`errorscreen.models.limiters.gates`).
While a gate acts, the lead-lags keep the time constants of voltage control: TUC1 to TOB2 have no effect.

(IEEE Std 421.5-2005, type ST5B; PSS/E model library, ST5B.)
"""

from __future__ import annotations

from typing import Any

from errorscreen.engine.stages import stage
from errorscreen.models.blocks import following_lag, lag, limited_lead_lag
from errorscreen.models.limiters.gates import (
    high_value,
    low_value,
    over_excitation_gate,
    summed,
    under_excitation_gate,
)
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TR    | s  | 0.02  | -           | >= 0 | time constant of the voltage transducer
    TC1   | s  | 0.8   | 0.2 .. 3 unless 0    | >= 0 | first lead time constant
    TB1   | s  | 6     | 2 .. 20 unless 0     | >= 0 | first lag time constant
    TC2   | s  | 0.08  | 0.02 .. 0.5 unless 0 | >= 0 | second lead time constant
    TB2   | s  | 0.01  | -           | >= 0 | second lag time constant
    KR    | pu | 200   | 50 .. 500   | > 0  | gain of the regulator
    VRMAX | pu | 5     | limit       | any  | upper limit of the regulator
    VRMIN | pu | -4    | limit       | any  | lower limit of the regulator
    T1    | s  | 0.004 | -           | >= 0 | time constant of the firing circuit
    KC    | pu | 0.004 | 0 .. 0.4 unless 0    | >= 0 | loading of the rectifier
    TUC1  | s  | 2     | -           | >= 0 | first lead time constant at under-excitation
    TUB1  | s  | 10    | -           | >= 0 | first lag time constant at under-excitation
    TUC2  | s  | 0.1   | -           | >= 0 | second lead time constant at under-excitation
    TUB2  | s  | 0.05  | -           | >= 0 | second lag time constant at under-excitation
    TOC1  | s  | 0.1   | -           | >= 0 | first lead time constant at over-excitation
    TOB1  | s  | 2     | -           | >= 0 | first lag time constant at over-excitation
    TOC2  | s  | 0.08  | -           | >= 0 | second lead time constant at over-excitation
    TOB2  | s  | 0.08  | -           | >= 0 | second lag time constant at over-excitation
    """
)


@stage("Efd", "d_Vm", "d_x1", "d_x2", "d_E")
def st5b(
    Vc: Any,
    Vs: Any,
    VUEL: Any,
    VOEL: Any,
    V: Any,
    If: Any,
    Vm: Any,
    x1: Any,
    x2: Any,
    E: Any,
    Vref: Any,
    low: Any,
    high: Any,
    lowE: Any,
    highE: Any,
    gateU: Any,
    gateO: Any,
    TR: Any,
    TC1: Any,
    TB1: Any,
    TC2: Any,
    TB2: Any,
    KR: Any,
    T1: Any,
    KC: Any,
    shortest: Any,
) -> Any:
    """Field voltage and derivatives, (1) to (3)."""
    measured, d_Vm = lag(Vm, Vc, TR, shortest)
    gated = Vref - measured + summed(VUEL, gateU) + summed(VOEL, gateO)
    gated = low_value(high_value(gated, VUEL, gateU), VOEL, gateO)
    y, d_x1 = limited_lead_lag(x1, gated + Vs, TC1, TB1, low / KR, high / KR, shortest)
    z, d_x2 = limited_lead_lag(x2, y, TC2, TB2, low / KR, high / KR, shortest)
    Efd, d_E = following_lag(E, KR * z - KC * If, T1, V * lowE, V * highE, shortest)
    return Efd, d_Vm, d_x1, d_x2, d_E


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0."""
    E = v["Efd0"]
    VR = E + v["KC"] * v["If"]
    error = VR / v["KR"]
    low, high = holding(VR, v["VRMIN"], v["VRMAX"])
    relative = E / v["V"]
    lowE, highE = holding(relative, v["VRMIN"], v["VRMAX"])
    gateU, under = under_excitation_gate(v, error - v["Vs"])
    gateO, over = over_excitation_gate(v, error - v["Vs"])
    return Start(
        {"Vm": v["Vc"], "x1": error, "x2": error, "E": E},
        {
            "Vref": error + v["Vc"] - v["Vs"],
            "low": low,
            "high": high,
            "lowE": lowE,
            "highE": highE,
            "gateU": gateU,
            "gateO": gateO,
        },
        (
            Limit("regulator", VR, v["VRMIN"], v["VRMAX"], ("VRMIN", "VRMAX")),
            Limit("field voltage at V = 1", relative, v["VRMIN"], v["VRMAX"], ("VRMIN", "VRMAX")),
            under,
            over,
        ),
    )


ST5B = Part(
    name="ST5B",
    slot="exciter",
    title="Static exciter, type ST5B",
    fields=FIELDS,
    stages=(st5b,),
    ports=("Efd",),
    states=("Vm", "x1", "x2", "E"),
    setpoints=("Vref", "low", "high", "lowE", "highE", "gateU", "gateO"),
    start=start,
    rules=("VRMIN < VRMAX", "TC1 needs TB1", "TC2 needs TB2"),
    formula="Efd = [(KR · (1 + s TC1) / (1 + s TB1) · (1 + s TC2) / (1 + s TB2) · (Vref + Vs − Vc / (1 + s TR)) "
    "− KC If) / (1 + s T1)] within V · VRMIN, V · VRMAX",
    source="IEEE Std 421.5-2005, type ST5B; PSS/E model library, ST5B",
)
