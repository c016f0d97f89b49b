"""Variables of MATLAB files: version 5 by scipy, version 7.3 (HDF5) by h5py."""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections.abc import Iterator
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.frames import Specs
from errorscreen.data.readers.base import Reader
from errorscreen.data.readers.tables import recording_of_table
from errorscreen.data.readers.text import check_file, check_size
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.data.units import as_column
from errorscreen.exceptions import InputError, MissingExtraError, unknown_name

_Array = NDArray[Any]
#: fields of fields of structures beyond this depth are not read
_DEPTH = 4
#: type of an element of version 5 that is compressed
_COMPRESSED = 15
_CHUNK = 2**20


def read_matlab(
    path: str | os.PathLike[str],
    columns: Specs | None,
    *,
    time: Any = "time",
    name: str | None = None,
    **options: Any,
) -> Recording:
    """Read a recording from the numeric variables of a MATLAB file; nothing else in it is read.

    Parameters
    ----------
    path : path-like
        Of version 5 to 7, or 7.3.
    columns : mapping of str to Column, str or mapping
        As in `errorscreen.data.from_frame`. Headers are variables, fields of structures as ``"s.field"``, and columns
        of matrices, from 1, as ``"name[1]"``.
    time : str or two of them
        Variable with the time stamps.
    name : str, optional
        The file's name without ending where not given.
    **options
        `time_unit`, `time_base`, `quality`, `waveforms`, and those of `errorscreen.data.frames.build_recording`.

    Raises
    ------
    InputError
        If the file is damaged, or variables are missing or differ in length.
    MissingExtraError
        For version 7.3 without h5py.
    """
    path = Path(path)
    found = _variables(path)
    first = time if isinstance(time, str) else time[0]
    if first not in found:
        remedy = "Give time, the variable with the time stamps"
        raise unknown_name(str(first), found, kind="variable", where=f"file {path}", remedy=remedy)
    length = len(found[first])
    source = f"file {path}"
    for role, column in (columns or {}).items():
        for header in as_column(role, column, f"{source}, channel {role!r}").headers:
            if header in found and len(found[header]) != length:
                raise InputError(
                    f"{header!r} has {len(found[header])} values, {first!r} has {length}",
                    where=source,
                    allowed="as many values as instants",
                )
    cells = {key: values for key, values in found.items() if len(values) == length}
    table = Table(cells, range(1, length + 1), source, "sample")
    options["name"] = path.stem if name is None else name
    return recording_of_table(table, columns, time=time, **options)


def read_headers(path: Path) -> list[str]:
    """Names of the variables."""
    return [*_variables(path)]


def _variables(path: Path) -> dict[str, _Array]:
    """Columns by name, of numeric variables only."""
    check_file(path)
    where = f"file {path}"
    content = path.read_bytes()
    try:
        if not content.startswith(b"MATLAB 5.0"):
            return _of_hdf5(path, where)
        for size in accumulate(_unpacked(content)):
            check_size(size, f"{where}, unpacked")
        import scipy.io

        found: dict[str, _Array] = {}
        for name, value in scipy.io.loadmat(io.BytesIO(content)).items():
            if not name.startswith("__"):
                _add(found, name, value)
        return found
    except (InputError, MissingExtraError):
        raise
    except Exception as error:  # the libraries pass on whatever a damaged file leads to
        raise InputError(
            f"is no sound MATLAB file: {type(error).__name__} {error}",
            where=where,
            allowed="a file of version 5 to 7.3",
            remedy="Save it again, or export its variables as CSV",
        ) from error


def _unpacked(content: bytes) -> Iterator[int]:
    """Sizes of the compressed elements of a file, which are unpacked in parts."""
    order, at = (">" if content[126:128] == b"MI" else "<"), 128
    while at + 8 <= len(content):
        kind, size = struct.unpack(f"{order}II", content[at : at + 8])
        if kind == _COMPRESSED:
            stream, part = zlib.decompressobj(), content[at + 8 : at + 8 + size]
            while part and not stream.eof:
                yield len(stream.decompress(part, _CHUNK))
                part = stream.unconsumed_tail
        at += 8 + size


def _add(found: dict[str, _Array], name: str, value: Any, depth: int = 0) -> None:
    """Add a variable, or the fields of a structure; texts, cells and objects are left out."""
    if not isinstance(value, np.ndarray) or depth > _DEPTH:
        return
    if value.dtype.names and type(value) is np.ndarray:
        for k, element in enumerate(value.ravel(), start=1):
            for field in value.dtype.names:
                own = name if value.size == 1 else f"{name}[{k}]"
                _add(found, f"{own}.{field}", element[field], depth + 1)
    elif value.dtype.kind in "biufc" and value.ndim == 2 and value.size:
        if 1 in value.shape:
            found[name] = value.ravel()
        else:
            found |= {f"{name}[{k}]": column for k, column in enumerate(value.T, start=1)}


def _of_hdf5(path: Path, where: str) -> dict[str, _Array]:
    try:
        import h5py
    except ModuleNotFoundError as error:
        raise MissingExtraError("h5py", extra="hdf5") from error
    found: dict[str, _Array] = {}
    total = 0

    def add(group: Any, prefix: str, depth: int) -> None:
        nonlocal total
        for key in group:
            if key.startswith("#") or not isinstance(group.get(key, getlink=True), h5py.HardLink):
                continue  # links may lead to other files
            item = group[key]
            if isinstance(item, h5py.Group) and depth < _DEPTH:
                add(item, f"{prefix}{key}.", depth + 1)
            elif isinstance(item, h5py.Dataset) and item.dtype.kind in "biuf" and item.ndim in (1, 2):
                if item.attrs.get("MATLAB_class") in (b"char", b"cell") or item.external:
                    continue
                total += item.size * item.dtype.itemsize
                check_size(total, f"{where}, unpacked")
                _add(found, prefix + key, np.atleast_2d(item[()]).T)

    with h5py.File(path, "r") as file:
        add(file, "", 0)
    return found


MATLAB = Reader(
    lambda head: head.startswith((b"MATLAB 5.0", b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")),
    read_matlab,
    layout=frozenset(("time", "time_unit", "time_base", "quality")),
    headers=read_headers,
)
