"""Finished stages of a study, kept so that an interrupted run goes on where it stopped."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from errorscreen.exceptions import InputError
from errorscreen.persistence import load_arrays, save_arrays

_FORMAT, _VERSION = "errorscreen-stage", 2
Stage = tuple[dict[str, Any], dict[str, Any]]


class StageStore:
    """Results of the stages of one study, in a folder that belongs to exactly this study.

    Parameters
    ----------
    folder : path-like
        Its parent holds the stages of all studies that were run with the same output folder.
    key : str
        Fingerprint of everything the stages depend on; another study gets another folder.
    report : callable
        Takes a line of text where a stored stage cannot be used.

    Raises
    ------
    InputError
        If the folder cannot be made.
    """

    def __init__(
        self, folder: str | Path, key: str, report: Callable[[str], None] = lambda line: None
    ) -> None:
        self.folder = Path(folder) / key[:16]
        self.reused: list[str] = []
        self._key, self._report = key, report
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"the folder cannot be made: {error.strerror or error}",
                where=f"folder {self.folder}",
                allowed="a folder for finished stages",
                remedy="Delete or rename what is in its place, or give another output folder",
            ) from None

    def get(self, name: str, compute: Callable[[], Stage]) -> Stage:
        """Return arrays and JSON values of a stage: the stored ones, or those that `compute` returns."""
        path = self.folder / f"{name}.npz"
        if path.exists():
            found = self._stored(name, path)
            if found is not None:
                self.reused.append(name)
                return found
            self._report(f"{path} holds no finished stage of this study; it is computed again")
        arrays, values = compute()
        meta = {"stage": name, "study": self._key, "values": values}
        save_arrays(path, format=_FORMAT, version=_VERSION, arrays=arrays, meta=meta)
        # also what was just computed is read back, so that a resumed run gives the same result bit for bit
        arrays, stored = load_arrays(path, format=_FORMAT, version=_VERSION)
        return arrays, stored["values"]

    def _stored(self, name: str, path: Path) -> Stage | None:
        """What a file holds, or None if it is damaged or belongs to another stage or study."""
        try:
            arrays, stored = load_arrays(path, format=_FORMAT, version=_VERSION)
        except InputError:
            return None
        fits = stored.get("stage") == name and stored.get("study") == self._key
        return (arrays, stored["values"]) if fits else None
