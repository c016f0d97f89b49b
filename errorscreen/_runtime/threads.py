"""Threads whose number does not change a result: one for BLAS, several for independent calls."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache, wraps
from threading import Lock, local
from typing import Any, Generic, ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

_P = ParamSpec("_P")
_T = TypeVar("_T")
_GROUP = local()
#: largest number of threads beside the callers' own
_MOST = 128


def one_blas_thread(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Limit BLAS to one thread while a function runs.
    Several threads sum a product in another order, and a search with many local minima can then end in another one.
    Simulations keep their threads, which do not change their results.
    """

    @wraps(function)
    def limited(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


def parallel_map(calls: Iterable[Callable[[], _T]], threads: int) -> list[_T]:
    """Make calls in `threads` threads, of which the caller's is one; results keep their order.
    Each call needs random numbers of its own. After an exception no further call starts, and after Ctrl-C none is
    awaited. With one thread, calls may use threads of their own.
    """
    calls = list(calls)
    threads = threads_left(threads)
    if threads <= 1 or len(calls) <= 1:
        return [call() for call in calls]
    group = _Group(calls, threads)
    helpers = [_pool().submit(group.work) for _ in range(min(threads, len(calls)) - 1)]
    try:
        group.work()
        running = [helper for helper in helpers if not helper.cancel()]
        if not isinstance(group.error, KeyboardInterrupt):
            wait(running)
    except KeyboardInterrupt:
        group.end()
        raise
    if group.error is not None:
        raise group.error
    return group.results


def threads_left(threads: int) -> int:
    """Return `threads`, or fewer inside a call of `parallel_map`: the calls that still run share its threads."""
    group: _Group[Any] | None = getattr(_GROUP, "now", None)
    return threads if group is None else min(threads, group.share)


class _Group(Generic[_T]):
    """Calls that several threads work off; each takes the next one."""

    def __init__(self, calls: list[Callable[[], _T]], threads: int) -> None:
        self._calls, self._threads, self._lock = calls, threads, Lock()
        self._begun, self._left = 0, len(calls)
        self.results: list[Any] = [None] * len(calls)
        self.error: BaseException | None = None

    @property
    def share(self) -> int:
        """Threads for each of the calls that have not ended."""
        return max(1, self._threads // max(1, self._left))

    def work(self) -> None:
        """Make calls until all have started."""
        outer, _GROUP.now = getattr(_GROUP, "now", None), self
        try:
            while (number := self._next()) < len(self._calls):
                try:
                    self.results[number] = self._calls[number]()
                except BaseException as error:
                    self.error = self.error or error
                    self.end()
                with self._lock:
                    self._left -= 1
        finally:
            _GROUP.now = outer

    def end(self) -> None:
        """Start no more calls."""
        with self._lock:
            self._begun = len(self._calls)

    def _next(self) -> int:
        with self._lock:
            number, self._begun = self._begun, self._begun + 1
            return number


@cache
def _pool() -> ThreadPoolExecutor:
    """Waiting threads, because starting one takes as long as a small batch; where none is free, the caller does all."""
    return ThreadPoolExecutor(_MOST)


# threads do not survive a fork
os.register_at_fork(after_in_child=_pool.cache_clear)
