r"""Connection of a device to a simulated grid, where its terminal voltage is a result.

Currents and voltages are phasors in the frame that rotates at the nominal frequency. Before the grid is solved a
device gives its *source*, which follows from its states; with the solution it continues with the terminal stages here,
in place of its own first stage. In per unit of the device's own base:

.. math::

    V &= |V_r + jV_i|,\quad P + jQ = (V_r + jV_i)(I_r + jI_i)^*                              & (T1)\\
    \dot\vartheta &= K_{PLL}\,V_q/V,\quad V_q = V_i\cos\vartheta - V_r\sin\vartheta,\quad
    \Delta f = \dot\vartheta/(2\pi f_0)                                                       & (T2)

with the phase-locked loop of (W2) for converters. The current of a unit on the base of the grid is `size` (rating over
that base) times its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, sincos

_V_MIN = 0.05  # the divisions by V stop here


@stage("V", "P", "Q")
def terminal_power(Vr: Any, Vi: Any, Ir: Any, Ii: Any, size: Any) -> Any:
    """Voltage magnitude, and power on the device's own base from the current on that of the grid, (T1)."""
    return np.sqrt(Vr * Vr + Vi * Vi), (Vr * Ir + Vi * Ii) / size, (Vi * Ir - Vr * Ii) / size


@stage("d_theta", "df")
def phase_locked_loop(Vr: Any, Vi: Any, V: Any, theta: Any, KPLL: Any, f0: Any) -> Any:
    """Angle of the converter's frame and measured frequency deviation in pu, (T2)."""
    s, c = sincos(theta)
    d_theta = KPLL * (Vi * c - Vr * s) / clip(V, _V_MIN, 10.0)
    return d_theta, d_theta / (6.283185307179586 * f0)
