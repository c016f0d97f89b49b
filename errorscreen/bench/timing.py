"""How time and memory are measured: repetition, new processes, the machine."""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

_SHORTEST = 0.3  # seconds of repetition behind every figure
_LIBRARIES = ("numpy", "numba", "scipy", "PyWavelets", "scikit-learn")


def best_seconds(call: Callable[[], Any]) -> float:
    """Seconds of one call: the best of three rounds of repetition, after one call to warm up."""
    call()
    start = perf_counter()
    call()
    repeat = max(1, int(_SHORTEST / 3 / max(perf_counter() - start, 1e-6)))
    rounds = []
    for _ in range(3):
        start = perf_counter()
        for _ in range(repeat):
            call()
        rounds.append((perf_counter() - start) / repeat)
    return min(rounds)


def in_new_process(code: str, **environment: str) -> str:
    """Last line that `code` prints in a new Python process, which finds the same packages as this one.

    What it writes to stderr is shown, so that a failure explains itself.

    Parameters
    ----------
    code : str
    **environment : str
        Variables that differ from those of this process.

    Returns
    -------
    str

    Raises
    ------
    subprocess.CalledProcessError
        If the code fails.

    Examples
    --------
    >>> in_new_process("print('one'); print('two')")
    'two'
    """
    path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path, **environment},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()[-1]


def peak_gib() -> float | None:
    """Most memory that this process has held so far, in GiB; None where the system does not tell (only Linux does).

    It is read from the kernel's account of this process, because ``getrusage`` starts a child at its parent's peak.
    """
    path = Path("/proc/self/status")
    found = re.search(r"VmHWM:\s*(\d+) kB", path.read_text()) if path.exists() else None
    return int(found[1]) / 2**20 if found else None


def _processor() -> str:
    """Model of the processor where the system tells, else its architecture."""
    path = Path("/proc/cpuinfo")
    found = re.search(r"model name\s*: (.+)", path.read_text()) if path.exists() else None
    return found[1].strip() if found else platform.processor() or platform.machine()


def machine() -> dict[str, Any]:
    """What was measured on: processor, cores, versions."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in _LIBRARIES},
    }
