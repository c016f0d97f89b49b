r"""EXAC1 and ESAC1A, alternator with diode rectifier, one regulator and stabilising feedback of the field current.

.. math::

    T_R\,\dot V_m &= V_c - V_m                                                                        & (1)\\
    V_F &= \frac{sK_F}{1 + sT_F}V_{FE},\quad e = V_{ref} + V_s + V_L - V_m - V_F                          & (2)\\
    T_B\,\dot x &= e - x,\quad y = x + (T_C/T_B)(e - x)                                                  & (3)\\
    T_A\,\dot V_A &= K_A y - V_A\ \text{within limits (non-windup)}                                        & (4)\\
    V_R &= V_A\ \text{(EXAC1)},\quad V_R = \min(\max(V_A, V_{UEL}), V_{OEL})\ \text{within}\ V_{RMIN}, V_{RMAX}
        \ \text{(ESAC1A)} & (5)

with the limits :math:`V_{RMIN}, V_{RMAX}` in (4) for EXAC1 and :math:`V_{AMIN}, V_{AMAX}` for ESAC1A. Alternator and
rectifier are those of `errorscreen.models.exciters.alternator`. :math:`V_L = V_{UEL} + V_{OEL}`, without signals that
enter at a gate of ESAC1A (`errorscreen.models.limiters.gates`).

(PSS/E model library, EXAC1 and ESAC1A; IEEE Std 421.5-2005, type AC1A; IEEE committee report 1981, type AC1.)
"""

from __future__ import annotations

from typing import Any

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip
from errorscreen.models.blocks import following_lag, lag, lead_lag
from errorscreen.models.exciters.alternator import alternator, at_rest, excited, rate_feedback
from errorscreen.models.limiters.gates import (
    high_value,
    low_value,
    over_excitation_gate,
    summed,
    under_excitation_gate,
)
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

_REGULATOR = record(
    """
    TR | s  | 0.02 | -           | >= 0 | time constant of the voltage transducer
    TB | s  | 0    | -           | >= 0 | lag of the regulator
    TC | s  | 0    | -           | >= 0 | lead of the regulator
    KA | pu | 400  | 50 .. 1000  | > 0  | gain of the regulator
    TA | s  | 0.02 | 0.01 .. 0.2 | >= 0 | time constant of the regulator
    """
)
_EXCITER = record(
    """
    TE          | s  | 0.8  | 0.2 .. 2     | > 0  | time constant of the exciter
    KF          | pu | 0.03 | 0.005 .. 0.1 | >= 0 | gain of the rate feedback
    TF          | s  | 1    | 0.3 .. 2     | >= 0 | time constant of the rate feedback
    KC          | pu | 0.2  | -            | >= 0 | loading factor of the rectifier
    KD          | pu | 0.38 | 0.1 .. 1     | >= 0 | demagnetisation by the field current of the machine
    KE          | pu | 1    | -            | any  | constant of the exciter
    E1          | pu | 4.18 | -            | >= 0 | first point of the saturation
    S1 = SE(E1) | -  | 0.1  | -            | >= 0 | saturation at E1
    E2          | pu | 3.14 | -            | >= 0 | second point of the saturation
    S2 = SE(E2) | -  | 0.03 | -            | >= 0 | saturation at E2
    """
)
_VR = record(
    """
    VRMAX | pu | 6.03  | limit | any | upper limit of the field voltage of the exciter
    VRMIN | pu | -5.43 | limit | any | lower limit of the field voltage of the exciter
    """
)
_VA = record(
    """
    VAMAX | pu | 14.5  | limit | any | upper limit of the regulator
    VAMIN | pu | -14.5 | limit | any | lower limit of the regulator
    """
)


@stage("VL")
def added(VUEL: Any, VOEL: Any) -> Any:
    """Signal of limiters at the summing point."""
    return (VUEL + VOEL,)


@stage("VL")
def added_without_gates(VUEL: Any, VOEL: Any, gateU: Any, gateO: Any) -> Any:
    """Signal of limiters at the summing point of ESAC1A, which has gates."""
    return (summed(VUEL, gateU) + summed(VOEL, gateO),)


@stage("VA", "d_Vm", "d_x", "d_A")
def regulator(
    Vc: Any, Vs: Any, VL: Any, VF: Any, Vm: Any, x: Any, A: Any, Vref: Any, low: Any, high: Any, TR: Any, TB: Any,
    TC: Any, KA: Any, TA: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Output of the regulator, (1) to (4)."""
    measured, d_Vm = lag(Vm, Vc, TR, shortest)
    y, d_x = lead_lag(x, Vref + Vs - measured - VF + VL, TC, TB, shortest)
    VA, d_A = following_lag(A, KA * y, TA, low, high, shortest)
    return VA, d_Vm, d_x, d_A


@stage("VR")
def unlimited(VA: Any) -> Any:
    """Field voltage of the exciter of EXAC1, (5)."""
    return (VA,)


@stage("VR")
def limited(VA: Any, VUEL: Any, VOEL: Any, gateU: Any, gateO: Any, lowR: Any, highR: Any) -> Any:
    """Field voltage of the exciter of ESAC1A, (5)."""
    return (clip(low_value(high_value(VA, VUEL, gateU), VOEL, gateO), lowR, highR),)


def start_exac1(v: Values) -> Start:
    """Equilibrium of EXAC1."""
    rest = at_rest(v)
    low, high = holding(rest.VFE, v["VRMIN"], v["VRMAX"])
    x = rest.VFE / v["KA"]
    return Start(
        {"VE": rest.VE, "xF": rest.VFE, "Vm": v["Vc"], "x": x, "A": rest.VFE},
        {"Vref": x + v["Vc"] - v["Vs"], "low": low, "high": high, **rest.setpoints},
        (
            Limit("field voltage of the exciter", rest.VFE, v["VRMIN"], v["VRMAX"], ("VRMIN", "VRMAX")),
            rest.limit,
        ),
    )


def start_esac1a(v: Values) -> Start:
    """Equilibrium of ESAC1A."""
    states, setpoints, limits, _ = start_exac1(v)
    VFE = states["A"]
    low, high = holding(VFE, v["VAMIN"], v["VAMAX"])
    gateU, under = under_excitation_gate(v, VFE)
    gateO, over = over_excitation_gate(v, VFE)
    return Start(
        states,
        {
            **setpoints,
            "low": low,
            "high": high,
            "lowR": setpoints["low"],
            "highR": setpoints["high"],
            "gateU": gateU,
            "gateO": gateO,
        },
        (
            Limit("output of the regulator", VFE, v["VAMIN"], v["VAMAX"], ("VAMIN", "VAMAX")),
            under,
            over,
            *limits,
        ),
    )


EXAC1 = Part(
    name="EXAC1",
    slot="exciter",
    title="Alternator with diode rectifier (IEEE AC1)",
    fields=_REGULATOR + _VR + _EXCITER,
    stages=(alternator, rate_feedback, added, regulator, unlimited, excited),
    ports=("Efd",),
    states=("VE", "xF", "Vm", "x", "A"),
    setpoints=("Vref", "low", "high", "lowE", "satA", "satB"),
    start=start_exac1,
    rules=("VRMIN < VRMAX", "TC needs TB", "KF needs TF"),
    formula="(1) to (5), (X1) to (X3)",
    source="PSS/E model library, EXAC1",
)
ESAC1A = Part(
    name="ESAC1A",
    slot="exciter",
    title="Alternator with diode rectifier (IEEE AC1A)",
    fields=_REGULATOR + _VA + _EXCITER + _VR,
    stages=(alternator, rate_feedback, added_without_gates, regulator, limited, excited),
    ports=("Efd",),
    states=("VE", "xF", "Vm", "x", "A"),
    setpoints=("Vref", "low", "high", "lowR", "highR", "gateU", "gateO", "lowE", "satA", "satB"),
    start=start_esac1a,
    rules=("VAMIN < VAMAX", "VRMIN < VRMAX", "TC needs TB", "KF needs TF"),
    formula="(1) to (5), (X1) to (X3)",
    source="PSS/E model library, ESAC1A",
)
