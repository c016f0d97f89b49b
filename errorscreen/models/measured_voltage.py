r"""Frequency and rate of change of a terminal voltage.

.. math::

    T\,\dot z &= V_r + jV_i - z,\quad 2\pi f_0\,\Delta f = \mathrm{Im}(\dot z / z)    & (1)\\
    \dot V &= \mathrm{Re}(\dot z\,z^*)/|z|                                               & (2)

with T = 20 ms, the filter of a measurement: without it, a jump of the voltage would be an impulse of its frequency.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.vmath import clip
from errorscreen.models.blocks import longer

#: filter of the terminal voltage in s
T_FILTER = 0.02


@register_jitable
def measured_voltage(xr: Any, xi: Any, Vr: Any, Vi: Any, f0: Any, shortest: Any) -> Any:
    """Frequency deviation in pu, derivative of the magnitude, and derivatives of the filtered voltage: (1), (2).

    Examples
    --------
    >>> [round(float(value), 6) for value in measured_voltage(1.0, 0.0, 1.0, 0.02 * 2 * np.pi, 50.0, 0.001)]
    [0.02, 0.0, 0.0, 6.283185]
    """
    T = longer(T_FILTER, shortest)
    d_xr, d_xi = (Vr - xr) / T, (Vi - xi) / T
    square = clip(xr * xr + xi * xi, 1e-4, 100.0)
    df = (xr * d_xi - xi * d_xr) / square / (6.283185307179586 * f0)
    return df, (xr * d_xr + xi * d_xi) / np.sqrt(square), d_xr, d_xi
