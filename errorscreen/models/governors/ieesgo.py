r"""IEESGO, steam turbine with governor, standard model of the IEEE.

.. math::

    T_1\,\dot x_1 &= K_1 e - x_1,\quad y_1 = x_1 + (T_2/T_1)(K_1 e - x_1),\quad
    T_3\,\dot x_3 = y_1 - x_3,\quad e = \omega - \omega_{ref}                                   & (1)\\
    T_4\,\dot y_4 &= u - y_4,\quad u = P_{ref} - x_3,\quad P_{MIN} \le u \le P_{MAX}                   & (2)\\
    T_5\,\dot y_5 &= y_4 - y_5,\quad T_6\,\dot y_6 = y_5 - y_6                                      & (3)\\
    P_m &= (1 - K_2) y_4 + K_2 (1 - K_3) y_5 + K_2 K_3 y_6                                     & (4)

(PSS/E model library, IEESGO; IEEE Committee Report, Trans. PAS-92, 1973, pp. 1904-1915.)
"""

from __future__ import annotations

from typing import Any

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip
from errorscreen.models.blocks import lag, lead_lag
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    T1   | s  | 0.2  | -         | >= 0     | lag of the controller
    T2   | s  | 0.0  | -         | >= 0     | lead of the controller
    T3   | s  | 0.3  | 0.1 .. 1  | >= 0     | lag of the governor
    T4   | s  | 0.2  | 0.05 .. 1 | >= 0     | time constant of the steam inlet
    T5   | s  | 6.0  | 3 .. 12   | >= 0     | time constant of the reheater
    T6   | s  | 0.5  | -         | >= 0     | time constant of the crossover
    K1   | pu | 20.0 | 10 .. 50  | >= 0     | gain, 1/droop
    K2   | -  | 0.7  | 0.5 .. 0.9 | 0 .. 1  | share of the power behind the reheater
    K3   | -  | 0.5  | -         | 0 .. 1   | share of that behind the crossover
    PMAX | pu | 1.0  | limit     | any      | upper limit of the power
    PMIN | pu | 0.0  | limit     | any      | lower limit of the power
    """
)


@stage("Pm", "d_x1", "d_x3", "d_y4", "d_y5", "d_y6")
def ieesgo(
    omega: Any, x1: Any, x3: Any, y4: Any, y5: Any, y6: Any, Pref: Any, wref: Any, low: Any, high: Any, T1: Any,
    T2: Any, T3: Any, T4: Any, T5: Any, T6: Any, K1: Any, K2: Any, K3: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Mechanical power and derivatives, (1) to (4)."""
    led, d_x1 = lead_lag(x1, K1 * (omega - wref), T2, T1, shortest)
    action, d_x3 = lag(x3, led, T3, shortest)
    first, d_y4 = lag(y4, clip(Pref - action, low, high), T4, shortest)
    second, d_y5 = lag(y5, first, T5, shortest)
    third, d_y6 = lag(y6, second, T6, shortest)
    Pm = (1.0 - K2) * first + K2 * ((1.0 - K3) * second + K3 * third)
    return Pm, d_x1, d_x3, d_y4, d_y5, d_y6


def start(v: Values) -> Start:
    """Equilibrium at the mechanical power Pm0."""
    P = v["Pm0"]
    low, high = holding(P, v["PMIN"], v["PMAX"])
    return Start(
        {"x1": 0.0 * P, "x3": 0.0 * P, "y4": P, "y5": P, "y6": P},
        {"Pref": P, "wref": 0.0 * P + 1.0, "low": low, "high": high},
        (Limit("power", P, v["PMIN"], v["PMAX"], ("PMIN", "PMAX")),),
    )


IEESGO = Part(
    name="IEESGO",
    slot="governor",
    title="Steam turbine with governor, IEEE standard model",
    fields=FIELDS,
    stages=(ieesgo,),
    ports=("Pm",),
    states=("x1", "x3", "y4", "y5", "y6"),
    setpoints=("Pref", "wref", "low", "high"),
    start=start,
    rules=("PMIN < PMAX", "T2 needs T1"),
    formula="u = Pref − K1 (1 + s T2) / ((1 + s T1) (1 + s T3)) Δω; Pm = shares of u behind T4, T5, T6",
    source="PSS/E model library, IEESGO",
)
