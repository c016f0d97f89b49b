r"""Signals of excitation limiters at an exciter: added at its summing point, or limits of a gate.

A limiter writes :math:`V_{UEL} \ge 0` or :math:`V_{OEL} \le 0`, which is zero at rest. Its constant g (``UELgate``,
``OELgate``) is the signal that a gate gets at rest, if the exciter has a gate for it:

.. math::

    y &= \max(x, V_{UEL} + g)                & (G1)\\
    y &= \min(x, V_{OEL} + g)                & (G2)

With :math:`g = \mp 10^9` the gate is open and the signal is added to the error of the voltage: so does a limiter of the
summed type, and an effect that stands for a limiter which the model lacks. A gate that would act at the start is moved
to it.

(IEEE Std 421.5-2005, section 9.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from errorscreen.engine.vmath import select
from errorscreen.models.part import Limit, Values

#: size of the constant g of an open gate, twice that from which a gate counts as open
OPEN = 1e9


@register_jitable
def summed(signal: Any, gate: Any) -> Any:
    """Share of a signal that is added at the summing point: all of it where the gate is open.

    Examples
    --------
    >>> float(summed(0.1, -1e9)), float(summed(-0.1, 1e9)), float(summed(0.1, 0.0))
    (0.1, -0.1, 0.0)
    """
    return select((gate < -0.5e9) | (gate > 0.5e9), signal, 0.0)


@register_jitable
def high_value(x: Any, VUEL: Any, gate: Any) -> Any:
    """High-value gate of under-excitation, (G1).

    Examples
    --------
    >>> float(high_value(0.1, 0.3, 0.0)), float(high_value(0.1, 0.3, -1e9))
    (0.3, 0.1)
    """
    return select(x < VUEL + gate, VUEL + gate, x)


@register_jitable
def low_value(x: Any, VOEL: Any, gate: Any) -> Any:
    """Low-value gate of over-excitation, (G2).

    Examples
    --------
    >>> float(low_value(0.1, -0.3, 0.0)), float(low_value(0.1, -0.3, 1e9))
    (-0.3, 0.1)
    """
    return select(x > VOEL + gate, VOEL + gate, x)


def under_excitation_gate(v: Values, value: NDArray[np.float64]) -> tuple[NDArray[np.float64], Limit]:
    """Constant g of (G1) that holds the start of a quantity, and its limit."""
    limit = Limit("input of the gate of under-excitation", value, v["UELgate"], np.inf, ("VUEL", "infinity"))
    return np.minimum(value, v["UELgate"]), limit


def over_excitation_gate(v: Values, value: NDArray[np.float64]) -> tuple[NDArray[np.float64], Limit]:
    """Constant g of (G2) that holds the start of a quantity, and its limit."""
    limit = Limit("input of the gate of over-excitation", value, -np.inf, v["OELgate"], ("-infinity", "VOEL"))
    return np.maximum(value, v["OELgate"]), limit
