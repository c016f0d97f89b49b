r"""Lag of a converter's command: a control loop, a delay or a phase-locked loop that the model treats as instantaneous.

.. math:: T\,\dot y = u - y                                                                   \qquad (C1)

with the command u and what acts, y. Below the integration step h the lag is blended out, so that T = 0 is an identity
and the step stays stable: :math:`y_{out} = u + (y - u)\min(T/h, 1)`, :math:`\dot y = (u - y)/\max(T, h)`. A pure delay
of the same length looks nearly the same below 1/(2πT).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values, strength
from errorscreen.engine.vmath import select


def control_lag(value: Any, y: Any, T: Any, Tc: Any, share: Any) -> Any:
    """Delayed command and derivative of the lag, (C1)."""
    return select(T > 0.0, value + share * (y - value), value), (value - y) / Tc


def _start(values: Values, h: float, start: Any) -> Values:
    T = values["T"]
    return {"Tc": np.maximum(T, h), "share": np.minimum(T / h, 1.0), "y": start * np.ones_like(T)}


def _start_active(values: Values, h: float) -> Values:
    return _start(values, h, values["P"] / values["V"])


def _start_reactive(values: Values, h: float) -> Values:
    return _start(values, h, values["Q"] / values["V"])


def _start_Q(values: Values, h: float) -> Values:
    return _start(values, h, values["Q"])


def _lag(name: str, title: str, port: str, start: Any, what: str, confused: tuple[str, ...]) -> Effect:
    return Effect(
        name=name,
        title=title,
        port=port,
        equations=control_lag,
        parameters=(strength("T", 0.05, 0.4, "s", what, "T", "time constant; 0: none"),),
        states=("y",),
        derived=("Tc", "share"),
        initialise=start,
        description=f"The {what} follows late: a control loop, a communication delay or a phase-locked loop lies "
        "between, which the model leaves out. Edges come late and rounded, steady values are right.",
        source="first-order lag; Milano, Power System Modelling and Scripting, 2010, section 10.2",
        confused_with=confused,
    )


ACTIVE_CURRENT_LAG = _lag(
    "lag_active", "Lag in the control of active current", "Ip_cmd", _start_active, "active-current command",
    ("a slower current regulator", "a lag in the measurement of P"),
)  # fmt: skip
REACTIVE_CURRENT_LAG = _lag(
    "lag_reactive", "Lag in the control of reactive current", "Iq_cmd", _start_reactive, "reactive-current command",
    ("a slower current regulator", "a lag in the measurement of Q"),
)  # fmt: skip
REACTIVE_POWER_LAG = _lag(
    "lag_reactive", "Lag in the plant's voltage control", "Qcmd", _start_Q, "reactive-power command",
    ("a slower voltage measurement", "a smaller gain of the reactive-power loop"),
)  # fmt: skip
