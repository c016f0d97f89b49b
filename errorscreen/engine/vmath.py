"""Elementary functions for device equations: the same source runs on NumPy arrays and compiles to vector code.

Equations call these instead of ``if``, ``min`` or ``math.sin``, because LLVM cannot vectorise branches and calls into
the C library. They use additions, multiplications, divisions, floor and selection only, so that scalar, vectorised and
NumPy path agree bit for bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload, register_jitable

# Cody-Waite splitting of pi/2: x - k*PIO2_HIGH - k*PIO2_LOW is exact enough for |k| < 1e6
_TWO_OVER_PI = 0.6366197723675814
_PIO2_HIGH = 1.5707963267341256
_PIO2_LOW = 6.077100506506192e-11


def select(condition: Any, a: Any, b: Any) -> Any:
    """`a` where the condition holds, else `b`.

    Examples
    --------
    >>> float(select(2.0 > 1.0, 5.0, 7.0))
    5.0
    """
    return np.where(condition, a, b)


@overload(select)
def _select_compiled(condition, a, b):
    return lambda condition, a, b: a if condition else b


@register_jitable
def clip(x: Any, lower: Any, upper: Any) -> Any:
    """Limit `x` to the range [lower, upper].

    Examples
    --------
    >>> [float(clip(x, 0.0, 1.0)) for x in (-1.0, 0.5, 2.0)]
    [0.0, 0.5, 1.0]
    """
    return select(x < lower, lower, select(x > upper, upper, x))


@register_jitable
def hold_at_limits(x: Any, dx: Any, lower: Any, upper: Any) -> Any:
    """Derivative of an integrator that does not wind up: zero where `dx` leads out of [lower, upper].

    Examples
    --------
    >>> float(hold_at_limits(1.0, 0.3, -1.0, 1.0)), float(hold_at_limits(1.0, -0.3, -1.0, 1.0))
    (0.0, -0.3)
    """
    outwards = ((x >= upper) & (dx > 0.0)) | ((x <= lower) & (dx < 0.0))
    return select(outwards, 0.0, dx)


@register_jitable
def back_calculate(x: Any, dx: Any, lower: Any, upper: Any, T: Any) -> Any:
    """Derivative of an integrator whose excess beyond [lower, upper] decays with the time constant `T`.

    Anti-windup by back-calculation (Åström, Hägglund, *Advanced PID Control*, 2006, section 3.5); what uses the
    integrator has to clip it. Continuous, unlike `hold_at_limits`, so that a fixed step keeps its accuracy.

    Examples
    --------
    >>> round(float(back_calculate(1.1, 0.3, -1.0, 1.0, 0.5)), 6)
    0.1
    """
    return dx - (x - clip(x, lower, upper)) / T


@register_jitable
def smooth_step(x: Any) -> Any:
    """Cubic transition from 0 (x <= 0) to 1 (x >= 1) with continuous slope.

    Replaces a hard switch so that responses stay differentiable in the threshold.

    Examples
    --------
    >>> [float(smooth_step(x)) for x in (-1.0, 0.5, 2.0)]
    [0.0, 0.5, 1.0]
    """
    y = clip(x, 0.0, 1.0)
    return y * y * (3.0 - 2.0 * y)


@register_jitable
def sincos(x: Any) -> Any:
    """Sine and cosine of `x` (rad), to 2e-16 for ``abs(x) < 1e5``.

    Range reduction to ``abs(r) <= pi/4`` and the minimax polynomials of the Cephes library (S. L. Moshier,
    "Methods and Programs for Mathematical Functions", 1989).

    Examples
    --------
    >>> s, c = sincos(np.array([0.0, np.pi / 2]))
    >>> bool(np.allclose(s, [0, 1]) and np.allclose(c, [1, 0]))
    True
    """
    k = np.floor(x * _TWO_OVER_PI + 0.5)
    r = (x - k * _PIO2_HIGH) - k * _PIO2_LOW
    z = r * r
    sine = r + r * z * (
        -1.66666666666666307295e-1
        + z
        * (
            8.33333333332211858878e-3
            + z
            * (
                -1.98412698295895385996e-4
                + z
                * (
                    2.75573136213857245213e-6
                    + z * (-2.50507477628578072866e-8 + z * 1.58962301576546568060e-10)
                )
            )
        )
    )
    cosine = (
        1.0
        - 0.5 * z
        + z
        * z
        * (
            4.16666666666665929218e-2
            + z
            * (
                -1.38888888888730564116e-3
                + z
                * (
                    2.48015872888517045348e-5
                    + z
                    * (
                        -2.75573141792967388112e-7
                        + z * (2.08757008419747316778e-9 + z * -1.13585365213876817300e-11)
                    )
                )
            )
        )
    )
    quadrant = k - 4.0 * np.floor(0.25 * k)
    odd = (quadrant == 1.0) | (quadrant == 3.0)
    s = select(odd, cosine, sine)
    c = select(odd, sine, cosine)
    return select(quadrant >= 2.0, -s, s), select((quadrant == 1.0) | (quadrant == 2.0), -c, c)


@register_jitable
def power(u: Any, k: Any) -> Any:
    r"""Power :math:`u^k` for ``1e-4 < u < 1e4`` and ``abs(k ln u) < 40``, to 1e-13; smaller u count as 1e-4.

    :math:`\ln u = 8\ln u^{1/8}` by the series of the inverse hyperbolic tangent, and :math:`e^y = (e^{y/256})^{256}` by
    Taylor's (Abramowitz, Stegun, *Handbook of Mathematical Functions*, 4.1.27 and 4.2.1).

    Examples
    --------
    >>> bool(abs(power(1.1, 7.0) / 1.1**7 - 1) < 1e-13), bool(abs(power(0.02, 0.5) / 0.02**0.5 - 1) < 1e-13)
    (True, True)
    """
    r = np.sqrt(np.sqrt(np.sqrt(clip(u, 1e-4, 1e4))))
    z = (r - 1.0) / (r + 1.0)
    w = z * z
    series = 1.0 / 15.0 + w * (1.0 / 17.0 + w * (1.0 / 19.0 + w * (1.0 / 21.0 + w / 23.0)))
    series = 1.0 / 7.0 + w * (1.0 / 9.0 + w * (1.0 / 11.0 + w * (1.0 / 13.0 + w * series)))
    log = 16.0 * z * (1.0 + w * (1.0 / 3.0 + w * (1.0 / 5.0 + w * series)))
    y = k * log / 256.0
    e = 1.0 + y * (1.0 + y / 2.0 * (1.0 + y / 3.0 * (1.0 + y / 4.0 * (1.0 + y / 5.0 * (1.0 + y / 6.0)))))
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return e * e
