"""The smallest model there is, for docstrings and tests of the engine."""

from __future__ import annotations

from typing import Any


def decay(x: Any, u: Any, T: Any) -> Any:
    """First-order lag: T dx/dt = u - x."""
    return ((u - x) / T,)
