"""What happened: the inputs a simulator is driven with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from errorscreen.exceptions import InputError


@dataclass(frozen=True)
class Event:
    """A disturbance, on the time grid on which it is observed.

    Parameters
    ----------
    time : ndarray of shape (L,)
        Uniform, increasing, in seconds: where responses are wanted.
    name : str
        For tables and plots.
    start : float
        Time at which the disturbance begins, in seconds, on the same axis as `time`; everything before it
        is the quiet part.
    """

    time: NDArray[np.float64]
    name: str = "event"
    start: float = 0.0

    def __post_init__(self) -> None:
        time = np.asarray(self.time, dtype=float)
        if time.ndim != 1 or len(time) < 2:
            raise InputError(f"the time axis has shape {time.shape}", allowed="at least two instants")
        steps = np.diff(time)
        if not np.allclose(steps, steps.mean(), rtol=1e-6, atol=1e-9) or not steps.mean() > 0:
            raise InputError(
                "the time axis of an event is not uniform and increasing",
                remedy="Resample the recording first (Recording.resample)",
            )
        object.__setattr__(self, "time", time)

    @property
    def dt(self) -> float:
        """Step of the time axis in seconds."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))


@dataclass(frozen=True)
class Playback(Event):
    """Measured signals that are injected at the terminal of a device.

    Parameters
    ----------
    signals : mapping of str to ndarray of shape (L,)
        ``"V"`` magnitude in pu and, where recorded, ``"angle"`` in rad.
    initial : mapping of str to float
        Pre-event values that the equilibrium is computed from: ``"V"``, ``"P"``, ``"Q"`` in pu.
    """

    signals: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, values in self.signals.items():
            if np.shape(values) != self.time.shape or not np.all(np.isfinite(values)):
                raise InputError(
                    f"signal {name!r} has shape {np.shape(values)} or holds values that are not finite",
                    allowed=f"{len(self.time)} finite values",
                )
