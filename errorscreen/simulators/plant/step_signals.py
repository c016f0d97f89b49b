r"""Courses of steps of set-points, at every half step of the integration.

The Runge-Kutta method weighs the values at the beginning, the middle and the end of a step of length h with 1/6, 4/6
and 1/6. A jump at the instant :math:`t_s` anywhere in a step is a ramp of length h around it:

.. math:: \sigma(t) = \min\!\big(\max\!\big((t - t_s)/h + \tfrac12,\ 0\big),\ 1\big)                   \qquad (1)

The weighted sums of this ramp over all steps are those of the jump, so the impulse that it gives is exact.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from errorscreen.events import Playback
from errorscreen.exceptions import InputError


def ramp(time: NDArray[np.float64], instant: float, h: float) -> NDArray[np.float64]:
    """Values of (1) at instants in seconds.

    Examples
    --------
    >>> ramp(np.array([0.9, 0.95, 1.0, 1.05, 1.1]), 1.0, 0.1).round(2)
    array([0. , 0. , 0.5, 1. , 1. ])
    """
    return np.clip((time - instant) / h + 0.5, 0.0, 1.0)


def step_signals(event: Playback, every: int, quantities: Mapping[str, bool]) -> list[NDArray[np.float64]]:
    """Sum of stated steps of each quantity, and of unit steps where sizes are to be found, each (2 * n_steps + 1,).

    ``quantities`` are those that the device can step (`Device.steps`); another one raises `InputError`.
    """
    h = event.dt / every
    time = event.time[0] + 0.5 * h * np.arange(2 * every * (len(event.time) - 1) + 1)
    for one in event.steps:
        if one.quantity not in quantities or (one.size is None and not quantities[one.quantity]):
            what = "steps" if one.size is not None else "steps by a size that is to be found"
            raise InputError(
                f"{one.quantity} {what}, but the simulator was built without such a step",
                where=f"event {event.name!r}",
                allowed=", ".join(quantities) or "no step",
                remedy="State the step in the recording that the simulator is built from, or give it a device with all "
                "steps (errorscreen.models.set_points.with_steps), as a case file does",
            )
    columns = []
    for quantity, sought in quantities.items():
        own = [one for one in event.steps if one.quantity == quantity]
        known = [one.size * ramp(time, one.time, h) for one in own if one.size is not None]
        columns.append(np.sum(known, axis=0) if known else np.zeros(len(time)))
        if sought:
            unknown = [ramp(time, one.time, h) for one in own if one.size is None]
            columns.append(np.sum(unknown, axis=0) if unknown else np.zeros(len(time)))
    return columns
