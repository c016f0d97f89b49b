"""Text of RAW files of PSS/E: header, sections, records and their fields.

Revisions 33, 34 and 35 differ in their sections and in the columns of their records (see `LAYOUT`). A record is one
line, that of a transformer four or five, with commas or blanks between the fields. An empty field has its default, and
so have fields behind the last one. The first ``/`` outside of quotes begins a comment, and so does ``@!`` at the start
of a line. A record that is ``0`` ends a section, ``Q`` ends the data.

(Siemens PTI, *PSS/E Program Operation Manual*, chapter on power flow raw data; the columns of revision 35 and the
additions of revision 34 are those on which several public readers and files agree.)
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from errorscreen.exceptions import InputError
from errorscreen.models.dyr_text import LINE, Token, end_of_code, number, tokens

REVISIONS = (33, 34, 35)
_RATES = " ".join(f"RATE{k}" for k in range(1, 13))
_OWNERS = "O1 F1 O2 F2 O3 F3 O4 F4"
_HEADER = "IC SBASE REV XFRRAT NXFRAT BASFRQ"

_TRANSFORMER = f"I J K CKT CW CZ CM MAG1 MAG2 NMETR NAME STAT {_OWNERS} VECGRP"
_CONTROL = "RMA RMI VMA VMI NTP TAB CR CX CNXA"
_STEPS = "N1 B1 N2 B2 N3 B3 N4 B4 N5 B5 N6 B6 N7 B7 N8 B8"
_ID_STEPS = " ".join(f"S{k} N{k} B{k}" for k in range(1, 9))

#: columns of the records by section, of revision 33 and of later ones where they differ
LAYOUT: dict[str, dict[int, str]] = {
    "bus": {33: "I NAME BASKV IDE AREA ZONE OWNER VM VA NVHI NVLO EVHI EVLO"},
    "load": {
        33: "I ID STATUS AREA ZONE PL QL IP IQ YP YQ OWNER SCALE INTRPT",
        34: "I ID STATUS AREA ZONE PL QL IP IQ YP YQ OWNER SCALE INTRPT DGENP DGENQ DGENM LOADTYPE",
    },
    "fixed shunt": {33: "I ID STATUS GL BL"},
    "generator": {
        33: f"I ID PG QG QT QB VS IREG MBASE ZR ZX RT XT GTAP STAT RMPCT PT PB {_OWNERS} WMOD WPF",
        34: f"I ID PG QG QT QB VS IREG MBASE ZR ZX RT XT GTAP STAT RMPCT PT PB {_OWNERS} WMOD WPF NREG",
        35: f"I ID PG QG QT QB VS IREG NREG MBASE ZR ZX RT XT GTAP STAT RMPCT PT PB BASLOD {_OWNERS} WMOD WPF",
    },
    "branch": {
        33: f"I J CKT R X B RATEA RATEB RATEC GI BI GJ BJ ST MET LEN {_OWNERS}",
        34: f"I J CKT R X B NAME {_RATES} GI BI GJ BJ ST MET LEN {_OWNERS}",
    },
    "system switching device": {34: f"I J CKT X {_RATES} STAT NSTAT MET STYPE NAME"},
    "transformer": {33: _TRANSFORMER, 34: f"{_TRANSFORMER} ZCOD"},
    "transformer impedance": {33: "R X SBASE R23 X23 SBASE23 R31 X31 SBASE31 VMSTAR ANSTAR"},
    "transformer winding": {
        33: f"WINDV NOMV ANG RATA RATB RATC COD CONT {_CONTROL}",
        34: f"WINDV NOMV ANG {_RATES} COD CONT {_CONTROL} NODE",
        35: f"WINDV NOMV ANG {_RATES} COD CONT NODE {_CONTROL}",
    },
    "switched shunt": {
        33: f"I MODSW ADJM STAT VSWHI VSWLO SWREM RMPCT RMIDNT BINIT {_STEPS}",
        34: f"I MODSW ADJM STAT VSWHI VSWLO SWREM RMPCT RMIDNT BINIT {_STEPS} NREG",
        35: f"I ID MODSW ADJM STAT VSWHI VSWLO SWREG NREG RMPCT RMIDNT BINIT {_ID_STEPS}",
    },
}
#: sections in the order of the file; those with a revision are there from it on
_SECTIONS: tuple[tuple[str, int], ...] = (
    ("system-wide", 34),
    *((name, 33) for name in ("bus", "load", "fixed shunt", "generator", "branch")),
    ("system switching device", 34),
    *(
        (name, 33)
        for name in (
            "transformer", "area", "two-terminal dc", "vsc dc", "impedance correction", "multi-terminal dc",
            "multi-section line", "zone", "inter-area transfer", "owner", "facts", "switched shunt", "gne device",
            "induction machine",
        )
    ),
)  # fmt: skip
#: sections that a file without Q may lack
_LAST = ("gne device", "induction machine")
#: largest number; PSS/E writes 9999 for no limit
_LARGEST = 1e10
#: lines of a record of a dc line
_DC_LINES = 3
_BEGIN = re.compile(r"\bBEGIN\s+([A-Z -]+?)\s+DATA\b", re.IGNORECASE)


class Header(NamedTuple):
    """Case identification.

    Parameters
    ----------
    revision : int
    base_mva : float
        Base of the network.
    frequency : float or None
        Base frequency in Hz; None if the file does not say it.
    line : int
    """

    revision: int
    base_mva: float
    frequency: float | None
    line: int


@dataclass(frozen=True)
class Row:
    """Fields of one line of a record, by the names of `LAYOUT`.

    Parameters
    ----------
    where : str
        File, line and section, for messages.
    names : tuple of str
    tokens : tuple of Token
    line : int
    """

    where: str
    names: tuple[str, ...]
    tokens: tuple[Token, ...]
    line: int

    @classmethod
    def of(cls, where: str, names: str, found: tuple[Token, ...], line: int) -> Row:
        """Row of as many fields as its record may have."""
        row = cls(where, tuple(names.split()), found, line)
        for token in found:
            if token.lone_quote:
                raise InputError(
                    f"the quote {token.text} in column {token.column} has no partner",
                    where=where,
                    allowed="text between two quotes on one line",
                )
        if len(found) > len(row.names):
            raise InputError(
                f"the record has {len(found)} fields",
                where=where,
                allowed=f"at most {len(row.names)}: {', '.join(row.names)}",
                remedy="Check the revision in the first line, and the commas",
            )
        return row

    def text(self, name: str, default: str | None = None) -> str:
        """Text of a field without blanks at its ends; the default for an empty one."""
        place = self.names.index(name) if name in self.names else len(self.tokens)
        found = self.tokens[place].text.strip() if place < len(self.tokens) else ""
        if found or default is not None:
            return found or (default or "")
        raise InputError(
            f"the field {name} is empty",
            where=self.where,
            allowed=f"a value; the fields are {', '.join(self.names[: place + 1])}",
            remedy="Give the value, or check that no line of the record is missing",
        )

    def number(self, name: str, default: float | None = None) -> float:
        """Value of a field; the default for an empty one."""
        found = self.text(name, None if default is None else repr(default))
        value = number(found)
        if not abs(value) <= _LARGEST:  # also NaN
            raise InputError(
                f"{name} is {found[:24]!r}",
                where=self.where,
                allowed=f"a number of at most {_LARGEST:g}",
                remedy="Check the commas and the quotes of the line",
            )
        return value

    def whole(self, name: str, default: int | None = None, allowed: tuple[int, ...] = ()) -> int:
        """Whole number of a field, one of those allowed."""
        value = self.number(name, default)
        if value != round(value) or (allowed and value not in allowed):
            raise InputError(
                f"{name} is {value:g}",
                where=self.where,
                allowed=", ".join(map(str, allowed)) if allowed else "a whole number",
            )
        return int(value)


def sections_of(revision: int) -> tuple[str, ...]:
    """Names of the sections up to the last one that is read."""
    return tuple(name for name, since in _SECTIONS if revision >= since)


def columns(section: str, revision: int) -> str:
    """Columns of a record of a section."""
    known = LAYOUT[section]
    return known[max(since for since in known if since <= revision)]


class Lines:
    """Lines of a file that hold data, read one section after the other."""

    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self._lines = _with_data(text)
        self._ended = False

    def header(self) -> Header:
        """Case identification; the two lines of titles behind it are passed over."""
        line, found, _ = next((one for one in self._lines if one[1]), (1, (), ""))
        where = f"{self.file}:{line}, case identification"
        words = [token.text for token in found]
        if len(words) < 3 or any(math.isnan(number(word)) for word in words[:3] if word):
            raise InputError(
                f"the file begins with {' '.join(words)[:40]!r}",
                where=where,
                allowed="the case identification of a RAW file: IC, SBASE, REV, XFRRAT, NXFRAT, BASFRQ",
                remedy="Save the power flow case as a RAW file; SAV, RAWX, EPC and CDF files are not read",
            )
        row = Row.of(where, _HEADER, found[:6], line)
        revision = row.whole("REV")
        if revision not in REVISIONS:
            raise InputError(
                f"the revision is {revision}",
                where=where,
                allowed=", ".join(map(str, REVISIONS)),
                remedy="Save the case as a RAW file of one of these revisions",
            )
        base, frequency = row.number("SBASE", 100.0), row.number("BASFRQ", 0.0)
        if not 1e-4 <= base <= 1e6 or not 0 <= frequency <= 1000:
            raise InputError(
                f"SBASE is {base:g} MVA and BASFRQ {frequency:g} Hz",
                where=where,
                allowed="0.0001 to 1e6 MVA, and up to 1000 Hz",
            )
        for _ in range(2):
            next(self._lines, None)
        return Header(revision, base, frequency or None, line)

    def section(self, name: str, following: str) -> Iterator[list[tuple[int, tuple[Token, ...]]]]:
        """Records of a section, each a list of the numbers and the fields of its lines."""
        line = 1
        for line, found, comment in self._lines:
            if not found:
                continue
            first = "" if found[0].quoted else found[0].text.upper()
            if first == "Q":
                self._ended, self._lines = True, iter(())
                return
            if first == "0":
                self._check_order(line, name, following, comment)
                return
            record = [(line, found)]
            for _ in range(_more_lines(name, found)):
                further = next(((number, more) for number, more, _ in self._lines if more), None)
                if further is None:
                    raise self._truncated(line, name)
                record.append(further)
            yield record
        if not self._ended and name not in _LAST:
            raise self._truncated(line, name)

    def _truncated(self, line: int, name: str) -> InputError:
        return InputError(
            f"the file ends inside the {name} data",
            where=f"{self.file}:{line}",
            allowed="sections that end with a line 0, and data that end with a line Q",
            remedy="The file is cut off: save the case again",
        )

    def _check_order(self, line: int, name: str, following: str, comment: str) -> None:
        """Refuse a file whose comments name other sections than its revision has."""
        told = _BEGIN.search(comment)
        begun = told[1].lower() if told else following
        if begun != following and begun in {one for one, _ in _SECTIONS}:
            raise InputError(
                f"the {name} data are followed by {begun} data",
                where=f"{self.file}:{line}",
                allowed=f"{following} data",
                remedy="Check the revision in the first line, which decides on the order of the sections",
            )


def _with_data(text: str) -> Iterator[tuple[int, tuple[Token, ...], str]]:
    """Number, fields and comment of each line; those of headings begin with ``@!``."""
    for line, found in enumerate(LINE.finditer(text), start=1):
        start, end = found.span(1)
        if not found[1].lstrip().startswith("@!"):
            code = end_of_code(text, start, end)
            yield line, tuple(tokens(text, [(line, start, code)])), text[code:end]


def _more_lines(section: str, found: tuple[Token, ...]) -> int:
    """Lines of a record behind its first one."""
    if section == "transformer":
        two_windings = len(found) < 3 or number(found[2].text or "0") == 0
        return 3 if two_windings else 4
    return _DC_LINES - 1 if section in ("two-terminal dc", "vsc dc") else 0
