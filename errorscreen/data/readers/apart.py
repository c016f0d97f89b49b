"""Files that are read in a process of its own: a damaged file may end or hang that process, not the user's."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from errorscreen.data.readers import child
from errorscreen.exceptions import InputError, MissingExtraError

#: s that reading may take, and bytes that are read in one more second; usual are 3e8
_SECONDS, _RATE = 30.0, 2e7


@dataclass(frozen=True)
class Variables:
    """Contents of a file by name: arrays, lists of texts, kinds of unread variables; `report` holds the rest."""

    arrays: dict[str, np.ndarray[Any, Any]]
    texts: dict[str, list[str]]
    unread: dict[str, str]
    report: dict[str, Any] = field(default_factory=dict)


def check_extra(package: str, extra: str) -> None:
    """Raise `MissingExtraError` where a package is not installed."""
    if find_spec(package) is None:
        raise MissingExtraError(package, extra=extra)


def variables_of(kind: str, path: Path, allowed: str) -> Variables:
    """Read a file by `errorscreen.data.readers.child`.

    Parameters
    ----------
    kind : {"matlab_5", "matlab_73", "parquet", "parquet_names"}
    path : Path
    allowed : str
        Kind of file, for messages.

    Raises
    ------
    InputError
        If the file is damaged, the process ends, or it takes too long or too much memory.
    """
    where, remedy = f"file {path}", "Open it in the program that wrote it and save it again, or export CSV"
    few_threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
    limit = _SECONDS + path.stat().st_size / _RATE
    with TemporaryDirectory() as folder:
        out = Path(folder, "found.npz")
        # with -P, the modules beside the program do not stand for those of Python
        command = [sys.executable, "-P", child.__file__, kind, os.path.abspath(path), str(out)]
        try:
            ended = subprocess.run(
                command, env=os.environ | few_threads, timeout=limit, check=False,
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            ).returncode  # fmt: skip
            problem = f"the process that reads it ended with code {ended}"
        except subprocess.TimeoutExpired:
            ended, problem = 1, f"reading it took more than {limit:.3g} s"
        if ended or not out.is_file():
            raise InputError(f"{problem}: a damaged file?", where=where, allowed=allowed, remedy=remedy)
        with np.load(out, allow_pickle=False) as found:
            report = json.loads(found["arr_0"].tobytes())
            names = report.pop("names")
            arrays = {name: found[f"arr_{number}"] for number, name in enumerate(names, start=1)}
    if "memory" in report:
        limits = f"at most {child.LARGEST // 2**20} MiB of numbers"
        raise InputError(
            "needs too much memory", where=where, allowed=limits, remedy="Check the file, or cut it"
        )
    if "problem" in report:
        raise InputError(f"is damaged: {report['problem']}", where=where, allowed=allowed, remedy=remedy)
    return Variables(arrays, report.pop("texts"), report.pop("unread"), report)
