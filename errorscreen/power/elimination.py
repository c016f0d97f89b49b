r"""Closed-form solution of a reduced grid with a machine and converters, without an algebraic loop.

:math:`Z` holds the admittances of the fixed machines (see `errorscreen.power.reduction`). There are two kinds of
currents: those of fixed machines and current-controlled converters follow from states (:math:`J_k`). Those of at most
one converter behind a reactance (w), and of one machine with different reactances in its axes (m), depend on the
voltage:

.. math::

    V_i &= V_i^0 + Z_{iw} I_w + Z_{im} I_m,\quad V_i^0 = \sum_k Z_{ik} J_k                   & (G1)\\
    I_w &= s_w C_w - y\,V_w,\quad y = s_w / (j X'')                                          & (G2)\\
    I_w &= I_w^0 + k I_m,\quad I_w^0 = g\,(s_w C_w - y V_w^0),\quad k = -g\,y\,Z_{wm},\quad
    g = 1/(1 + y Z_{ww})                                                                     & (G3)\\
    V_m &= E + (R + jX) I_m,\quad E = V_m^0 + Z_{mw} I_w^0,\quad R + jX = Z_{mm} + Z_{mw} k  & (G4)\\
    E'_d - E_d &= (R_a/s_m + R) I_d - (X'_q/s_m + X) I_q,\quad
    E'_q - E_q = (R_a/s_m + R) I_q + (X'_d/s_m + X) I_d                                      & (G5)

s is the rating of a unit over the base of the grid. (G5) is (M5), (M6) of the machine with the voltage source E and the
impedance R + jX of the rest of the grid in its stator: a complex factor commutes with the rotation into the rotor's
frame. Without such a converter, E is :math:`V_m^0` and R + jX is :math:`Z_{mm}`; without such a machine, :math:`I_w` is
:math:`I_w^0`. The same holds for a single unit on a voltage :math:`V^0` behind an impedance Z.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import sincos


def product(Jr: Any, Ji: Any, r: Any, x: Any) -> Any:
    """Voltage of one current at an impedance, the first term of a sum in (G1)."""
    return r * Jr - x * Ji, r * Ji + x * Jr


def add_one(ar: Any, ai: Any, Jr: Any, Ji: Any, r: Any, x: Any) -> Any:
    """One term more, (G1)."""
    return ar + (r * Jr - x * Ji), ai + (r * Ji + x * Jr)


def add_two(
    ar: Any, ai: Any, Jr0: Any, Ji0: Any, r0: Any, x0: Any, Jr1: Any, Ji1: Any, r1: Any, x1: Any
) -> Any:
    """Two terms more, (G1): one pass over the simulations instead of two."""
    ar = ar + (r0 * Jr0 - x0 * Ji0) + (r1 * Jr1 - x1 * Ji1)
    ai = ai + (r0 * Ji0 + x0 * Jr0) + (r1 * Ji1 + x1 * Jr1)
    return ar, ai


def add_three(
    ar: Any, ai: Any, Jr0: Any, Ji0: Any, r0: Any, x0: Any, Jr1: Any, Ji1: Any, r1: Any, x1: Any,
    Jr2: Any, Ji2: Any, r2: Any, x2: Any,
) -> Any:  # fmt: skip
    """Three terms more, (G1): one pass over the simulations instead of three."""
    ar = ar + (r0 * Jr0 - x0 * Ji0) + (r1 * Jr1 - x1 * Ji1) + (r2 * Jr2 - x2 * Ji2)
    ai = ai + (r0 * Ji0 + x0 * Jr0) + (r1 * Ji1 + x1 * Jr1) + (r2 * Ji2 + x2 * Jr2)
    return ar, ai


def add_seven(
    ar: Any, ai: Any, Jr0: Any, Ji0: Any, r0: Any, x0: Any, Jr1: Any, Ji1: Any, r1: Any, x1: Any,
    Jr2: Any, Ji2: Any, r2: Any, x2: Any, Jr3: Any, Ji3: Any, r3: Any, x3: Any,
    Jr4: Any, Ji4: Any, r4: Any, x4: Any, Jr5: Any, Ji5: Any, r5: Any, x5: Any,
    Jr6: Any, Ji6: Any, r6: Any, x6: Any,
) -> Any:  # fmt: skip
    """Seven terms more, (G1)."""
    ar = ar + (r0 * Jr0 - x0 * Ji0) + (r1 * Jr1 - x1 * Ji1) + (r2 * Jr2 - x2 * Ji2) + (r3 * Jr3 - x3 * Ji3)
    ai = ai + (r0 * Ji0 + x0 * Jr0) + (r1 * Ji1 + x1 * Jr1) + (r2 * Ji2 + x2 * Jr2) + (r3 * Ji3 + x3 * Jr3)
    ar = ar + (r4 * Jr4 - x4 * Ji4) + (r5 * Jr5 - x5 * Ji5) + (r6 * Jr6 - x6 * Ji6)
    ai = ai + (r4 * Ji4 + x4 * Jr4) + (r5 * Ji5 + x5 * Jr5) + (r6 * Ji6 + x6 * Jr6)
    return ar, ai


def copy(ar: Any, ai: Any) -> Any:
    """No term more."""
    return ar, ai


def injected(Cr: Any, Ci: Any, size: Any) -> Any:
    """Current of a current-controlled converter on the base of the grid."""
    return size * Cr, size * Ci


@stage("I0r", "I0i", "hr", "hi")
def norton(Cr: Any, Ci: Any, Xpp: Any, size: Any, V0r: Any, V0i: Any, r: Any, x: Any) -> Any:
    """Current of the converter without the machine and h = -g y, with r + jx its own impedance: (G2), (G3)."""
    b = size / Xpp  # y = -j b
    dr, di = 1.0 + x * b, -r * b
    q = dr * dr + di * di
    gr, gi = dr / q, -di / q
    tr, ti = size * Cr - b * V0i, size * Ci + b * V0r
    return gr * tr - gi * ti, gr * ti + gi * tr, -b * gi, b * gr


@stage("Er", "Ei", "R", "X", "kr", "ki")
def seen_by_machine(
    I0r: Any, I0i: Any, hr: Any, hi: Any, V0r: Any, V0i: Any,
    r: Any, x: Any, r_mw: Any, x_mw: Any, r_wm: Any, x_wm: Any,
) -> Any:  # fmt: skip
    """Voltage source and impedance that the machine sees, with r + jx its own impedance, and k: (G3), (G4)."""
    kr, ki = hr * r_wm - hi * x_wm, hr * x_wm + hi * r_wm
    Er, Ei = V0r + r_mw * I0r - x_mw * I0i, V0i + r_mw * I0i + x_mw * I0r
    return Er, Ei, r + r_mw * kr - x_mw * ki, x + r_mw * ki + x_mw * kr, kr, ki


@stage("Ir", "Ii", "Id", "Iq")
def machine_current(
    Er: Any, Ei: Any, R: Any, X: Any, delta: Any, Eq1: Any, Ed1: Any, Ra: Any, Xd1: Any, Xq1: Any, size: Any
) -> Any:
    """Current of the machine on the base of the grid and, in the rotor's frame, on its own: (G5)."""
    s, c = sincos(delta)
    vd, vq = Ed1 - (Er * s - Ei * c), Eq1 - (Er * c + Ei * s)
    Rt, Xd, Xq = Ra / size + R, Xd1 / size + X, Xq1 / size + X
    det = Rt * Rt + Xd * Xq
    Id, Iq = (Rt * vd + Xq * vq) / det, (Rt * vq - Xd * vd) / det
    return Id * s + Iq * c, Iq * s - Id * c, Id / size, Iq / size


@stage("Ir", "Ii")
def converter_current(I0r: Any, I0i: Any, kr: Any, ki: Any, Imr: Any, Imi: Any) -> Any:
    """Current of the converter beside the machine, (G3)."""
    return I0r + kr * Imr - ki * Imi, I0i + kr * Imi + ki * Imr


def magnitude(Vr: Any, Vi: Any) -> Any:
    """Magnitude of an observed voltage."""
    return (np.sqrt(Vr * Vr + Vi * Vi),)


def arriving_power(Vr: Any, Vi: Any, Ir: Any, Ii: Any) -> Any:
    """Active power that a current brings to an observed bus."""
    return (Vr * Ir + Vi * Ii,)
