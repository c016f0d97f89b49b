r"""First-order lag of a measured channel, exact for a signal that is linear between steps.

.. math::

    T\,\dot y &= u - y                                                                  & (L1)\\
    y_{k+1} &= a\,y_k + b_0 u_k + b_1 u_{k+1},\quad a = e^{-h/T},\quad
    b_0 = \tfrac{T}{h}(1 - a) - a,\quad b_1 = 1 - \tfrac{T}{h}(1 - a)                     & (L2)

(L2) is the first-order-hold equivalent of (L1) (Franklin, Powell, Workman, *Digital Control of Dynamic Systems*, 3rd
ed., section 6.3.2). Unlike an integrated state it is stable for any T and becomes the identity at T = 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.effects.base import Effect, Values
from errorscreen.exceptions import unknown_name
from errorscreen.parameters import Parameter


def lag(value: Any, y: Any, u: Any, a: Any, b0: Any, b1: Any) -> Any:
    """Filtered value, which is also the new memory, and the raw value to remember, (L2)."""
    filtered = a * y + b0 * u + b1 * value
    return filtered, filtered, value


def _start(values: Values, h: float, channel: str) -> Values:
    T = values["T"]
    positive = np.where(T > 0, T, 1.0)
    a = np.where(T > 0, np.exp(-h / positive), 0.0)
    ratio = T / h * (1 - a)
    level = values[channel] * np.ones_like(T)
    return {"a": a, "b0": ratio - a, "b1": 1 - ratio, "y": level, "u": level}


def _start_P(values: Values, h: float) -> Values:
    return _start(values, h, "P")


def _start_Q(values: Values, h: float) -> Values:
    return _start(values, h, "Q")


_STARTS = {"P": _start_P, "Q": _start_Q}


def measurement_lag(channel: str) -> Effect:
    """Lag of the measured channel ``"P"`` or ``"Q"``; another name raises `InputError`.

    Examples
    --------
    >>> measurement_lag("P").port
    'channel.P'
    """
    if channel not in _STARTS:
        raise unknown_name(channel, _STARTS, kind="channel", where="measurement_lag")
    return Effect(
        name=f"lag_{channel}",
        title=f"Lag in the measurement of {channel}",
        port=f"channel.{channel}",
        equations=lag,
        parameters=(
            Parameter("T", 0.05, 0.0, 0.5, "s", f"measurement of {channel}", "T", "time constant; 0: none"),
        ),
        memories=("y", "u"),
        derived=("a", "b0", "b1"),
        sampled=True,
        initialise=_STARTS[channel],
        description=f"The transducer or the meter smooths {channel}: fast edges arrive late and rounded, while slow "
        "swings are right.",
        source="Franklin, Powell, Workman, Digital Control of Dynamic Systems, 3rd ed., section 6.3.2",
        confused_with=("clock skew of the channel", "a slower current regulator"),
    )
