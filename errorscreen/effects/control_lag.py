r"""Lag of a converter's command: a control loop, a delay or a phase-locked loop that the model treats as instantaneous.

.. math:: T (1 - q)\,\dot y = u - y,\quad T q\,\dot z = y - z                                   \qquad (C1)

with the command u and the acting value z: one lag for q = 0, two equal ones for q = ½. Below the integration step h the
lags are blended out, so that T = 0 is an identity and the step stays stable: a lag shorter than h acts with the
share T/h and the time constant h. A pure delay of the same length looks nearly the same below 1/(2πT).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values, strength, value
from errorscreen.engine.vmath import select


def control_lag(value: Any, y: Any, z: Any, T: Any, T1: Any, T2: Any, part1: Any, part2: Any) -> Any:
    """Delayed command and derivatives of both lags, (C1)."""
    first = value + part1 * (y - value)
    return select(T > 0.0, first + part2 * (z - first), value), (value - y) / T1, (first - z) / T2


def _start(values: Values, h: float, start: Any) -> Values:
    T = values["T"]
    one, level = np.ones_like(T), start * np.ones_like(T)
    first, second = T * (1.0 - values["q"]), T * values["q"]
    return {
        "T1": np.maximum(first, h), "part1": np.minimum(first / h, one),
        "T2": np.maximum(second, h), "part2": np.minimum(second / h, one),
        "y": level, "z": level,
    }  # fmt: skip


def _start_active(values: Values, h: float) -> Values:
    return _start(values, h, values["P"] / values["V"])


def _start_reactive(values: Values, h: float) -> Values:
    return _start(values, h, values["Q"] / values["V"])


def _start_Q(values: Values, h: float) -> Values:
    return _start(values, h, values["Q"])


def _lag(
    name: str, title: str, port: str, start: Any, of: str, confused: tuple[str, ...], *devices: str
) -> Effect:
    return Effect(
        name=name,
        title=title,
        port=port,
        devices=devices,
        equations=control_lag,
        parameters=(
            strength("T", 0.05, 0.4, "s", of, "T", "time constant of both lags together; 0: none"),
            value("q", 0.1, 0.0, 0.5, "", of, "q", "share of the second lag"),
        ),
        states=("y", "z"),
        derived=("T1", "T2", "part1", "part2"),
        initialise=start,
        formula="u = u* / ((1 + s T (1 − q)) (1 + s T q))",
        description=f"The {of} follows late: a control loop, a communication delay or a phase-locked loop lies "
        "between, which the model leaves out. Edges come late and rounded, steady values are right.",
        source="first-order lag; Milano, Power System Modelling and Scripting, 2010, section 10.2",
        confused_with=confused,
    )


ACTIVE_CURRENT_LAG = _lag(
    "lag_active", "Lag in the control of active current", "Ip_cmd", _start_active,
    "active-current command", ("a slower current regulator", "a lag in the measurement of P"),
    "dfig_plant", "pv_plant",
)  # fmt: skip
REACTIVE_CURRENT_LAG = _lag(
    "lag_reactive", "Lag in the control of reactive current", "Iq_cmd", _start_reactive,
    "reactive-current command", ("a slower current regulator", "a lag in the measurement of Q"),
    "pv_plant",
)  # fmt: skip
REACTIVE_POWER_LAG = _lag(
    "lag_reactive", "Lag in the plant's voltage control", "Qcmd", _start_Q,
    "reactive-power command", ("a slower voltage measurement", "a smaller gain of the reactive-power loop"),
    "dfig_plant",
)  # fmt: skip
