r"""REGCA1, converter as a source of current (WECC REGC_A).

.. math::

    T_g\,\dot I_p &= I_{p,cmd} - I_p,\quad \dot I_p \le R_{rpwr},\quad I_p \le I_{LVPL}(V_f)            & (1)\\
    T_{fltr}\,\dot V_f &= V - V_f,\quad
    I_{LVPL} = L_{vpl1}\Big[\frac{V_f - Z_{erox}}{B_{rkpt} - Z_{erox}}\Big]_0^1\ \text{if}\ V_f < B_{rkpt},\
    \text{else}\ \infty                                                                             & (2)\\
    T_g\,\dot I_q &= I_{q,cmd} - I_q,\quad \dot I_q \le I_{qrmax}\ \text{if}\ Q_0 > 0,\quad
    \dot I_q \ge I_{qrmin}\ \text{if}\ Q_0 < 0                                                       & (3)\\
    P &= V I_p\Big[\frac{V - L_{vpnt0}}{L_{vpnt1} - L_{vpnt0}}\Big]_0^1                                & (4)\\
    Q &= V\,[I_q - K_{hv}[V - V_{olim}]^+]_{I_{olim}}                                                & (5)

The current lies along the terminal voltage. Reactive current is positive when reactive power is generated. The limit
of (2) is off with Lvplsw = 0. The acceleration of the network's solution has no part here: the voltage is known.

(WECC, *Solar Photovoltaic Power Plant Modeling and Validation Guideline*, 2019; PSS/E model library, REGCA1.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, select
from errorscreen.models.blocks import lag, longer
from errorscreen.models.part import Limit, Part, Start, Values, record
from errorscreen.models.renewables.behind import along_terminal, voltage_behind

FIELDS = record(
    """
    Lvplsw | code | 1    | - | 0, 1 | 1: active current is limited at low voltage
    Tg     | s    | 0.02 | 0.01 .. 0.1   | >= 0 | lag of the converter
    Rrpwr  | pu/s | 10   | 0.5 .. 20     | > 0  | rate at which active current returns
    Brkpt  | pu   | 0.9  | -             | any  | voltage below which active current is limited
    Zerox  | pu   | 0.4  | -             | any  | voltage at which that limit is zero
    Lvpl1  | pu   | 1.22 | limit         | any  | that limit at Brkpt
    Volim  | pu   | 1.2  | -             | any  | voltage above which reactive current is reduced
    Lvpnt1 | pu   | 0.8  | -             | any  | voltage below which active current fades
    Lvpnt0 | pu   | 0.4  | -             | any  | voltage at which it has faded
    Iolim  | pu   | -1.3 | limit         | any  | lower limit of the reactive current
    Tfltr  | s    | 0.02 | -             | >= 0 | filter of the voltage
    Khv    | pu   | 0.7  | -             | >= 0 | gain above Volim
    Iqrmax | pu/s | 999  | limit         | any  | upper rate of reactive current
    Iqrmin | pu/s | -999 | limit         | any  | lower rate of reactive current
    Accel  | -    | 0.7  | -             | any  | acceleration of the network's solution; not used
    """
)
#: stands for no limit
_NONE = 1e6
#: steps to the terminal voltage behind an impedance, and change of V in pu that gives the slopes of the currents
_STEPS, _NEAR = 6, 1e-7


@register_jitable
def ramp(x: Any, zero: Any, one: Any) -> Any:
    """Straight rise from 0 to 1 between two places; a step where they are the same.

    Examples
    --------
    >>> [float(ramp(x, 0.5, 1.0)) for x in (0.4, 0.75, 1.2)], float(ramp(0.6, 0.5, 0.5))
    ([0.0, 0.5, 1.0], 1.0)
    """
    width = one - zero
    return clip((x - zero) / select(width > 1e-9, width, 1e-9), 0.0, 1.0)


@register_jitable
def power_logic(Vf: Any, Lvplsw: Any, Brkpt: Any, Zerox: Any, Lvpl1: Any) -> Any:
    """Upper limit of the active current, (2)."""
    free = (Vf >= Brkpt) | (Lvplsw == 0.0)
    return select(free, _NONE, Lvpl1 * ramp(Vf, Zerox, Brkpt))


@register_jitable
def high_voltage(V: Any, Volim: Any, Khv: Any) -> Any:
    """What is taken from the reactive current at high voltage, (5)."""
    return Khv * clip(V - Volim, 0.0, _NONE)


@register_jitable
def currents(
    V: Any, Ip: Any, Iq: Any, Vf: Any, Lvplsw: Any, Brkpt: Any, Zerox: Any, Lvpl1: Any, Volim: Any, Lvpnt0: Any,
    Lvpnt1: Any, Iolim: Any, Khv: Any, Tfltr: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Share of the active current at low voltage, active and reactive current and limit of the active one, (4), (5)."""
    Vm, _ = lag(Vf, V, Tfltr, shortest)
    ceiling = power_logic(Vm, Lvplsw, Brkpt, Zerox, Lvpl1)
    reactive = clip(Iq - high_voltage(V, Volim, Khv), Iolim, _NONE)
    return ramp(V, Lvpnt0, Lvpnt1), select(Ip > ceiling, ceiling, Ip), reactive, ceiling


@stage("V", "P", "Q", "ceiling", "d_Vf")
def terminal(
    Vr: Any, Vi: Any, Ip: Any, Iq: Any, Vf: Any, Lvplsw: Any, Brkpt: Any, Zerox: Any, Lvpl1: Any, Volim: Any,
    Lvpnt0: Any, Lvpnt1: Any, Iolim: Any, Khv: Any, Tfltr: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Terminal voltage, injected power and limit of the active current, (2), (4), (5)."""
    V = np.sqrt(Vr * Vr + Vi * Vi)
    _, d_Vf = lag(Vf, V, Tfltr, shortest)
    fade, active, reactive, ceiling = currents(
        V, Ip, Iq, Vf, Lvplsw, Brkpt, Zerox, Lvpl1, Volim, Lvpnt0, Lvpnt1, Iolim, Khv, Tfltr, shortest
    )
    return V, V * fade * active, V * reactive, ceiling, d_Vf


@stage("Ir", "Ii")
def behind(
    Er: Any, Ei: Any, R_grid: Any, X_grid: Any, Ip: Any, Iq: Any, Vf: Any, Lvplsw: Any, Brkpt: Any, Zerox: Any,
    Lvpl1: Any, Volim: Any, Lvpnt0: Any, Lvpnt1: Any, Iolim: Any, Khv: Any, Tfltr: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Current behind an impedance.

    The currents are made of straight lines in V, so that (Z3) of `errorscreen.models.renewables.behind` on the line at
    the last V is exact as soon as that lies on the right one: mostly at once, nearly always within these steps.
    """
    E = np.sqrt(Er * Er + Ei * Ei)
    V, Ia, Ir = E, 0.0 * E, 0.0 * E
    for _ in range(_STEPS):
        fade, active, reactive, _limit = currents(
            V, Ip, Iq, Vf, Lvplsw, Brkpt, Zerox, Lvpl1, Volim, Lvpnt0, Lvpnt1, Iolim, Khv, Tfltr, shortest
        )
        near = V + _NEAR
        fade1, active1, reactive1, _limit = currents(
            near, Ip, Iq, Vf, Lvplsw, Brkpt, Zerox, Lvpl1, Volim, Lvpnt0, Lvpnt1, Iolim, Khv, Tfltr, shortest
        )
        a1, b1 = (fade1 * active1 - fade * active) / _NEAR, (reactive1 - reactive) / _NEAR
        a0, b0 = fade * active - a1 * V, reactive - b1 * V
        V = voltage_behind(E, R_grid, X_grid, a0, a1, b0, b1)
        Ia, Ir = a0 + a1 * V, b0 + b1 * V
    return along_terminal(Er, Ei, V, Ia, Ir, R_grid, X_grid)


@stage("d_Ip", "d_Iq")
def regulator(
    Ipcmd: Any, Iqcmd: Any, Ip: Any, Iq: Any, ceiling: Any, Qgen0: Any, Tg: Any, Rrpwr: Any, Iqrmax: Any, Iqrmin: Any,
    shortest: Any,
) -> Any:  # fmt: skip
    """Lags of the currents, (1), (3); above its limit the active current follows it within ``shortest``."""
    T = longer(Tg, shortest)
    d_Ip = (Ipcmd - Ip) / T
    d_Ip = select(d_Ip > Rrpwr, Rrpwr, d_Ip)
    over = Ip >= ceiling
    d_Ip = select(over & (d_Ip > 0.0), 0.0, d_Ip) + select(over, ceiling - Ip, 0.0) / shortest
    d_Iq = (Iqcmd - Iq) / T
    d_Iq = select((Qgen0 > 0.0) & (d_Iq > Iqrmax), Iqrmax, d_Iq)
    return d_Ip, select((Qgen0 < 0.0) & (d_Iq < Iqrmin), Iqrmin, d_Iq)


def start(v: Values) -> Start:
    """Equilibrium at V, P and Q."""
    V = v["V"]
    Ip = v["P"] / (V * np.maximum(ramp(V, v["Lvpnt0"], v["Lvpnt1"]), 0.01))
    Iq = v["Q"] / V + high_voltage(V, v["Volim"], v["Khv"])
    ceiling = power_logic(V, v["Lvplsw"], v["Brkpt"], v["Zerox"], v["Lvpl1"])
    return Start(
        {"Ip": Ip, "Iq": Iq, "Vf": V},
        {"Ip0": Ip, "Iq0": Iq, "Qgen0": v["Q"]},
        (
            Limit("active current", Ip, -_NONE, ceiling, ("", "Lvpl1")),
            Limit("reactive current", v["Q"] / V, v["Iolim"], _NONE, ("Iolim", "")),
        ),
    )


REGCA1 = Part(
    name="REGCA1",
    slot="converter",
    title="Converter as a source of current",
    fields=FIELDS,
    stages=(terminal,),
    closing=(regulator,),
    ports=("V", "P", "Q", "Ip0", "Iq0"),
    states=("Ip", "Iq", "Vf"),
    setpoints=("Ip0", "Iq0", "Qgen0"),
    start=start,
    rules=("Zerox <= Brkpt", "Lvpnt0 <= Lvpnt1"),
    formula="(1) to (5)",
    source="WECC REGC_A; PSS/E model library, REGCA1",
    checked="PSS/E (three buses)",
    aliases=("REGCAU1",),
    behind=behind,
)
