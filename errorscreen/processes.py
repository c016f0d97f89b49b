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
from loky import (
    ProcessPoolExecutor,
)  # unlike the standard library's it does not run the caller's script again
from tqdm import tqdm

#: seconds between two looks at whether the parent is still there
_LOOKS = 1.0
_P = ParamSpec("_P")
_T = TypeVar("_T")


class Call(Generic[_T]):
    """What a call returns that another process makes, or this one where no other can.

    Parameters
    ----------
    here : callable
        Makes the call in this process.
    future : Future, optional
        Its result and its warnings from the other process.
    """

    def __init__(
        self, here: Callable[[], _T], future: Future[tuple[_T, list[Warning | str]]] | None = None
    ) -> None:
        self._here, self._future = here, future

    @property
    def done(self) -> bool:
        """Whether nothing goes on in another process."""
        return self._future is None or self._future.done()

    def check(self) -> None:
        """Raise what the call has raised in the other process, if it has ended so."""
        if self._future is not None and self.done:
            with suppress(BrokenExecutor):
                self._future.result()

    def result(self) -> _T:
        """Wait for the result and return it, with the warnings of the call, or raise what it has raised.

        It is made here where the other process could not begin, or was killed.
        """
        if self._future is not None:
            with suppress(BrokenExecutor):
                found, warned = self._future.result()
                for warning in warned:
                    warnings.warn(warning, stacklevel=2)
                return found
        return self._here()


@contextmanager
def beside(function: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> Iterator[Call[_T]]:
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
    >>> with beside(pow, 2, 10) as call:
    ...     here = sum(range(10))
    ...     there = call.result()
    >>> here, there
    (45, 1024)
    """
    here, pool, future = partial(function, *args, **kwargs), None, None
    # whatever stands in the way of another process (what cannot be copied, no memory, no right to begin one inside of a
    # worker), the call can be made here
    with suppress(Exception):
        task = cloudpickle.dumps(here)
        pool = ProcessPoolExecutor(1, initializer=_prepare, initargs=(os.getpid(),))
        future = pool.submit(_recorded, task)
    try:
        yield Call(here, future)
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
