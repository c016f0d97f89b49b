r"""IEEEG1, steam turbine with up to four stages and governor.

.. math::

    T_1\,\dot x &= K e - x,\quad y = x + (T_2/T_1)(K e - x),\quad e = \omega - \omega_{ref}           & (1)\\
    \dot v &= (P_{ref} - y - v) / T_3,\quad U_C \le \dot v \le U_O,\
    P_{MIN} \le v \le P_{MAX}\ \text{(non-windup)}                                                & (2)\\
    T_4\,\dot y_4 &= v - y_4,\quad T_5\,\dot y_5 = y_4 - y_5,\quad T_6\,\dot y_6 = y_5 - y_6,\quad
    T_7\,\dot y_7 = y_6 - y_7                                                                  & (3)\\
    P_m &= K_1 y_4 + K_3 y_5 + K_5 y_6 + K_7 y_7                                              & (4)

The shares K2, K4, K6 and K8 of a cross-compound unit go to the machine at the bus JBUS with the identifier M; this unit
is the high-pressure one, and its own shares give the valve at the start. The dead bands of the IEEE's report are not in
the record of PSS/E.

(PSS/E model library, IEEEG1; IEEE Committee Report, Trans. PAS-92, 1973, pp. 1904-1915.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, hold_at_limits
from errorscreen.models.blocks import lag, lead_lag, longer
from errorscreen.models.part import Conflict, Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    JBUS | bus  | 0     | -           | any  | bus of the low-pressure unit; 0: none
    M    | id   | 0     | -           | any  | identifier of the low-pressure unit
    K    | pu   | 20.0  | 10 .. 50    | > 0  | gain, 1/droop
    T1   | s    | 0.15  | 0.05 .. 0.6 | >= 0 | lag of the governor
    T2   | s    | 0.0   | -           | >= 0 | lead of the governor
    T3   | s    | 0.2   | 0.05 .. 0.6 | >= 0 | time constant of the valve positioner
    UO   | pu/s | 0.3   | limit       | > 0  | limit of the opening rate
    UC   | pu/s | -0.5  | limit       | <= 0 | limit of the closing rate, negative
    PMAX | pu   | 1.0   | limit       | any  | upper limit of the valve
    PMIN | pu   | 0.0   | limit       | any  | lower limit of the valve
    T4   | s    | 0.3   | 0.1 .. 1    | >= 0 | time constant of the steam inlet
    K1   | -    | 0.3   | -           | >= 0 | share of stage 1
    K2   | -    | 0.0   | -           | >= 0 | share of stage 1 for the low-pressure unit
    T5   | s    | 7.0   | 3 .. 12     | >= 0 | time constant of the reheater, second boiler pass
    K3   | -    | 0.4   | -           | >= 0 | share of stage 2
    K4   | -    | 0.0   | -           | >= 0 | share of stage 2 for the low-pressure unit
    T6   | s    | 0.4   | -           | >= 0 | time constant of the crossover, third boiler pass
    K5   | -    | 0.3   | -           | >= 0 | share of stage 3
    K6   | -    | 0.0   | -           | >= 0 | share of stage 3 for the low-pressure unit
    T7   | s    | 0.0   | -           | >= 0 | time constant of the fourth boiler pass
    K7   | -    | 0.0   | -           | >= 0 | share of stage 4
    K8   | -    | 0.0   | -           | >= 0 | share of stage 4 for the low-pressure unit
    """
)


@stage("Pm", "d_x", "d_v", "d_y4", "d_y5", "d_y6", "d_y7")
def ieeeg1(
    omega: Any, x: Any, v: Any, y4: Any, y5: Any, y6: Any, y7: Any, Pref: Any, wref: Any, low: Any, high: Any, K: Any,
    T1: Any, T2: Any, T3: Any, UO: Any, UC: Any, T4: Any, K1: Any, T5: Any, K3: Any, T6: Any, K5: Any, T7: Any, K7: Any,
    shortest: Any,
) -> Any:  # fmt: skip
    """Mechanical power and derivatives, (1) to (4)."""
    y, d_x = lead_lag(x, K * (omega - wref), T2, T1, shortest)
    valve = clip(v, low, high)
    velocity = clip((Pref - y - valve) / longer(T3, shortest), UC, UO)
    first, d_y4 = lag(y4, valve, T4, shortest)
    second, d_y5 = lag(y5, first, T5, shortest)
    third, d_y6 = lag(y6, second, T6, shortest)
    fourth, d_y7 = lag(y7, third, T7, shortest)
    Pm = K1 * first + K3 * second + K5 * third + K7 * fourth
    return Pm, d_x, hold_at_limits(v, velocity, low, high), d_y4, d_y5, d_y6, d_y7


def start(v: Values) -> Start:
    """Equilibrium at the mechanical power Pm0; without any share of its own the unit has none."""
    share = v["K1"] + v["K3"] + v["K5"] + v["K7"]
    P = np.where(share > 0, v["Pm0"] / np.where(share > 0, share, 1.0), np.nan)
    low, high = holding(P, v["PMIN"], v["PMAX"])
    return Start(
        {"x": 0.0 * P, "v": P, "y4": P, "y5": P, "y6": P, "y7": P},
        {"Pref": P, "wref": 0.0 * P + 1.0, "low": low, "high": high},
        (Limit("valve", P, v["PMIN"], v["PMAX"], ("PMIN", "PMAX")),),
        (
            Conflict(
                share <= 0,
                "K1, K3, K5 and K7 are 0, so that no stage drives this unit. Give it its shares, or leave IEEEG1 out "
                "where the unit is the low-pressure one of a cross-compound",
                {},
            ),
        ),
    )


IEEEG1 = Part(
    name="IEEEG1",
    slot="governor",
    title="Steam turbine of several stages with governor",
    fields=FIELDS,
    stages=(ieeeg1,),
    ports=("Pm",),
    states=("x", "v", "y4", "y5", "y6", "y7"),
    setpoints=("Pref", "wref", "low", "high"),
    start=start,
    rules=("PMIN < PMAX", "UC < UO", "T2 needs T1"),
    formula="v = ∫ [(Pref − K (1 + s T2) / (1 + s T1) Δω − v) / T3] dt; Pm = Σ shares of v behind T4, T5, T6, T7",
    source="PSS/E model library, IEEEG1",
    gate="v",
    checked="OpenIPSL (one machine)",
)
