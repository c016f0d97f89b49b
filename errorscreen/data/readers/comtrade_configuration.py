"""Configuration of a COMTRADE record, checked line by line: IEEE C37.111 of 1991, 1999 and 2013."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from errorscreen.data.headers import spelled
from errorscreen.data.readers.tables import numbered
from errorscreen.exceptions import InputError

#: kinds of data
KINDS = ("ASCII", "BINARY", "BINARY32", "FLOAT32")
#: seconds of one unit of the stamps where a configuration states no other
TICK = 1e-6
#: units as some recorders write them; in the headers of other files these letters are phases
_SMALL = {"v": "V", "a": "A"}
#: more samples than any file that is read can hold
_MOST_SAMPLES = 1e10


@dataclass(frozen=True)
class Channel:
    """Analogue channel: name, phase and unit, and the factors from stored numbers to primary values.

    `rated` is the primary value of its transformer, 0 where the record lacks it; `skew` seconds after the stamp each
    sample was taken.
    """

    name: str
    phase: str
    unit: str
    factor: float
    offset: float
    rated: float
    skew: float


@dataclass(frozen=True)
class Configuration:
    """What a configuration states; `rates` are samples a second, each with the last sample it holds for."""

    revision: int
    channels: tuple[Channel, ...]
    n_status: int
    frequency: float
    rates: tuple[tuple[float, int], ...]
    start: str
    trigger: str
    kind: str
    #: seconds of one unit of the stamps
    tick: float


class _Lines:
    """Lines of a configuration, for messages with their number."""

    def __init__(self, content: bytes, source: str) -> None:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
        self._lines = text.replace("\x1a", "").splitlines()
        self.number, self._source = 0, source

    @property
    def where(self) -> str:
        return f"{self._source}, line {self.number} of the configuration"

    def cells(self, *, optional: bool = False) -> list[str]:
        """Cells of the next line."""
        self.number += 1
        if self.number > len(self._lines):
            if optional:
                return [""]
            raise InputError("the configuration ends too early", where=self.where, allowed="all of its lines")
        return [cell.strip() for cell in self.line.split(",")]

    @property
    def line(self) -> str:
        """The line that `cells` returned last."""
        return self._lines[self.number - 1]

    def numbers(self, cells: Sequence[str], kind: Any = float) -> list[Any]:
        """Cells as numbers; an empty one is zero."""
        try:
            found = [kind(cell or 0) for cell in cells]
            finite = all(map(math.isfinite, found))
        except (ValueError, OverflowError) as error:
            raise InputError(f"{', '.join(cells)!r} are no numbers", where=self.where) from error
        if not finite:
            raise InputError(f"{', '.join(cells)!r} are not finite", where=self.where)
        return found


def read_configuration(content: bytes, source: str) -> Configuration:
    """Read a configuration; `InputError` with the number of the line that is wrong."""
    lines = _Lines(content, source)
    first = lines.cells()
    revision = int(first[2]) if len(first) > 2 and re.fullmatch(r"\d{4}", first[2]) else 1991
    counts = lines.cells()
    match = [re.fullmatch(r"(\d{1,6})\s*([AD])", cell, re.IGNORECASE) for cell in counts[1:3]]
    if len(match) < 2 or not all(match):
        raise InputError(
            f"{','.join(counts)!r} does not state the numbers of channels",
            where=lines.where,
            allowed="as '8,6A,2D'",
        )
    n_analogue, n_status = (int(one[1]) for one in match if one)
    channels = [_channel(lines, revision) for _ in range(n_analogue)]
    names = numbered(_told_apart(channels), taken=["time"])
    channels = [replace(one, name=name) for one, name in zip(channels, names, strict=True)]
    for _ in range(n_status):
        lines.cells()
    (frequency,) = lines.numbers(lines.cells()[:1])
    (n_rates,) = lines.numbers(lines.cells()[:1], int)
    rates = []
    for _ in range(max(1, n_rates)):
        cells = lines.cells()
        if len(cells) < 2:
            raise InputError("a rate lacks its last sample", where=lines.where, allowed="as '1600,3200'")
        rate, last = lines.numbers(cells[:2])
        if rate < 0 or not 1 <= last <= _MOST_SAMPLES:
            allowed = f"a rate of at least 0 and a last sample from 1 to {_MOST_SAMPLES:g}"
            raise InputError(f"{','.join(cells[:2])!r} is no rate", where=lines.where, allowed=allowed)
        rates.append((rate, int(last)))
    start, trigger = (" ".join(lines.cells()) for _ in range(2))
    kind = lines.cells()[0].upper() or "ASCII"
    if kind not in KINDS:
        raise InputError(f"the data are {kind!r}", where=lines.where, allowed=", ".join(KINDS))
    (factor,) = lines.numbers(lines.cells(optional=True)[:1])
    # stamps count nanoseconds where the dates have nine decimals
    tick = 1e-9 if re.search(r"\.\d{9}", start) else TICK
    return Configuration(
        revision,
        tuple(channels),
        n_status,
        frequency,
        tuple(rates),
        start,
        trigger,
        kind,
        tick * (factor or 1.0),
    )


def _told_apart(channels: Sequence[Channel]) -> list[str]:
    """Names, those that occur several times with their phases."""
    times = Counter(one.name for one in channels)
    once = [pair for pair, count in Counter((one.name, one.phase) for one in channels).items() if count == 1]
    return [
        f"{one.name} {one.phase}"
        if times[one.name] > 1 and one.phase and (one.name, one.phase) in once
        else one.name
        for one in channels
    ]


def _channel(lines: _Lines, revision: int) -> Channel:
    cells = lines.cells()
    width = 10 if revision < 1999 and len(cells) < 13 else 13
    while len(cells) > width and not cells[-1]:  # commas at the end of the line
        cells.pop()
    if len(cells) < width:
        raise InputError(
            f"a channel has {len(cells)} entries",
            where=lines.where,
            allowed=f"{width} entries between commas",
        )
    surplus = len(cells) - width  # commas in the name
    name = ",".join(lines.line.split(",")[1 : 2 + surplus]).strip()
    cells = [cells[0], name, *cells[2 + surplus :]]
    if surplus and re.fullmatch(r"[-+.\deE]+", cells[4]):  # where the unit would stand
        raise InputError(
            f"a channel has {width + surplus} entries between commas, and its name, {name!r}, does not explain that",
            where=lines.where,
            allowed=f"{width} entries, and more only for commas in the name",
        )
    factor, offset, skew = lines.numbers(cells[5:8])
    primary, secondary = lines.numbers(cells[10:12]) if width == 13 else (0.0, 0.0)
    if width == 13 and cells[12].upper() == "S":
        ratio = primary / secondary if primary > 0 and secondary > 0 else 1.0
        factor, offset = factor * ratio, offset * ratio
    unit = _SMALL.get(cells[4], spelled(cells[4]))
    return Channel(cells[1], cells[2].upper(), unit, factor, offset, primary, 1e-6 * skew)
