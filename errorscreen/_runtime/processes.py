"""A call in a process of its own while this one continues."""

from __future__ import annotations

import importlib
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager, suppress
from functools import partial
from typing import Generic, ParamSpec, TypeVar

import cloudpickle

# unlike the standard library's it does not run the caller's script again
from loky import ProcessPoolExecutor
from tqdm import tqdm

#: seconds between two checks that the parent is alive
_CHECK_EVERY = 1.0
_P = ParamSpec("_P")
_T = TypeVar("_T")


class Call(Generic[_T]):
    """A call in another process; its future holds the result and the warnings."""

    def __init__(self, future: Future[tuple[_T, list[Warning | str]]]) -> None:
        self._future = future

    @property
    def done(self) -> bool:
        """Whether the call has ended, with a result or an error."""
        return self._future.done()

    def check(self) -> None:
        """Raise the error of a call that has failed by now."""
        if self.done:
            with suppress(BrokenExecutor):
                self._future.result()

    def result(self) -> _T:
        """Wait for the result and return it, or raise the error of the call; repeat its warnings here.
        Raises `BrokenExecutor` if the process could not start or was killed: the call can still be made here.
        """
        found, warned = self._future.result()
        for warning in warned:
            warnings.warn(warning, stacklevel=2)
        return found


class Subprocess:
    """A process beside this one that makes a single call; see `subprocess_importing`."""

    def __init__(self) -> None:
        self._error = BrokenExecutor("the process has not begun, or has ended")
        self._pool: ProcessPoolExecutor | None = None

    def start(self, modules: Sequence[str]) -> None:
        """Start the process, which imports modules."""
        try:
            self._pool = ProcessPoolExecutor(1, initializer=_prepare, initargs=(os.getpid(),))
            if modules:
                self._pool.submit(_import, modules)
        except Exception as error:  # no memory, or no right to start a process inside a worker
            self._error = BrokenExecutor(f"no process could start: {error}")

    def call(self, function: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> Call[_T]:
        """Start a call. Function and arguments are copied; settings of joblib and threadpoolctl do not carry over."""
        future: Future[tuple[_T, list[Warning | str]]] = Future()
        try:
            if self._pool is None:
                raise self._error
            future = self._pool.submit(_recorded, cloudpickle.dumps(partial(function, *args, **kwargs)))
        except Exception as error:  # not picklable, or no process
            future.set_exception(BrokenExecutor(f"no process could start: {error}"))
        return Call(future)

    def end(self) -> None:
        """End the process, whether its call is done or not."""
        if self._pool is not None:
            self._pool.shutdown(kill_workers=True)
            self._pool = None


@contextmanager
def subprocess_importing(*modules: str) -> Iterator[Subprocess]:
    """Start a process that imports modules at once and waits for a call; it ends with the block.
    It helps where much of the time is spent in the interpreter, whose lock threads share.
    """
    process = Subprocess()
    try:
        process.start(modules)
        yield process
    finally:
        process.end()


def _import(modules: Sequence[str]) -> None:
    """Import modules; a missing one is told by the call that needs it."""
    for name in modules:
        with suppress(ImportError):
            importlib.import_module(name)


def _recorded(task: bytes) -> tuple[object, list[Warning | str]]:
    """Result of a call and its warnings."""
    with warnings.catch_warnings(record=True) as warned:
        return cloudpickle.loads(task)(), [warning.message for warning in warned]


def _prepare(parent: int) -> None:
    """Prepare the process: leave Ctrl-C to the parent, and end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # a lock shared with other processes would be reported as leaked if this process is killed
    tqdm.set_lock(threading.RLock())
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    """End this process when its parent has been killed (where the system reports that)."""
    while os.getppid() == parent:
        time.sleep(_CHECK_EVERY)
    os._exit(1)
