r"""Volt-var droop with a dead band: reactive power against the deviation of voltage outside of ride-through.

.. math::

    T_d\,\dot V_d &= V - V_d,\quad e = \mathrm{db}(V_0 + V_c - V_d) - \mathrm{db}(V_c),\quad
        \mathrm{db}(x) = x - [x]_{-d}^{d}                                                           & (V1)\\
    \dot y &= \big[\big([Q_0 + K e]_{\pm Q_m} - [Q_0]_{\pm Q_m} - y\big)/T\big]_{-R}^{R},\quad Q_{ref} = Q_0 + y  & (V2)

with the slow measurement or detection time :math:`T_d`, the droop K, the largest reactive power :math:`Q_m` of the
curve and the limit R of the rate of change. It acts on the reference of the reactive-power control, so that the current
limit holds. The centre of the dead band lies :math:`V_c` above the voltage :math:`V_0` before the event: the plant may
start anywhere inside of it, or on the slope. Steps in one direction tell only the edge that they cross, and not centre
and width.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values, strength, value
from errorscreen.engine.vmath import clip


def volt_var(
    value: Any, V: Any, V0: Any, Q0: Any, Vd: Any, y: Any,
    K: Any, db: Any, Vc: Any, Qm: Any, T: Any, Td: Any, R: Any,
) -> Any:  # fmt: skip
    """Reference of the reactive power and derivatives of detection and droop, (V1), (V2)."""
    below = V0 + Vc - Vd
    before = Vc - clip(Vc, -db, db)
    droop = K * (below - clip(below, -db, db) - before)
    wanted = clip(Q0 + droop, -Qm, Qm) - clip(Q0, -Qm, Qm)
    return value + y, (V - Vd) / Td, clip((wanted - y) / T, -R, R)


def _start(values: Values, h: float) -> Values:
    level = values["V"] * np.ones_like(values["K"])
    return {"V0": level, "Vd": level}


VOLT_VAR = Effect(
    name="volt_var",
    title="Volt-var droop with dead band",
    port="Qref",
    devices=("pv_plant",),
    equations=volt_var,
    parameters=(
        strength("K", 4.0, 40.0, "pu", "volt-var control", "K", "reactive power per voltage; 0: none"),
        value("db", 0.01, 0.0, 0.08, "pu", "volt-var control", "d", "half width of the dead band of voltage"),
        value("Vc", 0.0, -0.08, 0.08, "pu", "volt-var control", "V_c", "centre of the dead band, from V0"),
        value("Qm", 1.0, 0.1, 1.2, "pu", "volt-var control", "Q_m", "largest reactive power of the curve"),
        value("T", 0.2, 0.02, 40.0, "s", "volt-var control", "T", "time constant"),
        value("Td", 0.05, 0.02, 2.0, "s", "volt-var control", "T_d", "time constant of the detection"),
        value("R", 2.0, 0.01, 5.0, "pu/s", "volt-var control", "R", "limit of the rate"),
    ),
    states=("Vd", "y"),
    derived=("V0",),
    initialise=_start,
    formula="Qref = Q0 + y, T dy/dt = K [db(V0 + Vc − V / (1 + s Td)) − db(Vc)] − y, |Qref| ≤ Qm,"
    " |dy/dt| ≤ R",
    description="Outside of ride-through the plant supports the voltage with a droop, beyond a dead band. A model that "
    "keeps its reactive power constant misses the reactive power that follows every change of voltage.",
    source="IEEE Std 1547-2018, section 5.3.3",
    confused_with=("other gains of the reactive-power control", "the wrong mode of the plant controller"),
)
