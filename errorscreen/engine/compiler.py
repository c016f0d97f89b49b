"""Machine code of generated modules: compiled once on a machine, and without filling the memory of a process.

Numba gives nothing back of what it takes to compile a function: 10 MB for a plant, 40 MB for the 39-bus system. Code
that it finds in its file cache takes a tenth of that or less. So only a few modules are compiled in the process that
uses them; then another process compiles, which is replaced from time to time.
"""

from __future__ import annotations

import atexit
import importlib.util
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from types import ModuleType

import numba
from numba.types import boolean, float64, int64, uint64

#: characters of source that are compiled in this process, and in another one before it is replaced; each takes 2 kB
_HERE, _ELSEWHERE = 64_000, 200_000
_MATRIX = float64[:, ::1]
#: types of the arguments of a generated ``integrate``
ARGUMENTS = (
    uint64, int64, int64, float64[::1], boolean[::1], boolean[::1], _MATRIX, _MATRIX, _MATRIX, _MATRIX, int64[:, ::1],
    float64, int64, int64[:, ::1], int64[::1], int64[::1], int64[::1], float64[:, :, ::1],
)  # fmt: skip
#: other programs may hold the interpreter, and would be started once more
_IS_PYTHON = "python" in Path(sys.executable or "").name.lower()
#: one thread at a time writes, compiles and imports a module
LOADING = Lock()


def imported(path: Path) -> ModuleType:
    """Import a generated module, once in a process."""
    name = path.stem
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None
        assert spec.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


def compiled(path: Path) -> ModuleType:
    """Import a generated module with the machine code of its ``integrate``."""
    with _one_process(path):
        size = path.stat().st_size
        stored = Path(numba.config.CACHE_DIR or path.parent / "__pycache__")  # numba's file cache
        if not any(stored.rglob(f"{path.stem}.integrate-*.nbi")):
            if _HELPER.compiled_here + size > _HERE and _IS_PYTHON:
                _HELPER.compile(path, size)
            else:
                _HELPER.compiled_here += size
        module = imported(path)
        module.integrate.compile(ARGUMENTS)
    return module


@contextmanager
def _one_process(path: Path) -> Iterator[None]:
    """Let other processes wait until this one has compiled a module; without file locks they compile it, too."""
    with path.open() as file:
        with suppress(ImportError, OSError):
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX)
        yield


class _Helper:
    """Another process that compiles modules one at a time."""

    def __init__(self) -> None:
        self.compiled_here = self._size = self._owner = 0
        self._process: subprocess.Popen[str] | None = None

    def compile(self, path: Path, size: int) -> None:
        """Have a module compiled and stored; where that fails, nothing happens."""
        if self._owner != os.getpid():  # the process of a parent that was forked
            self._process, self._owner = None, os.getpid()
        if self._process is not None and self._size + size > _ELSEWHERE:
            self.end()
        try:
            process = self._process = self._process or self._started()
            assert process.stdin is not None
            assert process.stdout is not None
            self._size += size
            print(path, file=process.stdin, flush=True)
            if not process.stdout.readline():
                self.end()
        except Exception:
            self.end()
        except BaseException:  # interrupted: the answer would be taken for that to the next module
            self.end()
            raise

    def _started(self) -> subprocess.Popen[str]:
        self._size = 0
        folders = os.pathsep.join(folder or os.getcwd() for folder in sys.path)
        return subprocess.Popen(
            [sys.executable, "-P", "-c", f"from {__name__} import serve; serve()"],
            env={**os.environ, "PYTHONPATH": folders},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def end(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None and self._owner == os.getpid():
            process.kill()
            process.communicate()


_HELPER = _Helper()
atexit.register(_HELPER.end)


def serve() -> None:
    """Compile modules whose paths are read, one a line, until there are no more; the process of `_Helper`."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # imported modules may print
    for line in sys.stdin:
        with suppress(Exception):
            imported(Path(line.rstrip("\n"))).integrate.compile(ARGUMENTS)
        print("done", file=answers, flush=True)
