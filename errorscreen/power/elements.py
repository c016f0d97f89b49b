r"""Parts of a grid in per unit of one system base: buses, branches, loads, shunts, generators.

A branch is the usual :math:`\Pi` circuit with an ideal transformer of ratio :math:`a = t\,e^{j\varphi}` at its first
end (Zimmerman, Murillo-Sánchez, *MATPOWER User's Manual* 7.1, section 3.2; Milano, *Power System Modelling and
Scripting*, 2010, section 11.2):

.. math::

    \begin{pmatrix} I_1 \\ I_2 \end{pmatrix} =
    \begin{pmatrix} (y + jb/2)/t^2 & -y/a^* \\ -y/a & y + jb/2 \end{pmatrix}
    \begin{pmatrix} V_1 \\ V_2 \end{pmatrix},\quad y = \frac{1}{r + jx}                       & (N1)

where currents enter the branch.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from errorscreen.exceptions import InputError, check_real


@dataclass(frozen=True)
class Bus:
    """A node of the grid.

    Parameters
    ----------
    number : int
        Unique in its network.
    name : str
    kv : float
        Nominal voltage in kV, for information only.
    """

    number: int
    name: str = ""
    kv: float = 1.0


@dataclass(frozen=True)
class Branch:
    r"""A line, or a transformer with its ratio at the first end; see (N1).

    Parameters
    ----------
    from_bus, to_bus : int
    r, x, b : float
        Series resistance and reactance, total charging susceptance, in pu.
    tap : float
        Ratio t; the voltage behind the ideal transformer is :math:`V_1 / a`.
    shift : float
        Angle in rad by which the first end leads.
    circuit : str
        Distinguishes branches between the same buses.
    in_service : bool
        False: open at both ends.

    Examples
    --------
    >>> Branch(1, 2, r=0.0, x=0.1, tap=1.25).admittances[0]
    -6.4j
    """

    from_bus: int
    to_bus: int
    r: float
    x: float
    b: float = 0.0
    tap: float = 1.0
    shift: float = 0.0
    circuit: str = "1"
    in_service: bool = True

    def __post_init__(self) -> None:
        where = f"branch {self.label}"
        _check_numbers(self, ("r", "x", "b", "tap", "shift"), where)
        if self.r == 0 and self.x == 0:
            raise InputError(
                "r and x are both 0", where=where, remedy="Merge the two buses, or give x = 1e-4"
            )
        if self.tap <= 0:
            raise InputError(
                f"the ratio is {self.tap:g}", where=where, allowed="a positive number; 1 for a line"
            )
        if self.from_bus == self.to_bus:
            raise InputError("both ends are at the same bus", where=where)

    @property
    def ends(self) -> tuple[int, int]:
        """Both buses."""
        return self.from_bus, self.to_bus

    @property
    def label(self) -> str:
        """For messages, as in ``"2-25 (circuit 1)"``."""
        return f"{self.from_bus}-{self.to_bus} (circuit {self.circuit})"

    @cached_property
    def admittances(self) -> tuple[complex, complex, complex, complex]:
        """The matrix of (N1) row by row; zero for a branch out of service."""
        if not self.in_service:
            return 0j, 0j, 0j, 0j
        y = 1 / complex(self.r, self.x)
        own, ratio = y + 0.5j * self.b, cmath.rect(self.tap, self.shift)
        return own / self.tap**2, -y / ratio.conjugate(), -y / ratio, own


@dataclass(frozen=True)
class Load:
    """Power that is drawn at a bus.

    Parameters
    ----------
    bus : int
    p, q : float
        In pu, positive when consumed.
    """

    bus: int
    p: float
    q: float = 0.0

    def __post_init__(self) -> None:
        _check_numbers(self, ("p", "q"), f"load at bus {self.bus}")


@dataclass(frozen=True)
class Shunt:
    """Admittance from a bus to ground.

    Parameters
    ----------
    bus : int
    g, b : float
        In pu; b is positive for a capacitor.
    """

    bus: int
    g: float = 0.0
    b: float = 0.0

    def __post_init__(self) -> None:
        _check_numbers(self, ("g", "b"), f"shunt at bus {self.bus}")


@dataclass(frozen=True)
class Generator:
    """Source at a bus for the load flow.

    Parameters
    ----------
    bus : int
    p : float
        Active power in pu; not used at the slack bus.
    v : float, optional
        Voltage magnitude in pu that it holds; where not given it delivers `q` instead.
    q : float
        Reactive power in pu where `v` is not given.
    q_min, q_max : float
        Limits in pu, see `solve_load_flow`.
    name : str
    """

    bus: int
    p: float = 0.0
    v: float | None = None
    q: float = 0.0
    q_min: float = -np.inf
    q_max: float = np.inf
    name: str = ""

    def __post_init__(self) -> None:
        where = f"generator at bus {self.bus}"
        _check_numbers(self, ("p", "q"), where)
        if self.v is not None:
            check_real(self.v, "the voltage", low=0, above=True, where=where)
        if not self.q_min <= self.q_max:
            raise InputError(
                f"the reactive limits are {self.q_min} and {self.q_max}",
                where=where,
                allowed="q_min <= q_max",
            )


def _check_numbers(element: Any, names: tuple[str, ...], where: str) -> None:
    for name in names:
        check_real(getattr(element, name), name, where=where)
