"""Whole grids written a second time: all buses, no reduction, no elimination, for an adaptive solver.

Each evaluation solves one real system of equations for the voltages of all buses; devices are those of `reference`.
Load flow and admittances of all buses are the package's own, which are checked against ANDES.
"""

import cmath
import math

import numpy as np
from scipy.integrate import solve_ivp

from errorscreen.power.load_flow import solve_load_flow
from tests.models.reference import DEVICES, Machine


def real(z):
    """Multiplication by a complex number, as a real matrix."""
    return np.array([[z.real, -z.imag], [z.imag, z.real]])


class Rotor:
    """A machine: two sources behind two reactances, which turn with the rotor."""

    def __init__(self, p, bus, size, V, S):
        self.bus, self.size, self.device = bus, size, Machine(p, V, S.real / size, S.imag / size)
        self.start = self.device.start()

    def source(self, x):
        p, turn = self.device.p, real(cmath.exp(1j * (math.pi / 2 - x[0])))
        y = np.linalg.inv([[p["Ra"], -p["Xq1"]], [p["Xd1"], p["Ra"]]])
        return self.size * turn.T @ y @ [x[3], x[2]], self.size * turn.T @ y @ turn

    def slope(self, x, V, power):
        return self.device.slope(x, V, power)


class Converter:
    """A converter: a source in the frame of its phase-locked loop, whose angle is the last state."""

    def __init__(self, name, p, bus, size, V, S):
        self.bus, self.size, self.name = bus, size, name
        self.device = DEVICES[name](p, abs(V), S.real / size, S.imag / size)
        own = self.device.start()
        self.start = [*(own[1:] if name == "dfig_plant" else own), cmath.phase(V)]

    def source(self, x):
        y = 0.0
        if self.name == "dfig_plant":
            y = 1 / (1j * self.device.p["Xpp"])
            own = x[9] + x[5] * y
        else:
            own = x[5] - 1j * x[6]
        current = self.size * own * cmath.exp(1j * x[-1])
        return [current.real, current.imag], real(self.size * y + 0j)

    def slope(self, x, V, power):
        if self.name == "dfig_plant":  # which has its own loop, as its first state
            first, *others = self.device.slope([x[-1], *x[:-1]], V, power)
            return [*others, first]
        loop = self.device.p["KPLL"] * math.sin(cmath.phase(V) - x[-1])
        return [*self.device.slope(x[:-1], V, power), loop]


class Grid:
    """Equations of a simulator's grid in one of its states."""

    def __init__(self, simulator, theta):
        flow = solve_load_flow(simulator.network)
        self.simulator, self.voltage = simulator, flow.voltage
        given = dict(zip(simulator.parameters.names, theta, strict=True))
        self.parts = []
        for unit in simulator.units_under_test:
            p = {**unit.default_constants, **unit.constants, "f0": simulator.f0}
            p |= {name: given[name] for name in unit.model.candidates.names}
            size, at = unit.rating / simulator.network.base_mva, self.at(unit.bus)
            kind = Rotor if unit.device == "synchronous_machine" else Converter
            name = () if kind is Rotor else (unit.device,)
            self.parts.append(
                kind(*name, p, unit.bus, size, flow.voltage[at], self.delivered(flow, unit.bus))
            )
        for m in simulator.machines:
            p = {"Ra": 0.0, "Xd": m.Xd, "Xd1": m.Xd1, "Xq": m.Xq, "Xq1": m.Xd1, "Tj": 2 * m.H, "D": m.D}
            p |= {"Td10": m.Td10, "Tq10": m.Tq10, "f0": simulator.f0}
            at = self.at(m.bus)
            self.parts.append(Rotor(p, m.bus, 1.0, flow.voltage[at], self.delivered(flow, m.bus)))
        ends = np.cumsum([len(part.start) for part in self.parts])
        self.slices = [slice(end - len(part.start), end) for end, part in zip(ends, self.parts, strict=True)]
        self.start = np.concatenate([part.start for part in self.parts])

    def at(self, bus):
        return self.simulator.network.index(bus)

    def delivered(self, flow, bus):
        """Complex power of the generator at a bus: what leaves it through the grid, and what its load draws."""
        network, at = self.simulator.network, self.at(bus)
        current = network.admittance(flow.voltage)[at] @ flow.voltage
        return flow.voltage[at] * current.conjugate()

    def enter(self, network):
        """Admittances in a state of the grid."""
        self.Y = network.admittance(self.voltage)
        self.grounded = [network.index(bus) for bus in network.grounded]
        self.network = network

    def voltages(self, x):
        """Voltages of all buses, and the current of each part."""
        n = len(self.Y)
        A, b = np.empty((2 * n, 2 * n)), np.zeros(2 * n)
        A[::2, ::2] = A[1::2, 1::2] = self.Y.real
        A[1::2, ::2], A[::2, 1::2] = self.Y.imag, -self.Y.imag
        sources = [part.source(x[s]) for part, s in zip(self.parts, self.slices, strict=True)]
        for part, (current, admittance) in zip(self.parts, sources, strict=True):
            here = slice(2 * self.at(part.bus), 2 * self.at(part.bus) + 2)
            A[here, here] += admittance
            b[here] += current
        for at in self.grounded:
            here = slice(2 * at, 2 * at + 2)
            A[here], b[here] = 0, 0
            A[here, here] = np.eye(2)
        v = np.linalg.solve(A, b)
        currents = []
        for part, (current, admittance) in zip(self.parts, sources, strict=True):
            at = 2 * self.at(part.bus)
            currents.append(complex(*(current - admittance @ v[at : at + 2])))
        return v[::2] + 1j * v[1::2], currents

    def slope(self, x):
        V, currents = self.voltages(x)
        slopes = np.empty_like(x)
        for part, s, current in zip(self.parts, self.slices, currents, strict=True):
            own = V[self.at(part.bus)]
            S = own * current.conjugate() / part.size
            slopes[s] = part.slope(x[s], own, (S.real, S.imag))
        return slopes

    def channels(self, x):
        """Observed quantities."""
        V, _ = self.voltages(x)
        return [self.channel(V, where) for where in self.simulator.observed.values()]

    def channel(self, V, where):
        if not isinstance(where, tuple):
            return abs(V[self.at(where)])
        sending, receiving = where
        line = self.network.branch(receiving, sending)
        y11, y12, y21, y22 = line.admittances
        here, there = V[self.at(receiving)], V[self.at(sending)]
        current = y11 * here + y12 * there if line.from_bus == receiving else y21 * there + y22 * here
        return -(here * current.conjugate()).real


def trajectory(simulator, theta, event):
    """Observed quantities (R, L) during a fault; NaN at the instants at which the grid changes."""
    grid, network = Grid(simulator, theta), simulator.network
    start, end = event.start, event.start + event.duration
    states = [
        (event.time[0], start, network),
        (start, end, network.with_fault(event.bus, event.impedance)),
        (end, event.time[-1], network),
    ]
    x, found = grid.start, np.full((len(simulator.observed), len(event.time)), np.nan)
    for begin, stop, state in states:
        grid.enter(state)
        inside = np.flatnonzero((event.time > begin + 1e-6) & (event.time < stop - 1e-6))
        solution = solve_ivp(
            lambda t, y: grid.slope(y), (begin, stop), x, method="LSODA", rtol=1e-9, atol=1e-11,
            t_eval=[*event.time[inside], stop],
        )  # fmt: skip
        found[:, inside] = np.transpose([grid.channels(y) for y in solution.y.T[:-1]])
        x = solution.y[:, -1]
    return found
