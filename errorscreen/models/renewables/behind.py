r"""Terminal voltage of a converter behind an impedance, where its current lies along that voltage.

With :math:`E` the voltage behind :math:`Z = R + jX`, :math:`V = |V|e^{j\theta}` that of the terminal, and the current
:math:`I = (I_a - jI_r)\,e^{j\theta}`:

.. math::

    E\,e^{-j\theta} &= u - jw,\quad u = |V| - R I_a - X I_r,\quad w = X I_a - R I_r,\quad |E|^2 = u^2 + w^2  & (Z1)\\
    e^{j\theta} &= \frac{E\,(u + jw)}{|E|^2}                                                            & (Z2)

Where the currents depend on :math:`|V|` in straight lines, :math:`I_a = a_0 + a_1|V|` and :math:`I_r = b_0 + b_1|V|`,
(Z1) is a quadratic equation, of which the larger root counts:

.. math::

    (p^2 + m^2)\,|V|^2 &- 2(pq - mn)\,|V| + q^2 + n^2 - |E|^2 = 0,\\
    p &= 1 - R a_1 - X b_1,\quad q = R a_0 + X b_0,\quad m = X a_1 - R b_1,\quad n = X a_0 - R b_0      & (Z3)

A current that the grid cannot take, :math:`|w| > |E|`, has no solution. Then :math:`|V|` is where the two come nearest.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.vmath import clip

#: the directions of voltages below this, in pu, are not defined
_DEAD = 1e-9


@register_jitable
def voltage_behind(E: Any, R: Any, X: Any, a0: Any, a1: Any, b0: Any, b1: Any) -> Any:
    """Magnitude of the terminal voltage, (Z3).

    Examples
    --------
    >>> V = voltage_behind(1.0, 0.02, 0.1, 0.8, 0.0, 0.3, 0.0)
    >>> w = 0.1 * 0.8 - 0.02 * 0.3
    >>> round(float((V - 0.02 * 0.8 - 0.1 * 0.3) ** 2 + w**2), 12)
    1.0
    """
    p, q, m, n = 1.0 - R * a1 - X * b1, R * a0 + X * b0, X * a1 - R * b1, X * a0 - R * b0
    square, half = p * p + m * m, p * q - m * n
    inside = half * half - square * (q * q + n * n - E * E)
    return clip((half + np.sqrt(clip(inside, 0.0, 1e12))) / square, 0.0, 1e6)


@register_jitable
def along_terminal(Er: Any, Ei: Any, V: Any, Ia: Any, Ir: Any, R: Any, X: Any) -> Any:
    """Real and imaginary part of the current in the frame of E, (Z2)."""
    u, w = V - R * Ia - X * Ir, X * Ia - R * Ir
    x, y = Er * u - Ei * w, Ei * u + Er * w
    size = clip(np.sqrt(x * x + y * y), _DEAD, 1e6)
    c, s = x / size, y / size
    return Ia * c + Ir * s, Ia * s - Ir * c
