r"""Elements of the network in a RAW file, and how they follow from the fields of its records.

Impedances and admittances of branches are in per unit of the base of the network and of the base voltages of the buses.
A transformer is an ideal ratio :math:`t_1` at its first bus, the impedance, and an ideal ratio :math:`t_2` at its
second bus. With the base :math:`S_b` of the network and :math:`S_{12}` of the windings in MVA:

.. math::

    t &= \text{WINDV}\ \text{(CW = 1)},\quad \text{WINDV}/\text{BASKV}\ \text{(CW = 2)},\quad
        \text{WINDV}\,\text{NOMV}/\text{BASKV}\ \text{(CW = 3)}                                    & (N1)\\
    Z &= R + jX\ \text{(CZ = 1)},\quad (R + jX)\,S_b/S_{12}\ \text{(CZ = 2)}                        & (N2)\\
    Z &= \Big(r + j\sqrt{X^2 - r^2}\Big)\,S_b/S_{12},\quad r = R/(10^6 S_{12})\ \text{(CZ = 3)}     & (N3)\\
    Y_m &= \text{MAG1} + j\,\text{MAG2}\ \text{(CM = 1)},\quad
        g - j\sqrt{y^2 - g^2}\ \text{(CM = 2)},\quad
        g = \frac{\text{MAG1}}{10^6 S_b} k,\ y = \text{MAG2}\frac{S_{12}}{S_b} k,\
        k = \Big(\frac{\text{BASKV}}{\text{NOMV}}\Big)^2                                          & (N4)

NOMV = 0 stands for BASKV. The impedance is taken on the base voltages of the buses whatever NOMV is; of public readers,
most do so and some do not.

(Siemens PTI, *PSS/E Program Operation Manual*, transformer data.)
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

from errorscreen.exceptions import InputError
from errorscreen.models.raw_text import Row

#: plausible bases in MVA and kV, and ratios; numbers far beyond come from shifted columns
_BASES, _KV, _RATIOS = (1e-4, 1e6), (1e-3, 1e4), (0.01, 100.0)
#: least reactance of a branch in pu
_LEAST_X = 1e-9


class RawBus(NamedTuple):
    """Bus: number, name, base voltage in kV (0 if unknown), type code, voltage in pu, and line in the file."""

    number: int
    name: str
    base_kv: float
    kind: int
    voltage: complex
    line: int

    @property
    def in_service(self) -> bool:
        """Whether it is not isolated."""
        return self.kind != 4


class RawShunt(NamedTuple):
    """Load or shunt at a bus as a constant admittance in MVA at 1 pu of voltage, with its power in MVA where a load."""

    kind: str
    bus: int
    id: str
    in_service: bool
    admittance: complex
    line: int


class RawGenerator(NamedTuple):
    """Generator: power in MVA, base in MVA, and in pu of that base its source impedance and its step-up transformer.

    `base_load` is the flag BASLOD of revision 35. 1: the governor only lowers the power, 2: it does not act.
    """

    bus: int
    id: str
    in_service: bool
    power: complex
    base_mva: float
    source: complex
    step_up: complex
    tap: float
    line: int
    base_load: int = 0


class RawBranch(NamedTuple):
    """Line, switch or transformer of two windings, see the equations of this module; `shunts` at its two ends in pu."""

    kind: str
    buses: tuple[int, int]
    circuit: str
    name: str
    in_service: bool
    impedance: complex
    ratios: tuple[complex, complex]
    shunts: tuple[complex, complex]
    line: int

    @property
    def title(self) -> str:
        """The branch in words."""
        return (
            f"{self.kind} {self.name or self.circuit!r} between the buses {self.buses[0]} and {self.buses[1]}"
        )


class RawOther(NamedTuple):
    """Device that is only looked up: transformer of three windings, dc line, FACTS device, induction machine."""

    kind: str
    buses: tuple[int, ...]
    name: str
    in_service: bool
    line: int


def bus_of(rows: list[Row]) -> RawBus:
    """Bus of a record."""
    row = rows[0]
    number, kv = row.whole("I"), _voltage(row, "BASKV", 0.0)
    if not 0 < number < 1_000_000:
        raise InputError(f"the bus number is {number}", where=row.where, allowed="1 to 999999")
    magnitude, angle = _within(row, "VM", row.number("VM", 1.0), 0.01, 10.0), row.number("VA", 0.0)
    voltage = cmath.rect(magnitude, math.radians(angle))
    return RawBus(number, row.text("NAME", ""), kv, row.whole("IDE", 1, (1, 2, 3, 4)), voltage, row.line)


def load_of(rows: list[Row], voltage: float) -> RawShunt:
    """Load of a record, as the admittance that takes the same power at the voltage of the case."""
    row = rows[0]

    def power(name: str) -> complex:
        return complex(row.number(f"P{name}", 0.0), row.number(f"Q{name}", 0.0))

    constant, current = power("L"), complex(row.number("IP", 0.0), row.number("IQ", 0.0))
    admittance = complex(row.number("YP", 0.0), row.number("YQ", 0.0))  # YQ of an inductive load is negative
    if row.whole("DGENM", 0, (0, 1)) == 1:
        constant -= complex(row.number("DGENP", 0.0), row.number("DGENQ", 0.0))
    admittance += constant.conjugate() / voltage**2 + current.conjugate() / voltage
    status = row.whole("STATUS", 1, (0, 1)) == 1
    return RawShunt("load", row.whole("I"), row.text("ID", "1"), status, admittance, row.line)


def fixed_shunt_of(rows: list[Row]) -> RawShunt:
    """Fixed shunt of a record."""
    row = rows[0]
    admittance = complex(row.number("GL", 0.0), row.number("BL", 0.0))
    status = row.whole("STATUS", 1, (0, 1)) == 1
    return RawShunt("shunt", row.whole("I"), row.text("ID", "1"), status, admittance, row.line)


def switched_shunt_of(rows: list[Row]) -> RawShunt:
    """Switched shunt of a record with the susceptance that the case says."""
    row = rows[0]
    status = row.whole("ST" if "ST" in row.names else "STAT", 1, (0, 1)) == 1
    id = row.text("ID", "1") if "ID" in row.names else "1"
    return RawShunt(
        "switched shunt", row.whole("I"), id, status, complex(0.0, row.number("BINIT", 0.0)), row.line
    )


def generator_of(rows: list[Row], base_mva: float) -> RawGenerator:
    """Generator of a record."""
    row = rows[0]
    base = _within(row, "MBASE", row.number("MBASE", base_mva), *_BASES)
    tap = _within(row, "GTAP", row.number("GTAP", 1.0), *_RATIOS)
    return RawGenerator(
        row.whole("I"),
        row.text("ID", "1").upper(),
        row.whole("STAT", 1, (0, 1)) == 1,
        complex(row.number("PG", 0.0), row.number("QG", 0.0)),
        base,
        complex(row.number("ZR", 0.0), row.number("ZX", 1.0)),
        complex(row.number("RT", 0.0), row.number("XT", 0.0)),
        tap,
        row.line,
        row.whole("BASLOD", 0, (0, 1, 2)) if "BASLOD" in row.names else 0,
    )


def _series(row: Row, impedance: complex) -> complex:
    if abs(impedance.imag) < _LEAST_X:
        raise InputError(
            f"X is {impedance.imag:g} (R is {impedance.real:g})",
            where=row.where,
            allowed=f"X of at least {_LEAST_X:g} pu, or as much below 0",
            remedy="Of a connection without impedance, give a small X such as 0.0001",
        )
    return impedance


def line_of(rows: list[Row]) -> RawBranch:
    """Line of a record; half of its charging B is at each end, beside the shunts of the line."""
    row = rows[0]
    half = 0.5j * row.number("B", 0.0)
    shunts = tuple(complex(row.number(f"G{end}", 0.0), row.number(f"B{end}", 0.0)) + half for end in "IJ")
    return RawBranch(
        "line",
        (row.whole("I"), abs(row.whole("J"))),  # a minus marks the metered end in old files
        row.text("CKT", "1"),
        row.text("NAME", "") if "NAME" in row.names else "",
        row.whole("ST", 1, (0, 1)) == 1,
        _series(row, complex(row.number("R", 0.0), row.number("X"))),
        (1.0, 1.0),
        (shunts[0], shunts[1]),
        row.line,
    )


def switch_of(rows: list[Row]) -> RawBranch:
    """Switching device of a record; only STAT = 1 is closed."""
    row = rows[0]
    return RawBranch(
        "switch", (row.whole("I"), row.whole("J")), row.text("CKT", "1"), row.text("NAME", ""),
        row.whole("STAT", 1) == 1, _series(row, complex(0.0, row.number("X", 0.0001))), (1.0, 1.0), (0j, 0j), row.line,
    )  # fmt: skip


def transformer_of(rows: list[Row], base_mva: float, base_kv: dict[int, float]) -> RawBranch | RawOther:
    """Transformer of a record, (N1) to (N4); of one with three windings, only where it is."""
    head, impedance, *windings = rows
    buses = tuple(abs(head.whole(name, 0 if name == "K" else None)) for name in "IJK")
    name, circuit = head.text("NAME", ""), head.text("CKT", "1")
    turns, ohms, magnetising = (
        head.whole(code, 1, (1, 2, 3)[:n]) for code, n in (("CW", 3), ("CZ", 3), ("CM", 2))
    )
    if buses[2]:
        # two to four: one winding is out of service, the second, the third or the first
        out = {0: buses, 2: buses[1:2], 3: buses[2:], 4: buses[:1]}
        status = head.whole("STAT", 1, (0, 1, 2, 3, 4))
        inside = tuple(bus for bus in buses if bus not in out.get(status, ()))
        return RawOther("transformer of three windings", inside, name or circuit, bool(inside), head.line)
    status = head.whole("STAT", 1, (0, 1))
    base = _within(impedance, "SBASE1-2", impedance.number("SBASE", base_mva), *_BASES)
    z = complex(impedance.number("R", 0.0), impedance.number("X"))
    if ohms == 3:
        resistance = z.real / (1e6 * base)
        z = complex(
            resistance, math.copysign(_leg(impedance, z.imag, resistance, "X1-2", "load loss"), z.imag)
        )
    if ohms > 1:
        z *= base_mva / base
    ratios = [_ratio(row, turns, base_kv[bus]) for row, bus in zip(windings, buses, strict=False)]
    if windings[0].whole("TAB", 0) and status:
        kind = "transformer with a table of impedance correction"
        return RawOther(kind, (buses[0], buses[1]), name or circuit, True, head.line)
    first = cmath.rect(ratios[0], math.radians(windings[0].number("ANG", 0.0)))
    y = complex(head.number("MAG1", 0.0), head.number("MAG2", 0.0))
    if magnetising == 2:
        nominal = _voltage(windings[0], "NOMV", 0.0) or base_kv[buses[0]] or 1.0
        k = ((base_kv[buses[0]] or nominal) / nominal) ** 2
        g, size = y.real / (1e6 * base_mva) * k, y.imag * base / base_mva * k
        y = complex(g, -_leg(head, size, g, "MAG2", "no-load loss"))
    return RawBranch(
        "transformer", (buses[0], buses[1]), circuit, name, status == 1, _series(impedance, z),
        (first, ratios[1]), (y, 0j), head.line,
    )  # fmt: skip


def _leg(row: Row, size: float, part: float, name: str, loss: str) -> float:
    """Other leg of a right triangle."""
    if abs(size) < abs(part):
        raise InputError(
            f"{name} is {size:g} pu, less than the part {part:g} pu that belongs to the {loss}",
            where=row.where,
            allowed="a magnitude of at least that part",
            remedy="With CZ = 3 and CM = 2 losses are in watts and magnitudes in pu: check the codes",
        )
    return math.sqrt(size**2 - part**2)


def _ratio(row: Row, code: int, base_kv: float) -> float:
    """Ratio of a winding in pu of the base voltage of its bus, (N1)."""
    if code == 2 and base_kv == 0:
        raise InputError(
            "WINDV is in kV, but its bus has no BASKV", where=row.where, allowed="a bus with a base voltage"
        )
    given = row.number("WINDV", base_kv if code == 2 else 1.0)
    nominal = _voltage(row, "NOMV", 0.0) or base_kv
    ratio = {1: given, 2: given / (base_kv or 1.0), 3: given * (nominal / base_kv if base_kv else 1.0)}[code]
    if not _RATIOS[0] <= ratio <= _RATIOS[1]:
        raise InputError(
            f"WINDV is {given:g}, which is {ratio:g} of the base voltage of its bus",
            where=row.where,
            allowed=f"a ratio from {_RATIOS[0]:g} to {_RATIOS[1]:g}",
            remedy="WINDV is in pu with CW = 1 and 3, and in kV with CW = 2",
        )
    return ratio


def _voltage(row: Row, name: str, default: float) -> float:
    """Voltage in kV, or 0 where it is unknown."""
    value = row.number(name, default)
    return value if value == 0 else _within(row, name, value, *_KV)


def _within(row: Row, name: str, value: float, low: float, high: float) -> float:
    if not low <= value <= high:
        raise InputError(f"{name} is {value:g}", where=row.where, allowed=f"{low:g} to {high:g}")
    return value
