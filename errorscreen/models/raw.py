"""Power flow files of PSS/E (RAW): the network around a unit."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from errorscreen._runtime.display import Displayed, listed
from errorscreen.exceptions import InputError
from errorscreen.models.dyr_text import read_text
from errorscreen.models.raw_elements import (
    RawBranch,
    RawBus,
    RawGenerator,
    RawOther,
    RawShunt,
    bus_of,
    fixed_shunt_of,
    generator_of,
    line_of,
    load_of,
    switch_of,
    switched_shunt_of,
    transformer_of,
)
from errorscreen.models.raw_text import Lines, Row, columns, sections_of

if TYPE_CHECKING:
    import pandas as pd

#: rows of the columns of a transformer behind the first one
_TRANSFORMER_ROWS = ("transformer", "transformer impedance", *["transformer winding"] * 3)
#: buses of devices that are only looked up: for each line of a record, the places of its bus numbers
_OTHER_BUSES = {
    "two-terminal dc": ((), (0,), (0,)),
    "vsc dc": ((), (0,), (0,)),
    "facts": ((1, 2),),
    "gne device": ((3,),),
    "induction machine": ((0,),),
}
_TITLES = {"two-terminal dc": "dc line", "vsc dc": "VSC dc line", "facts": "FACTS device"}
T = TypeVar("T", bound=RawShunt | RawGenerator | RawBranch)


class RawFile(Displayed):
    """A power flow file.

    Parameters
    ----------
    path : path-like
        For messages.
    text : str

    Attributes
    ----------
    revision : int
        33, 34 or 35.
    base_mva : float
        Base of the network in MVA.
    frequency : float or None
        Base frequency in Hz; None if the file does not say it.
    buses : dict of int to RawBus
    loads, shunts : list of RawShunt
    generators : list of RawGenerator
    branches : list of RawBranch
        Lines, switches and transformers of two windings.
    others : list of RawOther
        Transformers of three windings, dc lines, FACTS devices, induction machines and others, only where they are.

    Raises
    ------
    InputError
        If the text is no RAW file of these revisions, or one of its records cannot be read; with its line.

    Examples
    --------
    >>> text = '''0, 100.0, 33, 0, 1, 60.0 / a case
    ...
    ...
    ... 1,'GEN', 20.0,2
    ... 2,'GRID',138.0,3
    ... 0 / END OF BUS DATA, BEGIN LOAD DATA
    ... 0 / END OF LOAD DATA, BEGIN FIXED SHUNT DATA
    ... 0 / END OF FIXED SHUNT DATA, BEGIN GENERATOR DATA
    ... 1,'1',80.0,10.0,,,1.02,,100.0,0.0,0.25
    ... 0 / END OF GENERATOR DATA, BEGIN BRANCH DATA
    ... 1,2,'1',0.01,0.12
    ... Q'''
    >>> file = RawFile("case.raw", text)
    >>> file.generators[0].base_mva, file.branches[0].impedance, file.bus("grid").number
    (100.0, (0.01+0.12j), 2)
    """

    def __init__(self, path: str | os.PathLike[str], text: str) -> None:
        self.path = Path(path)
        lines = Lines(str(path), text)
        self.revision, self.base_mva, self.frequency, _ = lines.header()
        self.buses: dict[int, RawBus] = {}
        self.loads: list[RawShunt] = []
        self.shunts: list[RawShunt] = []
        self.generators: list[RawGenerator] = []
        self.branches: list[RawBranch] = []
        self.others: list[RawOther] = []
        self._seen: dict[tuple[Any, ...], int] = {}
        makers: dict[str, Callable[[list[Row]], None]] = {
            "bus": self._add_bus,
            "load": lambda rows: self._add(self.loads, load_of(rows, self._voltage(rows[0])), rows),
            "fixed shunt": lambda rows: self._add(self.shunts, fixed_shunt_of(rows), rows),
            "switched shunt": lambda rows: self._add(self.shunts, switched_shunt_of(rows), rows),
            "generator": lambda rows: self._add(self.generators, generator_of(rows, self.base_mva), rows),
            "branch": lambda rows: self._add(self.branches, line_of(rows), rows),
            "system switching device": lambda rows: self._add(self.branches, switch_of(rows), rows),
            "transformer": self._add_transformer,
        }
        names = sections_of(self.revision)
        for name, following in zip(names, (*names[1:], ""), strict=True):
            for record in lines.section(name, following):
                where = f"{path}:{record[0][0]}, {name} data"
                if name in makers:
                    makers[name]([*self._rows(name, record, where)])
                elif name in _OTHER_BUSES:
                    self._add_other(name, record)

    def bus(self, name: int | str, where: str | None = None) -> RawBus:
        """Bus by its number, its name, or its name and base voltage as in a DYR file; for errors also `where`."""
        where = where or f"file {self.path}"
        text = " ".join(str(name).split()).upper()
        if text.isdecimal() and int(text) in self.buses:
            return self.buses[int(text)]
        found = [one for one in self.buses.values() if text in _names(one)] if text else []
        if len(found) == 1:
            return found[0]
        if found:
            raise InputError(
                f"the name {name!r} belongs to {len(found)} buses",
                where=where,
                allowed=listed(str(one.number) for one in found),
                remedy="Give the number of the bus",
            )
        raise InputError(
            f"bus {name!r} is not in {self.path}",
            where=where,
            allowed=listed(f"{one.number} {one.name!r}" for one in self.buses.values()),
        )

    def table(self) -> pd.DataFrame:
        """All that was understood, one row for each element; impedances and ratios in pu of the network."""
        import pandas as pd

        names = [
            "kind",
            "buses",
            "id",
            "in_service",
            "P",
            "Q",
            "R",
            "X",
            "ratio",
            "G",
            "B",
            "base_mva",
            "line",
        ]
        return pd.DataFrame([{**row} for row in self._table()], columns=names)

    def summary(self) -> str:
        """Number of elements of each kind, in words."""
        counts: dict[str, int] = {}
        for row in self._table():
            counts[row["kind"]] = counts.get(row["kind"], 0) + 1
        found = ", ".join(f"{kind} {n}" for kind, n in counts.items())
        frequency = "unknown frequency" if self.frequency is None else f"{self.frequency:g} Hz"
        return f"{self.path}: revision {self.revision}, {self.base_mva:g} MVA, {frequency}; {found}"

    def _table(self) -> Iterator[dict[str, Any]]:
        for bus in self.buses.values():
            yield {
                "kind": "bus", "buses": (bus.number,), "id": bus.name, "in_service": bus.in_service, "line": bus.line,
            }  # fmt: skip
        for unit in self.generators:
            yield {
                "kind": "generator", "buses": (unit.bus,), "id": unit.id, "in_service": unit.in_service,
                "P": unit.power.real, "Q": unit.power.imag, "R": unit.source.real, "X": unit.source.imag,
                "ratio": unit.tap, "base_mva": unit.base_mva, "line": unit.line,
            }  # fmt: skip
        for shunt in (*self.loads, *self.shunts):
            yield {
                "kind": shunt.kind, "buses": (shunt.bus,), "id": shunt.id, "in_service": shunt.in_service,
                "G": shunt.admittance.real / self.base_mva, "B": shunt.admittance.imag / self.base_mva,
                "line": shunt.line,
            }  # fmt: skip
        for one in self.branches:
            total = sum(one.shunts)
            yield {
                "kind": one.kind, "buses": one.buses, "id": one.circuit, "in_service": one.in_service,
                "R": one.impedance.real, "X": one.impedance.imag, "ratio": abs(one.ratios[0] / one.ratios[1]),
                "G": total.real, "B": total.imag, "line": one.line,
            }  # fmt: skip
        for other in self.others:
            yield {
                "kind": other.kind, "buses": other.buses, "id": other.name, "in_service": other.in_service,
                "line": other.line,
            }  # fmt: skip

    def _rows(self, name: str, record: list[tuple[int, Any]], where: str) -> Iterator[Row]:
        kinds = _TRANSFORMER_ROWS if name == "transformer" else (name,)
        for (line, found), kind in zip(record, kinds, strict=False):
            place = where if line == record[0][0] else f"{self.path}:{line}, {kind} data"
            yield Row.of(place, columns(kind, self.revision), found, line)

    def _voltage(self, row: Row) -> float:
        return abs(self._known(row, "I").voltage)

    def _known(self, row: Row, name: str) -> RawBus:
        """Bus of a field, which must be in the bus data."""
        number = abs(row.whole(name))
        if number not in self.buses:
            raise InputError(
                f"{name} is bus {number}, which is not in the bus data",
                where=row.where,
                allowed=listed(map(str, self.buses)) or "a bus of the file; it has none",
            )
        return self.buses[number]

    def _add_bus(self, rows: list[Row]) -> None:
        bus = bus_of(rows)
        self._once(("bus", bus.number), rows[0], f"bus {bus.number}")
        self.buses[bus.number] = bus

    def _add(self, elements: list[T], element: T, rows: list[Row]) -> None:
        """Keep an element; its buses must be known, and each is given once."""
        row = rows[0]
        ends = [self._known(row, name).number for name in ("I", "J") if name in row.names]
        kind = "generator" if isinstance(element, RawGenerator) else element.kind
        id = element.circuit if isinstance(element, RawBranch) else element.id
        if len(ends) == 2 and ends[0] == ends[1]:
            raise InputError(f"both ends are bus {ends[0]}", where=row.where, allowed="two buses")
        self._once((kind, *sorted(ends), id), row, f"{kind} {id!r} at bus {' and '.join(map(str, ends))}")
        elements.append(element)

    def _add_transformer(self, rows: list[Row]) -> None:
        known = [self._known(rows[0], name) for name in ("I", "J")]
        if rows[0].number("K", 0):
            known.append(self._known(rows[0], "K"))
        element = transformer_of(rows, self.base_mva, {bus.number: bus.base_kv for bus in known})
        if isinstance(element, RawBranch):
            self._add(self.branches, element, rows)
        else:
            self.others.append(element)

    def _add_other(self, name: str, record: list[tuple[int, Any]]) -> None:
        texts = [
            found[place].text
            for (_, found), places in zip(record, _OTHER_BUSES[name], strict=True)
            for place in places
            if place < len(found)
        ]
        buses = tuple(int(text) for text in texts if text.isdecimal() and int(text) in self.buses)
        self.others.append(
            RawOther(_TITLES.get(name, name), buses, record[0][1][0].text.strip(), True, record[0][0])
        )

    def _once(self, key: tuple[Any, ...], row: Row, what: str) -> None:
        if key in self._seen:
            raise InputError(
                f"{what} is given twice, first in line {self._seen[key]}",
                where=row.where,
                allowed="each element once",
                remedy="Remove one of the records, or give it another identifier",
            )
        self._seen[key] = row.line

    def _facts(self) -> dict[str, Any]:
        return {
            "path": str(self.path),
            "revision": self.revision,
            "buses": len(self.buses),
            "generators": len(self.generators),
            "branches": len(self.branches),
        }


def _names(bus: RawBus) -> set[str]:
    """Names that a bus goes by: that of the file, and the extended one with the base voltage behind it."""
    name = " ".join(bus.name.split()).upper()
    return {name, *(f"{name} {bus.base_kv:{form}}" for form in ("g", ".1f", ".2f", ".3f", ".4f"))}


def read_raw(path: str | os.PathLike[str]) -> RawFile:
    """Read a power flow file of PSS/E.

    Parameters
    ----------
    path : path-like
        A RAW file of revision 33, 34 or 35 in UTF-8 or Latin-1.

    Returns
    -------
    RawFile
        ``read_raw(path).table()`` tells what was understood.

    Raises
    ------
    InputError
        If the path is no readable RAW file; with the line and what would be allowed there.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(
            f"the path is of type {type(path).__name__}", where="read_raw", allowed="the path of a file"
        )
    return RawFile(path, read_text(Path(path), "RAW")[0])
