r"""Alternator with diode rectifier, the exciter of EXAC1, ESAC1A, EXAC2, ESAC6A, AC8B and REXSYS.

.. math::

    V_{FE} &= K_E V_E + S_E(V_E)V_E + K_D I_{fd},\quad S_E(u)\,u = B([u - A]^+)^2\ \text{through}\ E_1, E_2   & (X1)\\
    T_E\,\dot V_E &= V_R - V_{FE},\quad V_E \ge 0\ \text{(non-windup)}                                    & (X2)\\
    E_{fd} &= F_{EX}(I_N)\,V_E,\quad I_N = K_C I_{fd}/V_E                                              & (X3)

:math:`V_{FE}` is the field current of the exciter. At rest (X3) is solved for :math:`V_E` in each mode of the
rectifier:

.. math::

    V_E = \begin{cases}
        E_{fd} + 0.577\,K_C I_{fd}                          & I_N \le 0.433\\
        \sqrt{(E_{fd}^2 + (K_C I_{fd})^2)/0.75}             & 0.433 < I_N < 0.75\\
        E_{fd}/1.732 + K_C I_{fd}                           & 0.75 \le I_N \le 1
    \end{cases}                                                                                       \qquad (X4)

The published characteristic has a gap of 2e-4 where the first mode ends; a unit that rests in it keeps
:math:`I_N = 0.433`.

(IEEE Std 421.5-2016, types AC and annexes C and D.)
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import clip, hold_at_limits, select
from errorscreen.models.blocks import longer, quadratic_constants, quadratic_saturation, rate, rectifier
from errorscreen.models.part import Limit, Values

#: upper limit of the voltage of an exciter that has none, in pu
UNLIMITED = 1e6


@register_jitable
def field_voltage(VE: Any, If: Any, KC: Any) -> Any:
    """Voltage behind the rectifier, (X3).

    Examples
    --------
    >>> round(float(field_voltage(3.0, 2.0, 0.2)), 4), float(field_voltage(0.0, 2.0, 0.2))
    (2.7692, 0.0)
    """
    return rectifier(KC * If / select(VE < 1e-6, 1e-6, VE)) * VE


@register_jitable
def exciter_slope(VE: Any, VR: Any, VFE: Any, TE: Any, lower: Any, upper: Any, shortest: Any) -> Any:
    """Derivative of the voltage of an exciter, (X2), whose state follows a limit that moves across it.

    Examples
    --------
    >>> [float(exciter_slope(VE, 3.0, 2.0, 0.5, 0.0, 2.0, 0.1)) for VE in (1.0, 2.0, 2.5)]
    [2.0, 0.0, -5.0]
    """
    slope = hold_at_limits(VE, (VR - VFE) / longer(TE, shortest), lower, upper)
    return slope - (VE - clip(VE, lower, upper)) / shortest


@stage("VFE", "Efd")
def alternator(VE: Any, If: Any, lowE: Any, KC: Any, KD: Any, KE: Any, satA: Any, satB: Any) -> Any:
    """Field current and field voltage, (X1) and (X3)."""
    limited = clip(VE, lowE, UNLIMITED)
    VFE = KE * limited + quadratic_saturation(limited, satA, satB) + KD * If
    return VFE, field_voltage(limited, If, KC)


@stage("d_VE")
def excited(VE: Any, VR: Any, VFE: Any, lowE: Any, TE: Any, shortest: Any) -> Any:
    """Voltage of the exciter, (X2)."""
    return (exciter_slope(VE, VR, VFE, TE, lowE, UNLIMITED, shortest),)


@stage("VF", "d_xF")
def rate_feedback(xF: Any, VFE: Any, KF: Any, TF: Any, shortest: Any) -> Any:
    """Stabilising feedback of the field current, s KF / (1 + s TF)."""
    VF, d_xF = rate(xF, VFE, KF, TF, shortest)
    return VF, d_xF


class AtRest(NamedTuple):
    """Alternator at the start: voltage, field current, saturation and lower limit."""

    VE: NDArray[np.float64]
    VFE: NDArray[np.float64]
    satA: NDArray[np.float64]
    satB: NDArray[np.float64]
    lowE: NDArray[np.float64]

    @property
    def setpoints(self) -> Values:
        """Constants that the stages of this file read."""
        return {"lowE": self.lowE, "satA": self.satA, "satB": self.satB}

    @property
    def limit(self) -> Limit:
        """Voltage of the exciter, which a rectifier cannot make negative."""
        return Limit("voltage of the exciter", self.VE, 0.0, UNLIMITED, ("0", "infinity"))


def before_rectifier(Efd: Any, If: Any, KC: Any) -> NDArray[np.float64]:
    """Voltage that a rectifier needs for a field voltage, (X4).

    Examples
    --------
    >>> VE = before_rectifier(np.array([2.0, 2.0, 2.0, 0.0]), np.array([2.0, 2.0, 2.0, 2.0]), [0.2, 1.0, 3.0, 0.5])
    >>> field_voltage(VE, 2.0, np.array([0.2, 1.0, 3.0, 0.5])).round(12).tolist()
    [2.0, 2.0, 2.0, 0.0]
    """
    Efd, current = np.asarray(Efd, dtype=float), np.maximum(np.asarray(KC) * If, 0.0)
    first = Efd + 0.577 * current
    second = np.sqrt((Efd * Efd + current * current) / 0.75)
    third = Efd / 1.732 + current
    inner = np.where(current < 0.75 * second, np.minimum(second, current / 0.433), third)
    return np.where(current <= 0.433 * first, first, inner)


def at_rest(v: Values) -> AtRest:
    """Equilibrium of the alternator at the field voltage and field current of the start."""
    satA, satB = quadratic_constants(v["E1"], v["S1"], v["E2"], v["S2"])
    VE = before_rectifier(v["Efd0"], v["If"], v["KC"])
    VFE = v["KE"] * VE + quadratic_saturation(VE, satA, satB) + v["KD"] * v["If"]
    return AtRest(VE, VFE, satA, satB, np.minimum(VE, 0.0))
