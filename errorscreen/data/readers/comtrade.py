"""COMTRADE records: IEEE C37.111 of 1991, 1999 and 2013, in two files or one (CFF).

The library ``comtrade`` decodes the data. It goes on with zeros where a file ends early, takes the rates for the truth
where stamps say something else, splits names at their commas, and knows not every mark of a gap. Therefore the
configuration is checked here line by line, and the library is given one without names, with as many samples as there
are, and with stamps instead of rates.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from errorscreen.data.frames import Specs, build_recording
from errorscreen.data.readers.base import Reader
from errorscreen.data.readers.comtrade_configuration import TICK, Configuration, read_configuration
from errorscreen.data.readers.tables import with_units
from errorscreen.data.readers.text import check_file
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.data.waveforms import Waveforms, trios
from errorscreen.exceptions import InputError, MissingExtraError

_Array = NDArray[np.float64]
_SECTION = re.compile(rb"^--- *file type: *([A-Z]+)(?: +([A-Z0-9]+))?(?:: *(\d+))? *---\s*$", re.MULTILINE)
_COUNTS = re.compile(rb"^\s*\d+\s*,\s*\d+\s*A\s*,\s*\d+\s*D", re.IGNORECASE)
#: types of the values of analogue channels in binary data
_BINARY = {"BINARY": "<i2", "BINARY32": "<i4", "FLOAT32": "<f4"}
#: numbers that stand for a gap and that the library leaves as they are
_GAPS = {
    "ASCII": 99999.0,
    "BINARY": -32768.0,
    "BINARY32": -(2.0**31),
    "FLOAT32": float(np.finfo(np.float32).min),
}


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
    MissingExtraError
        Without the library comtrade.
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


def read_comtrade_table(path: Path) -> tuple[Table, _Array, Configuration, list[str]]:
    """Analogue channels in primary values, their time in seconds, the configuration, and remarks."""
    head, data = _parts(path)
    found = read_configuration(head, f"file {path}")
    n_samples, stamped, values = _samples(data, found, f"file {path}")
    notes = [f"The record begins at {found.start}; the recorder was triggered at {found.trigger}."]
    last = found.rates[-1][1]
    if n_samples < last:
        notes.append(f"The data end with sample {n_samples} of {last} that the configuration states.")
    time = _times(n_samples, stamped, found, notes, f"file {path}")
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


def _samples(data: bytes, found: Configuration, source: str) -> tuple[int, _Array | None, list[_Array]]:
    """Number of samples, seconds by their stamps (None where one is missing), and stored values (NaN for gaps)."""
    try:
        import comtrade
    except ModuleNotFoundError as error:
        raise MissingExtraError("comtrade", extra="comtrade") from error
    last = found.rates[-1][1]
    whole: str | bytes
    if found.kind == "ASCII":
        rows = _rows(data, found, source)[:last]
        n_samples, whole = len(rows), "\n".join(",".join(row) for row in rows)
    else:
        size = 8 + np.dtype(_BINARY[found.kind]).itemsize * len(found.channels) + 2 * -(-found.n_status // 16)
        n_samples = min(len(data) // size, last)
        whole = data[: n_samples * size]
    if not n_samples:
        raise InputError("the data hold no sample", where=source, allowed="at least two samples")
    try:
        for stamped in (True, False):
            record = comtrade.Comtrade(ignore_warnings=True, use_numpy_arrays=True, use_double_precision=True)
            try:
                record.read(_plain(found, n_samples, stamped), whole)
                break
            except comtrade.ComtradeError:  # a stamp is missing
                continue
    except ValueError as error:
        raise InputError(f"the data hold no numbers: {error}", where=f"{source}, data") from error
    seconds = np.array(record.time) * (found.tick / TICK) if stamped else None
    return n_samples, seconds, [np.where(x == _GAPS.get(found.kind), np.nan, x) for x in record.analog]


def _rows(data: bytes, found: Configuration, source: str) -> list[list[str]]:
    """Cells of the samples in text; a gap is 'nan'."""
    lines = data.replace(b"\x1a", b"").decode("latin-1").splitlines()
    rows = [line.split(",") for line in lines if line.strip()]
    n = len(found.channels)
    width = 2 + n + found.n_status
    for k, row in enumerate(rows):
        while len(row) > width and not row[-1].strip():  # commas at the end of the line
            row.pop()
        if len(row) != width:
            if k == len(rows) - 1:  # a line that was cut off
                return rows[:-1]
            raise InputError(
                f"sample {k + 1} has {len(row)} entries",
                where=f"{source}, data",
                allowed=f"{width} entries",
            )
        row[0], row[2 : 2 + n] = str(k + 1), [cell.strip() or "nan" for cell in row[2 : 2 + n]]
        row[2 + n :] = ["0"] * found.n_status
    return rows


def _plain(found: Configuration, n_samples: int, stamped: bool) -> str:
    """Configuration for the library: the data's layout alone."""
    n = len(found.channels)
    lines = [f"-,-,{1991 if found.revision < 1999 else 1999}", f"{n + found.n_status},{n}A,{found.n_status}D"]
    lines += [f"{k},{k},,,,1,0,0,0,0,1,1,P" for k in range(1, n + 1)]
    lines += [f"{k},{k},,,0" for k in range(1, found.n_status + 1)]
    lines += ["0", "0" if stamped else "1", f"{0 if stamped else 1},{n_samples}", "", "", found.kind, ""]
    return "\n".join(lines)


def _times(
    n_samples: int, stamped: _Array | None, found: Configuration, notes: list[str], source: str
) -> _Array:
    """Seconds from the first sample: by the rates where stamps agree with them, else by the stamps."""
    stamped = np.full(n_samples, np.nan) if stamped is None else stamped - stamped[0]
    usable = bool(np.isfinite(stamped).all() and (np.diff(stamped) > 0).all())
    if all(rate > 0 for rate, _ in found.rates):
        ends = np.array([last for _, last in found.rates])
        at = np.searchsorted(ends, np.arange(1, n_samples) + 1)  # the rate that leads to a sample
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
