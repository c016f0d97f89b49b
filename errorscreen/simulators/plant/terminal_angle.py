r"""Angle of the terminal voltage where neither it nor the frequency was recorded.

Let a reactance X lie between the recorded point and a source whose angle does not move, as in a strong grid. The
current I out of the plant gives the voltage E of that source, and the angle :math:`\theta` of the terminal against it:

.. math::

    E &= V - jX I,\quad I = \left(\frac{P + jQ}{V}\right)^*                                        & (A1)\\
    \theta &= \arg\big(V^2 - XQ + jXP\big) & (A2)\\
    |E| &= \frac{1}{V}\sqrt{(V^2 - XQ)^2 + (XP)^2}                                                  & (A3)

(A2) and (A3) follow from (A1) with V along the real axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from errorscreen.exceptions import InputError, check_real

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class AngleSource:
    """Source of the angle where neither it nor the frequency was recorded.

    Parameters
    ----------
    constant_frequency : bool
        The frequency keeps its value before the event.
    reactance : float
        X of (A1) in pu of the device's base; 0: none.
    """

    constant_frequency: bool = False
    reactance: float = 0.0

    def __post_init__(self) -> None:
        check_real(self.reactance, "angle_reactance", low=0.0, high=2.0, where="PlantSimulator")
        if self.constant_frequency and self.reactance:
            raise InputError(
                "constant_frequency and angle_reactance are both given",
                where="PlantSimulator",
                allowed="one of them: the angle rests, or moves with P and Q",
            )

    @property
    def given(self) -> bool:
        """Whether it gives any angle."""
        return self.constant_frequency or self.reactance > 0


#: nothing but the recording gives the angle
NO_ANGLE = AngleSource()


def angle_behind(V: _Array, P: _Array, Q: _Array, X: float) -> tuple[_Array, _Array]:
    """Angle in rad of the terminal against the source, (A2), and magnitude of the source in pu, (A3).

    Examples
    --------
    >>> angle, size = angle_behind(np.array([1.0]), np.array([0.8]), np.array([0.2]), 0.5)
    >>> angle.round(4), size.round(4)
    (array([0.4182]), array([0.9849]))
    """
    phasor = V * V - X * Q + 1j * X * P
    with np.errstate(divide="ignore", invalid="ignore"):  # a short circuit
        return np.unwrap(np.angle(phasor)), np.abs(phasor) / V


def noise_of_angle(at: tuple[float, float, float], noise: tuple[float, float, float], X: float) -> float:
    """Standard deviation of the angle in rad from those of V, P and Q: (A2), linear around their values `at` rest."""
    V, P, Q = at
    real, imag = V * V - X * Q, X * P
    slopes = np.array([-2 * V * imag, X * real, X * imag]) / (real * real + imag * imag)
    return float(np.linalg.norm(slopes * noise))
