"""Signals that drive a plant in playback: the recorded voltage, or that behind the grid's impedance, and others."""

from __future__ import annotations

from numbers import Number

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from errorscreen.events import Playback
from errorscreen.exceptions import InputError
from errorscreen.models.device import Device

#: lowest voltage in pu at which P and Q give the current
_DEAD = 0.02


def check_impedance(impedance: complex) -> complex:
    """Return the impedance of a grid that can carry the rated power, or raise `InputError`."""
    number = isinstance(impedance, Number) and not isinstance(impedance, bool)
    value = complex(impedance) if number else complex(np.nan)
    if not (value.real >= 0 and value.imag >= 0 and abs(value) <= 1):
        raise InputError(
            f"the impedance of the grid is {impedance!r}",
            where="PlantSimulator",
            allowed="R + jX in pu of the device's base with R >= 0, X >= 0, and a magnitude of at most 1, where the "
            "short-circuit power is the rated one",
        )
    return value


def driving_signals(
    event: Playback,
    every: int,
    device: Device,
    impedance: complex,
    interpolation: str,
    jump: tuple[int, int, bool] | None = None,
) -> NDArray[np.float64]:
    """Real and imaginary part of the driving voltage at every half step, shape (2 * n_steps + 1, 2 + n_inputs).

    Of a device that power drives (`Device.imposed`), P and Q. Further columns are the deviations of recorded inputs
    (`Device.driven`) from their values before the event.

    Magnitude and angle are interpolated, not the components, so a turning phasor keeps its length. Monotone cubics
    (F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5, 1984) do not overshoot at a step. With a `jump`, (first
    sample, last sample, early), all signals jump just after the first sample, or just before the last.
    """
    inputs, by_power = tuple(device.driven), device.imposed != Device.imposed
    if by_power:
        needed = used = ("P", "Q", *inputs)
    else:
        more = (*(("P", "Q") if impedance else ()), *inputs)
        needed, used = ("V", *(("angle",) if device.needs_angle else ()), *more), ("V", "angle", *more)
    if not set(needed) <= set(event.signals):
        raise InputError(
            f"the event {event.name!r} has the signals {', '.join(event.signals) or 'none'}",
            allowed=f"{', '.join(needed)} for this device" + (" behind an impedance" if impedance else ""),
        )
    used = tuple(name for name in used if name in event.signals)
    samples = np.arange(len(event.time))
    position = np.arange(2 * every * samples[-1] + 1) / (2 * every)
    values = np.array([event.signals[name] for name in used], dtype=float)
    if interpolation == "linear":
        found = np.array([np.interp(position, samples, row) for row in values])
    else:  # together, because preparing each interpolation takes most of the time
        found = np.asarray(PchipInterpolator(samples, values, axis=1)(position))
    if jump is not None:
        first, last, early = jump
        found[:, (position > first) & (position < last)] = values[:, [last if early else first]]
    signals = dict(zip(used, found, strict=True))
    further = [signals[name] - event.initial[name] for name in inputs]
    if by_power:
        return np.column_stack([signals["P"], signals["Q"], *further])
    V = signals["V"] * (np.exp(1j * signals["angle"]) if "angle" in signals else 1.0 + 0j)
    if impedance:
        if np.abs(V).min() < _DEAD:
            raise InputError(
                f"the voltage falls to {np.abs(V).min():.2g} pu, where P and Q give no current, so the voltage behind "
                "the impedance is unknown",
                where=f"event {event.name!r}, grid_impedance",
                allowed=f"at least {_DEAD:g} pu",
                remedy="Leave the impedance out: the plant does not move a short-circuited voltage",
            )
        V = V - impedance * np.conj((signals["P"] + 1j * signals["Q"]) / V)
    return np.column_stack([V.real, V.imag, *further])
