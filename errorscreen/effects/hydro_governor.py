r"""Hydro turbine and governor: speed control of a machine whose mechanical power is constant.

A governor with temporary droop and the linear model of a turbine with an inelastic water column, in deviations from the
equilibrium, with the dead band of IEEE Std 1207:

.. math::

    e &= -\,\mathrm{db}(\omega - 1) - R\,c,\quad \mathrm{db}(x) = x - [x]_{-d}^{d}         & (H1)\\
    c &= x + K e,\quad T_R\,\dot x = K e,\quad 0 \le P_{m0} + x \le P_{max}                & (H2)\\
    T_G\,\dot g &= c - g,\quad 0 \le P_{m0} + g \le P_{max}                               & (H3)\\
    \tfrac12 T_W\,\dot w &= g - w,\quad P_m = P_{m0} + 3w - 2g                             & (H4)

K is the reciprocal of the temporary droop r, and (H1) is solved for c. The last line is the transfer function
:math:`(1 - sT_W)/(1 + sT_W/2)`: when the gate opens, the power falls first. T_W is the water starting time at the flow
of the equilibrium. HYGOV of the PSS/E model library has the same governor, and a turbine whose head is nonlinear.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from errorscreen.effects.base import Effect, strength, value
from errorscreen.effects.governor import SMALLEST_DEAD_BAND
from errorscreen.engine.vmath import clip, hold_at_limits

_P_MAX = 1.2
#: pu/s: limit of the gate's rate that is not reached
_FREE_RATE = 10.0


def hydro(
    value: Any,
    omega: Any,
    Pm0: Any,
    x: Any,
    g: Any,
    w: Any,
    K: Any,
    TR: Any,
    R: Any,
    TG: Any,
    TW: Any,
    db: Any,
) -> Any:
    """Mechanical power and derivatives of governor, gate and water, (H1) to (H4)."""
    speed = omega - 1.0
    e = clip(speed, -db, db) - speed
    # the limits hold the equilibrium, so that K = 0 is an identity at any loading
    low, high = clip(-Pm0, -1e9, 0.0), clip(_P_MAX - Pm0, 0.0, 1e9)
    c = (clip(x, low, high) + K * e) / (1.0 + K * R)
    gate = clip(g, low, high)
    return (
        value + 3.0 * w - 2.0 * gate,
        hold_at_limits(x, K * (e - R * c) / TR, low, high),
        hold_at_limits(g, (c - g) / TG, low, high),
        2.0 * (gate - w) / TW,
    )


def hygov_record(values: Mapping[str, float]) -> tuple[str, dict[str, float]]:
    """Record HYGOV that answers alike to small deviations, without dead band and loss at no load."""
    return "HYGOV", {
        **{"R": values["R"], "r": 1.0 / values["K"], "Tr": values["TR"], "Tf": 0.0, "Tg": values["TG"]},
        **{"VELM": _FREE_RATE, "GMAX": _P_MAX, "GMIN": 0.0, "TW": values["TW"] / values["P"]},
        **{"At": 1.0, "Dturb": 0.0, "qNL": 0.0},
    }


HYDRO_GOVERNOR = Effect(
    name="hydro_governor",
    title="Hydro turbine-governor with water hammer",
    told="The file of {unit} has no governor; one of a hydro turbine acted",
    port="Pm",
    devices=("without governor",),
    equations=hydro,
    record=hygov_record,
    parameters=(
        strength(
            "K", 2.5, 10.0, "pu", "governor", "K", "reciprocal of the temporary droop; 0: constant power"
        ),
        value("TR", 6.0, 1.0, 20.0, "s", "governor", "T_R", "reset time of the dashpot"),
        value("R", 0.05, 0.02, 0.1, "pu", "governor", "R", "permanent droop"),
        value("TG", 0.3, 0.05, 1.0, "s", "governor", "T_G", "time constant of the gate"),
        value("TW", 1.0, 0.5, 4.0, "s", "governor", "T_W", "water starting time"),
        value("db", 0.0006, 0.0, 0.004, "pu", "governor", "d", "half width of the dead band of speed"),
    ),
    smallest={"db": SMALLEST_DEAD_BAND},
    states=("x", "g", "w"),
    formula="Pm = Pm0 + (1 − s TW) / (1 + s TW / 2) · 1 / (1 + s TG) · K (1 + s TR) / (s TR) · (−db(ω − 1) − R c), "
    "0 ≤ Pm ≤ 1.2 pu",
    description="The governor of a hydro turbine moves the gate, and the inertia of the water first moves the power "
    "the other way. A model with constant mechanical power swings about another mean after the fault.",
    source="Kundur, Power System Stability and Control, 1994, sections 9.1.1 and 9.1.3; PSS/E model library, HYGOV",
    confused_with=("a steam turbine-governor", "a smaller damping coefficient D", "a forced oscillation"),
)
