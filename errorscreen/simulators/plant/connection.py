r"""Series connection between the recorded point and the terminal of a unit: transformer, collector, line.

All in per unit of the unit's own base; several equal units count as one on the sum of their bases. With the voltage
:math:`V` recorded at the point, the ratio t of an ideal transformer and the current I out of the unit:

.. math::

    V' &= V/t,\quad V_t = V' + (R + jX)\,I                                                     & (C1)\\
    P + jQ &= V' I^* e^{-j\psi} - (G - jB)\,|V|^2 - (P_{aux} + jQ_{aux})                           & (C2)\\
    V' I^* &= P_t + jQ_t - (R + jX)\,|I|^2                                                        & (C3)

with a shunt G + jB and an auxiliary load of constant power at the point. :math:`\psi` is zero but for shunts between
terminal and point, which draw a current through a part of the impedance (`errorscreen.simulators.plant.from_raw`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba.extending import register_jitable

from errorscreen.engine.stages import Equations, stage
from errorscreen.exceptions import InputError, check_real
from errorscreen.models.device import Values


@dataclass(frozen=True)
class Connection:
    """Connection of a unit to the recorded point; see the equations of this module.

    Parameters
    ----------
    resistance, reactance : float
        R and X in series, in pu.
    tap : float, default 1
        Ratio of the transformer, in pu of the rated one: above 1 the recorded voltage is higher than without.
    shunt : float, default 0
        Susceptance B at the recorded point, in pu; a capacitor is positive.
    auxiliary_p, auxiliary_q : float, default 0
        Load that is supplied before the recorded point, in pu.
    conductance : float, default 0
        Conductance G at the recorded point, in pu.
    turn : float, default 0
        Angle psi in rad.

    Examples
    --------
    >>> values = {"V": np.array([1.0]), "P": np.array([0.8]), "Q": np.array([0.1])}
    >>> found = Connection(0.0, 0.1).terminal(values)
    >>> [round(float(found[name][0]), 4) for name in ("V", "P", "Q")]
    [1.0132, 0.8, 0.165]
    """

    resistance: float = 0.0
    reactance: float = 0.0
    tap: float = 1.0
    shunt: float = 0.0
    auxiliary_p: float = 0.0
    auxiliary_q: float = 0.0
    conductance: float = 0.0
    turn: float = 0.0

    def __post_init__(self) -> None:
        where = "connection of the plant"
        for name in ("resistance", "reactance"):
            check_real(getattr(self, name), name, low=0.0, where=where)
        check_real(self.tap, "tap", low=0.0, above=True, where=where)
        for name in ("shunt", "auxiliary_p", "auxiliary_q", "conductance", "turn"):
            check_real(getattr(self, name), name, where=where)
        if abs(self.impedance) > 1.0:
            raise InputError(
                f"the impedance is {self.impedance:.4g} pu",
                where=where,
                allowed="a magnitude of at most 1 pu of the unit's base",
                remedy="Convert percent or ohms, and the base of the system, to the base of the unit",
            )

    @property
    def impedance(self) -> complex:
        """R + jX in pu."""
        return complex(self.resistance, self.reactance)

    @property
    def constants(self) -> dict[str, float]:
        """Constants of the model by name."""
        return {
            "R_grid": self.resistance,
            "X_grid": self.reactance,
            "size": 1.0,
            "tap": self.tap,
            "B_point": self.shunt,
            "P_aux": self.auxiliary_p,
            "Q_aux": self.auxiliary_q,
            "G_point": self.conductance,
            "turn_c": math.cos(self.turn),
            "turn_s": math.sin(self.turn),
        }

    def terminal(self, values: Values) -> Values:
        """Operating point V, P, Q, angle of the terminal from that of the recorded point, (C1), (C2)."""
        P = values["P"] + self.auxiliary_p + self.conductance * values["V"] ** 2
        Q = values["Q"] + self.auxiliary_q - self.shunt * values["V"] ** 2
        inner = values["V"] / self.tap
        current = np.conj((P + 1j * Q) * np.exp(1j * self.turn) / inner)
        voltage = inner + self.impedance * current
        power = voltage * np.conj(current)
        return {"V": np.abs(voltage), "angle": np.angle(voltage), "P": power.real, "Q": power.imag}


@register_jitable
def at_point(
    P: Any, Q: Any, Er: Any, Ei: Any, tap: Any, B_point: Any, P_aux: Any, Q_aux: Any, G_point: Any, turn_c: Any,
    turn_s: Any,
) -> Any:  # fmt: skip
    """Power at the recorded point from that of V' and I, (C2)."""
    square = Er * Er + Ei * Ei
    turned_P, turned_Q = P * turn_c + Q * turn_s, Q * turn_c - P * turn_s
    return turned_P - P_aux - G_point * tap * tap * square, turned_Q + B_point * tap * tap * square - Q_aux


@stage("P_point", "Q_point")
def point_power(
    Er: Any, Ei: Any, Ir: Any, Ii: Any, tap: Any, B_point: Any, P_aux: Any, Q_aux: Any, G_point: Any, turn_c: Any,
    turn_s: Any,
) -> Any:  # fmt: skip
    """Power at the recorded point from the current, (C2)."""
    P, Q = Er * Ir + Ei * Ii, Ei * Ir - Er * Ii
    return at_point(P, Q, Er, Ei, tap, B_point, P_aux, Q_aux, G_point, turn_c, turn_s)


@stage("P_point", "Q_point")
def point_power_of_terminal(
    P: Any, Q: Any, Er: Any, Ei: Any, Ir: Any, Ii: Any, R_grid: Any, X_grid: Any, tap: Any, B_point: Any, P_aux: Any,
    Q_aux: Any, G_point: Any, turn_c: Any, turn_s: Any,
) -> Any:  # fmt: skip
    """Power at the recorded point from that at the terminal, (C2), (C3): the same bits where nothing is between."""
    square = Ir * Ir + Ii * Ii
    P, Q = P - R_grid * square, Q - X_grid * square
    return at_point(P, Q, Er, Ei, tap, B_point, P_aux, Q_aux, G_point, turn_c, turn_s)


def power_at_point(kind: str) -> Equations:
    """Stage with the power at the recorded point, for a kind of `errorscreen.models.device.GridInterface`."""
    return point_power_of_terminal if kind == "solved" else point_power
