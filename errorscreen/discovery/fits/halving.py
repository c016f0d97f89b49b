"""Many fits in parallel: those that cannot be simulated drop out, and those that fall far behind stop early."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable
from functools import partial
from typing import TypeVar

from errorscreen._runtime.threads import parallel_map
from errorscreen.discovery.fits.hypotheses import SLICE, SLICES, JointFit
from errorscreen.exceptions import SimulationError

_T = TypeVar("_T")


def try_all(calls: Iterable[Callable[[], _T]], threads: int) -> list[_T | None]:
    """Results of calls made in parallel threads; None for each that raises `SimulationError`."""

    def attempt(call: Callable[[], _T]) -> _T | None:
        with contextlib.suppress(SimulationError):
            return call()
        return None

    return parallel_map([partial(attempt, call) for call in calls], threads)


def fit_to_end(fits: Iterable[JointFit | None], threads: int) -> list[JointFit]:
    """Continue fits in parallel until they end or are too far above the best; a None (see `try_all`) is left out."""
    started = [fit for fit in fits if fit is not None]
    running = started
    for _ in range(SLICES):
        running = parallel_map([partial(fit.run, SLICE) for fit in running if fit.active], threads)
        best = min((fit.objective for fit in started), default=0.0)
        running = [fit for fit in running if fit.may_reach(best)]
    return started
