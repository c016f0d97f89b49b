r"""ESST4B, static exciter with two PI regulators and a compound source (IEEE type ST4B).

.. math::

    T_R\,\dot V_m &= V_c - V_m,\quad e = V_{ref} + V_s + V_L - V_m  & (1)\\
    V_R &= K_{PR}\,e + x_R,\quad \dot x_R = K_{IR}\,e,\quad V_{RMIN} \le V_R \le V_{RMAX}  & (2)\\
    T_A\,\dot V_A &= V_R - V_A,\quad u = V_A - K_G E_{fd}  & (3)\\
    V_M &= K_{PM}\,u + x_M,\quad \dot x_M = K_{IM}\,u,\quad V_{MMIN} \le V_M \le V_{MMAX}  & (4)\\
    E_{fd} &= \min(V_M, V_{OEL})\min(V_B, V_{BMAX})  & (5)

with the available voltage :math:`V_B` of `errorscreen.models.exciters.compound_source`. The loop of :math:`K_G` through
(4) and (5) has no delay where :math:`K_{PM} > 0` and is solved. An integral holds while its output is at a limit and
the input leads beyond it. :math:`V_L = V_{UEL}`, and :math:`V_{OEL}` is added where it does
not enter at the gate of (5) (`errorscreen.models.limiters.gates`).

(IEEE Std 421.5-2005, type ST4B; PSS/E model library, ESST4B.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, hold_at_limits, select
from errorscreen.models.blocks import lag, limited_pi
from errorscreen.models.exciters.compound_source import compound_source
from errorscreen.models.limiters.gates import low_value, over_excitation_gate, summed
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TR     | s   | 0.02 | -         | >= 0 | time constant of the voltage transducer
    KPR    | pu  | 3    | 0.5 .. 15 | >= 0 | proportional gain of the voltage regulator
    KIR    | pu/s | 3   | 0.5 .. 15 | >= 0 | integral gain of the voltage regulator
    VRMAX  | pu  | 1    | limit     | any  | upper limit of the voltage regulator
    VRMIN  | pu  | -0.87 | limit    | any  | lower limit of the voltage regulator
    TA     | s   | 0.01 | -         | >= 0 | time constant of the regulator
    KPM    | pu  | 1    | -         | >= 0 | proportional gain of the inner regulator
    KIM    | pu/s | 0   | -         | >= 0 | integral gain of the inner regulator
    VMMAX  | pu  | 1    | limit     | any  | upper limit of the inner regulator
    VMMIN  | pu  | -0.87 | limit    | any  | lower limit of the inner regulator
    KG     | pu  | 0    | -         | >= 0 | gain of the feedback of the field voltage
    KP     | pu  | 6.7  | 3 .. 12   | >= 0 | gain of the source on the voltage
    KI     | pu  | 0    | -         | >= 0 | gain of the source on the current
    VBMAX  | pu  | 8.4  | limit     | > 0  | upper limit of the available voltage
    KC     | pu  | 0.1  | 0 .. 0.4 unless 0  | >= 0 | loading of the rectifier
    XL     | pu  | 0    | -         | >= 0 | reactance of the source
    THETAP | deg | 0    | -         | any  | angle of the gain KP
    """
)


@stage("Efd", "VB", "d_Vm", "d_xR", "d_VA", "d_xM")
def esst4b(
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
    xR: Any,
    VA: Any,
    xM: Any,
    Vref: Any,
    KPr: Any,
    KPi: Any,
    lowR: Any,
    highR: Any,
    lowM: Any,
    highM: Any,
    gateO: Any,
    TR: Any,
    KPR: Any,
    KIR: Any,
    TA: Any,
    KPM: Any,
    KIM: Any,
    KG: Any,
    KI: Any,
    VBMAX: Any,
    KC: Any,
    XL: Any,
    shortest: Any,
) -> Any:
    """Field voltage and derivatives, (1) to (5)."""
    available = compound_source(Vd, Vq, Id, Iq, If, KPr, KPi, KI, XL, KC)
    VB = select(available > VBMAX, VBMAX, available)
    measured, d_Vm = lag(Vm, Vc, TR, shortest)
    e = Vref + Vs - measured + VUEL + summed(VOEL, gateO)
    regulator, d_xR = limited_pi(xR, e, KPR, KIR, lowR, highR)
    outer, d_VA = lag(VA, regulator, TA, shortest)
    # VM = clip(KPM (outer - KG VB VM) + xM): monotone in VM, so the limits act on the solution without them
    VM = clip((KPM * outer + xM) / (1.0 + KPM * KG * VB), lowM, highM)
    Efd = low_value(VM, VOEL, gateO) * VB
    inner = outer - KG * Efd
    d_xM = hold_at_limits(KPM * inner + xM, KIM * inner, lowM, highM)
    return Efd, VB, d_Vm, d_xR, d_VA, d_xM


def _at_rest(output: Any, KP: Any, KI: Any) -> tuple[Any, Any]:
    """Input and integral of a PI block at rest: without an integral the input has to make the output."""
    integrates = KI != 0
    direct = ~integrates & (KP != 0)
    error = np.where(direct, output / np.where(KP == 0, 1.0, KP), 0.0)
    return error, np.where(direct, 0.0, output)


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0; a source without voltage leaves VM beyond its limits."""
    E, angle = v["Efd0"], np.deg2rad(v["THETAP"])
    KPr, KPi = v["KP"] * np.cos(angle), v["KP"] * np.sin(angle)
    terminal = (v["Vd"], v["Vq"], v["Id"], v["Iq"], v["If"])
    VB = np.minimum(compound_source(*terminal, KPr, KPi, v["KI"], v["XL"], v["KC"]), v["VBMAX"])
    VM = E / np.maximum(VB, 1e-6)
    inner, xM = _at_rest(VM, v["KPM"], v["KIM"])
    VR = inner + v["KG"] * E
    error, xR = _at_rest(VR, v["KPR"], v["KIR"])
    lowR, highR = holding(VR, v["VRMIN"], v["VRMAX"])
    lowM, highM = holding(VM, v["VMMIN"], v["VMMAX"])
    gateO, over = over_excitation_gate(v, VM)
    return Start(
        {"Vm": v["Vc"], "xR": xR, "VA": VR, "xM": xM},
        {
            "Vref": error + v["Vc"] - v["Vs"],
            "KPr": KPr,
            "KPi": KPi,
            "lowR": lowR,
            "highR": highR,
            "lowM": lowM,
            "highM": highM,
            "gateO": gateO,
        },
        (
            Limit("voltage regulator", VR, v["VRMIN"], v["VRMAX"], ("VRMIN", "VRMAX")),
            Limit("inner regulator", VM, v["VMMIN"], v["VMMAX"], ("VMMIN", "VMMAX")),
            over,
        ),
    )


ESST4B = Part(
    name="ESST4B",
    slot="exciter",
    title="Static exciter, type ST4B",
    fields=FIELDS,
    stages=(esst4b,),
    ports=("Efd",),
    states=("Vm", "xR", "VA", "xM"),
    setpoints=("Vref", "KPr", "KPi", "lowR", "highR", "lowM", "highM", "gateO"),
    start=start,
    rules=("VRMIN < VRMAX", "VMMIN < VMMAX"),
    formula="Efd = VB · [(KPM + KIM / s) (VA − KG Efd)] within VMMIN, VMMAX; VA = [(KPR + KIR / s) (Vref + Vs − "
    "Vc / (1 + s TR))] within VRMIN, VRMAX / (1 + s TA); VB = |KP V + j (KI + KP XL) I| FEX ≤ VBMAX",
    source="IEEE Std 421.5-2005, type ST4B; PSS/E model library, ESST4B",
)
