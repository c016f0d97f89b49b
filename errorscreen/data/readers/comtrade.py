"""COMTRADE records: IEEE C37.111 of 1991, 1999 and 2013, in two files or one (CFF).

The library ``comtrade`` is the reference in the tests. It is not used here, because it goes on with zeros where a file
ends early, takes the rates for the truth where stamps say something else, splits names at their commas, and knows no
mark of a gap in FLOAT32; each would have to be read a second time.
"""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from errorscreen.data.frames import Specs, build_recording
from errorscreen.data.headers import spelled
from errorscreen.data.readers.base import Reader
from errorscreen.data.readers.tables import numbered, with_units
from errorscreen.data.readers.text import check_file
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.data.waveforms import Waveforms, trios
from errorscreen.exceptions import InputError

_Array = NDArray[np.float64]
_SECTION = re.compile(rb"^--- *file type: *([A-Z]+)(?: +([A-Z0-9]+))?(?:: *(\d+))? *---\s*$", re.MULTILINE)
_COUNTS = re.compile(rb"^\s*\d+\s*,\s*\d+\s*A\s*,\s*\d+\s*D", re.IGNORECASE)
#: types of the values of analogue channels in binary data
_BINARY = {"BINARY": "<i2", "BINARY32": "<i4", "FLOAT32": "<f4"}
#: units as some recorders write them; in the headers of other files these letters are phases
_SMALL = {"v": "V", "a": "A"}
#: more samples than any file that is read can hold
_MOST_SAMPLES = 1e10
#: stamp that is missing
_NO_STAMP = 0xFFFFFFFF


@dataclass(frozen=True)
class _Channel:
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
class _Configuration:
    revision: int
    channels: tuple[_Channel, ...]
    n_status: int
    frequency: float
    rates: tuple[tuple[float, int], ...]
    start: str
    trigger: str
    kind: str
    #: seconds of one unit of the stamps
    tick: float


def read_comtrade(
    path: str | os.PathLike[str],
    columns: Specs | None = None,
    *,
    waveforms: Waveforms | Mapping[str, Any] | None = None,
    name: str | None = None,
    f_nominal: float,
    **options: Any,
) -> Recording:
    r"""Read a recording from a COMTRADE record.

    All values are primary ones. The data may end before the configuration says so; it ends there then.

    Parameters
    ----------
    path : path-like
        The configuration (``.cfg``), with the data (``.dat``) beside it, or both in one file (``.cff``).
    columns : mapping of str to Column, str or mapping, optional
        As in `errorscreen.data.from_frame`, of a record of rms values; the unit is that of the record where not given.
        Of waveforms, further channels, and channels that are to count instead of what follows from the waveforms.
    waveforms : Waveforms or mapping, optional
        Three voltages and three currents that V, angle, f, P and Q are computed from. Where neither these nor
        `columns` are given, the channels with the phases A, B and C are taken, if there are no others.
    name : str, optional
        The file's name without ending where not given.
    f_nominal : float
        Nominal frequency in Hz.
    **options
        `base_mva` and all others of `errorscreen.data.frames.build_recording`, but for the stamps.

    Raises
    ------
    InputError
        If the files are no COMTRADE record, or lack a channel.
    """
    path = Path(path)
    table, _, found, notes = read_comtrade_table(path)
    if waveforms is None and not columns and "phasors" not in options:
        waveforms = trios([(c.name, c.phase, c.unit) for c in found.channels], f"file {path}")
    label = path.stem if name is None else name
    return build_recording(
        table, with_units(columns or {}, table), time="time", f_nominal=f_nominal, waveforms=waveforms, name=label,
        notes=notes, **options,
    )  # fmt: skip


def read_comtrade_table(path: Path) -> tuple[Table, _Array, _Configuration, list[str]]:
    """Analogue channels in primary values, their time in seconds, the configuration, and remarks."""
    head, data = _parts(path)
    found = _configuration(head, f"file {path}")
    numbers, stamps, values = _samples(data, found, f"file {path}")
    notes = [f"The record begins at {found.start}; the recorder was triggered at {found.trigger}."]
    last = found.rates[-1][1]
    if len(numbers) < last:
        notes.append(f"The data end with sample {len(numbers)} of {last} that the configuration states.")
    time = _times(numbers, stamps, found, notes, f"file {path}")
    cells: dict[str, Any] = {"time": time}
    for channel, column in zip(found.channels, values, strict=True):
        cells[channel.name] = _at_stamps(time, channel.factor * column + channel.offset, channel.skew)
    late = [f"{c.name} ({1e6 * c.skew:g} us)" for c in found.channels if c.skew]
    if late:
        notes.append(
            f"Samples were interpolated to their stamps, which they are later than: {', '.join(late)}."
        )
    units = {channel.name: channel.unit for channel in found.channels}
    return Table(cells, range(1, len(time) + 1), f"file {path}", "sample", units), time, found, notes


def _at_stamps(time: _Array, values: _Array, skew: float) -> _Array:
    """Values at the stamps of samples that were taken `skew` seconds later; NaN beyond them and in a gap."""
    known = np.isfinite(values)
    if not skew or known.sum() < 2:
        return values
    taken = time + skew
    after = np.searchsorted(taken, time)
    inside = (after > 0) & (after < len(time))
    inside[inside] = known[after[inside]] & known[after[inside] - 1]
    return np.where(inside, CubicSpline(taken[known], values[known])(time), np.nan)


def _parts(path: Path) -> tuple[bytes, bytes]:
    """Configuration and data, of a CFF in one file."""
    check_file(path)
    content = path.read_bytes()
    sections = [*_SECTION.finditer(content)]
    if not sections:
        beside = [p for p in path.parent.iterdir() if p.stem == path.stem and p.suffix.lower() == ".dat"]
        if not beside:
            raise InputError(
                f"the data {path.stem}.dat are missing",
                where=f"file {path}",
                allowed="both files of the record in one folder",
                remedy="Put the .dat file beside it",
            )
        check_file(beside[0])
        return content, beside[0].read_bytes()
    found: dict[bytes, bytes] = {}
    for one, after in zip(sections, [*sections[1:], None], strict=True):
        end = len(content) if one[1] == b"DAT" or after is None else after.start()
        begin = one.end() if content[one.end() : one.end() + 1] != b"\n" else one.end() + 1
        found.setdefault(one[1], content[begin:end])
        if one[1] == b"DAT":  # binary data may hold anything
            break
    missing = [kind.decode() for kind in (b"CFG", b"DAT") if kind not in found]
    if missing:
        raise InputError(f"the part {missing[0]} is missing", where=f"file {path}", allowed="CFG and DAT")
    return found[b"CFG"], found[b"DAT"]


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


def _configuration(content: bytes, source: str) -> _Configuration:
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
    if kind not in ("ASCII", *_BINARY):
        raise InputError(f"the data are {kind!r}", where=lines.where, allowed=", ".join(("ASCII", *_BINARY)))
    (factor,) = lines.numbers(lines.cells(optional=True)[:1])
    # stamps count nanoseconds where the dates have nine decimals
    tick = 1e-9 if re.search(r"\.\d{9}", start) else 1e-6
    return _Configuration(
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


def _told_apart(channels: Sequence[_Channel]) -> list[str]:
    """Names, those that occur several times with their phases."""
    times = Counter(one.name for one in channels)
    once = [pair for pair, count in Counter((one.name, one.phase) for one in channels).items() if count == 1]
    return [
        f"{one.name} {one.phase}"
        if times[one.name] > 1 and one.phase and (one.name, one.phase) in once
        else one.name
        for one in channels
    ]


def _channel(lines: _Lines, revision: int) -> _Channel:
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
    return _Channel(cells[1], cells[2].upper(), unit, factor, offset, primary, 1e-6 * skew)


def _samples(data: bytes, found: _Configuration, source: str) -> tuple[_Array, _Array, list[_Array]]:
    """Numbers of samples, stamps (NaN where missing), and stored values by channel (NaN for gaps)."""
    n = len(found.channels)
    if found.kind == "ASCII":
        rows = [
            line.split(",")
            for line in data.replace(b"\x1a", b"").decode("latin-1").splitlines()
            if line.strip()
        ]
        width = 2 + n + found.n_status
        for k, row in enumerate(rows):
            while len(row) > width and not row[-1].strip():  # commas at the end of the line
                row.pop()
            if len(row) != width:
                if k == len(rows) - 1:  # a line that was cut off
                    rows.pop()
                    break
                raise InputError(
                    f"sample {k + 1} has {len(row)} entries",
                    where=f"{source}, data",
                    allowed=f"{width} entries",
                )
        try:
            table = np.array([[float(cell or "nan") for cell in row[: 2 + n]] for row in rows])
        except ValueError as error:
            raise InputError(f"the data hold no numbers: {error}", where=f"{source}, data") from error
        table = table.reshape(-1, 2 + n)
        values = [np.where(column == 99999, np.nan, column) for column in table[:, 2:].T]
        numbers, stamps = table[:, 0], table[:, 1]
    else:
        kind = np.dtype(_BINARY[found.kind])
        words = -(-found.n_status // 16)
        layout = np.dtype(
            [("n", "<u4"), ("stamp", "<u4"), ("value", kind, (n,)), ("status", "<u2", (words,))]
        )
        stored = np.frombuffer(data[: len(data) // layout.itemsize * layout.itemsize], dtype=layout)
        marks = [float(np.finfo(np.float32).min if kind.kind == "f" else np.iinfo(kind).min)]
        marks += [-1.0] if found.revision < 1999 and found.kind == "BINARY" else []
        columns = stored["value"].astype(float).T
        values = [np.where(np.isin(column, marks), np.nan, column) for column in columns]
        numbers, stamps = stored["n"].astype(float), stored["stamp"].astype(float)
        stamps = np.where(stamps == _NO_STAMP, np.nan, stamps)
    last = found.rates[-1][1]
    if not len(numbers):
        raise InputError("the data hold no sample", where=source, allowed="at least two samples")
    return numbers[:last], stamps[:last], [column[:last] for column in values]


def _times(numbers: _Array, stamps: _Array, found: _Configuration, notes: list[str], source: str) -> _Array:
    """Seconds from the first sample: by the rates where stamps agree with them, else by the stamps."""
    stamped = (stamps - stamps[0]) * found.tick
    usable = bool(np.isfinite(stamped).all() and (np.diff(stamped) > 0).all())
    if all(rate > 0 for rate, _ in found.rates):
        ends = np.array([last for _, last in found.rates])
        at = np.searchsorted(ends, np.arange(1, len(numbers)) + 1)  # the rate that leads to a sample
        steps = 1.0 / np.array([rate for rate, _ in found.rates])[np.minimum(at, len(ends) - 1)]
        rated = np.concatenate([[0.0], np.cumsum(steps)])
        if not usable or np.max(np.abs(rated - stamped)) <= 2.0 * found.tick:
            return rated
        notes.append(
            f"Stamps and rates differ by up to {np.max(np.abs(rated - stamped)):.3g} s; the stamps were taken."
        )
    elif not usable:
        raise InputError(
            "the record has neither rates nor increasing stamps", where=source, allowed="one of them"
        )
    return stamped


def _recognises(head: bytes) -> bool:
    """Whether a file begins as a configuration or a CFF does."""
    lines = head.lstrip(b"\xef\xbb\xbf").splitlines()
    return bool(_SECTION.match(head)) or (len(lines) > 1 and bool(_COUNTS.match(lines[1])))


COMTRADE = Reader(_recognises, read_comtrade, needs_columns=False, layout=frozenset())
