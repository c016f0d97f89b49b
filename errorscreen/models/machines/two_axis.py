r"""Synchronous machine, fourth-order (two-axis) model with constant field voltage and mechanical power.

Sauer, Pai, Chow, *Power System Dynamics and Stability*, 2nd ed. 2017, section 6.4 (two-axis model); Milano, *Power
System Modelling and Scripting*, 2010, section 15.1.9. Network frame to rotor frame: the q axis leads the d axis, and
the rotor angle δ is that of the q axis.

.. math::

    \dot\delta &= 2\pi f_0 (\omega - 1)                                     & (M1)\\
    T_j\,\dot\omega &= P_m - P_e - D(\omega - 1)                            & (M2)\\
    T'_{d0}\,\dot E'_q &= E_{fd} - E'_q - (X_d - X'_d) I_d                   & (M3)\\
    T'_{q0}\,\dot E'_d &= -E'_d + (X_q - X'_q) I_q                           & (M4)\\
    V_d &= V_r\sin\delta - V_i\cos\delta,\quad V_q = V_r\cos\delta + V_i\sin\delta & (M5)\\
    E'_d - V_d &= R_a I_d - X'_q I_q,\quad E'_q - V_q = R_a I_q + X'_d I_d    & (M6)\\
    P_e &= E'_d I_d + E'_q I_q + (X'_q - X'_d) I_d I_q                       & (M7)\\
    P &= V_d I_d + V_q I_q,\quad Q = V_q I_d - V_d I_q                       & (M8)

The speed in (M2) and (M7) is taken as 1 when power and torque are converted, as both references do.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.engine.stages import stage
from errorscreen.engine.vmath import sincos
from errorscreen.models.device import Constant, Device, GridInterface, Values, relative_parameters
from errorscreen.models.grid_terminal import terminal_power
from errorscreen.parameters import Parameter, ParameterSpace


@stage("Vd", "Vq", "Id", "Iq", "P", "Q", "V")
def stator(delta: Any, Eq1: Any, Ed1: Any, Vr: Any, Vi: Any, Ra: Any, Xd1: Any, Xq1: Any) -> Any:
    """Terminal voltage in the rotor frame, stator currents in closed form, power: (M5), (M6), (M8)."""
    s, c = sincos(delta)
    Vd = Vr * s - Vi * c  # (M5)
    Vq = Vr * c + Vi * s
    det = Ra * Ra + Xd1 * Xq1
    Id = (Ra * (Ed1 - Vd) + Xq1 * (Eq1 - Vq)) / det  # (M6), solved
    Iq = (Ra * (Eq1 - Vq) - Xd1 * (Ed1 - Vd)) / det
    P = Vd * Id + Vq * Iq  # (M8)
    Q = Vq * Id - Vd * Iq
    return Vd, Vq, Id, Iq, P, Q, np.sqrt(Vr * Vr + Vi * Vi)


@stage("Efd", "Pm")
def inputs(Efd0: Any, Pm0: Any) -> Any:
    """Field voltage and mechanical power without any controller; effects act on them."""
    return Efd0, Pm0


@stage("d_delta", "d_omega", "d_Eq1", "d_Ed1")
def rotor(
    omega: Any, Eq1: Any, Ed1: Any, Id: Any, Iq: Any, Efd: Any, Pm: Any, f0: Any,
    Xd: Any, Xd1: Any, Xq: Any, Xq1: Any, Td10: Any, Tq10: Any, Tj: Any, D: Any,
) -> Any:  # fmt: skip
    """Swing equation and field dynamics: (M1) to (M4), (M7)."""
    d_delta = 6.283185307179586 * f0 * (omega - 1.0)  # (M1)
    Pe = Ed1 * Id + Eq1 * Iq + (Xq1 - Xd1) * Id * Iq  # (M7)
    d_omega = (Pm - Pe - D * (omega - 1.0)) / Tj  # (M2)
    d_Eq1 = (Efd - Eq1 - (Xd - Xd1) * Id) / Td10  # (M3)
    d_Ed1 = (-Ed1 + (Xq - Xq1) * Iq) / Tq10  # (M4)
    return d_delta, d_omega, d_Eq1, d_Ed1


def initialise(v: Values) -> tuple[Values, Values, NDArray[np.bool_]]:
    """Equilibrium at the operating point V, P, Q, angle.

    The q axis lies along :math:`E_Q = V + (R_a + jX_q) I` with :math:`I = ((P + jQ)/V)^*` (Sauer, Pai, Chow, (7.46));
    all other quantities follow from (M3) to (M7) with zero derivatives.
    """
    terminal = v["V"] * np.exp(1j * v["angle"])
    current = np.conj((v["P"] + 1j * v["Q"]) / terminal)
    delta = np.angle(terminal + (v["Ra"] + 1j * v["Xq"]) * current)
    rotated = current * np.exp(-1j * (delta - np.pi / 2))
    Id, Iq = rotated.real, rotated.imag
    voltage = terminal * np.exp(-1j * (delta - np.pi / 2))
    Ed1 = voltage.real + v["Ra"] * Id - v["Xq1"] * Iq  # (M6)
    Eq1 = voltage.imag + v["Ra"] * Iq + v["Xd1"] * Id
    Pm0 = Ed1 * Id + Eq1 * Iq + (v["Xq1"] - v["Xd1"]) * Id * Iq  # (M2), (M7)
    Efd0 = Eq1 + (v["Xd"] - v["Xd1"]) * Id  # (M3)
    states = {"delta": delta, "omega": np.ones_like(delta), "Eq1": Eq1, "Ed1": Ed1}
    return states, {"Efd0": Efd0, "Pm0": Pm0}, Efd0 > 0


SYNCHRONOUS_MACHINE = Device(
    name="synchronous_machine",
    title="Synchronous machine, two-axis (4th-order) model",
    candidates=relative_parameters(
        "synchronous_machine",
        """
        Xd   | X_d    | pu | 1.60 | > 0  | d-axis synchronous reactance
        Xd1  | X'_d   | pu | 0.32 | > 0  | d-axis transient reactance
        Xq   | X_q    | pu | 1.55 | > 0  | q-axis synchronous reactance
        Xq1  | X'_q   | pu | 0.50 | > 0  | q-axis transient reactance
        Td10 | T'_d0  | s  | 6.0  | > 0  | d-axis open-circuit transient time constant
        Tq10 | T'_q0  | s  | 0.8  | > 0  | q-axis open-circuit transient time constant
        Tj   | T_j    | s  | 9.0  | > 0  | mechanical starting time, twice the inertia constant H
        D    | D      | pu | 2.0  | >= 0 | damping coefficient, power per speed deviation
        """,
    ),
    constants=(
        Constant("Ra", 0.002, "pu", "armature resistance"),
        Constant("f0", 60.0, "Hz", "nominal frequency"),
    ),
    further=ParameterSpace(
        [
            Parameter(
                "Ra",
                0.002,
                0.0,
                0.01,
                "pu",
                "synchronous_machine",
                "R_a",
                "armature resistance",
                0.01,
                ">= 0",
            )
        ]
    ),
    states=("delta", "omega", "Eq1", "Ed1"),
    setpoints=("Efd0", "Pm0"),
    stages=(stator, inputs, rotor),
    initialise=initialise,
    ports={"Efd": "field voltage in pu", "Pm": "mechanical power in pu"},
    needs_angle=True,
    source="Sauer, Pai, Chow, Power System Dynamics and Stability, 2nd ed. 2017, section 6.4",
    grid=GridInterface("rotor", source=(), terminal=(terminal_power,)),
)
