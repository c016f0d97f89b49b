"""A call in a process of its own while this one continues."""

from __future__ import annotations

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator
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


@contextmanager
def in_subprocess(function: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> Iterator[Call[_T]]:
    """Start a call in a process of its own, which ends with the block, whether the call is done or not.
    It helps where much of the time is spent in the interpreter, whose lock threads share. Function and arguments are
    copied; settings of joblib and threadpoolctl do not carry over.
    """
    future: Future[tuple[_T, list[Warning | str]]] = Future()
    pool = None
    try:
        try:
            task = cloudpickle.dumps(partial(function, *args, **kwargs))
            pool = ProcessPoolExecutor(1, initializer=_prepare, initargs=(os.getpid(),))
            future = pool.submit(_recorded, task)
        except Exception as error:  # not picklable, no memory, or no right to start a process inside a worker
            future.set_exception(BrokenExecutor(f"no process could start: {error}"))
        yield Call(future)
    finally:
        if pool is not None:
            pool.shutdown(kill_workers=True)


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
