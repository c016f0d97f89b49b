r"""A grid seen from the terminals of its dynamic units: all other buses eliminated.

With the loads as constant impedances, and the admittance of every unit that has a constant one connected, the grid is
linear. Currents :math:`I_t` injected at the terminals then give, for one state of the grid,

.. math::

    V_t = Z_{tt} I_t,\quad V_o = Z_{ot} I_t,\quad I_f = K_{ft} I_t                                    & (R1)

for the terminals, observed buses and observed branches. :math:`Z` is the inverse of the admittance matrix restricted to
those rows and columns; a bus with a bolted fault is eliminated exactly, so its rows and columns are zero. The same
without currents is Kron's reduction (Sauer, Pai, Chow, *Power System Dynamics and Stability*, 2nd ed. 2017, section
7.6; Dörfler, Bullo, *Kron Reduction of Graphs with Applications to Electrical Networks*, IEEE Trans. CAS I, 2013),

.. math:: Y_{red} = Y_{kk} - Y_{kr} Y_{rr}^{-1} Y_{rk}                                                 & (R2)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import zgecon, zgetrf, zgetrs

from errorscreen.exceptions import InputError
from errorscreen.power.network import Network, listed


@dataclass(frozen=True)
class ReducedNetwork:
    """Linear maps from injected currents to what a simulation needs, for one state of the grid.

    Currents have the shape (..., T), for T terminals.

    Parameters
    ----------
    terminals : tuple of int
        Buses where currents are injected.
    observed : tuple of int
        Buses whose voltage is observed.
    flows : tuple of (int, int)
        Branches whose flow is observed, as (sending bus, receiving bus).
    impedance : ndarray of shape (T, T), complex
        :math:`Z_{tt}` of (R1).
    transfer : ndarray of shape (O, T), complex
        :math:`Z_{ot}`.
    flow_currents : ndarray of shape (F, T), complex
        :math:`K_{ft}`: current that arrives at the receiving bus.
    flow_voltages : ndarray of shape (F, T), complex
        Voltage of the receiving bus.
    """

    terminals: tuple[int, ...]
    observed: tuple[int, ...]
    flows: tuple[tuple[int, int], ...]
    impedance: NDArray[np.complex128]
    transfer: NDArray[np.complex128]
    flow_currents: NDArray[np.complex128]
    flow_voltages: NDArray[np.complex128]

    def arriving_power(self, currents: ArrayLike) -> NDArray[np.complex128]:
        """Power P + jQ that arrives at the receiving bus of each observed branch, shape (..., F)."""
        currents = np.asarray(currents)
        return (currents @ self.flow_voltages.T) * (currents @ self.flow_currents.T).conj()


def reduce_network(
    network: Network,
    terminals: Iterable[int],
    *,
    load_voltages: ArrayLike,
    observed: Iterable[int] = (),
    flows: Iterable[tuple[int, int]] = (),
    admittances: Mapping[int, complex] | None = None,
) -> ReducedNetwork:
    """Eliminate everything but the terminals of the units.

    Parameters
    ----------
    network : Network
        One state of the grid: before, during or after a disturbance.
    terminals : iterable of int
    load_voltages : array-like of shape (n_buses,)
        Voltages of the load flow **before** the disturbance, at which the loads draw their power; in every later state
        a load keeps its impedance.
    observed : iterable of int
        Buses whose voltage is wanted.
    flows : iterable of (int, int)
        Branches whose flow is wanted: ``(25, 2)`` is what arrives at bus 2 over the branch from bus 25, over all of
        them where there are several. One that is out of service carries nothing.
    admittances : mapping of int to complex, optional
        By bus, constant internal admittance of a unit in pu, for example :math:`1/(R_a + jX'_d)` of a classical
        machine; its injected current is then the Norton current :math:`E'/(R_a + jX'_d)`.

    Returns
    -------
    ReducedNetwork

    Raises
    ------
    InputError
        If a bus or branch is unknown, or the grid without sources has no unique solution.

    Examples
    --------
    A unit at bus 1 feeds a load of 1 pu over a reactance of 0.1 pu:

    >>> from errorscreen.power.elements import Branch, Bus, Load
    >>> grid = Network((Bus(1), Bus(2)), (Branch(1, 2, 0.0, 0.1),), slack=1, loads=(Load(2, 1.0),))
    >>> reduced = reduce_network(grid, [1], load_voltages=[1.0, 1.0], observed=[2], flows=[(1, 2)])
    >>> reduced.impedance.round(12), reduced.arriving_power([0.5]).round(12)
    (array([[1.+0.1j]]), array([0.25+0.j]))
    >>> during = reduce_network(grid.with_fault(2), [1], load_voltages=[1.0, 1.0], observed=[2])
    >>> during.impedance.round(12), during.transfer
    (array([[0.+0.1j]]), array([[0.+0.j]]))
    """
    terminals, observed, flows = (
        tuple(listed(terminals)),
        tuple(listed(observed)),
        tuple((a, b) for a, b in flows),
    )
    Y = network.admittance(network.voltages(load_voltages, "load_voltages"))
    for bus, y in (admittances or {}).items():
        i = network.index(bus, where="admittances")
        Y[i, i] += y
    t = network.indices(terminals)
    V = _unit_responses(Y, t, network.indices(sorted(network.grounded)))
    receiving = network.indices(to for _, to in flows)
    return ReducedNetwork(
        terminals,
        observed,
        flows,
        V[t],
        V[network.indices(observed)],
        np.array([_arriving(network, V, *ends) for ends in flows], dtype=complex).reshape(-1, len(t)),
        V[receiving],
    )


def kron_reduction(Y: ArrayLike, keep: Iterable[int]) -> NDArray[np.complex128]:
    r"""Admittance matrix of the kept nodes after all others, which carry no source, are eliminated, (R2).

    Parameters
    ----------
    Y : array-like of shape (n, n), complex
    keep : iterable of int
        Positions of the kept nodes, in the order wanted.

    Returns
    -------
    ndarray of shape (n_kept, n_kept), complex

    Raises
    ------
    InputError
        If a position is outside the matrix, or appears twice, or the eliminated part is singular.

    Examples
    --------
    Two reactances of 0.1 pu in series:

    >>> Y = [[-10j, 10j, 0], [10j, -20j, 10j], [0, 10j, -10j]]
    >>> kron_reduction(Y, [0, 2]).imag
    array([[-5.,  5.],
           [ 5., -5.]])
    """
    Y = np.asarray(Y, dtype=complex)
    k = np.array(list(keep), dtype=np.int64)
    if Y.ndim != 2 or Y.shape[0] != Y.shape[1]:
        raise InputError(f"the admittance matrix has shape {Y.shape}", allowed="a square matrix")
    if len(set(k.tolist())) != len(k) or not np.all((k >= 0) & (k < len(Y))):
        raise InputError(
            f"the kept positions are {k.tolist()}", allowed=f"different integers from 0 to {len(Y) - 1}"
        )
    r = np.setdiff1d(np.arange(len(Y)), k)
    return Y[np.ix_(k, k)] - Y[np.ix_(k, r)] @ _solve(Y[np.ix_(r, r)], Y[np.ix_(r, k)])


def _unit_responses(
    Y: NDArray[np.complex128], terminals: NDArray[np.int64], grounded: NDArray[np.int64]
) -> NDArray[np.complex128]:
    """Voltages of all buses for 1 pu at each terminal in turn, shape (n_buses, n_terminals)."""
    V = np.zeros((len(Y), len(terminals)), dtype=complex)
    free = np.delete(np.arange(len(Y)), grounded)
    units = (free[:, None] == terminals).astype(complex)
    V[free] = _solve(Y[np.ix_(free, free)], units)
    return V


def _arriving(
    network: Network, V: NDArray[np.complex128], sending: int, receiving: int
) -> NDArray[np.complex128]:
    """Current that all branches from one bus bring to another, as a row over the terminals."""
    i, k = network.index(sending, where="flows"), network.index(receiving, where="flows")
    found = [branch for branch in network.branches if set(branch.ends) == {sending, receiving}]
    if not found:
        raise InputError(f"no branch connects the buses {sending} and {receiving}", where="flows")
    current = np.zeros(V.shape[1], dtype=complex)
    for branch in found:
        y11, y12, y21, y22 = branch.admittances
        if branch.to_bus == receiving:
            current -= y21 * V[i] + y22 * V[k]
        else:
            current -= y12 * V[i] + y11 * V[k]
    return current


def _solve(Y: NDArray[np.complex128], right: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Solve, and refuse a matrix that is singular to working precision whatever the size of its rows."""
    if not len(Y):
        return right
    scale = np.abs(Y).max(axis=1, keepdims=True)
    lu, pivots, _ = zgetrf(Y / np.where(scale > 0, scale, 1.0))
    # an estimate of the reciprocal condition number in the 1-norm, from the factors that solve as well
    if not (np.all(scale > 0) and zgecon(lu, np.linalg.norm(Y / scale, 1))[0] > np.finfo(float).eps):
        raise InputError(
            "the admittance matrix is singular: nothing fixes the voltage of an eliminated part",
            where="reduction",
            remedy="Include loads, line charging or the admittances of the units",
        )
    return np.asarray(zgetrs(lu, pivots, right / scale)[0], dtype=complex)
