"""Finished parts of a long computation in a folder, so that an interrupted run resumes.

joblib.Memory and diskcache are no substitute: they unpickle what they read, and reading a file must run no code.
"""

from __future__ import annotations

import dataclasses
import hashlib
import logging
import os
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.persistence import load_arrays, read_json, save_arrays, write_json_atomic
from errorscreen.exceptions import InputError

_log = logging.getLogger(__name__)
FORMAT, VERSION = "errorscreen-store", 1
_MANIFEST = "store.json"
_Arrays = dict[str, NDArray[Any]]
#: arrays and JSON values of one part
Entry = tuple[_Arrays, dict[str, Any]]


class Store:
    """A folder of entries, each with arrays and JSON values, that depend on the same inputs.
    An entry is written completely or not at all; several runs may share a folder. The `fingerprint` has the `digest` of
    each input by a name that the user understands: a folder of other inputs is refused. `reused` names the entries
    found.
    """

    def __init__(self, folder: str | os.PathLike[str], fingerprint: Mapping[str, str] | None = None) -> None:
        self.folder = Path(folder)
        self.reused: list[str] = []
        self._key = digest(fingerprint)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"the folder cannot be made: {error.strerror or error}",
                where=f"folder {self.folder}",
                allowed="a folder for finished parts",
                remedy="Delete or rename what is in its place, or give another folder",
            ) from None
        if fingerprint is not None:
            self._claim(fingerprint)

    def under(self, key: str) -> Store:
        """Store of the entries whose inputs have this fingerprint, which changes of other inputs leave in use."""
        store = Store(self.folder / key[:16], {"inputs": key})
        store.reused = self.reused
        return store

    def get(self, name: str, compute: Callable[[], Entry]) -> Entry:
        """Return arrays and JSON values of an entry: the stored ones, or those that `compute` returns."""
        found = self._find(name)
        if found is not None:
            self.reused.append(name)
            return found
        self._put(name, *compute())
        # a computed entry is read back too, so that a resumed run gives the same result bit for bit
        arrays, meta = load_arrays(self._path(name), format=FORMAT, version=VERSION)
        return arrays, meta["values"]

    def has(self, name: str) -> bool:
        """Whether an entry is there; only `get` checks that it can be used."""
        return self._path(name).exists()

    def load(self, numbers: Iterable[int]) -> dict[int, _Arrays]:
        """Return the arrays of those numbered batches that are stored."""
        found = {number: self._find(f"batch-{number:06d}") for number in numbers}
        return {number: entry[0] for number, entry in found.items() if entry is not None}

    def save(self, number: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Store the arrays of a numbered batch."""
        self._put(f"batch-{number:06d}", arrays, {})

    def _claim(self, fingerprint: Mapping[str, str]) -> None:
        """Write the inputs into the folder, or compare them with those that are there."""
        manifest = self.folder / _MANIFEST
        if not manifest.exists():
            write_json_atomic(manifest, {"fingerprint": fingerprint}, format=FORMAT, version=VERSION)
        stored = read_json(manifest, format=FORMAT, version=VERSION).get("fingerprint", {})
        different = [name for name, value in fingerprint.items() if stored.get(name) != value]
        if different:
            raise InputError(
                f"the folder belongs to another run: {', '.join(different)} differ",
                where=f"folder {self.folder}",
                remedy="Repeat the call that made it, or use another folder",
            )

    def _find(self, name: str) -> Entry | None:
        """Arrays and values of an entry; None where it is missing, damaged, or that of other inputs."""
        path = self._path(name)
        if not path.exists():
            return None
        try:
            arrays, meta = load_arrays(path, format=FORMAT, version=VERSION)
        except InputError as error:
            _log.warning("%s cannot be used (it %s); it is computed again", path, error.what)
            return None
        if (meta.get("name"), meta.get("key")) != (name, self._key):
            _log.warning("%s belongs to another run; it is computed again", path)
            return None
        return arrays, meta["values"]

    def _put(self, name: str, arrays: Mapping[str, NDArray[Any]], values: Mapping[str, Any]) -> None:
        meta = {"name": name, "key": self._key, "values": values}
        save_arrays(self._path(name), format=FORMAT, version=VERSION, arrays=arrays, meta=meta)

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.npz"


def digest(*values: Any) -> str:
    """Fingerprint of values: equal for equal numbers, texts, arrays, dataclasses and collections; else by type only."""
    state = hashlib.sha256()
    _feed(state, values)
    return state.hexdigest()


@cache
def program() -> str:
    """Fingerprint of this package's code, so that results of earlier code do not count as finished."""
    package = Path(__file__).parents[1]
    return digest(
        [(p.relative_to(package).as_posix(), p.read_bytes()) for p in sorted(package.rglob("*.py"))]
    )


def _feed(state: Any, value: Any) -> None:
    state.update(f"{type(value).__module__}.{type(value).__qualname__}(".encode())
    if isinstance(value, np.ndarray):
        state.update(f"{value.dtype.str}{value.shape}".encode())
        state.update(np.ascontiguousarray(value).ravel().view(np.uint8))
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for item in dataclasses.fields(value):
            _feed(state, item.name)
            _feed(state, getattr(value, item.name))
    elif isinstance(value, Mapping):
        for key in sorted(value):
            _feed(state, key)
            _feed(state, value[key])
    elif isinstance(value, list | tuple):
        for item in value:
            _feed(state, item)
    elif isinstance(value, str | bytes | int | float | complex | bool | np.generic) or value is None:
        state.update(repr(value).encode())
    state.update(b")")
