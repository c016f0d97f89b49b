r"""STAB1, stabiliser of the speed with a washout and two lead-lags.

.. math::

    V_s = \Big[\frac{K}{T}\,\frac{sT}{1 + sT}\,\frac{1 + sT_1}{1 + sT_3}\,\frac{1 + sT_2}{1 + sT_4}\,
        (\omega - 1)\Big]_{-H_{LIM}}^{H_{LIM}}                                               & (1)

(PSS/E model library, STAB1.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip
from errorscreen.models.blocks import lead_lag, washout
from errorscreen.models.part import Part, Start, Values, record

FIELDS = record(
    """
    K_T = K/T     | 1/s | 10   | 1 .. 50     | any  | gain over the time constant of the washout
    T             | s   | 10   | 1 .. 20     | > 0  | time constant of the washout
    T1_T3 = T1/T3 | -   | 5    | 1 .. 15     | >= 0 | lead over lag of the first lead-lag
    T3            | s   | 0.03 | 0.01 .. 0.2 | >= 0 | lag of the first lead-lag
    T2_T4 = T2/T4 | -   | 5    | 1 .. 15     | >= 0 | lead over lag of the second lead-lag
    T4            | s   | 0.03 | 0.01 .. 0.2 | >= 0 | lag of the second lead-lag
    HLIM          | pu  | 0.1  | limit       | >= 0 | limit of the output
    """
)


@stage("Vs", "d_x1", "d_x2", "d_x3")
def stab1(
    omega: Any, x1: Any, x2: Any, x3: Any, K_T: Any, T: Any, T1_T3: Any, T3: Any, T2_T4: Any, T4: Any, HLIM: Any,
    shortest: Any,
) -> Any:  # fmt: skip
    """Signal and derivatives, (1)."""
    y1, d_x1 = washout(x1, K_T * (omega - 1.0), T, shortest)
    y2, d_x2 = lead_lag(x2, y1, T1_T3 * T3, T3, shortest)
    y3, d_x3 = lead_lag(x3, y2, T2_T4 * T4, T4, shortest)
    return clip(y3, -HLIM, HLIM), d_x1, d_x2, d_x3


def start(v: Values) -> Start:
    """Equilibrium at nominal speed."""
    rest = np.zeros_like(v["V"])
    return Start({"x1": rest, "x2": rest, "x3": rest}, {})


STAB1 = Part(
    name="STAB1",
    slot="stabiliser",
    title="Stabiliser of the speed",
    fields=FIELDS,
    stages=(stab1,),
    ports=("Vs",),
    states=("x1", "x2", "x3"),
    start=start,
    formula="Vs = [K s / (1 + s T) · (1 + s T1) (1 + s T2) / ((1 + s T3) (1 + s T4)) · (ω − 1)] within ± HLIM",
    source="PSS/E model library, STAB1",
)
