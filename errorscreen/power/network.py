r"""A grid in the steady state of its frequency, and its admittance matrix.

Everything is in per unit of one system base. Branches (N1, see `errorscreen.power.elements`) and shunts make up the
matrix. A load with constant impedance adds

.. math:: y_L = (P_L - jQ_L) / |V_0|^2                                                            & (N2)

with the voltage :math:`V_0` at which it draws :math:`P_L, Q_L`. Networks are immutable: a fault, a tripped line or a
changed load gives another network.
"""

from __future__ import annotations

import cmath
import copy
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from numbers import Complex, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.exceptions import InputError, check_real, unknown_name
from errorscreen.power.elements import Branch, Bus, Generator, Load, Shunt

#: share of a branch below which the admittance matrix is assembled anew, to avoid a difference of large numbers
_SMALL_SHARE = 1e-4


@dataclass(frozen=True)
class Network:
    """A connected grid.

    Parameters
    ----------
    buses : tuple of Bus
    branches : tuple of Branch
    slack : int
        Bus whose angle is the reference and whose generator balances the power.
    loads : tuple of Load
    shunts : tuple of Shunt
        Several loads or shunts at one bus add up.
    generators : tuple of Generator
        At most one at a bus.
    base_mva : float
    grounded : frozenset of int
        Buses with a bolted fault, whose voltage is exactly zero.

    Raises
    ------
    InputError
        If a bus is unknown or declared twice, a branch or generator appears twice, a number is not finite, or a bus is
        not connected with the slack bus.

    Examples
    --------
    >>> grid = Network((Bus(1), Bus(2)), (Branch(1, 2, 0.0, 0.1),), slack=1, loads=(Load(2, 0.5),))
    >>> grid.admittance()
    array([[0.-10.j, 0.+10.j],
           [0.+10.j, 0.-10.j]])
    """

    buses: tuple[Bus, ...]
    branches: tuple[Branch, ...]
    slack: int
    loads: tuple[Load, ...] = ()
    shunts: tuple[Shunt, ...] = ()
    generators: tuple[Generator, ...] = ()
    base_mva: float = 100.0
    grounded: frozenset[int] = frozenset()
    _index: Mapping[int, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("buses", "branches", "loads", "shunts", "generators"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        object.__setattr__(self, "grounded", frozenset(self.grounded))
        object.__setattr__(self, "_index", {bus.number: i for i, bus in enumerate(self.buses)})
        check_real(self.base_mva, "base_mva", low=0, above=True, where="network")
        _reject_twice((b.number for b in self.buses), "bus")
        _reject_twice((g.bus for g in self.generators), "a generator at bus", "Add them up")
        _reject_twice(
            (f"{min(ends)}-{max(ends)} (circuit {b.circuit})" for b in self.branches for ends in [b.ends]),
            "branch",
            "Give each its own circuit",
        )
        for kind, elements in (("load", self.loads), ("shunt", self.shunts), ("generator", self.generators)):
            for element in elements:
                self.index(element.bus, where=kind)
        for branch in self.branches:
            self.index(branch.from_bus, where=f"branch {branch.label}")
            self.index(branch.to_bus, where=f"branch {branch.label}")
        for number in (self.slack, *self.grounded):
            self.index(number, where="network")
        self._check_connected()

    def index(self, bus: int, *, where: str | None = None) -> int:
        """Position of a bus in `buses`; an unknown one raises `InputError`."""
        if not isinstance(bus, Real):
            raise InputError(f"the bus is {bus!r}", where=where, allowed="the number of a bus")
        if bus not in self._index:
            raise unknown_name(str(bus), map(str, self._index), kind="bus", where=where)
        return self._index[bus]

    def indices(self, buses: Iterable[int]) -> NDArray[np.int64]:
        """Positions of several buses."""
        return np.array([self.index(bus) for bus in listed(buses)], dtype=np.int64)

    def branch(self, bus: int, other: int, circuit: str | None = None) -> Branch:
        """Branch between two buses, in either order; `circuit` is needed where there are several.

        Raises
        ------
        InputError
            If there is not exactly one.
        """
        found = list(self.branches_between(bus, other))
        circuits = ", ".join(b.circuit for b in found)
        if circuit is not None:
            found = [b for b in found if b.circuit == circuit]
        if len(found) != 1:
            ends = sorted({b.from_bus + b.to_bus - bus for b in self.branches if bus in b.ends})
            raise InputError(
                f"there are {len(found)} branches between the buses {bus} and {other}"
                + (f" with circuit {circuit!r}" if circuit is not None else ""),
                allowed=f"circuit {circuits}"
                if circuits
                else f"from bus {bus} to {', '.join(map(str, ends))}",
            )
        return found[0]

    def branches_between(self, bus: int, other: int) -> tuple[Branch, ...]:
        """All branches between two buses, with those out of service; an unknown bus raises `InputError`."""
        self.index(bus), self.index(other)
        return tuple(self.branches[k] for k in self._positions.get(frozenset((bus, other)), ()))

    def with_line_out(self, bus: int, other: int, circuit: str | None = None) -> Network:
        """Open the branch between two buses at both ends; an island raises `InputError`."""
        out = self.branch(bus, other, circuit)
        branches = (replace(b, in_service=False) if b is out else b for b in self.branches)
        return replace(self, branches=tuple(branches))

    def with_branch_share(self, bus: int, other: int, share: float, circuit: str | None = None) -> Network:
        """Keep a share of a branch's admittance in service; 0 opens it, see `with_line_out`."""
        check_real(share, "the share of a branch", low=0, where="with_branch_share")
        if share == 0:
            return self.with_line_out(bus, other, circuit)
        part = self.branch(bus, other, circuit)
        less = replace(part, r=part.r / share, x=part.x / share, b=part.b * share)
        at = next(k for k in self._positions[frozenset(part.ends)] if self.branches[k] is part)
        branches = (*self.branches[:at], less, *self.branches[at + 1 :])
        if share < _SMALL_SHARE:
            return replace(self, branches=branches)
        i, k = (self._index[end] for end in part.ends)
        change = [new - old for new, old in zip(less.admittances, part.admittances, strict=True)]
        return self._changed((([i, i, k, k], [i, k, i, k]), change), branches=branches)

    def with_fault(self, bus: int, impedance: complex = 0.0) -> Network:
        """Connect a bus to ground through a symmetrical fault impedance in pu; 0 is an exact bolted fault."""
        self.index(bus)
        if not (isinstance(impedance, Complex) and cmath.isfinite(impedance)):
            raise InputError(f"the fault impedance is {impedance!r}", allowed="a finite number in pu")
        if impedance == 0:
            return self._changed(grounded=self.grounded | {bus})
        y, at = 1 / complex(impedance), self._index[bus]
        return self._changed(((at, at), y), shunts=(*self.shunts, Shunt(bus, y.real, y.imag)))

    def _changed(self, change: tuple[Any, Any] | None = None, **elements: Any) -> Network:
        """Grid with other branches, shunts or bolted faults, whose connections are not checked again.

        `change` (index, array) adds to entries of the admittance matrix, because a search tries thousands of faults.
        """
        other = copy.copy(self)
        if change is not None:
            where, value = change
            Y = self._branches_and_shunts.copy()
            Y[where] += value
            other.__dict__["_branches_and_shunts"] = Y
        other.__dict__.update(elements)
        return other

    def with_load_scaled(self, factor: float, buses: Iterable[int] | None = None) -> Network:
        """Multiply the loads at some buses, or at all, by a factor.

        Examples
        --------
        >>> grid = Network((Bus(1), Bus(2)), (Branch(1, 2, 0.0, 0.1),), slack=1, loads=(Load(2, 0.5),))
        >>> grid.with_load_scaled(1.2).loads
        (Load(bus=2, p=0.6, q=0.0),)
        """
        check_real(factor, "the factor", where="with_load_scaled")
        chosen = _chosen(buses, (load.bus for load in self.loads), "with_load_scaled")
        scaled = (
            replace(load, p=load.p * factor, q=load.q * factor) if load.bus in chosen else load
            for load in self.loads
        )
        return replace(self, loads=tuple(scaled))

    def with_generation_scaled(self, factor: float, buses: Iterable[int] | None = None) -> Network:
        """Multiply the active power of the generators at some buses, or of all, by a factor."""
        check_real(factor, "the factor", where="with_generation_scaled")
        chosen = _chosen(buses, (g.bus for g in self.generators), "with_generation_scaled")
        scaled = (replace(g, p=g.p * factor) if g.bus in chosen else g for g in self.generators)
        return replace(self, generators=tuple(scaled))

    def with_base(self, base_mva: float) -> Network:
        """Express the same grid in per unit of another base."""
        check_real(base_mva, "base_mva", low=0, above=True, where="with_base")
        k = self.base_mva / base_mva
        return replace(
            self,
            base_mva=base_mva,
            branches=tuple(replace(b, r=b.r / k, x=b.x / k, b=b.b * k) for b in self.branches),
            loads=tuple(replace(s, p=s.p * k, q=s.q * k) for s in self.loads),
            shunts=tuple(replace(s, g=s.g * k, b=s.b * k) for s in self.shunts),
            generators=tuple(
                replace(g, p=g.p * k, q=g.q * k, q_min=g.q_min * k, q_max=g.q_max * k)
                for g in self.generators
            ),
        )

    def demand(self) -> NDArray[np.complex128]:
        """Power P + jQ drawn by the loads at each bus in pu, shape (n_buses,)."""
        return self._demand.copy()

    @cached_property
    def _demand(self) -> NDArray[np.complex128]:
        demand = np.zeros(len(self.buses), dtype=complex)
        for load in self.loads:
            demand[self._index[load.bus]] += complex(load.p, load.q)
        return demand

    def voltages(self, values: ArrayLike, name: str) -> NDArray[np.complex128]:
        """Copy of `values` as complex voltages (n_buses,); anything else raises `InputError` with `name`."""
        try:
            V = np.array(values, dtype=complex)
        except (TypeError, ValueError):
            V = np.array(np.nan)
        if V.shape != (len(self.buses),) or not np.all(np.isfinite(V) & (V != 0)):
            raise InputError(
                f"{name} has another shape, or values that are zero or not finite",
                allowed=f"one voltage in pu for each of the {len(self.buses)} buses",
            )
        return V

    def admittance(self, load_voltages: ArrayLike | None = None) -> NDArray[np.complex128]:
        """Bus admittance matrix (n_buses, n_buses) from (N1) and the shunts, without bolted faults.

        Parameters
        ----------
        load_voltages : array-like of shape (n_buses,), optional
            Voltages (complex, or magnitudes) in pu at which the loads draw their power, (N2); no loads where not given.
        """
        Y = self._branches_and_shunts.copy()
        if load_voltages is not None:
            V = self.voltages(load_voltages, "load_voltages")
            Y.flat[:: len(Y) + 1] += self._demand.conj() / np.abs(V) ** 2  # (N2)
        return Y

    @cached_property
    def _positions(self) -> Mapping[frozenset[int], list[int]]:
        positions: dict[frozenset[int], list[int]] = {}
        for k, branch in enumerate(self.branches):
            positions.setdefault(frozenset(branch.ends), []).append(k)
        return positions

    @cached_property
    def _branches_and_shunts(self) -> NDArray[np.complex128]:
        Y = np.zeros((len(self.buses),) * 2, dtype=complex)
        ends = np.array([[self._index[bus] for bus in branch.ends] for branch in self.branches], dtype=int)
        values = np.array([branch.admittances for branch in self.branches], dtype=complex)
        i, k = ends.reshape(-1, 2).T
        np.add.at(Y, (np.stack([i, i, k, k], axis=1), np.stack([i, k, i, k], axis=1)), values.reshape(-1, 4))
        for shunt in self.shunts:
            Y[self._index[shunt.bus], self._index[shunt.bus]] += complex(shunt.g, shunt.b)
        return Y

    def _check_connected(self) -> None:
        neighbours: dict[int, set[int]] = {bus.number: set() for bus in self.buses}
        for b in filter(lambda b: b.in_service, self.branches):
            neighbours[b.from_bus].add(b.to_bus)
            neighbours[b.to_bus].add(b.from_bus)
        reached, queue = {self.slack}, [self.slack]
        while queue:
            new = neighbours[queue.pop()] - reached
            reached |= new
            queue += new
        cut_off = [str(bus.number) for bus in self.buses if bus.number not in reached]
        if cut_off:
            more = f" and {len(cut_off) - 8} more" if len(cut_off) > 8 else ""
            raise InputError(
                f"no branch connects the buses {', '.join(cut_off[:8])}{more} with the slack bus {self.slack}",
                where="network",
                allowed="one connected grid",
                remedy="Keep a branch, or leave the island out",
            )


def listed(buses: Iterable[int]) -> list[int]:
    """Return bus numbers as a list; a single number, or text, raises `InputError`."""
    if isinstance(buses, str) or not isinstance(buses, Iterable):
        raise InputError(f"the buses are {buses!r}", allowed="a list of bus numbers")
    return list(buses)


def _chosen(buses: Iterable[int] | None, known: Iterable[int], where: str) -> set[int]:
    """Named buses, or all known ones; an unknown one raises `InputError`."""
    known = set(known)
    chosen = known if buses is None else set(listed(buses))
    for bus in sorted(chosen - known):
        raise unknown_name(str(bus), map(str, sorted(known)), kind="bus", where=where)
    return chosen


def _reject_twice(names: Iterable[Hashable], what: str, remedy: str | None = None) -> None:
    seen: set[Hashable] = set()
    for name in names:
        if name in seen:
            raise InputError(f"{what} {name} appears more than once", where="network", remedy=remedy)
        seen.add(name)
