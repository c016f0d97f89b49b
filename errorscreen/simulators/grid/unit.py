"""Plants and loads under test in a grid: which device, where, how large."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from errorscreen.exceptions import InputError, check_real, unknown_name
from errorscreen.models import DEVICES, LOAD, Device, FixedMachine
from errorscreen.models.device import Values
from errorscreen.power.load_flow import LoadFlow
from errorscreen.power.network import Network
from errorscreen.simulators.grid.assembly import machine_prefix, qualified

#: quantities of the fixed machines by name in the model, and size, voltage and power of each unit or load
AtTerminals = tuple[Values, list[tuple[float, complex, complex]]]


@dataclass(frozen=True)
class Unit:
    """A plant under test at a bus of the grid, with the power of the generator there in the load flow.

    Parameters
    ----------
    bus : int
    device : Device or str
        A device, or its name, that can be connected to a grid.
    rating : float
        Base of the plant's own per unit in MVA.
    constants : mapping of str to float
        Constants of the device that differ from the defaults.

    Examples
    --------
    >>> Unit(37, "dfig_plant", rating=600.0).model.title
    'DFIG wind plant with voltage control, virtual inertia and active-power control'
    """

    bus: int
    device: Device | str
    rating: float
    constants: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"unit at bus {self.bus}"
        if self.model.grid is None or self.model.grid.names or self.model.grid.kind == "solved":
            raise InputError(f"the device {self.model.name!r} cannot be connected to a grid", where=where)
        check_real(self.rating, "the rating", low=0, above=True, where=where)
        _check_constants(self, where)

    @property
    def model(self) -> Device:
        """The device itself."""
        if not isinstance(self.device, str):
            return self.device
        return DEVICES.find(self.device, f"unit at bus {self.bus}")

    @property
    def default_constants(self) -> dict[str, float]:
        """Constants of the device and of its connection; the frequency is that of the grid."""
        values = self.model.constant_values(in_grid=True)
        return {name: value for name, value in values.items() if name != "f0"}


@dataclass(frozen=True)
class LoadUnderTest:
    """A load of the grid in which effects may act.

    Parameters
    ----------
    bus : int
        Its device is called ``load_`` and the bus.
    constants : mapping of str to float
        Constants of the load that differ from the defaults.

    Examples
    --------
    >>> LoadUnderTest(8).model.name
    'load_8'
    """

    bus: int
    constants: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_constants(self, f"load at bus {self.bus}")

    @property
    def model(self) -> Device:
        """The device itself."""
        return replace(LOAD, name=f"load_{self.bus}")

    @property
    def default_constants(self) -> dict[str, float]:
        """Constants of a load; the frequency is that of the grid."""
        return LOAD.constant_values()


def _check_constants(item: Unit | LoadUnderTest, where: str) -> None:
    for name in item.constants:
        if name not in item.default_constants:
            raise unknown_name(name, item.default_constants, kind="constant", where=where)


def at_rest(
    item: Unit | LoadUnderTest, given: Values, size: float, voltage: complex, power: complex, f0: float
) -> tuple[Values, NDArray[np.bool_]]:
    """Quantities of a unit or load at its equilibrium, without prefix, and rows that have one.

    `given` holds parameters (n,); `size` is the item's base over that of the grid; power is what a unit delivers or a
    load draws, in pu of the grid.
    """
    device = item.model
    assert device.grid is not None
    own: Values = {p.name: given.get(p.name, np.array(p.nominal)) for p in device.candidates}
    numbers = {**item.default_constants, **item.constants, "size": size, "f0": f0}
    numbers |= {"V": abs(voltage), "angle": float(np.angle(voltage))}
    numbers |= {"P": power.real / size, "Q": power.imag / size}
    own |= {name: np.array(value) for name, value in numbers.items()}
    with np.errstate(all="ignore"):  # an absurd parameter shows as no equilibrium
        states, setpoints, possible = device.initialise(own)
    return {**own, **states, **setpoints, **{s: own[name] for s, name in device.grid.states}}, possible


def at_terminals(
    flow: LoadFlow, machines: Sequence[FixedMachine], items: Sequence[Unit | LoadUnderTest]
) -> AtTerminals:
    """Equilibrium of the fixed machines, by name in the model, and arguments of `at_rest` for each unit and load."""
    network, generation = flow.network, flow.generation
    demand = network.demand()
    values: Values = {}
    for machine in machines:
        start = machine.initialise(complex(flow.voltage[network.index(machine.bus)]), generation[machine.bus])
        values |= {qualified(machine_prefix(machine.bus), k): np.array(v) for k, v in start.items()}
    given = []
    for item in items:
        bus = network.index(item.bus)
        power = generation[item.bus] if isinstance(item, Unit) else complex(demand[bus])
        size = item.rating / network.base_mva if isinstance(item, Unit) else abs(power)
        given.append((size, complex(flow.voltage[bus]), power))
    return values, given


def check_terminals(
    network: Network,
    units: Sequence[Unit],
    machines: Sequence[FixedMachine],
    loads: Sequence[LoadUnderTest],
) -> None:
    """Raise `InputError` unless each generator has a machine or unit, and each load under test exists."""
    where = "PowerSystemSimulator"
    buses = [m.bus for m in machines] + [u.bus for u in units]
    have = sorted(g.bus for g in network.generators)
    if sorted(buses) != have:
        raise InputError(
            f"machines and units are at the buses {sorted(buses)}",
            where=where,
            allowed=f"one at each generator: {have}",
        )
    kinds = [u.model.grid.kind for u in units if u.model.grid]
    names = [u.model.name for u in units]
    if len(set(names)) < len(names) or any(kinds.count(k) > 1 for k in ("norton", "rotor")):
        raise InputError(f"the devices are {', '.join(names)}", where=where, allowed="each kind at most once")
    if not machines:
        raise InputError("there is no fixed machine", where=where, allowed="at least one FixedMachine")
    demand = network.demand()
    drawing = [bus.number for bus in network.buses if demand[network.index(bus.number)]]
    for load in loads:
        if load.bus not in drawing:
            raise InputError(f"there is no load at bus {load.bus}", where=where, allowed=f"{drawing}")
    if len({load.bus for load in loads}) < len(loads):
        raise InputError("a load is given twice", where=where, allowed="each bus once")
