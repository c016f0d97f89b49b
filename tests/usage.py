"""Writes time and memory of every test as CSV; off unless asked for: ``pytest -p tests.usage --usage FILE``."""

import os
import resource
import time
from pathlib import Path

import numba.core.event
import pytest


class _Compilation(numba.core.event.Listener):
    """Seconds that numba compiled, nested compilations counted once."""

    def __init__(self):
        self.seconds, self.count, self._depth, self._begun = 0.0, 0, 0, 0.0

    def on_start(self, event):
        if self._depth == 0:
            self._begun = time.perf_counter()
        self._depth += 1

    def on_end(self, event):
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._begun
            self.count += 1


def _resident():
    """MiB that this process holds now."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 2**20


class _Usage:
    def __init__(self, path):
        self.path, self.compilation = path, _Compilation()
        numba.core.event.register("numba:compiler_lock", self.compilation)

    def _now(self):
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        return (
            time.perf_counter(),
            time.process_time(),
            children.ru_utime + children.ru_stime,
            self.compilation.seconds,
            _resident(),
        )

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item):
        before = self._now()
        yield
        spent = ",".join(f"{b - a:.2f}" for a, b in zip(before, self._now(), strict=True))
        worker = os.environ.get("PYTEST_XDIST_WORKER", "main")
        with self.path.open("a", encoding="utf-8") as file:
            file.write(f'{worker},{spent},{_resident():.0f},"{item.nodeid}"\n')


def pytest_addoption(parser):
    parser.addoption("--usage", metavar="FILE", help="CSV for the time and memory of every test")


def pytest_configure(config):
    if path := config.getoption("--usage"):
        path = Path(path).resolve()
        if not hasattr(config, "workerinput"):
            path.write_text(
                "worker,seconds,cpu,cpu_children,compiling,grown_mib,held_mib,test\n", encoding="utf-8"
            )
        config.pluginmanager.register(_Usage(path), "usage")
