"""What runs on one thread so that a result does not depend on how many cores a machine has, and what on several."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from functools import wraps
from threading import local
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

_P = ParamSpec("_P")
_T = TypeVar("_T")
_BESIDE_OTHERS = local()


def one_blas_thread(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Let a function's matrix products run on one thread.

    On several threads a product is summed in another order, and the last digits differ. A search with many local
    minima, such as those of thresholds and timers, can then end in another one. Simulations keep their threads; their
    results do not depend on these.

    Parameters
    ----------
    function : callable

    Returns
    -------
    callable
        The same, with BLAS limited to one thread while it runs.

    Examples
    --------
    >>> import numpy as np
    >>> product = one_blas_thread(np.matmul)
    >>> float(product(np.ones(3), np.ones(3)))
    3.0
    """

    @wraps(function)
    def limited(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


def side_by_side(calls: Iterable[Callable[[], _T]], threads: int) -> list[_T]:
    """Results of some calls in their order, made in so many threads.

    Worth it where most of the time is spent in compiled code that releases the interpreter lock. Each call must have
    its own random numbers, so that its result does not depend on the others. After an exception nothing more begins,
    and after Ctrl-C nothing is waited for.

    Parameters
    ----------
    calls : iterable of callable
        Without arguments.
    threads : int
        With one, nothing is started, and calls may use threads of their own.

    Returns
    -------
    list

    Examples
    --------
    >>> from functools import partial
    >>> side_by_side([partial(abs, -1), partial(abs, -2)], threads=2)
    [1, 2]
    """
    calls = list(calls)
    if threads_left(threads) <= 1 or len(calls) <= 1:
        return [call() for call in calls]
    pool = ThreadPoolExecutor(threads)
    futures = [pool.submit(_called, call) for call in calls]
    at_once = False
    try:
        for future in wait(futures, return_when=FIRST_EXCEPTION).done:
            future.result()
        return [future.result() for future in futures]
    except KeyboardInterrupt:
        at_once = True
        raise
    finally:
        pool.shutdown(wait=not at_once, cancel_futures=True)


def threads_left(threads: int) -> int:
    """As many threads, or one inside of a call that runs beside others: these share the cores already."""
    return 1 if getattr(_BESIDE_OTHERS, "now", False) else threads


def _called(call: Callable[[], _T]) -> _T:
    _BESIDE_OTHERS.now = True  # the thread belongs to these calls
    return call()
