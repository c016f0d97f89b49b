"""MATLAB files of version 5 and 7.3: vectors, matrices, structs, and the structures with time of Simulink.

Objects, such as timeseries and tables, are stored in a form that is not published, so they are refused by name.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from errorscreen.data.frames import Specs
from errorscreen.data.headers import guess_time
from errorscreen.data.readers.apart import Variables, check_extra, variables_of
from errorscreen.data.readers.base import Reader
from errorscreen.data.readers.tables import recording_of_table
from errorscreen.data.readers.text import check_file
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.exceptions import InputError, unknown_name

_V5, _V73 = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"
_ALLOWED = "a MATLAB file of version 5 or 7.3"
#: names of a list of names beside a matrix
_NAMES = frozenset({"names", "labels", "label"})


@dataclass
class MatlabColumns:
    """Columns of a file, of any lengths, by header: numbers or texts; and remarks on how they were found."""

    source: str
    columns: dict[str, Any]
    notes: list[str] = field(default_factory=list)
    unread: Mapping[str, str] = field(default_factory=dict)

    def table(self, time: str) -> Table:
        """Columns that are as long as the time stamps."""
        length = len(self.columns[time])
        cells = {name: cells for name, cells in self.columns.items() if len(cells) == length}
        return Table(cells, range(1, length + 1), self.source, "sample")

    def check(self, wanted: Iterator[str], time: str) -> None:
        """Refuse columns that are wanted and cannot be used, and a time that is none."""
        for name in wanted:
            whole = name.split(".")[0].split("[")[0]
            where = f"{self.source}, variable {name!r}"
            if name not in self.columns and (kind := self.unread.get(name, self.unread.get(whole))):
                raise InputError(
                    f"is of the class {kind}, which is not read",
                    where=where,
                    allowed="numbers, and structs of them",
                    remedy=_remedy(kind),
                )
            if name in self.columns and time in self.columns:
                sizes = len(self.columns[name]), len(self.columns[time])
                if sizes[0] != sizes[1]:
                    raise InputError(
                        f"has {sizes[0]} values, but the time {time!r} has {sizes[1]}",
                        where=where,
                        allowed="variables as long as the time",
                        remedy="Give the time that belongs to it",
                    )
        if time not in self.columns:
            remedy = "Give time, the variable with the time stamps"
            raise unknown_name(time, self.columns, kind="variable", where=self.source, remedy=remedy)


def read_matlab(
    path: str | os.PathLike[str],
    columns: Specs | None,
    *,
    time: str | Sequence[str] = "time",
    name: str | None = None,
    **options: Any,
) -> Recording:
    """Read a recording from a MATLAB file.

    Parameters
    ----------
    path : path-like
    columns : mapping of str to Column, str or mapping
        As in `errorscreen.data.from_frame`. A vector is a column of its name. A matrix ``M`` gives ``M[1]``, ``M[2]`` …
        along its shorter side; they are called by the texts of ``names`` or ``labels`` beside it, where there is just
        one matrix and a text for each of its columns. The field ``f`` of a struct ``s`` is ``s.f``, and of an array of
        structs ``s[1].f``. Of a structure with time of Simulink, a signal is ``s.`` with its label.
    time : str
        Header of the time stamps.
    name : str, optional
        The file's name without ending where not given.
    **options
        `time_unit`, `time_format`, `time_base`, `quality`, and those of `errorscreen.data.frames.build_recording`.

    Raises
    ------
    InputError
        If the file is damaged, or what is wanted is an object, such as a timeseries, or of another length.
    MissingExtraError
        Without h5py, of a file of version 7.3.
    """
    path = Path(path)
    found = read_matlab_columns(path)
    first = time if isinstance(time, str) else time[0]
    given = [columns, *(options.get(key) for key in ("waveforms", "phasors", "quality"))]
    found.check(_texts([time, *given]), first)
    options["name"] = path.stem if name is None else name
    return recording_of_table(found.table(first), columns, time=time, notes=found.notes, **options)


def read_headers(path: Path) -> list[str]:
    """Headers of the columns that are as long as the time, or of all where none is called so."""
    found = read_matlab_columns(path)
    time, _ = guess_time(found.columns)
    return [*(found.columns if time is None else found.table(time).columns)]


def read_matlab_columns(path: Path) -> MatlabColumns:
    """All columns of a file."""
    check_file(path)
    with path.open("rb") as file:
        new = file.read(len(_V73)) == _V73
    if new:
        check_extra("h5py", "matlab")
    found = variables_of("matlab_73" if new else "matlab_5", path, _ALLOWED)
    columns, notes = _columns(found)
    if not columns:
        kinds = ", ".join(f"{name!r} of the class {kind}" for name, kind in found.unread.items())
        raise InputError(
            f"holds no vectors or matrices of numbers{', only ' + kinds if kinds else ''}",
            where=f"file {path}",
            allowed="numbers, and structs of them",
            remedy=_remedy(*found.unread.values()),
        )
    return MatlabColumns(f"file {path}", columns, notes, found.unread)


def _remedy(*kinds: str) -> str:
    if "timeseries" in kinds:
        return "In MATLAB: t = x.Time; V = squeeze(x.Data); save('new.mat', 't', 'V')"
    if "timetable" in kinds or "table" in kinds:
        return "In MATLAB: writetimetable(x, 'new.csv') or writetable(x, 'new.csv')"
    return "In MATLAB, save its numbers as vectors"


def _columns(found: Variables) -> tuple[dict[str, Any], list[str]]:
    columns: dict[str, Any] = {}
    notes: list[str] = []
    arrays = {name: np.squeeze(values) for name, values in found.arrays.items()}
    for name, values in arrays.items():
        if values.ndim == 1:
            columns[_signal(name, found) or name] = values
        elif values.ndim == 2:
            turned = values.shape[1] > values.shape[0]
            rows = values if turned else values.T
            if turned:
                notes.append(f"The rows of {name!r} were taken as its columns, because they are longer.")
            columns |= zip(_of_matrix(name, len(rows), found, arrays), rows, strict=True)
    for name, texts in found.texts.items():
        if len(texts) > 1 and name not in columns:
            columns[name] = texts
    return columns, notes


def _signal(name: str, found: Variables) -> str | None:
    """Header of a signal with one value in a structure with time, by its label."""
    owner, _, last = name.rpartition(".")
    base, _, of_signals = owner.rpartition(".")
    if last != "values" or not of_signals.startswith("signals") or f"{base}.time" not in found.arrays:
        return None
    alike = [
        texts[:1]
        for key, texts in found.texts.items()
        if key.startswith(f"{base}.signals") and key.endswith(".label")
    ]
    label = found.texts.get(f"{owner}.label", [""])[0]
    return f"{base}.{label}" if label not in ("", "time") and alike.count([label]) == 1 else None


def _of_matrix(
    name: str, width: int, found: Variables, arrays: Mapping[str, np.ndarray[Any, Any]]
) -> list[str]:
    """Headers of the columns of a matrix: the texts beside it, where it is clear that they are its; else numbers."""
    owner = name.rpartition(".")[0]
    label = _signal(name, found) or name
    numbers = [f"{label}[{number}]" for number in range(1, width + 1)]
    beside = [texts for key, texts in found.texts.items() if _is_list(key, owner)]
    matrices = [key for key, one in arrays.items() if one.ndim == 2 and key.rpartition(".")[0] == owner]
    if len(beside) != 1 or len(matrices) != 1 or len(beside[0]) != width:
        return numbers
    names = [f"{owner}.{text}" if owner else text for text in beside[0]]
    clear = all(beside[0]) and len({*names}) == width and not {*names} & arrays.keys()
    return names if clear else numbers


def _is_list(key: str, owner: str) -> bool:
    place, _, last = key.rpartition(".")
    return place == owner and last.casefold() in _NAMES


def _texts(value: Any) -> Iterator[str]:
    """All texts in descriptions of columns."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        yield from _texts(list(value.values()))
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _texts(one)
    elif hasattr(value, "__dict__"):
        yield from _texts(list(vars(value).values()))


MATLAB = Reader(
    lambda head: head.startswith((_V5, _V73)),
    read_matlab,
    layout=frozenset({"time", "time_unit", "time_format", "time_base", "quality"}),
    headers=read_headers,
)
