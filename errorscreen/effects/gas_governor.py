r"""Gas turbine and governor: speed control of a machine whose mechanical power is constant.

A governor with droop of the measured power, and a turbine with one lag, in deviations from the equilibrium. These are
the equations of GGOV1 (PSS/E model library) with RSELECT = 1, and without its limits of rate, load and acceleration:

.. math::

    e &= \mathrm{db}\big(-(\omega - 1) - R\,p\big),\quad T_P\,\dot p = (P - P_0) - p,\quad
    \mathrm{db}(x) = x - [x]_{-d}^{d}                                                     & (T1)\\
    y &= \big[K e + z\big],\quad T_I\,\dot z = y - z,\quad 0 \le P_{m0} + y \le P_{max}           & (T2)\\
    T_A\,\dot v &= y - v,\quad T_B\,\dot w = v - w,\quad P_m = P_{m0} + w                          & (T3)

Within the limits :math:`T_I\,\dot z = K e`: the governor is a PI controller, whose integral follows the limited request
and does not wind up. K is KPGOV KTURB, T_I is KPGOV/KIGOV.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from errorscreen.effects.base import Effect, Values, strength, value
from errorscreen.effects.governor import SMALLEST_DEAD_BAND
from errorscreen.engine.vmath import clip

_P_MAX = 1.2
#: pu: limits of the speed error and of rates in the record that are not reached
_FREE = 10.0


def gas(
    value: Any, omega: Any, P: Any, Pm0: Any, P_start: Any, p: Any, z: Any, v: Any, w: Any, K: Any, TI: Any, R: Any,
    TA: Any, TB: Any, TP: Any, db: Any,
) -> Any:  # fmt: skip
    """Mechanical power and derivatives of measured power, governor, valve and turbine, (T1) to (T3)."""
    error = 1.0 - omega - R * p
    e = error - clip(error, -db, db)
    # the limits hold the equilibrium, so that K = 0 is an identity at any loading
    y = clip(K * e + z, clip(-Pm0, -1e9, 0.0), clip(_P_MAX - Pm0, 0.0, 1e9))
    return value + w, (P - P_start - p) / TP, (y - z) / TI, (y - v) / TA, (v - w) / TB


def _start(values: Values, h: float) -> Values:
    return {"P_start": values["P"]}


def ggov1_record(values: Mapping[str, float]) -> tuple[str, dict[str, float]]:
    """Record GGOV1 with these equations; its load limiter and acceleration control do not act."""
    return "GGOV1", {
        **{
            "RSELECT": 1.0,
            "FLAG": 0.0,
            "R": values["R"],
            "TPELEC": values["TP"],
            "MAXERR": _FREE,
            "MINERR": -_FREE,
        },
        **{"KPGOV": values["K"], "KIGOV": values["K"] / values["TI"], "KDGOV": 0.0, "TDGOV": 1.0},
        **{"VMAX": _P_MAX, "VMIN": 0.0, "TACT": values["TA"], "KTURB": 1.0, "WFNL": 0.0},
        **{"TB": values["TB"], "TC": 0.0, "TENG": 0.0, "TFLOAD": 3.0, "KPLOAD": 2.0, "KILOAD": 0.67},
        **{"LDREF": _FREE, "DM": 0.0, "ROPEN": _FREE, "RCLOSE": -_FREE, "KIMW": 0.0},
        **{"ASET": 0.01, "KA": 0.0, "TA": 0.1, "TRATE": 0.0, "DB": values["db"], "TSA": 4.0, "TSB": 5.0},
        **{"RUP": 99.0, "RDOWN": -99.0},
    }


GAS_GOVERNOR = Effect(
    name="gas_governor",
    title="Gas turbine-governor with droop of the measured power",
    told="The file of {unit} has no governor; one of a gas turbine acted",
    port="Pm",
    devices=("without governor",),
    equations=gas,
    record=ggov1_record,
    parameters=(
        strength("K", 12.0, 45.0, "pu", "governor", "K", "proportional gain; 0: constant power"),
        value("TI", 5.0, 1.0, 40.0, "s", "governor", "T_I", "reset time"),
        value("R", 0.04, 0.02, 0.1, "pu", "governor", "R", "permanent droop"),
        value("TA", 0.5, 0.05, 1.5, "s", "governor", "T_A", "time constant of the valve"),
        value("TB", 0.3, 0.05, 2.0, "s", "governor", "T_B", "time constant of the turbine"),
        value("TP", 1.0, 0.05, 4.0, "s", "governor", "T_P", "time constant of the measured power"),
        value(
            "db", 0.0006, 0.0, 0.004, "pu", "governor", "d", "half width of the dead band of the speed error"
        ),
    ),
    smallest={"db": SMALLEST_DEAD_BAND},
    states=("p", "z", "v", "w"),
    derived=("P_start",),
    initialise=_start,
    formula="Pm = Pm0 + 1 / (1 + s TB) · 1 / (1 + s TA) · K (1 + 1 / (s TI)) · db(−(ω − 1) − R (P − P0) / (1 + s TP)), "
    "0 ≤ Pm ≤ 1.2 pu",
    description="The governor of a gas turbine is a quick PI controller with a droop of the measured power. A model "
    "with constant mechanical power swings about another mean after the fault and is damped differently.",
    source="PSS/E model library, GGOV1; IEEE PES-TR1, 2013, section 3.1.2.3",
    confused_with=("a steam turbine-governor", "a larger damping coefficient D", "a forced oscillation"),
)
