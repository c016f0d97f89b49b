"""Measurement of time and memory: repetition, new processes, the machine."""

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

#: seconds of repetition behind each figure
_SHORTEST = 0.3
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
    """Last line that `code` prints in a new Python process, which finds the same packages as this one."""
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
    """Largest memory of this process so far in GiB; None on systems other than Linux.

    It is read from the kernel's account of this process, because ``getrusage`` starts a child at its parent's peak.
    """
    found = _found("/proc/self/status", r"VmHWM:\s*(\d+) kB")
    return int(found) / 2**20 if found else None


def _found(file: str, pattern: str) -> str | None:
    """First match in a file of the system, if there are both."""
    path = Path(file)
    found = re.search(pattern, path.read_text()) if path.exists() else None
    return found[1].strip() if found else None


def machine() -> dict[str, Any]:
    """Processor, number of cores and versions of Python and libraries."""
    processor = _found("/proc/cpuinfo", r"model name\s*: (.+)")
    return {
        "processor": processor or platform.processor() or platform.machine(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in _LIBRARIES},
    }
