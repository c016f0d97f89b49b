r"""SCRX, static exciter fed by its bus or by a solid source.

.. math::

    e &= V_{ref} + V_s + V_{UEL} + V_{OEL} - V_c  & (1)\\
    T_B\,\dot x &= e - x,\quad y = x + (T_A/T_B)(e - x)  & (2)\\
    T_E\,\dot E &= K y - E,\quad E_{MIN} \le E \le E_{MAX}\ \text{(non-windup)}  & (3)\\
    E_{fd} &= \begin{cases} E\,V & \text{bus fed (CSWITCH = 0)}\\ E & \text{solid fed (CSWITCH = 1)} \end{cases} & (4)

While the field current is negative and :math:`r_c/r_{fd} > 0`, the bridge blocks and the current flows through the
resistor :math:`r_c`: :math:`E_{fd} = -(r_c/r_{fd}) X_{ad}I_{fd}`. With :math:`r_c/r_{fd} = 0` the bridge carries it.

(PSS/E model library, SCRX; type AC4 of IEEE Std 421.5-2016 in per unit of a bus-fed bridge.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import select
from errorscreen.models.blocks import lead_lag, limited_lag
from errorscreen.models.part import Limit, Part, Start, Values, holding, record

FIELDS = record(
    """
    TA_TB = TA/TB    | -    | 0.1  | 0.02 .. 1    | >= 0 | lead over lag time constant
    TB               | s    | 10   | 1 .. 20 unless 0      | >= 0 | lag time constant
    K                | pu   | 200  | 20 .. 400    | > 0  | gain
    TE               | s    | 0.05 | 0.004 .. 0.2 | >= 0 | time constant of the exciter
    EMIN             | pu   | 0    | limit        | any  | lower limit of the field voltage, at V = 1 if bus fed
    EMAX             | pu   | 5    | limit        | any  | upper limit of the field voltage, at V = 1 if bus fed
    CSWITCH          | code | 0    | -            | 0, 1 | 0: fed by the bus, 1: by a solid source
    rc_rfd = rc/rfd  | -    | 0    | -            | >= 0 | resistance for negative current over that of the field
    """
)


@stage("Efd", "d_x", "d_E")
def scrx(
    Vc: Any,
    Vs: Any,
    VUEL: Any,
    VOEL: Any,
    V: Any,
    If: Any,
    x: Any,
    E: Any,
    Vref: Any,
    low: Any,
    high: Any,
    TA_TB: Any,
    TB: Any,
    K: Any,
    TE: Any,
    CSWITCH: Any,
    rc_rfd: Any,
    shortest: Any,
) -> Any:
    """Field voltage and derivatives, (1) to (4)."""
    y, d_x = lead_lag(x, Vref + Vs - Vc + VUEL + VOEL, TA_TB * TB, TB, shortest)
    inner, d_E = limited_lag(E, K * y, TE, low, high, shortest)
    bridge = select(CSWITCH == 0.0, inner * V, inner)
    return select((If < 0.0) & (rc_rfd > 0.0), -rc_rfd * If, bridge), d_x, d_E


def start(v: Values) -> Start:
    """Equilibrium at the field voltage Efd0; with a blocked bridge there is none at a negative field current."""
    E = v["Efd0"] / np.where(v["CSWITCH"] == 0, v["V"], 1.0)
    low, high = holding(E, v["EMIN"], v["EMAX"])
    x = E / v["K"]
    least = np.where(v["rc_rfd"] > 0, 0.0, -1e9)
    return Start(
        {"x": x, "E": E},
        {"Vref": x + v["Vc"] - v["Vs"], "low": low, "high": high},
        (
            Limit("field voltage", E, v["EMIN"], v["EMAX"], ("EMIN", "EMAX")),
            Limit("field current", v["If"], least, 1e9, ("0, from rc/rfd", "")),
        ),
    )


SCRX = Part(
    name="SCRX",
    slot="exciter",
    title="Static exciter, bus or solid fed",
    fields=FIELDS,
    stages=(scrx,),
    ports=("Efd",),
    states=("x", "E"),
    setpoints=("Vref", "low", "high"),
    start=start,
    rules=("EMIN < EMAX",),
    formula="Efd = [K / (1 + s TE) · (1 + s TA) / (1 + s TB) · (Vref + Vs − Vc)] within EMIN, EMAX · V if bus fed",
    source="PSS/E model library, SCRX",
    checked="OpenIPSL (one machine, two records, bus fed)",
)
