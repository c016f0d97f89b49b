"""Lines of progress in the log of the package."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class _Calling(logging.Handler):
    """Handler that calls a function, and hands on the lines that would have been shown without it."""

    def __init__(self, call: Callable[[str], None], parent: logging.Logger | None, shown: int) -> None:
        super().__init__(logging.INFO)
        self._call, self._parent, self._shown = call, parent, shown

    def emit(self, record: logging.LogRecord) -> None:
        self._call(record.getMessage())
        if self._parent is not None and record.levelno >= self._shown and self._parent.hasHandlers():
            self._parent.callHandlers(record)


@contextmanager
def at_each_line(call: Callable[[str], None]) -> Iterator[None]:
    """Call a function with each line of the package's log inside the block; its errors pass.

    Handlers of the program that uses the package see no more lines than before.
    """
    logger = logging.getLogger("errorscreen")
    level, shown, propagate = logger.level, logger.getEffectiveLevel(), logger.propagate
    handler = _Calling(call, logger.parent if propagate else None, shown)
    logger.addHandler(handler)
    logger.setLevel(min(logging.INFO, shown))
    logger.propagate = False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
        logger.propagate = propagate
