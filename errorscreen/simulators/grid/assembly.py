"""Wires machines, converters and the solution of the reduced grid to one model for the engine."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from errorscreen.effects import (
    FAULT_DURATION,
    FAULT_IMPEDANCE,
    Effect,
    branch_trip,
    effects_of,
    measurement_effects,
)
from errorscreen.engine.stages import Call, Equations, Model, reads_of, writes_of
from errorscreen.events import BusFault, Event
from errorscreen.exceptions import InputError
from errorscreen.models.device import Device
from errorscreen.models.machines import fixed as two_axis_fixed
from errorscreen.power import elimination
from errorscreen.power.network import Network
from errorscreen.power.reduction import ReducedNetwork
from errorscreen.simulators.assembly import effect_call, effect_constants, effect_states, gates

#: quantities of the whole grid, which have no prefix
_SHARED = ("f0",)
#: functions that add so many terms to a sum
_SUMS: dict[int, Equations] = {
    0: elimination.copy,
    1: elimination.add_one,
    2: elimination.add_two,
    3: elimination.add_three,
    7: elimination.add_seven,
}


def qualified(prefix: str, name: str) -> str:
    """Name of a quantity of one unit in the model: ``d_W`` becomes ``d_pv_plant.W``."""
    if name in _SHARED:
        return name
    return f"d_{prefix}.{name[2:]}" if name.startswith("d_") else f"{prefix}.{name}"


def machine_prefix(bus: int) -> str:
    """Prefix of the quantities of a fixed machine."""
    return f"machine_{bus}"


def grid_effects(
    devices: Mapping[str, str], channels: Iterable[str], network: Network, events: Sequence[Event]
) -> Iterator[Effect]:
    """Effects of each device, given with its registry name, of the measurement, and of faults recorded wrongly."""
    for device, kind in devices.items():
        yield from (effect.at(device) for effect in effects_of(kind))
    yield from measurement_effects(channels)
    faulted = {event.bus for event in events if isinstance(event, BusFault)}
    if faulted:
        yield from (FAULT_DURATION, FAULT_IMPEDANCE)
    for branch in network.branches:
        if not faulted.isdisjoint(branch.ends) and branch.in_service:
            try:
                network.with_line_out(*branch.ends, branch.circuit)
            except InputError:  # an island
                continue
            several = sum(set(other.ends) == set(branch.ends) for other in network.branches) > 1
            yield branch_trip(branch.ends, branch.circuit if several else None)


class GridModel:
    """Model of machines and devices at the terminals of a reduced grid, with effects at the devices that they name.

    There may be one device of the kind ``"norton"`` and one of the kind ``"rotor"``.
    """

    def __init__(
        self,
        machines: Iterable[int],
        devices: Iterable[Device],
        channels: dict[str, int | tuple[int, int]],
        effects: Iterable[Effect] = (),
    ) -> None:
        self.effects = tuple(effects)
        self.machines, self.devices, self.channels = tuple(machines), tuple(devices), channels
        self._calls: list[Call] = []
        self._machines = [machine_prefix(bus) for bus in self.machines]
        self._order = [*self._machines, *(d.name for d in self.devices)]
        by_kind = {d.interface.kind: d.name for d in self.devices}
        self._norton, self._rotor = by_kind.get("norton"), by_kind.get("rotor")

    def model(self) -> Model:
        """Model whose tables are those of `tables`."""
        self._calls = []
        self._sources()
        self._solve()
        self._units()
        self._observe()
        machine_constants = ("Xd", "Xd1", "Xq", "D", "Bd1", "per_Td10", "per_Tq10", "per_Tj", "Efd", "Pm")
        states = [qualified(p, s) for p in self._machines for s in two_axis_fixed.STATES]
        constants = [qualified(p, c) for p in self._machines for c in machine_constants]
        for d in self.devices:
            states += [qualified(d.name, s) for s in (*d.states, *(s for s, _ in d.interface.states))]
            own = (*d.candidates.names, *d.constant_values(in_grid=True), *d.setpoints, "size")
            constants += [qualified(d.name, c) for c in own]
        rows = list(self._order)
        for name, where in self.channels.items():
            rows += [f"channel.{name}.{part}" for part in ("VI" if isinstance(where, tuple) else "V")]
        return Model(
            name="grid",
            inputs=(),
            states=(*states, *effect_states(self.effects)),
            constants=tuple(dict.fromkeys((*_SHARED, *constants, *effect_constants(self.effects)))),
            calls=tuple(self._calls),
            outputs=tuple(f"channel.{name}" for name in self.channels),
            tables=tuple(part for row in rows for column in self._order for part in _impedance(row, column)),
            gated=gates(self.effects),
        )

    def tables(self, reduced: ReducedNetwork) -> NDArray[np.float64]:
        """Values of the tables for one state of the grid, shape (n_tables,), or several, (n_states, n_tables)."""
        rows = [reduced.impedance]
        flow = 0
        for where in self.channels.values():
            if isinstance(where, tuple):
                rows += [reduced.flow_voltages[..., flow, None, :], reduced.flow_currents[..., flow, None, :]]
                flow += 1
            else:
                rows.append(reduced.transfer[..., reduced.observed.index(where), None, :])
        values = np.concatenate(rows, axis=-2)
        return np.stack([values.real, values.imag], axis=-1).reshape(*values.shape[:-2], -1)

    def _add(
        self, function: Equations, reads: Iterable[str], writes: Iterable[str], recorded: bool = False
    ) -> None:
        self._calls.append(Call(function, tuple(reads), tuple(writes), recorded=recorded))

    def _stage(self, prefix: str, function: Equations | Call) -> None:
        """Call a stage of one unit, then the effects on its results."""
        assert not isinstance(function, Call)  # a unit of standard models is refused before
        self._add(
            function,
            (qualified(prefix, n) for n in reads_of(function)),
            (qualified(prefix, n) for n in writes_of(function)),
        )
        for name in writes_of(function):
            for effect in self.effects:
                if (effect.device, effect.port) == (prefix, name):
                    self._calls.append(effect_call(effect, partial(qualified, prefix)))

    def _sources(self) -> None:
        """Currents J that follow from states, of machines and of current-controlled converters."""
        for prefix in self._machines:
            self._stage(prefix, two_axis_fixed.internal_source)
        for d in self.devices:
            for function in d.interface.source:
                self._stage(d.name, function)
            if d.interface.kind == "current":
                self._add(elimination.injected, _of(d.name, "Cr", "Ci", "size"), _of(d.name, "Ir", "Ii"))

    def _solve(self) -> None:
        """Currents of all units, then their voltages: (G1) to (G5)."""
        for row in self._order:
            self._sum(row, row, "V0", self._known())
        w, m = self._norton, self._rotor
        if w:
            reads = (*_of(w, "Cr", "Ci", "Xpp", "size", "V0r", "V0i"), *_impedance(w, w))
            self._add(elimination.norton, reads, _of(w, *writes_of(elimination.norton)))
        if w and m:
            reads = (
                *_of(w, "I0r", "I0i", "hr", "hi"), *_of(m, "V0r", "V0i"),
                *_impedance(m, m), *_impedance(m, w), *_impedance(w, m),
            )  # fmt: skip
            self._add(elimination.seen_by_machine, reads, _of(m, *writes_of(elimination.seen_by_machine)))
        if m:
            seen = _of(m, "Er", "Ei", "R", "X") if w else (*_of(m, "V0r", "V0i"), *_impedance(m, m))
            own = _of(m, *reads_of(elimination.machine_current)[4:])
            self._add(
                elimination.machine_current, (*seen, *own), _of(m, *writes_of(elimination.machine_current))
            )
        if w and m:
            reads = (*_of(w, "I0r", "I0i"), *_of(m, "kr", "ki", "Ir", "Ii"))
            self._add(elimination.converter_current, reads, _of(w, "Ir", "Ii"))
        elif w:
            self._add(elimination.copy, _of(w, "I0r", "I0i"), _of(w, "Ir", "Ii"))
        for row in self._order:
            self._sum(row, row, "V", self._unknown(), start=_of(row, "V0r", "V0i"))

    def _units(self) -> None:
        """Derivatives of all states."""
        for prefix in self._machines:
            self._stage(prefix, two_axis_fixed.rotor)
        for d in self.devices:
            for function in (*d.interface.terminal, *d.stages[1:]):
                self._stage(d.name, function)

    def _observe(self) -> None:
        """Channels, once a step."""
        for name, where in self.channels.items():
            channel = f"channel.{name}"
            parts = ("V", "I") if isinstance(where, tuple) else ("V",)
            for part in parts:
                self._sum(f"{channel}.{part}", channel, f"{part}0", self._known(), recorded=True)
                start = _of(channel, f"{part}0r", f"{part}0i")
                self._sum(f"{channel}.{part}", channel, part, self._unknown(), start=start, recorded=True)
            function = elimination.arriving_power if len(parts) == 2 else elimination.magnitude
            self._add(
                function,
                (n for p in parts for n in _of(channel, f"{p}r", f"{p}i")),
                (channel,),
                recorded=True,
            )

    def _known(self) -> list[tuple[str, ...]]:
        """Columns and names of the currents that follow from states."""
        known = [(p, *_of(p, "Jr", "Ji")) for p in self._machines]
        others = [d.name for d in self.devices if d.name not in (self._norton, self._rotor)]
        return [*known, *((p, *_of(p, "Ir", "Ii")) for p in others)]

    def _unknown(self) -> list[tuple[str, ...]]:
        return [(p, *_of(p, "Ir", "Ii")) for p in (self._norton, self._rotor) if p]

    def _sum(
        self,
        row: str,
        owner: str,
        name: str,
        terms: list[tuple[str, ...]],
        *,
        start: tuple[str, ...] = (),
        recorded: bool = False,
    ) -> None:
        """Add the voltages of several currents at one row of the grid to `start`, (G1)."""
        target = _of(owner, f"{name}r", f"{name}i")
        if not start:
            (column, *current), *terms = terms
            self._add(elimination.product, (*current, *_impedance(row, column)), target, recorded)
            start = target
        while terms or start != target:
            count = max(n for n in _SUMS if n <= len(terms))
            function = _SUMS[count]
            reads = (n for column, *current in terms[:count] for n in (*current, *_impedance(row, column)))
            self._add(function, (*start, *reads), target, recorded)
            start, terms = target, terms[count:]


def _of(prefix: str, *names: str) -> tuple[str, ...]:
    return tuple(qualified(prefix, name) for name in names)


def _impedance(row: str, column: str) -> tuple[str, str]:
    """Names of the table entries from a current (column) to a row."""
    return f"r({row}, {column})", f"x({row}, {column})"
