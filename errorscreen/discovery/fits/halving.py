"""Fits side by side: what cannot be simulated drops out, and what is far behind is not led to its end."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable
from functools import partial
from typing import TypeVar

from errorscreen._runtime.threads import parallel_map
from errorscreen.discovery.fits.hypotheses import SLICE, SLICES, JointFit
from errorscreen.exceptions import SimulationError

_T = TypeVar("_T")


def attempted(calls: Iterable[Callable[[], _T]], threads: int) -> list[_T | None]:
    """Results of some calls, made side by side in so many threads; None for each that cannot be simulated."""
    return parallel_map([partial(_attempted, call) for call in calls], threads)


def _attempted(call: Callable[[], _T]) -> _T | None:
    with contextlib.suppress(SimulationError):
        return call()
    return None


def race(fits: Iterable[JointFit | None], threads: int) -> list[JointFit]:
    """Go on with begun fits side by side, without those that have come to rest far above the best.

    Those that could not begin (None, see `attempted`) are left out.
    """
    begun = [fit for fit in fits if fit is not None]
    running = begun
    for _ in range(SLICES):
        active = [partial(fit.run, SLICE) for fit in running if fit.active]
        running = parallel_map(active, threads)
        best = min((fit.objective for fit in begun), default=0.0)
        running = [fit for fit in running if fit.may_reach(best)]
    return begun
