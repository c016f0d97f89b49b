"""A call that runs in a process of its own while this one goes on."""

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

#: seconds between two looks at whether the parent is still there
_LOOKS = 1.0
_P = ParamSpec("_P")
_T = TypeVar("_T")


class Call(Generic[_T]):
    """A call that another process makes.

    Parameters
    ----------
    future : Future
        Its result and its warnings.
    """

    def __init__(self, future: Future[tuple[_T, list[Warning | str]]]) -> None:
        self._future = future

    @property
    def done(self) -> bool:
        """Whether nothing goes on any more."""
        return self._future.done()

    def check(self) -> None:
        """Raise what the call has raised, if it has ended so."""
        if self.done:
            with suppress(BrokenExecutor):
                self._future.result()

    def result(self) -> _T:
        """Wait for the result and return it, with the warnings of the call, or raise what it has raised.

        Raises
        ------
        BrokenExecutor
            If the process could not begin, or was killed: the call can still be made here.
        """
        found, warned = self._future.result()
        for warning in warned:
            warnings.warn(warning, stacklevel=2)
        return found


@contextmanager
def in_subprocess(function: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> Iterator[Call[_T]]:
    """Begin a call in a process of its own; at the end of the block that process ends, whether it is done or not.

    Worth it where much of the time is spent in the interpreter, whose lock threads share. Settings that joblib or
    threadpoolctl have in this process are not those of the other one.

    Parameters
    ----------
    function : callable
        What it and its arguments hold is copied at once; what it changes stays in its process.
    *args, **kwargs
        Of the call.

    Yields
    ------
    Call

    Examples
    --------
    >>> with in_subprocess(pow, 2, 10) as call:
    ...     here = sum(range(10))
    ...     there = call.result()
    >>> here, there
    (45, 1024)
    """
    future: Future[tuple[_T, list[Warning | str]]] = Future()
    pool = None
    try:
        try:
            task = cloudpickle.dumps(partial(function, *args, **kwargs))
            pool = ProcessPoolExecutor(1, initializer=_prepare, initargs=(os.getpid(),))
            future = pool.submit(_recorded, task)
        except (
            Exception
        ) as error:  # what cannot be copied, no memory, no right to begin a process inside of a worker
            future.set_exception(BrokenExecutor(f"no process could begin: {error}"))
        yield Call(future)
    finally:
        if pool is not None:
            pool.shutdown(kill_workers=True)


def _recorded(task: bytes) -> tuple[object, list[Warning | str]]:
    """Result of a call, and its warnings, which the process that waits shows as its own."""
    with warnings.catch_warnings(record=True) as warned:
        return cloudpickle.loads(task)(), [warning.message for warning in warned]


def _prepare(parent: int) -> None:
    """Leave Ctrl-C, which a terminal sends to all processes, to the one that waits; and leave nothing behind."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # progress bars share a lock with other processes otherwise, and one that was killed is reported to have leaked it
    tqdm.set_lock(threading.RLock())
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    """End this process when its parent has been killed (where the system tells)."""
    while os.getppid() == parent:
        time.sleep(_LOOKS)
    os._exit(1)
