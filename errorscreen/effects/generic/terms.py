r"""Terms that are added to a quantity v: a state equation, an input or an output. They depend on a signal s.

.. math::

    v &- d\,s                                                                                & (G0)\\
    v &+ a\,s^2                                                                              & (G1)\\
    v &+ a\,s^3                                                                              & (G2)\\
    v &- a\,|s|\,s                                                                           & (G3)\\
    v &- F\,\mathrm{sgn}(s)                                                                  & (G4)\\
    v &- F\big(1 + r\,e^{-(s/s_0)^2}\big)\,\mathrm{sgn}(s)                                   & (G5)\\
    v &+ b                                                                                   & (G6)\\
    v &+ A \sin(2\pi f t + \varphi)                                                          & (G7)\\
    v &- F z,\quad \dot z = \frac{s}{y}\Big(1 - \tfrac12\big(1 + \mathrm{sgn}(s z)\big)\,|z|^2\Big)   & (G8)\\
    v &- k \max(s - c, 0)                                                                    & (G9)\\
    v &- B \max(|s| - A, 0)^2\,\mathrm{sgn}(s)                                                & (G20)

Linear resistance or viscous friction (G0), quadratic (G1) and cubic (G2) term, quadratic resistance or drag (G3;
Batchelor, *An Introduction to Fluid Dynamics*, section 5.11), Coulomb (G4) and Stribeck friction (G5;
Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30, 1994), constant offset (G6), periodic forcing (G7),
hysteresis of Bouc and Wen with :math:`\beta = \gamma = \tfrac12`, n = 2 (G8; Ismail, Ikhouane, Rodellar, Arch. Comput.
Methods Eng. 16, 2009), overflow above a brim at c (G9), magnetic saturation of a flux above A (G20; P. Kundur, *Power
System Stability and Control*, 1994, section 3.8, in the quadratic form that GENROU has).

Friction that changes sign at once cannot be integrated with a fixed step h. In the equation of the very state s that it
opposes, v is the derivative without it, and friction of at most F takes the part that brings s to rest within the step:

.. math:: v - \mathrm{clip}\big(v + s/h,\, -F,\, F\big)                                             \qquad (G10)

(the implicit step of Moreau's time stepping, *Unilateral contact and dry friction in finite freedom dynamics*, 1988),
so that it sticks where it should. In another equation a smoothed sign stands for it,

.. math:: \mathrm{sgn}_\varepsilon(s) = \tanh(s/\varepsilon),\quad
   \varepsilon = \max(10^{-4} S,\; 0.6\,F h)                                                        \qquad (G18)

with the size S of the signal: :math:`h F/\varepsilon` is then at most 1.7, inside the stability region of the
integrator (2.8). A spill that is nearly instantaneous cannot be integrated either. The flow over the brim comes from an
implicit step of length h/2,

.. math:: v - \frac{k}{1 + k h/2} \max\big(s + \tfrac{h}{2} v - c,\, 0\big)                         \qquad (G19)

with v as the derivative of s without it: the level comes to rest at exactly c + v/k whatever k, and returns to it at a
rate of at most 2/h. All three become exact as the step goes to zero.
"""

from __future__ import annotations

import math
from typing import Any

from numba.extending import register_jitable


@register_jitable
def viscous(v: Any, s: Any, d: Any) -> Any:
    """Linear resistance, (G0)."""
    return v - d * s


@register_jitable
def quadratic(v: Any, s: Any, a: Any) -> Any:
    """Quadratic term, (G1)."""
    return v + a * s * s


@register_jitable
def cubic(v: Any, s: Any, a: Any) -> Any:
    """Cubic term, (G2)."""
    return v + a * s * s * s


@register_jitable
def drag(v: Any, s: Any, a: Any) -> Any:
    """Quadratic resistance, (G3)."""
    return v - a * abs(s) * s


@register_jitable
def magnetic_saturation(v: Any, s: Any, B: Any, A: Any) -> Any:
    """Magnetic saturation, (G20)."""
    beyond = max(abs(s) - A, 0.0)
    return v - math.copysign(B * beyond * beyond, s)


@register_jitable
def dry(v: Any, s: Any, F: Any, size: Any, h: Any, own: Any) -> Any:
    """Dry friction of at most F, (G10) in the equation of s itself (`own`), (G18) in another one."""
    if own:
        return v - min(max(v + s / h, -F), F)
    return v - F * math.tanh(s / max(1e-4 * size, 0.6 * abs(F) * h))


@register_jitable
def coulomb(v: Any, s: Any, F: Any, size: Any, h: Any, own: Any) -> Any:
    """Coulomb friction, (G4)."""
    return dry(v, s, F, size, h, own)


@register_jitable
def stribeck(v: Any, s: Any, F: Any, r: Any, s0: Any, size: Any, h: Any, own: Any) -> Any:
    """Stribeck friction, (G5)."""
    return dry(v, s, F * (1.0 + r * math.exp(-((s / s0) ** 2))), size, h, own)


@register_jitable
def offset(v: Any, b: Any) -> Any:
    """Constant offset, (G6)."""
    return v + b


@register_jitable
def forcing(v: Any, t: Any, A: Any, f: Any, phi: Any) -> Any:
    """Periodic forcing, (G7)."""
    return v + A * math.sin(2.0 * math.pi * f * t + phi)


@register_jitable
def hysteresis(v: Any, z: Any, F: Any) -> Any:
    """Restoring force of Bouc and Wen, (G8)."""
    return v - F * z


@register_jitable
def hysteresis_slope(s: Any, z: Any, y: Any) -> Any:
    """Derivative of the hysteretic variable, (G8)."""
    loading = 1.0 if s * z > 0.0 else 0.0
    return s / y * (1.0 - loading * z * z)


@register_jitable
def spill(v: Any, s: Any, k: Any, c: Any, h: Any) -> Any:
    """Flow over the brim, (G9) by (G19)."""
    return k / (1.0 + 0.5 * k * h) * max(s + 0.5 * h * v - c, 0.0)
