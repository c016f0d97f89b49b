"""Results for the last few events and rows: a search simulates the same recordings over and over."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.events import Event

#: results that are kept; searches rarely have more recordings at once, with parts of them in several threads
_KEPT = 32
#: sets of rows that are kept, a few for each thread, and rows of those that are worth their memory
_KEPT_SETS, _MOST_ROWS = 8, 1024


class Recent:
    """Keeps what was computed for the last few events.

    An event is recognised as the same object, which does not change. Copies and pickles begin empty.

    Examples
    --------
    >>> from errorscreen.events import InputSignal
    >>> recent, event = Recent(), InputSignal([0.0, 1.0], "step", 0.0)
    >>> recent.get((event, 2), lambda: print("computed") or 7), recent.get((event, 2), lambda: 8)
    computed
    (7, 7)
    """

    def __init__(self) -> None:
        self._found: list[tuple[tuple[Any, ...], Any]] = []

    def __reduce__(self) -> tuple[type[Recent], tuple[()]]:
        return Recent, ()

    def get(self, key: tuple[Event, *tuple[Any, ...]], compute: Callable[[], Any]) -> Any:
        """Return what was computed for an event and further settings, or compute it.

        Parameters
        ----------
        key : tuple
            Event first, then what is compared by value.
        compute : callable
            Without arguments.
        """
        for known, value in self._found:
            if known[0] is key[0] and known[1:] == key[1:]:
                return value
        value = compute()
        self._found = [(key, value), *self._found[: _KEPT - 1]]
        return value


class RecentRows:
    """Keeps what was computed for the last few sets of rows, because one is simulated for several recordings in turn.

    What is kept must not be changed. Copies and pickles begin empty.

    Examples
    --------
    >>> recent, model = RecentRows(), object()
    >>> recent.get(np.ones((1, 2)), (model,), (0.1,), lambda: print("computed") or 7)
    computed
    7
    >>> recent.get(np.ones((1, 2)), (model,), (0.1,), lambda: 8)
    7
    """

    def __init__(self) -> None:
        self._found: list[tuple[NDArray[np.float64], tuple[Any, ...], tuple[Any, ...], Any]] = []

    def __reduce__(self) -> tuple[type[RecentRows], tuple[()]]:
        return RecentRows, ()

    def get(
        self,
        rows: NDArray[np.float64],
        objects: tuple[Any, ...],
        key: tuple[Any, ...],
        compute: Callable[[], Any],
    ) -> Any:
        """Return what was computed for rows, objects and further settings, or compute it.

        Parameters
        ----------
        rows : ndarray of shape (n, m)
            Compared by value.
        objects : tuple
            Recognised as the same objects, which do not change.
        key : tuple
            Compared by value.
        compute : callable
            Without arguments.
        """
        if len(rows) > _MOST_ROWS:
            return compute()
        for known, owners, settings, value in self._found:
            same = all(a is b for a, b in zip(owners, objects, strict=True)) and settings == key
            if same and np.array_equal(known, rows):
                return value
        value = compute()
        self._found = [(rows.copy(), objects, key, value), *self._found[: _KEPT_SETS - 1]]
        return value
