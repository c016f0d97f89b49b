r"""Stator of a machine with subtransient flux linkages, and its swing equation; used by GENROU, GENROE, GENSAL, GENSAE.

The q axis leads the d axis and the rotor angle δ is that of the q axis, as in `errorscreen.models.machines.two_axis`.
:math:`\psi''_q` is counted positive like :math:`V_d`, and :math:`X''_d = X''_q = X''`:

.. math::

    V_d &= \psi''_q + X'' I_q - R_a I_d,\quad V_q = \psi''_d - X'' I_d - R_a I_q             & (R1)\\
    T_e &= \psi''_d I_q + \psi''_q I_d                                                   & (R2)\\
    2H\,\dot\omega &= (P_m - D(\omega - 1)) / \omega - T_e,\quad \dot\delta = 2\pi f_0(\omega - 1)  & (R3)

(PSS/E model library; Kundur, *Power System Stability and Control*, 1994, section 3.6; the speed is taken as 1 in (R1).)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import sincos
from errorscreen.models.blocks import quadratic_constants
from errorscreen.models.part import Values

#: quantities of a machine that other parts and effects may read
PORTS = (
    "delta", "omega", "Eq1", "psi2d", "psi2q", "Vd", "Vq", "Id", "Iq", "P", "Q", "V", "It", "Te", "If", "Efd0", "Pm0",
)  # fmt: skip


@stage("Vd", "Vq", "Id", "Iq", "P", "Q", "V", "It", "Te")
def stator(delta: Any, psi2d: Any, psi2q: Any, Vr: Any, Vi: Any, Ra: Any, Xpp: Any) -> Any:
    """Terminal voltage in the rotor frame, currents, power and torque: (R1), (R2)."""
    s, c = sincos(delta)
    Vd = Vr * s - Vi * c
    Vq = Vr * c + Vi * s
    det = Ra * Ra + Xpp * Xpp
    Id = (Ra * (psi2q - Vd) + Xpp * (psi2d - Vq)) / det  # (R1), solved
    Iq = (Ra * (psi2d - Vq) - Xpp * (psi2q - Vd)) / det
    P = Vd * Id + Vq * Iq
    Q = Vq * Id - Vd * Iq
    return (
        Vd,
        Vq,
        Id,
        Iq,
        P,
        Q,
        np.sqrt(Vr * Vr + Vi * Vi),
        np.sqrt(Id * Id + Iq * Iq),
        psi2d * Iq + psi2q * Id,
    )


@stage("d_delta", "d_omega")
def swing(omega: Any, Te: Any, Pm: Any, H: Any, D: Any, f0: Any) -> Any:
    """Swing equation, (R3)."""
    d_omega = ((Pm - D * (omega - 1.0)) / omega - Te) / (2.0 * H)
    return 6.283185307179586 * f0 * (omega - 1.0), d_omega


def machine_saturation(S10: Any, S12: Any) -> Any:
    """Constants A and B of the quadratic saturation through S(1.0) and S(1.2).

    S(1.0) = 0 means none, whatever S(1.2) is: so PSS/E runs a record with 0 and 1.

    Examples
    --------
    >>> [float(machine_saturation(0.0, S12)[1]) for S12 in (0.0, 1.0)]
    [0.0, 0.0]
    """
    return quadratic_constants(1.0, S10, 1.2, np.where(np.asarray(S10) > 0, S12, 0.0))


def phasors(v: Values) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Terminal voltage and current out of the machine at the start, in the frame of the grid."""
    voltage = v["V"] * np.exp(1j * v["angle"])
    return voltage, np.conj((v["P"] + 1j * v["Q"]) / voltage)


def in_rotor_frame(phasor: NDArray[np.complex128], delta: NDArray[np.float64]) -> Any:
    """Components along d and q."""
    turned = phasor * np.exp(-1j * (delta - np.pi / 2))
    return turned.real, turned.imag
