"""Program of a process of its own: reads a file by a library that a damaged file may end, or keep busy for ever.

It imports nothing of errorscreen, so it starts fast. ``python child.py KIND FILE OUT`` writes plain arrays and a
report in JSON to OUT, in the format of `numpy.savez`. Forms of the files: MATLAB v5 as scipy reads it; MATLAB v7.3 is
HDF5, in which ``MATLAB_class`` names the class of a variable, arrays are transposed, structs are groups, and cells are
references (documentation of the package hdf5storage); the types of Parquet are those of Arrow.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

#: bytes of all arrays together, and of address space
LARGEST, MEMORY = 2**31, 2**32
#: levels of structs, and elements of an array of structs
_DEPTH, _ELEMENTS = 8, 1000
_NUMBERS = frozenset("biufc")


class Found:
    """Variables by name: arrays, texts, and kinds of unread ones."""

    def __init__(self) -> None:
        self.arrays: dict[str, np.ndarray[Any, Any]] = {}
        self.texts: dict[str, list[str]] = {}
        self.unread: dict[str, str] = {}
        self.report: dict[str, Any] = {"texts": self.texts, "unread": self.unread}
        self._left = LARGEST

    def reserve(self, size: int) -> None:
        """Count the bytes of an array."""
        self._left -= size
        if self._left < 0:
            raise MemoryError

    def add(self, name: str, values: np.ndarray[Any, Any]) -> None:
        """Add numbers."""
        if values.size:
            self.reserve(values.nbytes)
            self.arrays[name] = values


def matlab_5(path: str, found: Found) -> None:
    """Variables of a MATLAB file of version 5."""
    from scipy.io import loadmat

    for name, value in loadmat(path, chars_as_strings=True).items():
        if not name.startswith("__"):
            _variable(name, value, found, 0)


def _variable(name: str, value: Any, found: Found, depth: int) -> None:
    kind = type(value).__name__
    if kind == "MatlabOpaque":
        with suppress(KeyError, IndexError, ValueError):
            name, kind = (_plain(value[part].flat[0]) for part in ("s0", "s2"))
        found.unread[name] = kind
    elif not isinstance(value, np.ndarray) or kind in ("MatlabFunction", "MatlabObject") or depth > _DEPTH:
        found.unread[name] = kind
    elif value.dtype.names:
        elements = value.reshape(-1)[:_ELEMENTS]
        for number, element in enumerate(elements, start=1):
            for field in value.dtype.names:
                label = name if len(elements) == 1 else f"{name}[{number}]"
                _variable(f"{label}.{field}", element[field], found, depth + 1)
    elif value.dtype.kind in "US":
        found.texts[name] = [_plain(text) for text in value.reshape(-1)]
    elif value.dtype.kind == "O":
        cells = [_plain(cell) for cell in value.reshape(-1)]
        if cells and None not in cells:
            found.texts[name] = cells
        else:
            found.unread[name] = "cell"
    elif value.dtype.kind in _NUMBERS:
        found.add(name, value)


def _plain(cell: Any) -> Any:
    """Text of a cell; None where it holds something else."""
    if isinstance(cell, bytes):
        return cell.decode("latin-1").strip()
    if isinstance(cell, str):
        return str(cell).strip()
    if isinstance(cell, np.ndarray) and cell.dtype.kind in "US" and cell.size <= 1:
        return str(cell.reshape(-1)[0]).strip() if cell.size else ""
    return None


def matlab_73(path: str, found: Found) -> None:
    """Variables of a MATLAB file of version 7.3."""
    import h5py

    with h5py.File(path, "r") as file:
        _group(h5py, file, "", found, 0)


def _group(h5py: Any, group: Any, prefix: str, found: Found, depth: int) -> None:
    for name in group:
        # soft and external links may lead anywhere
        if name.startswith("#") or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        _object(h5py, group[name], f"{prefix}{name}", found, depth)


def _object(h5py: Any, one: Any, name: str, found: Found, depth: int) -> None:
    kind = one.attrs.get("MATLAB_class", b"")
    kind = kind.decode("latin-1") if isinstance(kind, bytes) else str(kind)
    if isinstance(one, h5py.Group):
        if depth > _DEPTH or kind not in ("", "struct"):
            found.unread[name] = kind or "group"
        else:
            _group(h5py, one, f"{name}.", found, depth + 1)
    elif not isinstance(one, h5py.Dataset) or one.attrs.get("MATLAB_empty", 0) or one.shape is None:
        return
    elif one.is_virtual or one.external:
        found.unread[name] = "numbers in another file"
    elif one.dtype == h5py.ref_dtype:
        _references(h5py, one, name, kind, found, depth)
    elif kind == "char":
        found.reserve(one.nbytes)
        codes = np.atleast_2d(one[()].T)
        rows = codes.reshape(1, -1) if 1 in codes.shape else codes
        found.texts[name] = ["".join(map(chr, row)).rstrip() for row in rows.tolist()]
    elif "MATLAB_object_decode" in one.attrs:
        found.unread[name] = kind
    elif one.dtype.kind in _NUMBERS:
        found.reserve(one.nbytes)
        found.add(name, one[()].T)
    elif one.dtype.names == ("real", "imag"):
        found.reserve(one.nbytes)
        parts = one[()].T
        found.add(name, parts["real"] + 1j * parts["imag"])
    else:
        found.unread[name] = kind or str(one.dtype)


def _references(h5py: Any, one: Any, name: str, kind: str, found: Found, depth: int) -> None:
    """A cell array of texts, or the field of an array of structs."""
    if depth > _DEPTH or one.size > 100 * _ELEMENTS:
        found.unread[name] = kind or "struct"
        return
    elements = [one.file[reference] for reference in one[()].T.reshape(-1) if reference]
    if kind == "cell":
        inside = Found()
        for number, element in enumerate(elements):
            if element.attrs.get("MATLAB_class") == b"char":
                inside.texts[str(number)] = [""]
                _object(h5py, element, str(number), inside, depth + 1)
        if elements and len(inside.texts) == len(elements):
            found.texts[name] = ["".join(texts) for texts in inside.texts.values()]
        else:
            found.unread[name] = kind
        return
    owner, _, field = name.rpartition(".")
    for number, element in enumerate(elements[:_ELEMENTS], start=1):
        label = owner if len(elements) == 1 else f"{owner}[{number}]"
        _object(h5py, element, f"{label}.{field}", found, depth + 1)


def parquet_names(path: str, found: Found) -> None:
    """Names of the columns of a Parquet file."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        _schema(file, found)


def parquet(path: str, found: Found) -> None:
    """Columns of a Parquet file; of equal names none."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        _schema(file, found)
        names = file.schema_arrow.names
        wanted = [name for name, times in Counter(names).items() if times == 1]
        found.reserve(file.metadata.num_rows * len(wanted) * 8)
        table = file.read(columns=wanted, use_threads=False)
    for name in wanted:
        _column(name, table.column(name), found)


def _schema(file: Any, found: Found) -> None:
    """Report the names of the columns, and those that pandas stored the index in."""
    names = file.schema_arrow.names
    pandas = json.loads((file.schema_arrow.metadata or {}).get(b"pandas", b"{}"))
    index = [one for one in pandas.get("index_columns", ()) if one in names]
    found.report |= {"columns": names, "index": index, "zoned": []}


def _column(name: str, column: Any, found: Found) -> None:
    import pyarrow as pa

    types = pa.types
    if types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    kind = column.type
    if types.is_timestamp(kind) and kind.tz is not None:
        found.report["zoned"].append(name)
    if types.is_date(kind):
        column = column.cast(pa.timestamp("ms"))
    elif types.is_time(kind):
        column = column.cast(pa.string())
    elif types.is_decimal(kind) or types.is_null(kind) or types.is_boolean(kind):
        column = column.cast(pa.float64())
    kind = column.type
    if types.is_string(kind) or types.is_large_string(kind):
        found.texts[name] = ["" if text is None else text for text in column.to_pylist()]
    elif types.is_integer(kind) or types.is_floating(kind):
        if column.null_count:
            column = column.cast(pa.float64(), safe=False)
        found.arrays[name] = column.to_numpy()
    elif types.is_timestamp(kind) or types.is_duration(kind):
        found.arrays[name] = column.to_numpy()
    else:
        found.unread[name] = str(kind)


def _limit() -> None:
    """Limit the memory, where the system can, and leave no image of a crash."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def main(kind: str, path: str, out: str) -> None:
    """Read a file and write its variables."""
    _limit()
    readers: Mapping[str, Callable[[str, Found], None]] = {
        one.__name__: one for one in (matlab_5, matlab_73, parquet, parquet_names)
    }
    found = Found()
    sys.modules["pandas"] = None  # type: ignore[assignment]  # pyarrow would take a second to import it
    try:
        readers[kind](path, found)
    except MemoryError:
        found.report, found.arrays = {"memory": True}, {}
    except Exception as error:  # whatever the library raises at a damaged file
        found.report, found.arrays = {"problem": f"{type(error).__name__} {error}"[:300]}, {}
    found.report["names"] = [*found.arrays]
    report = np.frombuffer(json.dumps(found.report).encode(), dtype=np.uint8)
    with open(out, "wb") as file:
        np.savez(file, report, *found.arrays.values())


if __name__ == "__main__":
    main(*sys.argv[1:])
