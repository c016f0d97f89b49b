"""Lines of progress in the log of the package."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class _Calling(logging.Handler):
    def __init__(self, call: Callable[[str], None]) -> None:
        super().__init__(logging.INFO)
        self._call = call

    def emit(self, record: logging.LogRecord) -> None:
        self._call(record.getMessage())


@contextmanager
def at_each_line(call: Callable[[str], None]) -> Iterator[None]:
    """Call a function with each line of the package's log inside the block; its errors pass."""
    logger, handler = logging.getLogger("errorscreen"), _Calling(call)
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(min(logging.INFO, logger.getEffectiveLevel()))
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
