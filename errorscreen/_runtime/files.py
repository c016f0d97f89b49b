"""Paths of users' files: refused where they are no ordinary file of usual size, which reading might never end on."""

from __future__ import annotations

import difflib
import hashlib
import stat
from collections.abc import Iterable
from pathlib import Path

from errorscreen.exceptions import InputError


def check_file(path: Path, where: str, largest: int, allowed: str, remedy: str | None = None) -> None:
    """Refuse a path that is no ordinary file.

    Parameters
    ----------
    path : Path
    where : str
        Name of the file, for messages.
    largest : int
        Bytes that it may have.
    allowed : str
        Kind of file, for messages.
    remedy : str, optional
        For a path of another kind.

    Raises
    ------
    InputError
        With the nearest names in the folder for a file that does not exist.
    """
    try:
        found = path.stat()
    except FileNotFoundError as error:
        siblings = [one.name for one in path.parent.iterdir()] if path.parent.is_dir() else []
        near = difflib.get_close_matches(path.name, siblings, n=3)
        advice = f"Did you mean {', '.join(near)}?" if near else "Check the path"
        raise InputError("does not exist", where=where, allowed=allowed, remedy=advice) from error
    except (OSError, ValueError) as error:
        problem = f"cannot be read: {getattr(error, 'strerror', None) or error}"
        raise InputError(problem, where=where, allowed=allowed) from error
    if not stat.S_ISREG(found.st_mode):
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a device or a pipe"
        raise InputError(f"is {kind}", where=where, allowed=allowed, remedy=remedy)
    check_size(found.st_size, largest, where)


def check_size(size: int, largest: int, where: str) -> None:
    """Refuse more bytes than a file, or what it unpacks to, may have."""
    if size > largest:
        raise InputError(
            f"has {size / 2**20:.0f} MiB",
            where=where,
            allowed=f"at most {largest // 2**20} MiB",
            remedy="Check that this is the right file, or cut it",
        )


def sha256(path: Path) -> str:
    """Digest of a file, by which it can be told again."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_new(paths: Iterable[Path], remedy: str) -> None:
    """Raise `InputError` for the first path that exists already."""
    for path in paths:
        if path.exists():
            raise InputError(
                "exists already, and is not overwritten",
                where=f"file {path}",
                allowed="a new file",
                remedy=remedy,
            )
