"""Finished stages of a study, kept so that an interrupted run goes on where it stopped."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from errorscreen.persistence import load_arrays, save_arrays

_FORMAT, _VERSION = "errorscreen-stage", 1
Stage = tuple[dict[str, Any], dict[str, Any]]


class StageStore:
    """Results of the stages of one study, in a folder that belongs to exactly this study.

    Parameters
    ----------
    folder : path-like
        Its parent holds the stages of all studies that were run with the same output folder.
    key : str
        Fingerprint of everything the stages depend on; another study gets another folder.
    """

    def __init__(self, folder: str | Path, key: str) -> None:
        self.folder = Path(folder) / key[:16]
        self.folder.mkdir(parents=True, exist_ok=True)
        self.reused: list[str] = []

    def get(self, name: str, compute: Callable[[], Stage]) -> Stage:
        """Return arrays and JSON values of a stage: the stored ones, or those that `compute` returns."""
        path = self.folder / f"{name}.npz"
        if path.exists():
            self.reused.append(name)
        else:
            arrays, meta = compute()
            save_arrays(path, format=_FORMAT, version=_VERSION, arrays=arrays, meta=meta)
        # also what was just computed is read back, so that a resumed run gives the same result bit for bit
        return load_arrays(path, format=_FORMAT, version=_VERSION)
