r"""TGOV1, steam turbine with governor.

.. math::

    T_1\,\dot g &= P_{ref} - (\omega - \omega_{ref})/R - g,\quad V_{MIN} \le g \le V_{MAX}\ \text{(non-windup)}  & (1)\\
    T_3\,\dot x &= g - x,\quad y = x + (T_2/T_3)(g - x)                                       & (2)\\
    P_m &= y - D_t\,\Delta\omega                                                           & (3)

(PSS/E model library, TGOV1.)
"""

from __future__ import annotations

from typing import Any

from errorscreen.engine.stages import stage
from errorscreen.models.blocks import lead_lag, limited_lag
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    R    | pu | 0.05 | 0.02 .. 0.1  | > 0  | permanent droop
    T1   | s  | 0.3  | 0.05 .. 1    | >= 0 | time constant of the valve
    VMAX | pu | 1.0  | limit        | any  | upper limit of the valve
    VMIN | pu | 0.0  | limit        | any  | lower limit of the valve
    T2   | s  | 2.0  | 0 .. 6       | >= 0 | lead of the reheater
    T3   | s  | 7.0  | 0.5 .. 15    | >= 0 | lag of the reheater
    Dt   | pu | 0.0  | -            | >= 0 | damping of the turbine
    """
)


@stage("Pm", "d_g", "d_x")
def tgov1(
    omega: Any,
    g: Any,
    x: Any,
    Pref: Any,
    wref: Any,
    low: Any,
    high: Any,
    R: Any,
    T1: Any,
    T2: Any,
    T3: Any,
    Dt: Any,
    shortest: Any,
) -> Any:
    """Mechanical power and derivatives, (1) to (3)."""
    speed = omega - 1.0
    gate, d_g = limited_lag(g, Pref - (omega - wref) / R, T1, low, high, shortest)
    y, d_x = lead_lag(x, gate, T2, T3, shortest)
    return y - Dt * speed, d_g, d_x


def start(v: Values) -> Start:
    """Equilibrium at the mechanical power Pm0."""
    P = v["Pm0"]
    low, high = holding(P, v["VMIN"], v["VMAX"])
    return Start(
        {"g": P, "x": P},
        {"Pref": P, "wref": 0.0 * P + 1.0, "low": low, "high": high},  # the reference already divided by R
        (Limit("valve", P, v["VMIN"], v["VMAX"], ("VMIN", "VMAX")),),
    )


TGOV1 = Part(
    name="TGOV1",
    slot="governor",
    title="Steam turbine with governor",
    fields=FIELDS,
    stages=(tgov1,),
    ports=("Pm",),
    states=("g", "x"),
    setpoints=("Pref", "wref", "low", "high"),
    start=start,
    rules=("VMIN < VMAX", "T2 needs T3"),
    formula="Pm = (1 + s T2) / (1 + s T3) · [(Pref − Δω) / R / (1 + s T1)] within VMIN, VMAX − Dt Δω",
    source="PSS/E model library, TGOV1",
    gate="g",
    checked="Dynawo (unit of case 1)",
)
