"""A call that runs in a process of its own while this one goes on."""

from __future__ import annotations

import signal
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from pickle import PicklingError
from typing import ParamSpec, TypeVar

# joblib's own: unlike the standard library's it does not run the caller's script again, and it also passes functions on
# that have no name in a module
from joblib.externals.loky import ProcessPoolExecutor
from tqdm import tqdm

#: seconds for which a process stays that nobody asks for more, such as one whose parent was killed
_IDLE = 5.0
_P = ParamSpec("_P")
_T = TypeVar("_T")


@contextmanager
def beside(function: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> Iterator[Callable[[], _T]]:
    """Begin a call in a process of its own; at the end of the block that process ends, whether it is done or not.

    Worth it where much of the time is spent in the interpreter, whose lock threads share.

    Parameters
    ----------
    function : callable
        What it and its arguments hold is copied; what it changes stays in its process.
    *args, **kwargs
        Of the call.

    Yields
    ------
    callable
        Waits for the result and returns it, with the warnings of the call, or raises what it has raised. Where there
        can be no such process, because something cannot be copied or the memory is not enough, the call is made here.

    Examples
    --------
    >>> with beside(pow, 2, 10) as result:
    ...     here = sum(range(10))
    ...     there = result()
    >>> here, there
    (45, 1024)
    """
    pool = ProcessPoolExecutor(1, initializer=_prepare, timeout=_IDLE)
    try:
        future = pool.submit(_recorded, function, *args, **kwargs)

        def result() -> _T:
            try:
                found, warned = future.result()
            except (BrokenExecutor, PicklingError):
                return function(*args, **kwargs)
            for warning in warned:
                warnings.warn(warning, stacklevel=2)
            return found

        yield result
    finally:
        pool.shutdown(kill_workers=True)


def _recorded(
    function: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs
) -> tuple[_T, list[Warning | str]]:
    """Result of a call, and its warnings, which the process that waits shows as its own."""
    with warnings.catch_warnings(record=True) as warned:
        return function(*args, **kwargs), [warning.message for warning in warned]


def _prepare() -> None:
    """Leave Ctrl-C, which a terminal sends to all processes, to the one that waits; and leave nothing behind."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # progress bars share a lock with other processes otherwise, and one that was killed is reported to have leaked it
    tqdm.set_lock(threading.RLock())
