"""Text output of PSCAD/EMTDC: the names in an .inf file, the numbers in files of up to ten channels beside it."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from errorscreen.data.frames import Specs
from errorscreen.data.headers import known_unit
from errorscreen.data.readers.base import Reader
from errorscreen.data.readers.tables import numbered, recording_of_table
from errorscreen.data.readers.text import check_file, check_size
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.exceptions import InputError

_CHANNEL = re.compile(r"^\s*PGB\((\d{1,9})\)\s+Output\b(.*)$", re.MULTILINE)
_FIELD = re.compile(r'(\w+)="([^"]*)"')


def read_pscad(
    path: str | os.PathLike[str], columns: Specs | None, *, name: str | None = None, **options: Any
) -> Recording:
    """Read a recording from the output of a PSCAD/EMTDC run.

    Parameters
    ----------
    path : path-like
        The ``.inf`` file; ``NAME_01.out`` and the next ones stand beside it. A file that ends before the others ends
        the recording.
    columns : mapping of str to Column, str or mapping
        As in `errorscreen.data.from_frame`, with the names and units of the ``.inf`` file. Equal names get their group
        in front, as ``"Main.V"``, or a number.
    name : str, optional
        The file's name without ending where not given.
    **options
        `waveforms`, and those of `errorscreen.data.frames.build_recording`.

    Raises
    ------
    InputError
        If files are missing or do not fit together.
    """
    path = Path(path)
    notes: list[str] = []
    table = read_pscad_table(path, notes)
    options["name"] = path.stem if name is None else name
    return recording_of_table(table, columns, time="time", notes=notes, **options)


def read_pscad_table(path: Path, notes: list[str]) -> Table:
    """Time and channels of a run, with remarks."""
    names, units = _channels(path)
    return _table(path, names, units, notes)


def read_headers(path: Path) -> list[str]:
    """Names of the channels."""
    return _channels(path)[0]


def _channels(path: Path) -> tuple[list[str], dict[str, str]]:
    """Names and units of the channels in the order of their numbers."""
    check_file(path)
    text = path.read_bytes().decode("latin-1")
    found = sorted((int(match[1]), dict(_FIELD.findall(match[2]))) for match in _matches(text, path))
    named = [fields.get("Desc", "").strip() or f"PGB({number})" for number, fields in found]
    groups = [fields.get("Group", "").strip() for _, fields in found]
    full = [f"{g}.{n}" if g and named.count(n) > 1 else n for n, g in zip(named, groups, strict=True)]
    names = numbered(full, taken=["time"])
    units = [fields.get("Units", "").strip() for _, fields in found]
    return names, {n: known_unit("", unit) or unit for n, unit in zip(names, units, strict=True)}


def _matches(text: str, path: Path) -> list[re.Match[str]]:
    """Lines of channels; `InputError` where there are none, or two of one number."""
    found = [*_CHANNEL.finditer(text)]
    if not found or len({int(match[1]) for match in found}) < len(found):
        raise InputError(
            "names no channels, or two with one number",
            where=f"file {path}",
            allowed='lines as PGB(1) Output Desc="V" Group="Main" Units="kV"',
        )
    return found


def _table(path: Path, names: list[str], units: dict[str, str], notes: list[str]) -> Table:
    pattern = re.compile(re.escape(path.stem) + r"_(\d{1,6})\.out", re.IGNORECASE)
    beside = [(int(match[1]), p) for p in path.parent.iterdir() if (match := pattern.fullmatch(p.name))]
    files = [p for _, p in sorted(beside)]
    if not files:
        raise InputError(
            f"the numbers {path.stem}_01.out are missing",
            where=f"file {path}",
            allowed="the .out files of the run in the same folder",
        )
    for one in files:
        check_file(one)
    check_size(sum(one.stat().st_size for one in files), f"file {path} with its .out files")
    parts = [_numbers(one, notes) for one in files]
    width = sum(part.shape[1] - 1 for part, _ in parts)
    if width != len(names):
        raise InputError(
            f"the .out files hold {width} channels, but {len(names)} are named",
            where=f"file {path}",
            allowed=f"all files of one run; found were {', '.join(one.name for one in files)}",
        )
    length = min(len(part) for part, _ in parts)
    if any(len(part) > length for part, _ in parts):
        notes.append(f"The .out files differ in length; {length} rows that all of them have were read.")
    time = parts[0][0][:length, 0]
    for one, (part, _) in zip(files, parts, strict=True):
        if not np.array_equal(part[:length, 0], time):
            raise InputError(
                f"its time differs from that of {files[0].name}",
                where=f"file {one}",
                allowed="files of one run",
            )
    cells: dict[str, Any] = {"time": time}
    cells |= zip(names, (column for part, _ in parts for column in part[:length, 1:].T), strict=True)
    first = parts[0][1]
    return Table(cells, range(first, first + length), f"file {path}", units=units)


def _numbers(path: Path, notes: list[str]) -> tuple[np.ndarray[Any, Any], int]:
    """Numbers of a file, and the number of its first line with some."""
    lines = path.read_bytes().decode("latin-1").split("\n")
    while lines and not lines[-1].strip():
        lines.pop()
    first = lines[0].split() if lines else []
    head = 0 if first and pd.to_numeric(pd.Series(first), errors="coerce").notna().all() else 1
    rows = [line.split() for line in lines[head:]]
    width = len(rows[0]) if rows else 0
    if width < 2:
        raise InputError("holds no rows of numbers", where=f"file {path}", allowed="a time and its channels")
    if len(rows) > 1 and len(rows[-1]) < width:
        rows.pop()
        notes.append(f"The last line of {path.name} was cut off; it was not read.")
    for k, row in enumerate(rows):
        if len(row) != width:
            raise InputError(
                f"the line has {len(row)} numbers, the first one {width}",
                where=f"file {path}, line {head + 1 + k}",
                allowed="as many numbers in each line",
            )
    try:
        return np.array(rows, dtype=float), head + 1
    except ValueError as error:
        raise InputError(f"holds texts among the numbers: {error}", where=f"file {path}") from error


def _recognises(head: bytes) -> bool:
    return bool(_CHANNEL.match(head.decode("latin-1").lstrip("\xef\xbb\xbf")))


PSCAD = Reader(_recognises, read_pscad, layout=frozenset(), headers=read_headers)
