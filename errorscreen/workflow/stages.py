"""Finished stages of a study, kept so that an interrupted run goes on where it stopped."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from errorscreen._runtime.persistence import load_arrays, save_arrays
from errorscreen.exceptions import InputError

_FORMAT, _VERSION = "errorscreen-stage", 4
Stage = tuple[dict[str, Any], dict[str, Any]]


class StageStore:
    """Results of the stages of studies that have the same output folder.

    Each stage lies in a folder named after the fingerprint of what it depends on. So one that a change of the case file
    does not concern is used again, and one that it concerns is not.

    Parameters
    ----------
    folder : path-like
    report : callable
        Takes a line of text where a stored stage cannot be used.

    Raises
    ------
    InputError
        If the folder cannot be made.
    """

    def __init__(self, folder: str | Path, report: Callable[[str], None] = lambda line: None) -> None:
        self.root, self._report = Path(folder), report
        self.reused: list[str] = []
        _make(self.root)

    def folder(self, key: str) -> Path:
        """Folder of the stages with a fingerprint; made where it is missing."""
        return _make(self.root / key[:16])

    def has(self, name: str, key: str) -> bool:
        """Whether a stage lies there; only `get` finds out whether it can be used."""
        return self._path(name, key).exists()

    def get(self, name: str, key: str, compute: Callable[[], Stage]) -> Stage:
        """Return arrays and JSON values of a stage: the stored ones, or those that `compute` returns.

        Parameters
        ----------
        name : str
        key : str
            Fingerprint of everything the stage depends on.
        compute : callable
        """
        path = self._path(name, key)
        if path.exists():
            found = _stored(name, key, path)
            if found is not None:
                self.reused.append(name)
                return found
            self._report(f"{path} holds no finished stage of this study; it is computed again")
        arrays, values = compute()
        meta = {"stage": name, "key": key, "values": values}
        save_arrays(path, format=_FORMAT, version=_VERSION, arrays=arrays, meta=meta)
        # also what was just computed is read back, so that a resumed run gives the same result bit for bit
        arrays, stored = load_arrays(path, format=_FORMAT, version=_VERSION)
        return arrays, stored["values"]

    def _path(self, name: str, key: str) -> Path:
        return self.folder(key) / f"{name}.npz"


def _make(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"the folder cannot be made: {error.strerror or error}",
            where=f"folder {folder}",
            allowed="a folder for finished stages",
            remedy="Delete or rename what is in its place, or give another output folder",
        ) from None
    return folder


def _stored(name: str, key: str, path: Path) -> Stage | None:
    """What a file holds, or None if it is damaged or belongs to another stage or study."""
    try:
        arrays, stored = load_arrays(path, format=_FORMAT, version=_VERSION)
    except InputError:
        return None
    fits = stored.get("stage") == name and stored.get("key") == key
    return (arrays, stored["values"]) if fits else None
