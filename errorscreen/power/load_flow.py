r"""Load flow by Newton's method in polar coordinates.

Tinney, Hart, *Power Flow Solution by Newton's Method*, IEEE Trans. PAS, 1967; the derivatives in the complex form of
Zimmerman, *AC Power Flows, Generalized OPF Costs and their Derivatives using Complex Matrix Notation*, MATPOWER
Technical Note 2, 2010. Brackets make a diagonal matrix of a vector.

.. math::

    S &= [V] I^*,\quad I = Y V                                                                & (F1)\\
    \partial S/\partial\theta &= j\,[V]\,([I] - Y [V])^*                                       & (F2)\\
    \partial S/\partial|V| &= [V]\,(Y [V/|V|])^* + [I]^* [V/|V|]                               & (F3)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.exceptions import InputError
from errorscreen.power.elements import Generator
from errorscreen.power.network import Network

#: largest mismatch in pu of the system base that counts as solved
TOLERANCE = 1e-10
_MAX_ITERATIONS = 30
_MAX_SWITCHES = 20


@dataclass(frozen=True)
class LoadFlow:
    """A solved load flow of a network: complex `voltage` (n_buses,) and powers P + jQ in pu.

    `mismatch` is the largest difference in P or Q between injection and grid, `iterations` counts Newton steps, and
    `at_limit` names buses whose generator is at a reactive limit.
    """

    network: Network
    voltage: NDArray[np.complex128]
    mismatch: float
    iterations: int
    at_limit: tuple[int, ...] = ()

    @property
    def magnitude(self) -> NDArray[np.float64]:
        """Voltage magnitudes in pu, shape (n_buses,)."""
        return np.abs(self.voltage)

    @property
    def angle(self) -> NDArray[np.float64]:
        """Voltage angles in rad, shape (n_buses,)."""
        return np.angle(self.voltage)

    @property
    def injection(self) -> NDArray[np.complex128]:
        """Net power into the grid at each bus, (F1), shape (n_buses,)."""
        return self.voltage * (self.network.admittance() @ self.voltage).conj()

    @property
    def generation(self) -> dict[int, complex]:
        """Power of each generator by bus: power into the grid plus the loads there."""
        total = self.injection + self.network.demand()
        return {g.bus: complex(total[self.network.index(g.bus)]) for g in self.network.generators}

    @property
    def branch_flows(self) -> NDArray[np.complex128]:
        """Power that enters each branch at its first and at its second end, shape (n_branches, 2)."""
        ends = [self.network.indices(b.ends) for b in self.network.branches]
        V = self.voltage[np.array(ends, dtype=np.int64).reshape(-1, 2)]
        Y = np.array([b.admittances for b in self.network.branches], dtype=complex).reshape(-1, 2, 2)
        return V * (Y @ V[:, :, None])[:, :, 0].conj()


def solve_load_flow(
    network: Network, *, start: ArrayLike | None = None, reactive_limits: bool = False
) -> LoadFlow:
    """Solve for the voltages at which every bus balances, from `start` (n_buses,) or a flat profile.

    Loads draw constant power. With `reactive_limits` a generator beyond a limit delivers the limit, and holds its
    voltage again where it can; the slack generator has no limits. `InputError` where no solution is near the start.
    """
    V = _start(network, start)
    if not reactive_limits:
        V, mismatch, iterations = _newton(network, V)
        return LoadFlow(network, V, mismatch, iterations)
    limited, total = network, 0
    for _ in range(_MAX_SWITCHES):
        V, mismatch, iterations = _newton(limited, V)
        total += iterations
        changed = _switched(network, limited, LoadFlow(limited, V, mismatch, total))
        if changed == limited:
            held = tuple(g.bus for g in network.generators if g not in limited.generators)
            return LoadFlow(network, V, mismatch, total, held)
        limited = changed
        V = _start(limited, V)
    raise InputError(
        f"the generators at reactive limits still change after {_MAX_SWITCHES} rounds",
        where="load flow",
        remedy="Widen the limits, or solve without them",
    )


def _start(network: Network, start: ArrayLike | None) -> NDArray[np.complex128]:
    """Initial voltages with the held magnitudes and the reference angle."""
    slack = {g.bus: g for g in network.generators}.get(network.slack)
    if slack is None or slack.v is None:
        raise InputError(
            f"no generator holds the voltage of the slack bus {network.slack}",
            where="load flow",
            remedy="Give the slack bus a generator with v, or choose another slack bus",
        )
    if network.grounded:
        raise InputError(
            f"the buses {', '.join(map(str, sorted(network.grounded)))} have a bolted fault",
            where="load flow",
            allowed="a grid without faults",
        )
    V = network.voltages(np.ones(len(network.buses)) if start is None else start, "start")
    V *= np.exp(-1j * np.angle(V[network.index(network.slack)]))
    for g in network.generators:
        if g.v is not None:
            i = network.index(g.bus)
            V[i] *= g.v / np.abs(V[i])
    return V


def _newton(network: Network, V: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], float, int]:
    """Voltages, mismatch and number of steps of Newton's method."""
    Y = network.admittance()
    slack = network.index(network.slack)
    held = {network.index(g.bus) for g in network.generators if g.v is not None} | {slack}
    n = len(V)
    angles = np.array([i for i in range(n) if i != slack], dtype=np.int64)
    magnitudes = np.array([i for i in range(n) if i not in held], dtype=np.int64)
    target = -network.demand()
    for g in network.generators:
        target[network.index(g.bus)] += complex(g.p, g.q)
    best, closest = np.inf, target
    with np.errstate(all="ignore"):  # a divergent step shows in the mismatch
        for iteration in range(_MAX_ITERATIONS + 1):
            error = target - V * (Y @ V).conj()  # (F1)
            F = np.concatenate([error[angles].real, error[magnitudes].imag])
            mismatch = float(np.abs(F).max(initial=0.0))
            if mismatch < TOLERANCE:
                return V, mismatch, iteration
            if mismatch < best:
                best, closest = mismatch, error
            if iteration == _MAX_ITERATIONS or not np.isfinite(mismatch):
                break
            try:
                step = np.linalg.solve(_jacobian(Y, V, angles, magnitudes), F)
            except np.linalg.LinAlgError:
                break
            angle, magnitude = np.angle(V), np.abs(V)
            angle[angles] += step[: len(angles)]
            magnitude[magnitudes] += step[len(angles) :]
            V = magnitude * np.exp(1j * angle)
    raise _not_solved(network, closest, angles, magnitudes, iteration)


def _jacobian(
    Y: NDArray[np.complex128],
    V: NDArray[np.complex128],
    angles: NDArray[np.int64],
    magnitudes: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Derivatives of P at `angles` and Q at `magnitudes` by these angles and magnitudes."""
    unit, current = V / np.abs(V), Y @ V
    dS_angle = 1j * V[:, None] * (np.diag(current) - Y * V).conj()  # (F2)
    dS_magnitude = V[:, None] * (Y * unit).conj() + np.diag(current.conj() * unit)  # (F3)
    return np.block(
        [
            [dS_angle[np.ix_(angles, angles)].real, dS_magnitude[np.ix_(angles, magnitudes)].real],
            [dS_angle[np.ix_(magnitudes, angles)].imag, dS_magnitude[np.ix_(magnitudes, magnitudes)].imag],
        ]
    )


def _not_solved(
    network: Network,
    error: NDArray[np.complex128],
    angles: NDArray[np.int64],
    magnitudes: NDArray[np.int64],
    iterations: int,
) -> InputError:
    """Error with the bus of the worst mismatch in the best step."""
    size = np.zeros(len(error))
    size[angles] = np.abs(error[angles].real)
    size[magnitudes] = np.maximum(size[magnitudes], np.abs(error[magnitudes].imag))
    worst = int(np.argmax(size))
    return InputError(
        f"no solution in {iterations} Newton steps; the closest left a mismatch of {size[worst]:.3g} pu "
        f"at bus {network.buses[worst].number}",
        where="load flow",
        remedy="Check loads, generation and branch data near this bus, or start from a solution of a similar case",
    )


def _switched(original: Network, limited: Network, flow: LoadFlow) -> Network:
    """Network with the next guess of the generators at a limit."""
    pairs = zip(original.generators, limited.generators, strict=True)
    found = (w if w.bus == original.slack else _at_limit(w, g, flow) for w, g in pairs)
    return replace(original, generators=tuple(found))


def _at_limit(wanted: Generator, g: Generator, flow: LoadFlow) -> Generator:
    """Generator of the next guess: at the limit that it exceeds, or with its voltage again."""
    if wanted.v is None or (g.v is None and wanted.q_min == wanted.q_max):
        return g
    if g.v is not None:
        q = flow.generation[g.bus].imag
        if wanted.q_min - TOLERANCE <= q <= wanted.q_max + TOLERANCE:
            return wanted
        return replace(wanted, v=None, q=wanted.q_max if q > wanted.q_max else wanted.q_min)
    magnitude = flow.magnitude[flow.network.index(g.bus)]
    # at the upper limit the voltage sags; else the generator can hold it again
    recovered = magnitude > wanted.v if g.q == wanted.q_max else magnitude < wanted.v
    return wanted if recovered else g
