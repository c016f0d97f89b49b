"""A standard model as a part of a unit: the constants of its record, its equations and its start.

A unit has slots (machine, exciter, governor, stabiliser, ...). Each holds one part, and the parts know nothing of each
other but the quantities that pass between them. `errorscreen.models.unit` joins them to a device.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from errorscreen.engine.stages import Call, Equations, reads_of, writes_of
from errorscreen.exceptions import InputError
from errorscreen.parameters import DOMAINS, Parameter

Values = dict[str, NDArray[np.float64]]

#: range of a constant of zero that has no usual one
AROUND_ZERO = 0.5
#: slots of a synchronous unit and of a converter unit, in the order of evaluation; the first one meets the grid
SLOTS = (
    (
        "machine",
        "compensator",
        "stabiliser",
        "over_excitation",
        "under_excitation",
        "exciter",
        "governor",
    ),
    (
        "converter",
        "plant_control",
        "drive_train",
        "pitch_control",
        "aerodynamics",
        "torque_control",
        "electrical_control",
    ),
)


@dataclass(frozen=True)
class Field:
    """One constant of a record.

    Parameters
    ----------
    name : str
        Identifier in the equations, for example ``"Tpdo"``.
    symbol : str
        Spelling of PSS/E, ``"T'do"``.
    unit, description : str
    typical : float
        A usual value.
    lower, upper : float, optional
        Usual range in which it may move in a fit; a constant without one is a candidate only where it is named.
    absent_at_zero : bool
        A value of zero means that the model lacks this, so that it is no candidate: an effect may add it.
    limit : bool
        A limit, which shows only in recordings that reach it, so that it is a candidate only where it is named.
    allowed : str
        ``""``, ``"> 0"``, ``">= 0"``, ``"<= 0"``, ``"a .. b"``, or integers ``"0, 1"``.
    integer : bool
        A flag or a number of a bus (ICON), or text where it names an identifier.
    """

    name: str
    symbol: str
    unit: str
    description: str
    typical: float
    lower: float | None = None
    upper: float | None = None
    allowed: str = ""
    integer: bool = False
    absent_at_zero: bool = False
    limit: bool = False

    def accepts(self, value: float) -> bool:
        """Whether a value lies in the allowed range."""
        if self.allowed in ("", "any"):
            return True
        if ".." in self.allowed:
            low, high = (float(end) for end in self.allowed.split(".."))
            return low <= value <= high
        if self.integer:
            return value in [float(code) for code in self.allowed.split(",")]
        return {"> 0": value > 0, ">= 0": value >= 0, "<= 0": value <= 0}[self.allowed]

    def parameter(self, value: float, prefix: str) -> Parameter | None:
        """Candidate with this value as nominal; None if it is not to move in a fit.

        The usual range is widened to 30 % around the value where that lies at its edge or outside. A value of zero has
        the width of the range as the size of a change that matters.
        """
        if self.lower is None or self.upper is None or (self.absent_at_zero and value == 0):
            return None
        lower, upper = min(self.lower, value - 0.3 * abs(value)), max(self.upper, value + 0.3 * abs(value))
        return self._moving(value, prefix, lower, upper)

    def on_request(self, value: float, prefix: str) -> Parameter | None:
        """Candidate where the user names this constant, which has no usual range; None for flags and what is absent.

        The range is half to twice the value, and `AROUND_ZERO` around zero, as far as the value is allowed there.
        """
        if self.integer or self.lower is not None or (self.absent_at_zero and value == 0):
            return None
        lower, upper = sorted((0.5 * value, 2.0 * value)) if value else (-AROUND_ZERO, AROUND_ZERO)
        least, most = self._ends
        return self._moving(value, prefix, max(lower, least), min(upper, most))

    @property
    def _ends(self) -> tuple[float, float]:
        """Ends of the allowed values."""
        if ".." in self.allowed:
            low, high = (float(end) for end in self.allowed.split(".."))
            return low, high
        return 0.0 if self.allowed[:1] == ">" else -math.inf, 0.0 if self.allowed[:1] == "<" else math.inf

    def _moving(self, value: float, prefix: str, lower: float, upper: float) -> Parameter:
        return Parameter(
            f"{prefix}.{self.name}", value, lower, upper, self.unit, prefix, self.symbol, self.description,
            scale=abs(value) or upper - lower, domain=self.allowed if self.allowed in DOMAINS else "",
        )  # fmt: skip


def record(rows: str) -> tuple[Field, ...]:
    """Fields of a record from ``name [= symbol] | unit | typical | range | allowed | description`` a line.

    The order is that of the record in a DYR file. A range is ``a .. b``, ``limit`` or ``-``, perhaps with ``unless 0``
    behind it; the unit of a flag is ``code``.

    Examples
    --------
    >>> found = record("Tpdo = T'do | s | 6.0 | 2 .. 12 | > 0 | d-axis transient open-circuit time constant")
    >>> found[0].name, found[0].symbol, found[0].upper
    ('Tpdo', "T'do", 12.0)
    """
    fields = []
    for row in rows.strip().splitlines():
        name, unit, typical, span, allowed, description = (cell.strip() for cell in row.split("|"))
        name, _, symbol = (text.strip() for text in name.partition("="))
        span, unless, _ = span.partition(" unless 0")
        lower, upper = (float(end) for end in span.split("..")) if ".." in span else (None, None)
        fields.append(
            Field(
                name, symbol or name, unit, description, float(typical), lower, upper,
                allowed="" if allowed in ("any", "-") else allowed,
                integer=unit in ("code", "bus", "id"),
                absent_at_zero=bool(unless),
                limit=span == "limit",
            )
        )  # fmt: skip
    return tuple(fields)


class Limit(NamedTuple):
    """A quantity that starts between two limits of a record.

    Parameters
    ----------
    quantity : str
        In words, for example ``"field voltage"``.
    value, lower, upper : ndarray
    names : tuple of str
        Symbols of the lower and the upper limit.
    """

    quantity: str
    value: NDArray[np.float64]
    lower: NDArray[np.float64] | float
    upper: NDArray[np.float64] | float
    names: tuple[str, str]


class Conflict(NamedTuple):
    """Values of records that contradict each other, or the start.

    Parameters
    ----------
    found : ndarray of bool, shape (n,) or ()
        Rows that have it.
    text : str
        Sentence with the names of `values` in braces.
    values : mapping of str to ndarray
    """

    found: NDArray[np.bool_]
    text: str
    values: Values


class Start(NamedTuple):
    """Equilibrium of a part.

    Parameters
    ----------
    states : mapping of str to ndarray
    setpoints : mapping of str to ndarray
        References and other constants that follow from the start.
    limits : tuple of Limit
    conflicts : tuple of Conflict
    """

    states: Values
    setpoints: Values
    limits: tuple[Limit, ...] = ()
    conflicts: tuple[Conflict, ...] = ()


def no_start(values: Values) -> Start:
    """Start of a part without states and references."""
    return Start({}, {})


@dataclass(frozen=True)
class Part:
    """A standard model in a slot.

    Parameters
    ----------
    name : str
        Name in a DYR file, ``"ESST4B"``.
    slot : str
        One of `SLOTS`.
    title : str
    fields : tuple of Field
        Constants in the order of the record.
    stages : tuple of callable
        Equations (`errorscreen.engine.stage`). They read and write their own constants, states, references and signals,
        and the quantities that pass between parts, by name.
    ports : tuple of str
        Quantities that it writes for other parts; all other quantities that it writes are its own.
    states, setpoints : tuple of str
    start : callable
        ``start(values) -> Start`` from the constants and the quantities of other parts at the start, arrays (n,) or ().
    closing : tuple of callable
        Stages behind those of all parts.
    rules : tuple of str
        What a record must hold: ``"VRMIN < VRMAX"`` (a chain), or ``"TC needs TB"`` (TC may be other than zero only if
        TB is). A term may be a product, ``"M * N <= 8"``, and a need may have alternatives, ``"A5 needs A1 or A3"``.
    formula : str
        Equations in one line, for tables.
    source : str
    checked : str
        What outside trajectory the part is compared with; empty: none.
    aliases : tuple of str
        Other names of the same record.
    gate : str
        State of a governor that is the gate or valve; empty where it has none.
    behind : callable, optional
        Of a converter: its current ``Ir``, ``Ii`` on the voltage ``Er``, ``Ei`` behind ``R_grid`` + j ``X_grid``.
    """

    name: str
    slot: str
    title: str
    fields: tuple[Field, ...]
    stages: tuple[Equations, ...]
    ports: tuple[str, ...]
    states: tuple[str, ...] = ()
    setpoints: tuple[str, ...] = ()
    start: Callable[[Values], Start] = no_start
    closing: tuple[Equations, ...] = ()
    rules: tuple[str, ...] = ()
    formula: str = ""
    source: str = ""
    checked: str = ""
    aliases: tuple[str, ...] = field(default=())
    gate: str = ""
    behind: Equations | None = None

    @property
    def typical(self) -> dict[str, float]:
        """Usual values of the record, by name."""
        return {one.name: one.typical for one in self.fields}

    @cached_property
    def own(self) -> frozenset[str]:
        """Names that belong to this part alone, all others pass between parts."""
        named = {*(one.name for one in self.fields), *self.states, *self.setpoints}
        signals = {
            name for one in (*self.stages, *self.closing) for name in writes_of(one) if name[:2] != "d_"
        }
        return frozenset((named | signals) - {*self.ports})

    def qualified(self, name: str) -> str:
        """Name of a quantity in the model of a unit."""
        if name[:2] == "d_" and name[2:] in self.states:
            return f"d_{self.qualified(name[2:])}"
        return f"{self.name}.{name}" if name in self.own else name

    def call(self, function: Equations) -> Call:
        """Bind equations of this part to the names of the model."""
        reads, writes = reads_of(function), writes_of(function)
        return Call(function, tuple(map(self.qualified, reads)), tuple(map(self.qualified, writes)))

    def local(self, values: Mapping[str, NDArray[np.float64]]) -> Values:
        """Quantities of a unit under the names of this part."""
        return {
            **values,
            **{name: values[self.qualified(name)] for name in self.own if self.qualified(name) in values},
        }

    def broken(self, values: Mapping[str, NDArray[np.float64] | float]) -> dict[str, NDArray[np.bool_]]:
        """Rules that values of the record do not keep, each with where (n,)."""
        found = {}
        for rule in self.rules:
            wrong = np.asarray(_broken(rule, values))
            if wrong.any():
                found[rule] = wrong
        return found

    def check(self, values: Mapping[str, float], where: str) -> None:
        """Refuse values outside their allowed range, or that break a rule, with `InputError`."""
        for error in self.wrong(values, lambda name: where):
            raise error

    def wrong(self, values: Mapping[str, float], where: Callable[[str], str]) -> Iterator[InputError]:
        """Values outside their allowed range, then broken rules.

        ``where(name)`` tells the place of a constant, ``where("")`` that of the record.
        """
        for one in self.fields:
            value = values[one.name]
            if not np.isfinite(value) or not one.accepts(value):
                yield InputError(
                    f"{one.symbol} is {value:g}",
                    where=where(one.name),
                    allowed=f"{one.allowed or 'a finite number'} ({one.description})",
                )
        for rule in self.broken(values):
            names = [one for one in self.fields if re.search(rf"\b{one.name}\b", rule)]
            yield InputError(
                " and ".join(f"{one.symbol} is {values[one.name]:g}" for one in names),
                where=where(""),
                allowed=in_words(rule, {one.name: one.symbol for one in names}),
                remedy="; ".join(f"{one.symbol}: {one.description}" for one in names),
            )


def in_words(rule: str, symbols: Mapping[str, str]) -> str:
    """A rule for messages.

    Examples
    --------
    >>> in_words("TC needs TB", {})
    'TC other than 0 only with TB other than 0'
    """
    for name, symbol in symbols.items():
        rule = re.sub(rf"\b{name}\b", symbol.replace("\\", ""), rule)
    one, needs, other = rule.partition(" needs ")
    return f"{one} other than 0 only with {other} other than 0" if needs else rule


def _broken(rule: str, values: Mapping[str, NDArray[np.float64] | float]) -> NDArray[np.bool_]:
    def value(term: str) -> NDArray[np.float64]:
        factors = (values[name] if name in values else float(name) for name in term.split(" * "))
        return np.asarray(math.prod(factors))

    one, needs, other = rule.partition(" needs ")
    if needs:
        lacking = [value(term) == 0 for term in other.split(" or ")]
        return (value(one) != 0) & reduce(np.logical_and, lacking)
    names, wrong = re.split(r"\s+(<=?)\s+", rule), np.zeros((), dtype=bool)
    for left, sign, right in zip(names[::2], names[1::2], names[2::2], strict=False):
        a, b = value(left), value(right)
        wrong = wrong | ~((a < b) if sign == "<" else (a <= b))
    return wrong


def holding(
    value: NDArray[np.float64], lower: Any, upper: Any
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Limits that hold the start: recorded values are inexact, and a unit at rest at its limit has to stay at rest.

    Examples
    --------
    >>> [float(end) for end in holding(np.array(1.01), 0.0, 1.0)]
    [0.0, 1.01]
    """
    return np.minimum(lower, value), np.maximum(upper, value)
