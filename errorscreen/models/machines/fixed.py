r"""Machines of the grid with fixed parameters: two-axis model with one transient reactance.

With :math:`X'_q := X'_d` the stator is a constant admittance :math:`1/(jX'_d)`, which belongs into the reduced grid,
beside the current :math:`J`, so that many machines cost no system of equations in a step (Sauer, Pai, Chow, *Power
System Dynamics and Stability*, 2nd ed. 2017, sections 6.4 and 7.9.2: constant-admittance form of the two-axis model).
Field voltage and mechanical power are constant. In per unit of the grid's base:

.. math::

    E &= (E'_d + jE'_q)\,e^{j(\delta - \pi/2)},\quad J = E / (jX'_d)                          & (A1)\\
    I &= (E - V) / (jX'_d),\quad I_d + jI_q = I e^{-j(\delta - \pi/2)},\quad
    P_e = \mathrm{Re}(E I^*)                                                                  & (A2)\\
    \dot\delta &= 2\pi f_0 (\omega - 1),\quad T_j\,\dot\omega = P_m - P_e - D(\omega - 1)     & (A3)\\
    T'_{d0}\,\dot E'_q &= E_{fd} - E'_q - (X_d - X'_d) I_d,\quad
    T'_{q0}\,\dot E'_d = -E'_d + (X_q - X'_d) I_q                                             & (A4)

With :math:`X_d = X_q = X'_d` this is the classical machine: E'_d is 0 and E'_q stays as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import sincos
from errorscreen.exceptions import check_real


@dataclass(frozen=True)
class FixedMachine:
    """Data of a machine in pu of the grid's base.

    Parameters
    ----------
    bus : int
    H : float
        Inertia constant in s.
    Xd1 : float
        Transient reactance of both axes.
    Xd, Xq : float, optional
        Synchronous reactances; that of `Xd1` where not given, which makes the machine a classical one.
    Td10, Tq10 : float
        Open-circuit transient time constants in s.
    D : float
        Damping, power per speed deviation.

    Examples
    --------
    >>> FixedMachine(39, H=500.0, Xd1=0.006).Xd
    0.006
    """

    bus: int
    H: float
    Xd1: float
    Xd: float = 0.0
    Xq: float = 0.0
    Td10: float = 6.0
    Tq10: float = 1.0
    D: float = 0.0

    def __post_init__(self) -> None:
        where = f"machine at bus {self.bus}"
        for name in ("H", "Xd1", "Td10", "Tq10"):
            check_real(getattr(self, name), name, low=0, above=True, where=where)
        check_real(self.D, "D", where=where)
        for name in ("Xd", "Xq"):
            value = check_real(getattr(self, name), name, low=0, where=where)
            object.__setattr__(self, name, value or float(self.Xd1))

    @property
    def admittance(self) -> complex:
        """Constant admittance that belongs into the reduced grid, (A1)."""
        return 1 / (1j * self.Xd1)

    def initialise(self, voltage: complex, power: complex) -> dict[str, float]:
        """States and constants at rest, by name, from terminal voltage and power in pu of the grid's base.

        The q axis lies along :math:`V + jX_q I`; everything else follows from (A2) to (A4) with zero derivatives.
        """
        current = (power / voltage).conjugate()
        delta = float(np.angle(voltage + 1j * self.Xq * current))
        turn = np.exp(-1j * (delta - np.pi / 2))
        inner, own = (voltage + 1j * self.Xd1 * current) * turn, current * turn
        return {
            "delta": delta, "omega": 1.0, "Eq1": inner.imag, "Ed1": inner.real,
            "Efd": inner.imag + (self.Xd - self.Xd1) * own.real, "Pm": (inner * own.conjugate()).real,
            "Xd": self.Xd, "Xd1": self.Xd1, "Xq": self.Xq, "D": self.D,
            # reciprocals: many machines are integrated, and a division takes as long as many products
            "Bd1": 1 / self.Xd1, "per_Td10": 1 / self.Td10, "per_Tq10": 1 / self.Tq10, "per_Tj": 1 / (2 * self.H),
        }  # fmt: skip


STATES = ("delta", "omega", "Eq1", "Ed1")


@stage("sin", "cos", "Er", "Ei", "Jr", "Ji")
def internal_source(delta: Any, Eq1: Any, Ed1: Any, Bd1: Any) -> Any:
    """Direction of the rotor, electromotive force and the current beside the admittance, (A1)."""
    s, c = sincos(delta)
    Er, Ei = Ed1 * s + Eq1 * c, Eq1 * s - Ed1 * c
    return s, c, Er, Ei, Bd1 * Ei, -Bd1 * Er


@stage("d_delta", "d_omega", "d_Eq1", "d_Ed1")
def rotor(
    sin: Any, cos: Any, Er: Any, Ei: Any, Vr: Any, Vi: Any, omega: Any, Eq1: Any, Ed1: Any, f0: Any,
    Xd: Any, Xd1: Any, Xq: Any, Bd1: Any, per_Td10: Any, per_Tq10: Any, per_Tj: Any, D: Any, Efd: Any, Pm: Any,
) -> Any:  # fmt: skip
    """Swing equation and field dynamics, (A2) to (A4)."""
    Ir, Ii = Bd1 * (Ei - Vi), Bd1 * (Vr - Er)
    Id, Iq = Ir * sin - Ii * cos, Ir * cos + Ii * sin
    Pe = Er * Ir + Ei * Ii
    return (
        6.283185307179586 * f0 * (omega - 1.0),
        per_Tj * (Pm - Pe - D * (omega - 1.0)),
        per_Td10 * (Efd - Eq1 - (Xd - Xd1) * Id),
        per_Tq10 * (-Ed1 + (Xq - Xd1) * Iq),
    )
