"""Finished batches of a long run, kept in a folder so that an interrupted run can go on."""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.persistence import load_arrays, read_json, save_arrays, write_json_atomic
from errorscreen.exceptions import InputError

FORMAT, VERSION = "errorscreen-checkpoint", 1
_MANIFEST = "checkpoint.json"


def digest(*values: Any) -> str:
    """Fingerprint of values: equal for equal numbers, texts, arrays, dataclasses and collections of them.

    Of other objects only the type counts.

    Examples
    --------
    >>> digest([1, 2.0], {"a": np.arange(3)}) == digest([1, 2.0], {"a": np.arange(3)})
    True
    >>> digest(np.arange(3)) == digest(np.arange(3.0))
    False
    """
    state = hashlib.sha256()
    _feed(state, values)
    return state.hexdigest()


@cache
def program() -> str:
    """Fingerprint of this package's code: what an earlier state of it has computed does not count as finished."""
    folder = Path(__file__).parent
    return digest(
        [(path.relative_to(folder).as_posix(), path.read_bytes()) for path in sorted(folder.rglob("*.py"))]
    )


def _feed(state: Any, value: Any) -> None:
    state.update(f"{type(value).__module__}.{type(value).__qualname__}(".encode())
    if isinstance(value, np.ndarray):
        state.update(f"{value.dtype.str}{value.shape}".encode())
        state.update(np.ascontiguousarray(value).tobytes())
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


class Checkpoint:
    """A folder of finished batches that belong to one run.

    Parameters
    ----------
    folder : path-like
        Made where it does not exist.
    fingerprint : mapping of str to str
        `digest` of everything the batches depend on, by a name that the user understands.

    Raises
    ------
    InputError
        If the folder cannot be used, or holds the batches of a run with another fingerprint.
    """

    def __init__(self, folder: str | os.PathLike[str], fingerprint: Mapping[str, str]) -> None:
        self.folder = Path(folder)
        where = f"checkpoint {self.folder}"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"the folder cannot be made: {error.strerror}", where=where, allowed="a folder"
            ) from error
        manifest = self.folder / _MANIFEST
        if not manifest.exists():
            write_json_atomic(manifest, {"fingerprint": fingerprint}, format=FORMAT, version=VERSION)
            return
        stored = read_json(manifest, format=FORMAT, version=VERSION)["fingerprint"]
        different = [name for name, value in fingerprint.items() if stored.get(name) != value]
        if different:
            raise InputError(
                f"the folder belongs to another run: {', '.join(different)} differ",
                where=where,
                remedy="Repeat the call that made it, or use another folder",
            )

    def save(self, number: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Store one finished batch, complete or not at all."""
        save_arrays(self._path(number), format=FORMAT, version=VERSION, arrays=arrays)

    def load(self, numbers: Iterable[int]) -> dict[int, dict[str, NDArray[Any]]]:
        """Return those of the numbered batches that are stored."""
        paths = {number: self._path(number) for number in numbers}
        return {
            number: load_arrays(path, format=FORMAT, version=VERSION)[0]
            for number, path in paths.items()
            if path.exists()
        }

    def _path(self, number: int) -> Path:
        return self.folder / f"batch-{number:06d}.npz"
