r"""SEXS, simplified excitation system.

.. math::

    e &= V_{ref} + V_s + V_{UEL} + V_{OEL} - V_c                                                & (1)\\
    T_B\,\dot x &= e - x,\quad y = x + (T_A/T_B)(e - x)                          & (2)\\
    T_E\,\dot E_{fd} &= K y - E_{fd},\quad E_{MIN} \le E_{fd} \le E_{MAX}\ \text{(non-windup)}   & (3)

(PSS/E model library, SEXS.)
"""

from __future__ import annotations

from typing import Any

from errorscreen.engine.stages import stage
from errorscreen.models.blocks import lead_lag, limited_lag
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TA_TB = TA/TB | -  | 0.1 | 0.02 .. 1   | >= 0 | lead over lag time constant
    TB            | s  | 10  | 1 .. 20     | >= 0 | lag time constant
    K             | pu | 100 | 20 .. 400   | > 0  | gain
    TE            | s  | 0.1 | 0.01 .. 0.6 | >= 0 | time constant of the exciter
    EMIN          | pu | 0   | limit       | any  | lower limit of the field voltage
    EMAX          | pu | 5   | limit       | any  | upper limit of the field voltage
    """
)


@stage("Efd", "d_x", "d_E")
def sexs(
    Vc: Any,
    Vs: Any,
    VUEL: Any,
    VOEL: Any,
    x: Any,
    E: Any,
    Vref: Any,
    low: Any,
    high: Any,
    TA_TB: Any,
    TB: Any,
    K: Any,
    TE: Any,
    shortest: Any,
) -> Any:
    """Field voltage and derivatives, (1) to (3)."""
    y, d_x = lead_lag(x, Vref + Vs - Vc + VUEL + VOEL, TA_TB * TB, TB, shortest)
    Efd, d_E = limited_lag(E, K * y, TE, low, high, shortest)
    return Efd, d_x, d_E


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0."""
    E = v["Efd0"]
    low, high = holding(E, v["EMIN"], v["EMAX"])
    x = E / v["K"]
    return Start(
        {"x": x, "E": E},
        {"Vref": x + v["Vc"] - v["Vs"], "low": low, "high": high},
        (Limit("field voltage", E, v["EMIN"], v["EMAX"], ("EMIN", "EMAX")),),
    )


SEXS = Part(
    name="SEXS",
    slot="exciter",
    title="Simplified excitation system",
    fields=FIELDS,
    stages=(sexs,),
    ports=("Efd",),
    states=("x", "E"),
    setpoints=("Vref", "low", "high"),
    start=start,
    rules=("EMIN < EMAX",),
    formula="Efd = [K / (1 + s TE) · (1 + s TA) / (1 + s TB) · (Vref + Vs − Vc)] within EMIN, EMAX",
    source="PSS/E model library, SEXS",
    checked="PSS/E (three buses), Dynawo",
)
