"""Blocks of control diagrams, each as its output and the derivative of its state.

Standard models hold lags of milliseconds beside seconds, and a time constant of zero means "no lag". ``shortest`` is
the shortest time constant that the step of the integration advances (`errorscreen.models.unit.SHORTEST` steps). A lag
that is shorter passes its input on where it stands in the forward path, and lasts ``shortest`` in a loop or with
limits. Both tend to the exact equations as the step gets smaller.

Limits do not wind up (IEEE Std 421.5-2016, annex E) unless a model says so.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.vmath import clip, hold_at_limits, select


@register_jitable
def longer(T: Any, shortest: Any) -> Any:
    """Time constant of a lag that has to last at least ``shortest``.

    Examples
    --------
    >>> float(longer(0.0, 0.001)), float(longer(2.0, 0.001))
    (0.001, 2.0)
    """
    return select(shortest > T, shortest, T)


@register_jitable
def lag(x: Any, u: Any, T: Any, shortest: Any) -> Any:
    r"""First-order lag, :math:`y = u / (1 + sT)`: output and derivative of its state x.

    Examples
    --------
    >>> [float(value) for value in lag(1.0, 3.0, 2.0, 0.001)]
    [1.0, 1.0]
    >>> float(lag(1.0, 3.0, 0.0, 0.001)[0])
    3.0
    """
    return select(shortest > T, u, x), (u - x) / longer(T, shortest)


@register_jitable
def limited_lag(x: Any, u: Any, T: Any, lower: Any, upper: Any, shortest: Any) -> Any:
    """First-order lag within fixed limits (non-windup): output and derivative.

    A step may carry the state beyond a limit, where it stays until the input leads back; only the output is clipped. So
    a lag of a few steps enters its limit without the chatter of a stiff return.

    Examples
    --------
    >>> [float(value) for value in limited_lag(1.0, 3.0, 2.0, 0.0, 1.0, 0.001)]
    [1.0, 0.0]
    """
    return clip(x, lower, upper), hold_at_limits(x, (u - x) / longer(T, shortest), lower, upper)


@register_jitable
def following_lag(x: Any, u: Any, T: Any, lower: Any, upper: Any, shortest: Any) -> Any:
    """First-order lag within limits that move (non-windup): a state beyond a limit returns within ``shortest``.

    Examples
    --------
    >>> [float(value) for value in following_lag(1.0, 3.0, 2.0, 0.0, 1.0, 0.001)]
    [1.0, 0.0]
    >>> [round(float(value), 6) for value in following_lag(1.5, 3.0, 2.0, 0.0, 1.0, 0.001)]
    [1.0, -500.0]
    """
    y = clip(x, lower, upper)
    return y, hold_at_limits(x, (u - x) / longer(T, shortest), lower, upper) + (y - x) / shortest


@register_jitable
def lead_lag(x: Any, u: Any, T1: Any, T2: Any, shortest: Any) -> Any:
    r"""Lead-lag, :math:`y = u (1 + sT_1)/(1 + sT_2)`: output and derivative of the state x, which is u behind T2.

    Examples
    --------
    >>> [float(value) for value in lead_lag(1.0, 3.0, 0.5, 2.0, 0.001)]
    [1.5, 1.0]
    """
    T = longer(T2, shortest)
    return select(shortest > T2, u, x + T1 / T * (u - x)), (u - x) / T


@register_jitable
def washout(x: Any, u: Any, T: Any, shortest: Any) -> Any:
    r"""Washout, :math:`y = u\,sT/(1 + sT)`; without a time constant the input passes.

    Examples
    --------
    >>> [float(value) for value in washout(1.0, 3.0, 2.0, 0.001)]
    [2.0, 1.0]
    """
    return select(shortest > T, u, u - x), (u - x) / longer(T, shortest)


@register_jitable
def rate(x: Any, u: Any, K: Any, T: Any, shortest: Any) -> Any:
    r"""Derivative with lag, :math:`y = u\,sK/(1 + sT)`.

    Examples
    --------
    >>> [float(value) for value in rate(1.0, 3.0, 4.0, 2.0, 0.001)]
    [4.0, 1.0]
    """
    dx = (u - x) / longer(T, shortest)
    return K * dx, dx


@register_jitable
def dead_band(x: Any, width: Any) -> Any:
    """Dead band without a step at its edge (IEEE Std 1207, type I), half width `width`.

    Examples
    --------
    >>> [float(dead_band(x, 0.1)) for x in (-0.25, 0.05)]
    [-0.15, 0.0]
    """
    return x - clip(x, -width, width)


@register_jitable
def rectifier(In: Any) -> Any:
    """Rectifier loading factor F_EX of the normalised current I_N (IEEE Std 421.5-2016, annex D).

    Examples
    --------
    >>> [round(float(rectifier(In)), 4) for In in (-1.0, 0.0, 0.4, 0.6, 0.9, 2.0)]
    [1.0, 1.0, 0.7692, 0.6245, 0.1732, 0.0]
    """
    second = np.sqrt(clip(0.75 - In * In, 0.0, 0.75))
    upper = select(In < 0.75, second, clip(1.732 * (1.0 - In), 0.0, 1.0))
    return select(In <= 0.0, 1.0, select(In <= 0.433, 1.0 - 0.577 * In, upper))


@register_jitable
def quadratic_saturation(u: Any, A: Any, B: Any) -> Any:
    r"""Quadratic saturation, :math:`S(u)\,u = B ([u - A]^+)^2`: the product, so that u = 0 needs no division.

    Examples
    --------
    >>> round(float(quadratic_saturation(1.2, 0.9, 2.0)), 12)
    0.18
    """
    over = clip(u - A, 0.0, 1e9)
    return B * over * over


def quadratic_constants(u1: Any, S1: Any, u2: Any, S2: Any) -> Any:
    r"""A and B of the quadratic saturation through two points, :math:`S(u) = B (u - A)^2 / u`.

    From :math:`\sqrt{u_1 S_1} = \sqrt B (u_1 - A)` and the same at u2; no saturation where S2 = 0. Points in the other
    order, or with S1 at the larger u, are the same curve.

    Examples
    --------
    >>> A, B = quadratic_constants(1.0, 0.11, 1.2, 0.39)
    >>> S = lambda u: float(B * (u - A) ** 2 / u)
    >>> round(S(1.0), 12), round(S(1.2), 12)
    (0.11, 0.39)
    """
    u1, S1, u2, S2 = (np.asarray(value, dtype=float) for value in (u1, S1, u2, S2))
    root1, root2 = np.sqrt(np.maximum(u1 * S1, 0.0)), np.sqrt(np.maximum(u2 * S2, 0.0))
    distance = np.where(u2 == u1, 1.0, u2 - u1)
    slope = (root2 - root1) / distance
    found = slope > 0
    A = np.where(found, u1 - root1 / np.where(found, slope, 1.0), 1e9)
    return A, np.where(found, slope * slope, 0.0)


@register_jitable
def limited_pi(x: Any, u: Any, KP: Any, KI: Any, lower: Any, upper: Any) -> Any:
    """Proportional and integral block whose output is limited: output and derivative of the integral x.

    The integral holds while the output is at a limit and the input leads beyond it (IEEE Std 421.5-2016, annex E).

    Examples
    --------
    >>> [float(value) for value in limited_pi(0.5, 0.1, 2.0, 3.0, -1.0, 1.0)]
    [0.7, 0.30000000000000004]
    >>> [float(value) for value in limited_pi(0.5, 0.4, 2.0, 3.0, -1.0, 1.0)]
    [1.0, 0.0]
    """
    y = x + KP * u
    return clip(y, lower, upper), hold_at_limits(y, KI * u, lower, upper)


@register_jitable
def limited_lead_lag(x: Any, u: Any, T1: Any, T2: Any, lower: Any, upper: Any, shortest: Any) -> Any:
    r"""Lead-lag, :math:`(1 + sT_1)/(1 + sT_2)`, whose output is limited (non-windup): output and derivative of x.

    The state is the limited output behind :math:`T_1`, so that :math:`y = (T_1/T_2)u + (1 - T_1/T_2)x` stays at a limit
    only as long as the input demands it (IEEE Std 421.5-2016, annex E). The lead lasts at least ``shortest``.

    Examples
    --------
    >>> [float(value) for value in limited_lead_lag(1.0, 3.0, 0.5, 2.0, 0.0, 5.0, 0.001)]
    [1.5, 1.0]
    >>> [float(value) for value in limited_lead_lag(1.0, 3.0, 0.5, 2.0, 0.0, 1.25, 0.001)]
    [1.25, 0.5]
    """
    lead = longer(T1, shortest)
    share = lead / longer(T2, shortest)
    y = clip(select(shortest > T2, u, share * u + (1.0 - share) * x), lower, upper)
    return y, (y - x) / lead


@register_jitable
def high_frequency_gain(T1: Any, T2: Any, shortest: Any) -> Any:
    """Gain of a lead-lag for fast changes, T1/T2; 1 where it passes its input.

    Examples
    --------
    >>> float(high_frequency_gain(1.0, 4.0, 0.001)), float(high_frequency_gain(0.0, 0.0, 0.001))
    (0.25, 1.0)
    """
    return select(shortest > T2, 1.0, T1 / longer(T2, shortest))
