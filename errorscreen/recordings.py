"""Measured channels: names, units, time base, gaps, noise and what was assumed about them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from errorscreen.events import Event


@dataclass(frozen=True)
class Observation:
    """A recording as one simulator sees it: its channels, on its time grid.

    Parameters
    ----------
    event : Event
        What the simulator has to be driven with to reproduce it; ``event.time`` is the time axis (L,).
    values : ndarray of shape (R, L)
        Measured channels; NaN where nothing was measured.
    noise : ndarray of shape (R,)
        Standard deviation of the measurement noise of each channel, in the channel's unit; positive.
    channels : tuple of str
    units : tuple of str
    assumptions : tuple of str
        Sentences on what was assumed about the data, for the report.
    """

    event: Event
    values: NDArray[np.float64]
    noise: NDArray[np.float64]
    channels: tuple[str, ...]
    units: tuple[str, ...]
    assumptions: tuple[str, ...] = ()

    @property
    def time(self) -> NDArray[np.float64]:
        """Time axis in seconds, shape (L,)."""
        return self.event.time

    @property
    def mask(self) -> NDArray[np.bool_]:
        """True where a value was measured, shape (R, L)."""
        return np.isfinite(self.values)
