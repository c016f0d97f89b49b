r"""Connection of a unit to the point where it was recorded, from the network in a RAW file.

The recorded bus m cuts the network. What is left around the bus t of the unit must hold no other generator. It is the
unit's own network, with its transformers, lines, shunts and loads as constant admittances. All its buses but t and m
are eliminated (G. Kron, *Tensor Analysis of Networks*, 1939), which is exact for any form of it. With :math:`I` the
current of the unit and :math:`I_m` that into m:

.. math::

    I &= Y_{tt} V + Y_{tm} V_m,\quad -I_m = Y_{mt} V + Y_{mm} V_m                                       & (N5)\\
    V &= a V_m + Z I,\quad Z = 1/Y_{tt},\quad a = -Z Y_{tm}                                             & (N6)\\
    I_m &= c I - y V_m,\quad c = -Z Y_{mt},\quad y = Y_{mm} - Z Y_{mt} Y_{tm}                            & (N7)

These are (C1), (C2) of `errorscreen.simulators.plant.connection` with :math:`t = 1/|a|`, :math:`G + jB = y` and
:math:`\psi = \arg a + \arg c`; :math:`|a| = |c|`, because the network is reciprocal but for the angles of phase
shifters. The step-up transformer of the generator's record, :math:`Z_T = R_T + jX_T` behind the ratio GTAP = g, gives
:math:`Z/g^2 + Z_T` and g t instead; of the figure in the manual we read that g is on the side of the bus.
"""

from __future__ import annotations

import cmath
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from errorscreen._runtime.display import listed
from errorscreen.exceptions import InputError
from errorscreen.models.raw import RawFile
from errorscreen.models.raw_elements import RawBranch, RawGenerator, RawShunt
from errorscreen.simulators.plant.connection import Connection

if TYPE_CHECKING:
    import pandas as pd

#: buses of a way that a message tells
_LONGEST = 8
#: units count as equal up to this part of their values
_EQUAL = 1e-3
_BY_HAND = (
    "Name as measured the bus that all power of the unit alone passes, or state resistance, reactance, tap and shunt "
    "in [plant] by hand"
)


@dataclass(frozen=True)
class RawPlant:
    """A unit in the network of a RAW file.

    Parameters
    ----------
    connection : Connection
        In pu of `base_mva`.
    base_mva : float
        Sum of the bases of the units that count as one.
    base_kv : float
        Base voltage of the recorded bus; 0 if unknown.
    frequency : float or None
        Base frequency of the file in Hz.
    units : tuple of str
        Identifiers of the units that count as one, with that of the model first.
    constants : dict of str to float
        Constants of the unit that a DYR file does not hold: ``Xsource`` and ``Ra``, the generator's source impedance.
    elements : tuple of RawBranch or RawShunt
        Between unit and point.
    notes : tuple of str
        What was found, in sentences.
    where : str
        File and line of the generator.
    """

    connection: Connection
    base_mva: float
    base_kv: float
    frequency: float | None
    units: tuple[str, ...]
    constants: dict[str, float]
    elements: tuple[RawBranch | RawShunt, ...]
    notes: tuple[str, ...]
    where: str

    def check(self, base_mva: float, base_kv: float | None, f_nominal: float, where: str) -> None:
        """Refuse a recording in pu of another base, or of another nominal frequency."""
        if abs(base_mva - self.base_mva) > 1e-6 * self.base_mva:
            several = len(self.units) > 1
            raise InputError(
                f"base_mva is {base_mva:g}, but the "
                + (f"sum of MBASE of {len(self.units)} equal units" if several else "MBASE of the unit")
                + f" is {self.base_mva:g} MVA ({self.where})",
                where=where,
                allowed=f"base_mva = {self.base_mva:g}, which the constants of the unit refer to",
                remedy="P and Q must be those of all these units; a unit that was off has STAT = 0"
                if several
                else "Correct base_mva of the recording, or MBASE",
            )
        if base_kv is not None and self.base_kv and abs(base_kv - self.base_kv) > 1e-4 * self.base_kv:
            raise InputError(
                f"base_kv is {base_kv:g}, but BASKV of the recorded bus is {self.base_kv:g} kV ({self.where})",
                where=where,
                allowed=f"base_kv = {self.base_kv:g}, which the ratios of the transformers refer to",
                remedy="Correct base_kv of the recording, or the bus in plant.measured",
            )
        if self.frequency not in (None, f_nominal):
            raise InputError(
                f"f_nominal is {f_nominal:g} Hz, but BASFRQ is {self.frequency:g} Hz ({self.where})",
                where=where,
                allowed="the same frequency",
                remedy="Correct f_nominal of the recording, or BASFRQ",
            )

    def constants_with(self, stated: Mapping[str, float]) -> tuple[dict[str, float], list[str]]:
        """Constants of the file and those that the user states, which count, and sentences where they differ."""
        notes = [
            f"{name} is {stated[name]:g} pu as the case file states, not {value:g} pu as the RAW file says."
            for name, value in self.constants.items()
            if stated.get(name, value) != value
        ]
        return {**self.constants, **stated}, notes

    def table(self) -> pd.DataFrame:
        """Elements between unit and point; impedances, ratios and admittances in pu of the network."""
        import pandas as pd

        rows = [
            (one.title, one.impedance.real, one.impedance.imag, abs(one.ratios[0] / one.ratios[1]), one.line)
            if isinstance(one, RawBranch)
            else (f"{one.kind} {one.id!r} at bus {one.bus}", np.nan, np.nan, np.nan, one.line)
            for one in self.elements
        ]
        return pd.DataFrame(rows, columns=["element", "R", "X", "ratio", "line"])


def plant_in(file: RawFile, bus: int | str, id: str, measured: int | str) -> RawPlant:
    """Unit of a RAW file, and its connection to the bus where it was recorded.

    Parameters
    ----------
    file : RawFile
    bus : int or str
        Bus of the unit, by number or name.
    id : str
    measured : int or str
        Bus where V, P and Q were recorded; the bus of the unit for its own terminal, or the high-voltage side of the
        step-up transformer in its record.

    Raises
    ------
    InputError
        If there is no such unit, it is out of service, or its network up to the point holds other generators or
        devices that are no series elements.

    Examples
    --------
    >>> text = '''0, 100.0, 33, 0, 1, 60.0
    ...
    ...
    ... 1,'GEN', 20.0,2
    ... 2,'GRID',138.0,3
    ... 0 / END OF BUS DATA, BEGIN LOAD DATA
    ... 0 / END OF LOAD DATA, BEGIN FIXED SHUNT DATA
    ... 0 / END OF FIXED SHUNT DATA, BEGIN GENERATOR DATA
    ... 1,'1',80.0,10.0,,,1.02,,200.0,0.0,0.25
    ... 0 / END OF GENERATOR DATA, BEGIN BRANCH DATA
    ... 1,2,'1',0.01,0.06
    ... Q'''
    >>> found = plant_in(RawFile("case.raw", text), 1, "1", "GRID")
    >>> round(found.connection.reactance, 6), found.base_mva, found.constants["Xsource"]
    (0.12, 200.0, 0.25)
    >>> print(found.notes[0])
    Unit '1' at bus 1 and the recorded bus 2 are joined by line '1' between the buses 1 and 2, R + jX = 0.01 + j0.06 \
pu on 100 MVA.
    """
    place = f"file {file.path}"
    start, end = file.bus(bus, "[device] bus"), file.bus(measured, "[plant] measured")
    units = _units(file, start.number, id, place)
    first = units[0]
    where = f"{file.path}:{first.line}"
    inside, branches = _own_network(file, start.number, end.number)
    _check_alone(file, inside, start.number)
    if start is not end and not any(end.number in branch.buses for branch in branches):
        raise InputError(
            f"no branch in service leads from bus {start.number} to bus {end.number}",
            where=place,
            allowed=f"one of the buses that the unit reaches: {listed(map(str, inside))}",
            remedy="Check the bus of the recording, and the status of the branches",
        )
    hanging = tuple(one for one in (*file.loads, *file.shunts) if one.in_service and one.bus in inside)
    a, c, z, y = _two_port(file.base_mva, start.number, end.number, branches, hanging)
    base = sum(one.base_mva for one in units)
    scale, tap = base / file.base_mva, first.tap if first.step_up else 1.0
    impedance = z * scale / tap**2 + first.step_up
    if not (
        impedance.real >= 0 and impedance.imag >= 0 and abs(impedance) <= 1
    ):  # also NaN, where branches cancel
        raise InputError(
            f"R + jX between the unit and bus {end.number} is {impedance.real:.4g} + j{impedance.imag:.4g} pu on "
            f"{base:g} MVA",
            where=where,
            allowed="R and X of at least 0, and a magnitude of at most 1 pu",
            remedy="Check MBASE, the impedances of the branches, and the recorded bus",
        )
    connection = Connection(
        impedance.real,
        impedance.imag,
        tap=tap / abs(a),
        shunt=y.imag / scale,
        conductance=y.real / scale,
        turn=cmath.phase(a) + cmath.phase(c),
    )
    return RawPlant(
        connection,
        base,
        end.base_kv,
        file.frequency,
        tuple(one.id for one in units),
        {"Ra": first.source.real, **({"Xsource": first.source.imag} if first.source.imag > 0 else {})},
        (*branches, *hanging),
        tuple(_notes(file, units, end.number, branches, hanging, connection, base)),
        where,
    )


def _units(file: RawFile, bus: int, id: str, place: str) -> list[RawGenerator]:
    """The generator of the model, and those at its bus that are equal to it and in service."""
    here = [one for one in file.generators if one.bus == bus]
    name = id.strip().upper()
    first = next((one for one in here if one.id == name), None)
    if first is None:
        raise InputError(
            f"bus {bus} has no generator {id!r}",
            where=place,
            allowed=listed(repr(one.id) for one in here)
            or listed(f"bus {one.bus}" for one in file.generators),
        )
    if not (first.in_service and file.buses[bus].in_service):
        raise InputError(
            f"generator {first.id!r} at bus {bus} is out of service",
            where=f"{file.path}:{first.line}",
            allowed="STAT = 1, and a bus that is not isolated",
            remedy="Use the RAW file of the time of the recording",
        )
    units = [first, *(one for one in here if one is not first and one.in_service)]
    for one in units[1:]:
        mine, other = ((u.power, u.base_mva, u.source, u.step_up, u.tap) for u in (first, one))
        if not np.allclose(mine, other, rtol=_EQUAL, atol=_EQUAL):
            raise InputError(
                f"generators {first.id!r} and {one.id!r} at bus {bus} differ in PG, QG, MBASE, ZR, ZX, RT, XT or GTAP",
                where=f"{file.path}:{one.line}",
                allowed="one unit in service, or equal ones",
                remedy=f"Set STAT = 0 for units that the recording does not hold. {_BY_HAND}",
            )
    return units


def _own_network(
    file: RawFile, start: int, end: int
) -> tuple[dict[int, tuple[int, ...]], tuple[RawBranch, ...]]:
    """Buses that the unit reaches without passing the recorded one, each with the way to it, and all branches there."""
    if start == end:
        return {}, ()
    at: dict[int, list[RawBranch]] = {}
    for branch in file.branches:
        if branch.in_service and all(file.buses[bus].in_service for bus in branch.buses):
            for bus in branch.buses:
                at.setdefault(bus, []).append(branch)
    ways: dict[int, tuple[int, ...]] = {start: (start,)}
    branches: dict[int, RawBranch] = {}
    waiting = deque([start])
    while waiting:
        bus = waiting.popleft()
        for branch in at.get(bus, ()):
            branches[id(branch)] = branch
            further = branch.buses[branch.buses[0] == bus]
            if further not in ways and further != end:
                ways[further] = (*ways[bus][:_LONGEST], further)
                waiting.append(further)
    return ways, tuple(branches.values())


def _check_alone(file: RawFile, inside: dict[int, tuple[int, ...]], start: int) -> None:
    """Refuse other generators, and devices that are no series elements, in the unit's own network."""
    units = {one.bus: one for one in reversed(file.generators) if one.in_service and one.bus != start}
    for bus, way in inside.items():
        if bus in units:
            raise InputError(
                f"generator {units[bus].id!r} at bus {bus} is reached from bus {start} without passing the recorded "
                f"bus, by the buses {listed(map(str, way), _LONGEST)}",
                where=f"{file.path}:{units[bus].line}",
                allowed="a recorded bus that cuts the unit off from all other generators",
                remedy=_BY_HAND,
            )
    for other in file.others:
        if other.in_service and not inside.keys().isdisjoint(other.buses):
            raise InputError(
                f"the {other.kind} {other.name!r} lies in the unit's network up to the recorded bus",
                where=f"{file.path}:{other.line}",
                allowed="lines, switches and transformers of two windings",
                remedy=_BY_HAND,
            )


def _two_port(
    base_mva: float,
    start: int,
    end: int,
    branches: tuple[RawBranch, ...],
    hanging: tuple[RawShunt, ...],
) -> tuple[complex, complex, complex, complex]:
    """a, c, Z and y of (N5) to (N7) in pu of the network."""
    if start == end:
        return 1.0, 1.0, 0j, 0j
    further = {bus for branch in branches for bus in branch.buses} - {start, end}
    place = {bus: k for k, bus in enumerate((start, end, *sorted(further)))}
    Y = np.zeros((len(place), len(place)), dtype=complex)
    for branch in branches:
        i, j = (place[bus] for bus in branch.buses)
        (t1, t2), (first, second), admittance = branch.ratios, branch.shunts, 1.0 / branch.impedance
        Y[i, i] += admittance / abs(t1) ** 2 + first
        Y[j, j] += admittance / abs(t2) ** 2 + second
        Y[i, j] -= admittance / (t1.conjugate() * t2)
        Y[j, i] -= admittance / (t1 * complex(t2).conjugate())
    for shunt in hanging:
        Y[place[shunt.bus], place[shunt.bus]] += shunt.admittance / base_mva
    try:
        kept = Y[:2, :2] - Y[:2, 2:] @ np.linalg.solve(Y[2:, 2:], Y[2:, :2])
    except np.linalg.LinAlgError:
        kept = np.full((2, 2), np.nan + 0j)
    with np.errstate(all="ignore"):
        z = 1.0 / kept[0, 0]
        found = (-z * kept[0, 1], -z * kept[1, 0], z, kept[1, 1] - z * kept[1, 0] * kept[0, 1])
    a, c, z, y = map(complex, found)
    return a, c, z, y


def _notes(
    file: RawFile,
    units: list[RawGenerator],
    end: int,
    branches: tuple[RawBranch, ...],
    hanging: tuple[RawShunt, ...],
    connection: Connection,
    base: float,
) -> Iterator[str]:
    """What was found, in sentences."""
    first = units[0]
    unit = f"Unit {first.id!r} at bus {first.bus}"
    if branches:
        told = [_told(one, file.base_mva) for one in branches[:6]]
        more = f" and {len(branches) - 6} more branches" if len(branches) > 6 else ""
        yield f"{unit} and the recorded bus {end} are joined by {'; '.join(told)}{more}."
    else:
        yield f"{unit} was recorded at its own bus."
    if hanging:
        total = sum(one.admittance for one in hanging)
        named = listed(f"{one.kind} {one.id!r} at bus {one.bus}" for one in hanging)
        yield (
            f"Between unit and point, as constant admittances of together {total.real:.4g} MW and "
            f"{-total.imag:.4g} Mvar at 1 pu: {named}."
        )
    if first.step_up:
        z = first.step_up
        yield (
            f"The step-up transformer of the generator's record, {z.real:.4g} + j{z.imag:.4g} pu on "
            f"{first.base_mva:g} MVA with the ratio {first.tap:g}, lies between terminal and bus {first.bus}."
        )
    if len(units) > 1:
        yield (
            f"The {len(units)} equal units {', '.join(repr(one.id) for one in units)} at bus {first.bus} count as one "
            f"of {base:g} MVA."
        )
    if first.base_load:
        acts = "only lowers the power" if first.base_load == 1 else "does not act"
        yield (
            f"BASLOD of {unit.lower()} is {first.base_load}: the RAW file says base loaded, its governor {acts}. "
            "A governor of the DYR file acts here all the same; if the recording shows none, leave it out, or let the "
            "search find governor_acting."
        )
    yield (
        f"The terminal lies behind R + jX = {connection.resistance:.4g} + j{connection.reactance:.4g} pu on {base:g} "
        f"MVA and the ratio {connection.tap:.5g}, with a shunt of {connection.conductance:.3g} + "
        f"j{connection.shunt:.3g} pu at the recorded point."
    )
    yield (
        f"The source impedance of the generator is {first.source.real:.4g} + j{first.source.imag:.4g} pu "
        f"({file.path.name}, line {first.line})."
    )


def _told(branch: RawBranch, base_mva: float) -> str:
    z, ratio = branch.impedance, abs(branch.ratios[0] / branch.ratios[1])
    tap = f", ratio {ratio:.5g}" if branch.kind == "transformer" else ""
    return f"{branch.title}, R + jX = {z.real:.4g} + j{z.imag:.4g} pu on {base_mva:g} MVA{tap}"
