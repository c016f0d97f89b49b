r"""MNLEX2, minimum excitation limiter with a circle in the plane of active and reactive power.

.. math::

    m &= (Q_0 V^2 - Q)^2 + P^2 - (R\,V^2)^2                                                       & (1)\\
    V_F &= \frac{sK_{F2}}{1 + sT_{F2}}V_{UEL}                                                     & (2)\\
    T_M\,\dot V_{UEL} &= K_M(m - V_F) - V_{UEL},\quad 0 \le V_{UEL} \le M_{ELMAX}\ \text{(non-windup)}   & (3)

with R the ``Radius``. Inside the circle around :math:`P = 0`, :math:`Q = Q_0 V^2` the limiter rests; at :math:`P = 0`
the least reactive power is :math:`(Q_0 - R)V^2`.

The signal raises the excitation: it is added at the summing point of the exciter, or enters at its high-value gate
(`errorscreen.models.limiters.gates`).

(PSS/E model library, MNLEX2; IEC 61970-302, UnderexcLimX2.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip
from errorscreen.models.blocks import limited_lag, longer, rate
from errorscreen.models.part import Limit, Part, Start, Values, record

FIELDS = record(
    """
    KF2    | pu | 0    | -          | >= 0 | gain of the rate feedback
    TF2    | s  | 1    | -          | >= 0 | time constant of the rate feedback
    KM     | pu | 0.3  | 0.1 .. 10  | > 0  | gain
    TM     | s  | 0.5  | 0.05 .. 2  | >= 0 | time constant
    MELMAX | pu | 0.1  | limit      | >= 0 | upper limit of the signal
    Q0     | pu | 1.3  | -          | any  | reactive power of the centre of the circle at V = 1
    Radius | pu | 1.92 | 0.8 .. 4   | > 0  | radius of the circle at V = 1
    """
)


@stage("VUEL", "d_x", "d_xF")
def mnlex2(
    P: Any, Q: Any, V: Any, x: Any, xF: Any, reach: Any, KF2: Any, TF2: Any, KM: Any, TM: Any, MELMAX: Any, Q0: Any,
    shortest: Any,
) -> Any:  # fmt: skip
    """Signal and derivatives, (1) to (3); ``reach`` is the radius that holds the start."""
    square = V * V
    below, radius = Q0 * square - Q, reach * square
    VF, d_xF = rate(xF, clip(x, 0.0, MELMAX), KF2, TF2, shortest)
    # the rate feedback makes the limiter faster by its loop gain; the loop lasts at least the shortest time
    T = longer(TM, shortest * (1.0 + KM * KF2 / longer(TF2, shortest)))
    VUEL, d_x = limited_lag(x, KM * (below * below + P * P - radius * radius - VF), T, 0.0, MELMAX, shortest)
    return VUEL, d_x, d_xF


def start(v: Values) -> Start:
    """Equilibrium inside the circle."""
    square = v["V"] * v["V"]
    distance = np.hypot(v["Q0"] * square - v["Q"], v["P"]) / square
    rest = 0.0 * distance
    return Start(
        {"x": rest, "xF": rest},
        {"UELgate": rest, "reach": np.maximum(v["Radius"], distance)},
        (
            Limit(
                "distance from the centre of the circle",
                distance,
                -np.inf,
                v["Radius"],
                ("-infinity", "Radius"),
            ),
        ),
    )


MNLEX2 = Part(
    name="MNLEX2",
    slot="under_excitation",
    title="Minimum excitation limiter, circle",
    fields=FIELDS,
    stages=(mnlex2,),
    ports=("VUEL", "UELgate"),
    states=("x", "xF"),
    setpoints=("UELgate", "reach"),
    start=start,
    rules=("KF2 needs TF2",),
    formula="VUEL = [KM / (1 + s TM) · ((Q0 V² − Q)² + P² − (Radius V²)² − s KF2 / (1 + s TF2) VUEL)] within 0, MELMAX",
    source="PSS/E model library, MNLEX2",
)
