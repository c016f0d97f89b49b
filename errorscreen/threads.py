"""Linear algebra on one thread, so that a result does not depend on how many cores a machine has."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

_P = ParamSpec("_P")
_T = TypeVar("_T")


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
