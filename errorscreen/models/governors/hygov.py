r"""HYGOV, hydro turbine with governor.

.. math::

    T_f\,\dot x &= n_{ref} - \Delta\omega - R\,c - x                                          & (1)\\
    \dot c &= (x/T_r + \dot x) / r,\quad |\dot c| \le V_{ELM},\
    G_{MIN} \le c \le G_{MAX}\ \text{(non-windup)}                                            & (2)\\
    T_g\,\dot g &= c - g,\quad h = (q/g)^2,\quad T_W\,\dot q = 1 - h                             & (3)\\
    P_m &= A_t h (q - q_{NL}) - D_{turb}\,g\,\Delta\omega                                         & (4)

The gate in (3) counts as at least four shortest time constants over TW, below which the water would be faster than the
step.

(PSS/E model library, HYGOV.)
"""

from __future__ import annotations

from typing import Any

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, hold_at_limits
from errorscreen.models.blocks import lag, longer
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    R     | pu   | 0.05 | 0.02 .. 0.1 | >= 0 | permanent droop
    r     | pu   | 0.4  | 0.1 .. 1.2  | > 0  | temporary droop
    Tr    | s    | 6.0  | 2 .. 20     | > 0  | reset time of the dashpot
    Tf    | s    | 0.05 | -           | >= 0 | time constant of the filter
    Tg    | s    | 0.3  | 0.1 .. 1    | >= 0 | time constant of the gate servo
    VELM  | pu/s | 0.2  | limit       | > 0  | limit of the gate's velocity
    GMAX  | pu   | 1.0  | limit       | any  | upper limit of the gate
    GMIN  | pu   | 0.0  | limit       | any  | lower limit of the gate
    TW    | s    | 1.5  | 0.5 .. 3    | > 0  | water starting time
    At    | pu   | 1.2  | -           | > 0  | gain of the turbine
    Dturb | pu   | 0.3  | -           | >= 0 | damping of the turbine
    qNL   | pu   | 0.08 | -           | any  | flow at no load
    """
)


@stage("Pm", "d_x", "d_c", "d_g", "d_q")
def hygov(
    omega: Any, x: Any, c: Any, g: Any, q: Any, nref: Any, low: Any, high: Any, R: Any, r: Any, Tr: Any, Tf: Any,
    Tg: Any, VELM: Any, TW: Any, At: Any, Dturb: Any, qNL: Any, shortest: Any,
) -> Any:  # fmt: skip
    """Mechanical power and derivatives, (1) to (4)."""
    speed = omega - 1.0
    desired = clip(c, low, high)
    d_x = (nref - speed - R * desired - x) / longer(Tf, shortest)
    velocity = clip((x / Tr + d_x) / r, -VELM, VELM)
    gate, d_g = lag(g, desired, Tg, shortest)
    ratio = q / longer(gate, 4.0 * shortest / TW)
    head = ratio * ratio
    Pm = At * head * (q - qNL) - Dturb * gate * speed
    return Pm, d_x, hold_at_limits(c, velocity, low, high), d_g, (1.0 - head) / TW


def start(v: Values) -> Start:
    """Equilibrium at the mechanical power Pm0, with the head at 1."""
    gate = v["Pm0"] / v["At"] + v["qNL"]
    low, high = holding(gate, v["GMIN"], v["GMAX"])
    return Start(
        {"x": 0.0 * gate, "c": gate, "g": gate, "q": gate},
        {"nref": v["R"] * gate, "low": low, "high": high},
        (Limit("gate", gate, v["GMIN"], v["GMAX"], ("GMIN", "GMAX")),),
    )


HYGOV = Part(
    name="HYGOV",
    slot="governor",
    title="Hydro turbine with governor",
    fields=FIELDS,
    stages=(hygov,),
    ports=("Pm",),
    states=("x", "c", "g", "q"),
    setpoints=("nref", "low", "high"),
    start=start,
    rules=("GMIN < GMAX",),
    formula="c = (1 + s Tr) / (r s Tr) · (nref − Δω − R c) / (1 + s Tf); TW dq/dt = 1 − (q/g)²; Pm = At h (q − qNL)",
    source="PSS/E model library, HYGOV",
    gate="g",
    checked="OpenIPSL (one machine), PSS/E (three buses)",
)
