r"""ESDC1A and ESDC2A, rotating exciters with regulator and lead-lag (IEEE types DC1A and DC2A).

.. math::

    T_R\,\dot V_m &= V_c - V_m,\quad e = V_{ref} + V_s + V_L - V_m - V_F  & (1)\\
    T_B\,\dot x &= e - x,\quad y = \max(x + (T_C/T_B)(e - x), V_{UEL})  & (2)\\
    T_A\,\dot V_R &= K_A y - V_R,\quad b V_{RMIN} \le V_R \le b V_{RMAX}\ \text{(non-windup)}  & (3)\\
    T_E\,\dot E_{fd} &= V_R - K_E E_{fd} - S_E(E_{fd})E_{fd},\quad E_{fd} \ge 0\ \text{(non-windup)}  & (4)\\
    T_{F1}\,\dot x_F &= E_{fd} - x_F,\quad V_F = (K_F/T_{F1})(E_{fd} - x_F)  & (5)

with :math:`b = 1` in ESDC1A, and :math:`b = V` in ESDC2A, whose regulator is fed by the terminal. Zero as KE or VRMAX
means a computed value (`errorscreen.models.exciters.rotating`). The field ``Switch`` of the record is a place holder.
:math:`V_L = V_{OEL}`, and :math:`V_{UEL}` is added where it does not enter at the gate of (2)
(`errorscreen.models.limiters.gates`).

(IEEE Std 421.5-2005, types DC1A and DC2A; PSS/E model library, ESDC1A and ESDC2A.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, hold_at_limits
from errorscreen.models.blocks import following_lag, lag, lead_lag, rate
from errorscreen.models.exciters.rotating import computed, rotating
from errorscreen.models.limiters.gates import high_value, summed, under_excitation_gate
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TR          | s    | 0.02 | -            | >= 0 | time constant of the voltage transducer
    KA          | pu   | 100  | 10 .. 400    | > 0  | gain of the regulator
    TA          | s    | 0.05 | 0.01 .. 0.3  | >= 0 | time constant of the regulator
    TB          | s    | 0    | -            | >= 0 | lag time constant
    TC          | s    | 0    | -            | >= 0 | lead time constant
    VRMAX       | pu   | 5    | limit unless 0 | any  | upper limit of the regulator; 0: computed
    VRMIN       | pu   | -5   | limit        | any  | lower limit of the regulator
    KE          | pu   | 1    | - unless 0   | any  | constant of the exciter; 0: computed
    TE          | s    | 0.8  | 0.1 .. 1.5   | > 0  | time constant of the exciter
    KF          | pu   | 0.05 | 0.005 .. 0.2 unless 0 | >= 0 | gain of the rate feedback
    TF1         | s    | 1    | 0.3 .. 2     | >= 0 | time constant of the rate feedback
    Switch      | code | 0    | -            | any  | place holder
    E1          | pu   | 3    | -            | >= 0 | first point of the saturation
    S1 = SE(E1) | -    | 0.05 | -            | >= 0 | saturation at E1
    E2          | pu   | 4    | -            | >= 0 | second point of the saturation
    S2 = SE(E2) | -    | 0.3  | -            | >= 0 | saturation at E2
    """
)


@stage("supply")
def independent(V: Any) -> Any:
    """Supply of the regulator of ESDC1A."""
    return (0.0 * V + 1.0,)


@stage("supply")
def from_terminal(V: Any) -> Any:
    """Supply of the regulator of ESDC2A."""
    return (1.0 * V,)


@stage("Efd", "VF", "d_Vm", "d_x", "d_VR", "d_E", "d_xF")
def esdc(
    Vc: Any,
    Vs: Any,
    VUEL: Any,
    VOEL: Any,
    supply: Any,
    Vm: Any,
    x: Any,
    VR: Any,
    E: Any,
    xF: Any,
    Vref: Any,
    low: Any,
    high: Any,
    least: Any,
    gateU: Any,
    gain: Any,
    satA: Any,
    satB: Any,
    TR: Any,
    KA: Any,
    TA: Any,
    TB: Any,
    TC: Any,
    TE: Any,
    KF: Any,
    TF1: Any,
    shortest: Any,
) -> Any:
    """Field voltage and derivatives, (1) to (5); ``gain`` is KE, computed where the record has 0."""
    measured, d_Vm = lag(Vm, Vc, TR, shortest)
    Efd = clip(E, least, 1e9)
    VF, d_xF = rate(xF, Efd, KF, TF1, shortest)
    e = Vref + Vs - measured - VF + summed(VUEL, gateU) + VOEL
    y, d_x = lead_lag(x, e, TC, TB, shortest)
    input = KA * high_value(y, VUEL, gateU)
    regulator, d_VR = following_lag(VR, input, TA, low * supply, high * supply, shortest)
    d_E = hold_at_limits(E, rotating(E, regulator, gain, TE, satA, satB, shortest), least, 1e9)
    return Efd, VF, d_Vm, d_x, d_VR, d_E, d_xF


def _starting(v: Values, supply: Any) -> Start:
    E, found = v["Efd0"], computed(v)
    low, high = holding(found.VR / supply, found.VRMIN, found.VRMAX)
    error = found.VR / v["KA"]
    gateU, under = under_excitation_gate(v, error)
    return Start(
        {"Vm": v["Vc"], "x": error, "VR": found.VR, "E": E, "xF": E},
        {
            "Vref": error + v["Vc"] - v["Vs"],
            "low": low,
            "high": high,
            "least": np.minimum(E, 0.0),
            "gateU": gateU,
            "gain": found.KE,
            "satA": found.satA,
            "satB": found.satB,
        },
        (
            Limit("regulator", found.VR / supply, found.VRMIN, found.VRMAX, ("VRMIN", "VRMAX")),
            Limit("field voltage", E, 0.0, 1e9, ("0", "")),
            under,
        ),
    )


def start_independent(v: Values) -> Start:
    """Equilibrium of ESDC1A at the field voltage Efd0."""
    return _starting(v, 1.0)


def start_from_terminal(v: Values) -> Start:
    """Equilibrium of ESDC2A at the field voltage Efd0."""
    return _starting(v, v["V"])


def _exciter(name: str, title: str, supply: Any, start: Any, limits: str) -> Part:
    return Part(
        name=name,
        slot="exciter",
        title=title,
        fields=FIELDS,
        stages=(supply, esdc),
        ports=("Efd",),
        states=("Vm", "x", "VR", "E", "xF"),
        setpoints=("Vref", "low", "high", "least", "gateU", "gain", "satA", "satB"),
        start=start,
        rules=("VRMIN <= VRMAX", "KF needs TF1", "TC needs TB"),
        formula="VR = [KA / (1 + s TA) · (1 + s TC) / (1 + s TB) · (Vref + Vs − Vc / (1 + s TR) − s KF / (1 + s TF1) "
        f"· Efd)] within {limits}; TE dEfd/dt = VR − (KE + SE(Efd)) Efd, Efd ≥ 0",
        source=f"IEEE Std 421.5-2005; PSS/E model library, {name}",
    )


ESDC1A = _exciter("ESDC1A", "Rotating exciter, type DC1A", independent, start_independent, "VRMIN, VRMAX")
ESDC2A = _exciter(
    "ESDC2A", "Rotating exciter, type DC2A", from_terminal, start_from_terminal, "V · VRMIN, V · VRMAX"
)
