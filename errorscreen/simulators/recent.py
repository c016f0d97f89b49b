"""Results for the last few events, because a search simulates the same recordings over and over."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from errorscreen.events import Event

#: results that are kept; searches rarely have more recordings at once, with parts of them in several threads
_KEPT = 32


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
