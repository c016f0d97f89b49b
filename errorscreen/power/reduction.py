r"""A grid reduced to the terminals of its dynamic units.

With loads as constant impedances, and the constant admittances of units connected, the grid is linear. In one state of
the grid, currents :math:`I_t` injected at the terminals give

.. math::

    V_t = Z_{tt} I_t,\quad V_o = Z_{ot} I_t,\quad I_f = K_{ft} I_t                                    & (R1)

for the terminals, observed buses and observed branches. :math:`Z` has rows and columns of the inverse admittance
matrix; those of a bus with a bolted fault are zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import zgecon, zgetrf, zgetrs

from errorscreen.exceptions import InputError
from errorscreen.power.elements import Branch
from errorscreen.power.network import Network, listed

#: largest condition number of all steps of an update together; rounding errors grow by it
_ILL_CONDITIONED = 1e9


@dataclass(frozen=True)
class ReducedNetwork:
    """Linear maps from currents (..., T) injected at T terminals to voltages and flows.

    `impedance` (T, T) is :math:`Z_{tt}` of (R1), `transfer` (O, T) gives the observed voltages, `flow_currents` (F, T)
    and `flow_voltages` (F, T) the current that arrives over each of `flows`, and the voltage there. For several states
    of the grid each has one more axis, the first.
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
        voltages, arriving = self.flow_voltages.swapaxes(-1, -2), self.flow_currents.swapaxes(-1, -2)
        return (currents @ voltages) * (currents @ arriving).conj()


class Reducer:
    """Eliminates the same buses in many states of one grid.

    States differ little: a fault, a branch or a load changes a few entries D of the admittance matrix, at the buses s.
    With the inverse Z of the matrix before, the voltages for unit currents at the terminals are

    .. math:: V' = V - Z_{:s} (1 + D Z_{ss})^{-1} D V_s                                                  & (R2)

    (Woodbury's identity; Hager, *Updating the Inverse of a Matrix*, SIAM Review, 1989), and likewise for a bolted
    fault, whose voltage is zero. A state is reduced anew where a quarter of the buses changes, or where rounding errors
    would be large.

    `network` is close to all states. `load_voltages` (n_buses,) of the load flow before the disturbance fix the
    impedances of the loads. The flow ``(25, 2)`` is the power that arrives at bus 2 over all branches from bus 25.
    `admittances` are constant internal admittances of units in pu, for example :math:`1/(R_a + jX'_d)` of a classical
    machine, whose injected current is then its Norton current.
    """

    def __init__(
        self,
        network: Network,
        terminals: Iterable[int],
        *,
        load_voltages: ArrayLike,
        observed: Iterable[int] = (),
        flows: Iterable[tuple[int, int]] = (),
        admittances: Mapping[int, complex] | None = None,
    ) -> None:
        self.network = network
        self.terminals, self.observed = tuple(listed(terminals)), tuple(listed(observed))
        self.flows = tuple((a, b) for a, b in flows)
        self._load_voltages = network.voltages(load_voltages, "load_voltages")
        self._units = np.zeros(len(network.buses), dtype=complex)
        for bus, y in (admittances or {}).items():
            self._units[network.index(bus, where="admittances")] += y
        self._at = network.indices(self.terminals)
        self._seen = network.indices(self.observed)
        ends = [[network.index(bus, where="flows") for bus in flow] for flow in self.flows]
        self._sending, self._receiving = np.array(ends, dtype=np.int64).reshape(-1, 2).T
        for sending, receiving in self.flows:
            if not network.branches_between(sending, receiving):
                raise InputError(f"no branch connects the buses {sending} and {receiving}", where="flows")

    def __call__(self, networks: Sequence[Network]) -> ReducedNetwork:
        """Reduce several states of the grid, the first axis, by (R2) where little differs; NaN where it is singular."""
        for network in networks:
            if network.buses != self.network.buses:
                raise InputError("a state of the grid has other buses than that before", where="Reducer")
        before, Z, _ = self._before
        V = np.zeros((len(networks), len(before), len(self._at)), dtype=complex)
        alike: dict[tuple[bytes, frozenset[int]], list[int]] = {}
        D = self._admittances(networks) - before
        changed = np.asarray(D.any(axis=1) | D.any(axis=2))
        for k, network in enumerate(networks):
            alike.setdefault((changed[k].tobytes(), network.grounded), []).append(k)
        for rows in map(np.array, alike.values()):
            s, grounded = np.flatnonzero(changed[rows[0]]), self._grounded(networks[rows[0]])
            V[rows], well = self._updated(Z, D[np.ix_(rows, s, s)], s, grounded)
            for k in rows[~well]:
                try:
                    V[k] = self._solved(networks[k])
                except InputError:
                    V[k] = np.nan
        return self._reduced(networks, V)

    def anew(self, network: Network) -> ReducedNetwork:
        """Reduce one state of the grid without (R2); one without a unique solution raises `InputError`."""
        found = self._reduced([network], self._solved(network)[None])
        arrays = (found.impedance, found.transfer, found.flow_currents, found.flow_voltages)
        return ReducedNetwork(self.terminals, self.observed, self.flows, *(values[0] for values in arrays))

    def _grounded(self, network: Network) -> NDArray[np.int64]:
        return network.indices(sorted(network.grounded))

    def _solved(self, network: Network) -> NDArray[np.complex128]:
        """Voltages of all buses for 1 pu at each terminal, from the whole matrix."""
        Y = self._admittances([network])[0]
        V = np.zeros((len(Y), len(self._at)), dtype=complex)
        free = np.delete(np.arange(len(Y)), self._grounded(network))
        V[free] = _solve(Y[np.ix_(free, free)], (free[:, None] == self._at).astype(complex))
        return V

    @cached_property
    def _before(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128], float]:
        """Admittance matrix without bolted faults, its inverse, and its condition number."""
        Y = self._admittances([self.network])[0]
        try:
            Z = _solve(Y, np.eye(len(Y), dtype=complex))
        except InputError:  # a bolted fault may be all that fixes the voltages
            return Y, np.zeros_like(Y), np.inf
        return Y, Z, float(np.linalg.norm(Y, 1) * np.linalg.norm(Z, 1))

    def _admittances(self, networks: Sequence[Network]) -> NDArray[np.complex128]:
        """Admittance matrices with loads and units, shape (n_states, n_buses, n_buses)."""
        Y = np.array([network.admittance(self._load_voltages) for network in networks])
        own = np.arange(Y.shape[-1])
        Y[:, own, own] += self._units
        return Y

    def _updated(
        self,
        Z: NDArray[np.complex128],
        D: NDArray[np.complex128],
        s: NDArray[np.int64],
        grounded: NDArray[np.int64],
    ) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
        """Voltages of all buses in states with the same changed buses, by (R2), and which states are accurate."""
        n, T = len(D), len(self._at)
        if 4 * (len(s) + len(grounded)) > len(Z):
            return np.zeros((n, len(Z), T), dtype=complex), np.zeros(n, dtype=bool)
        V = np.repeat(Z[None, :, np.concatenate([self._at, grounded])], n, axis=0)
        well = np.ones(n, dtype=bool)
        if len(s):
            change = D @ Z[np.ix_(s, s)]
            left, V_s = np.eye(len(s)) + change, V[:, s]
            well &= self._accurate(left, 1.0 + np.linalg.norm(change, 1, axis=(-2, -1)))
            left[~well] = np.eye(len(s))
            V -= Z[:, s] @ np.linalg.solve(left, D @ V_s)
        if len(grounded):
            # the current of a bolted fault keeps its voltage at zero
            own, left = V[..., T:], V[:, grounded, T:]
            well &= self._accurate(left, np.linalg.norm(own, 1, axis=(-2, -1)))
            left[~well] = np.eye(len(grounded))
            V = V[..., :T] - own @ np.linalg.solve(left, V[:, grounded, :T])
            V[:, grounded] = 0
        return V, well

    def _accurate(self, left: NDArray[np.complex128], size: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether rounding errors stay small; `size` is that of terms that may cancel in matrices (n, k, k)."""
        with np.errstate(all="ignore"):
            inverse = np.linalg.cond(left, 1) / np.linalg.norm(left, 1, axis=(-2, -1))
            return np.asarray(self._before[2] * size * inverse < _ILL_CONDITIONED)

    def _reduced(self, networks: Sequence[Network], V: NDArray[np.complex128]) -> ReducedNetwork:
        """Reduced states from the voltages of all buses for 1 pu at each terminal."""
        arriving = np.zeros((len(networks), len(self.flows), len(self._at)), dtype=complex)
        for f, ends in enumerate(self.flows):
            seen: dict[tuple[Branch, ...], tuple[complex, complex]] = {}
            i, k = self._sending[f], self._receiving[f]
            values = []
            for network in networks:
                branches = network.branches_between(*ends)
                if branches not in seen:
                    seen[branches] = _into(branches, *ends)
                values.append(seen[branches])
            passing, own = np.array(values).T[..., None]
            arriving[:, f] = -(passing * V[:, i] + own * V[:, k])
        return ReducedNetwork(
            self.terminals,
            self.observed,
            self.flows,
            V[:, self._at],
            V[:, self._seen],
            arriving,
            V[:, self._receiving],
        )


def _into(branches: Iterable[Branch], sending: int, receiving: int) -> tuple[complex, complex]:
    """Admittances between two buses, and at the receiving one, of all branches between them."""
    passing, own = 0j, 0j
    for branch in branches:
        y11, y12, y21, y22 = branch.admittances
        forward = branch.to_bus == receiving
        passing, own = passing + (y21 if forward else y12), own + (y22 if forward else y11)
    return passing, own


def _solve(Y: NDArray[np.complex128], right: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Solve after scaling the rows; a matrix that is singular to working precision raises `InputError`."""
    if not len(Y):
        return right
    scale = np.abs(Y).max(axis=1, keepdims=True)
    lu, pivots, _ = zgetrf(Y / np.where(scale > 0, scale, 1.0))
    # estimate of the reciprocal condition number in the 1-norm, from the factors of the solution
    if not (np.all(scale > 0) and zgecon(lu, np.linalg.norm(Y / scale, 1))[0] > np.finfo(float).eps):
        raise InputError(
            "the admittance matrix is singular: nothing fixes the voltage of an eliminated part",
            where="reduction",
            remedy="Include loads, line charging or the admittances of the units",
        )
    return np.asarray(zgetrs(lu, pivots, right / scale)[0], dtype=complex)
