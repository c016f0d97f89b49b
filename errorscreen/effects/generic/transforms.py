r"""Changes of a signal v on its way: as an input, inside the model, or in the measurement.

Without memory:

.. math::

    w &= v - \mathrm{clip}(v - c, -b, b)                                                      & (G11)\\
    w &= v + k\,\big(\mathrm{clip}(v, l, u) - v\big)                                          & (G12)

With a memory that is updated at the beginning of each step and read τ later, inside the step:

.. math::

    w &= w_0 + \mathrm{clip}(v - w_0, -\tau/k, \tau/k)                                         & (G13)\\
    w &= v - m T + (w_0 - v_0 + m T)\,e^{-\tau/T},\quad m = (v - v_0)/\tau                      & (G14)\\
    w &= v(t - d)                                                                            & (G15)\\
    w &= \mathrm{clip}(w_0, v - b, v + b)                                                     & (G16)\\
    w &= (1 - a\,\rho)\,v,\quad \rho = \mathrm{clip}\big((T_b - T)/h + \tfrac12, 0, 1\big)     & (G17)

Dead band (G11), saturation (G12; k = 1 cuts off all that lies beyond the limits), rate limit (G13; k seconds for one
unit), lag (G14; exact for a signal that is linear in time, Franklin, Powell, Workman, *Digital Control of Dynamic
Systems*, 3rd ed., section 6.3.2), delay (G15; linear between steps), backlash or play (G16; Nordin and Gutman,
Automatica 38, 2002), relay (G17), which takes a share a of the signal away once another signal has been beyond a
threshold for :math:`T_b` ≥ T; spread over one step, so that the instant counts and not its step.
"""

from __future__ import annotations

import math
from typing import Any

from numba.extending import register_jitable


@register_jitable
def clip(v: Any, lower: Any, upper: Any) -> Any:
    """Limit one number."""
    return min(max(v, lower), upper)


@register_jitable
def dead_band(v: Any, b: Any, c: Any) -> Any:
    """Dead band of half width b around c, (G11)."""
    return v - clip(v - c, -b, b)


@register_jitable
def saturation(v: Any, k: Any, lower: Any, upper: Any) -> Any:
    """Saturation, (G12)."""
    return v + k * (clip(v, lower, upper) - v)


@register_jitable
def rate_limit(v: Any, w0: Any, tau: Any, k: Any) -> Any:
    """Rate limit of one unit in k seconds, (G13)."""
    return w0 + clip(v - w0, -tau / k, tau / k)


@register_jitable
def lag(v: Any, w0: Any, v0: Any, tau: Any, T: Any) -> Any:
    """First-order lag, (G14)."""
    if tau <= 0.0:
        return w0
    m = (v - v0) / tau
    return v - m * T + (w0 - v0 + m * T) * math.exp(-tau / T)


@register_jitable
def delay(
    v: Any, d: Any, h: Any, k: Any, tau: Any, history: Any, r: Any, held: Any, after: Any
) -> Any:  # fmt: skip
    """Value d seconds ago, (G15); the first value before the record began.

    The memory holds the value just before each step began; a held input has had it since the step before.
    """
    position = k + (tau - d) / h
    if position <= 0.0:
        return history[r, 0]
    if held:
        i = math.ceil(position + 1e-9) if after else math.ceil(position - 1e-9)
        return history[r, i] if i <= k else v
    i = int(position)
    if i + 1 <= k:
        return history[r, i] + (position - i) * (history[r, i + 1] - history[r, i])
    if tau <= 0.0:
        return v
    return history[r, k] + (position - k) * h / tau * (v - history[r, k])


@register_jitable
def backlash(v: Any, w0: Any, b: Any) -> Any:
    """Play of half width b, (G16)."""
    return clip(w0, v - b, v + b)


@register_jitable
def relay(v: Any, beyond: Any, a: Any, T: Any, h: Any) -> Any:
    """Signal behind a relay with a timer, (G17); `beyond` is the time since the threshold was passed."""
    if beyond <= 0.0:
        return v
    return v * (1.0 - a * clip((beyond - T) / h + 0.5, 0.0, 1.0))


@register_jitable
def time_beyond(distance: Any, before: Any, timer: Any, tau: Any) -> Any:
    """Time that a signal has been beyond a threshold, linear between steps; `distance` is positive beyond it."""
    if distance <= 0.0:
        return 0.0
    if before <= 0.0:
        return tau * distance / (distance - before)
    return timer + tau
