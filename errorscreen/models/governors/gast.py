r"""GAST, gas turbine with governor.

.. math::

    u &= \min\big(P_{ref} - (\omega - \omega_{ref})/R,\ A_T + K_T (A_T - x_3)\big)                             & (1)\\
    T_1\,\dot x_1 &= u - x_1,\quad V_{MIN} \le x_1 \le V_{MAX}\ \text{(non-windup)}                     & (2)\\
    T_2\,\dot x_2 &= x_1 - x_2,\quad T_3\,\dot x_3 = x_2 - x_3                                      & (3)\\
    P_m &= x_2 - D_{turb}\,\Delta\omega                                                        & (4)

(PSS/E model library, GAST.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import select
from errorscreen.models.blocks import lag, limited_lag, longer
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    R     | pu | 0.05 | 0.02 .. 0.1 | > 0  | permanent droop
    T1    | s  | 0.4  | 0.05 .. 1   | >= 0 | time constant of the valve
    T2    | s  | 0.1  | 0.05 .. 1   | >= 0 | time constant of the turbine
    T3    | s  | 3.0  | 1 .. 6      | >= 0 | time constant of the temperature's measurement
    AT    | pu | 1.0  | limit       | any  | load limit of the ambient temperature
    KT    | pu | 2.0  | 1 .. 5      | >= 0 | gain of the temperature loop
    VMAX  | pu | 1.0  | limit       | any  | upper limit of the valve
    VMIN  | pu | 0.0  | limit       | any  | lower limit of the valve
    Dturb | pu | 0.0  | -           | >= 0 | damping of the turbine
    """
)


@stage("Pm", "d_x1", "d_x2", "d_x3")
def gast(
    omega: Any, x1: Any, x2: Any, x3: Any, Pref: Any, wref: Any, limit: Any, low: Any, high: Any, R: Any, T1: Any,
    T2: Any, T3: Any, KT: Any, Dturb: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Mechanical power and derivatives, (1) to (4)."""
    wanted, allowed = Pref - (omega - wref) / R, limit + KT * (limit - x3)
    valve, d_x1 = limited_lag(x1, select(wanted < allowed, wanted, allowed), T1, low, high, shortest)
    power, d_x2 = lag(x2, valve, T2, shortest)
    return power - Dturb * (omega - 1.0), d_x1, d_x2, (power - x3) / longer(T3, shortest)


def start(v: Values) -> Start:
    """Equilibrium at the mechanical power Pm0, which the load limit allows."""
    P = v["Pm0"]
    low, high = holding(P, v["VMIN"], v["VMAX"])
    return Start(
        {"x1": P, "x2": P, "x3": P},
        {"Pref": P, "wref": 0.0 * P + 1.0, "limit": np.maximum(v["AT"], P), "low": low, "high": high},
        (
            Limit("valve", P, v["VMIN"], v["VMAX"], ("VMIN", "VMAX")),
            Limit("load", P, -np.inf, v["AT"], ("", "AT")),
        ),
    )


GAST = Part(
    name="GAST",
    slot="governor",
    title="Gas turbine with governor",
    fields=FIELDS,
    stages=(gast,),
    ports=("Pm",),
    states=("x1", "x2", "x3"),
    setpoints=("Pref", "wref", "limit", "low", "high"),
    start=start,
    rules=("VMIN < VMAX",),
    formula="Pm = min(Pref − Δω / R, AT + KT (AT − x3)) / (1 + s T1) / (1 + s T2) − Dturb Δω",
    source="PSS/E model library, GAST",
    gate="x1",
)
