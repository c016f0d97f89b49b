"""From a recording of any system to the inputs of a model and the outputs to compare with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.signal import resample_poly

from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.data.resampling import SHORT_GAP
from errorscreen.events import InputSignal
from errorscreen.exceptions import InputError

#: course of inputs between samples
INTERPOLATIONS = ("linear", "hold", "cubic", "bandlimited")
#: time stamps this close to a uniform grid, in steps, are rounded, not irregular
_ROUNDED = 0.05
#: steps of the grid between two irregular readings
_FINER = 4

Names = Mapping[str, str] | Iterable[str]
_Array = NDArray[np.float64]


def named(names: Names, what: str, empty: bool = False) -> tuple[tuple[str, ...], dict[str, str]]:
    """Names of quantities, and their units."""
    if isinstance(names, str):
        raise InputError(
            f"{what} is the text {names!r}", allowed="a list of names, or a mapping of names to units"
        )
    units = dict(names) if isinstance(names, Mapping) else {str(name): "" for name in names}
    if not units and not empty:
        raise InputError(f"there are no {what}", allowed="at least one name")
    return tuple(units), units


def signal_observation(
    recording: Recording,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    units: tuple[str, ...],
    initial: Mapping[str, str | float],
) -> Observation:
    """Inputs and measured outputs on one uniform grid; an output that was not recorded is all NaN.

    Irregular readings move to the nearest instant of a grid four times as fine, along the curve through their
    neighbours; the other instants are not compared. `initial` gives the first guess of states: a number, or the output
    whose first reading it is.
    """
    where = f"recording {recording.name!r}"
    for name in inputs:
        if name not in recording.channels:
            raise InputError(
                f"the input {name!r} was not recorded", where=where, allowed=", ".join(recording.names)
            )
    if not any(name in recording.channels for name in outputs):
        raise InputError(
            f"none of the outputs {', '.join(outputs)} was recorded",
            where=where,
            allowed=", ".join(recording.names),
        )
    for name, unit in zip(outputs, units, strict=True):
        found = recording.channels[name].unit if name in recording.channels else ""
        if unit and found and unit != found:
            raise InputError(
                f"channel {name!r} is in {found!r}, the model's output in {unit!r}", where=where,
                remedy="Convert the channel, or correct the unit",
            )  # fmt: skip
    time, regular = _grid(recording.time)
    signals = {name: _everywhere(recording, name, time) for name in inputs}
    values, noise = np.full((len(outputs), len(time)), np.nan), np.ones(len(outputs))
    for r, name in enumerate(outputs):
        if name in recording.channels:
            channel = recording.channels[name]
            values[r] = channel.values if regular else _placed(recording.time, channel.values, time)
            noise[r] = channel.noise
    start = {}
    for state, value in initial.items():
        if isinstance(value, str):
            row = values[outputs.index(value)]
            value = float(row[np.isfinite(row)][0]) if np.isfinite(row).any() else 0.0
        start[state] = float(value)
    notes = () if regular else (
        f"The readings are irregular; they were moved to a grid of {time[1] - time[0]:.3g} s.",
    )  # fmt: skip
    event = InputSignal(time, recording.name, max(recording.event_time, float(time[0])), signals, start)
    return Observation(event, values, noise, outputs, units, (*recording.assumptions, *notes))


def _grid(time: _Array) -> tuple[_Array, bool]:
    """Uniform time axis, and whether the readings lie on it."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    even = time[0] + step * np.arange(len(time))
    if np.abs(time - even).max() <= _ROUNDED * step:
        return even, True
    step = float(np.median(np.diff(time))) / _FINER
    return time[0] + step * np.arange(int(np.ceil((time[-1] - time[0]) / step - 1e-9)) + 1), False


def _placed(source: _Array, values: _Array, time: _Array) -> _Array:
    """Readings at the nearest instants of a finer grid."""
    known = np.isfinite(values)
    out = np.full(len(time), np.nan)
    if known.sum() < 2:
        return out
    index = np.rint((source[known] - time[0]) / (time[1] - time[0])).astype(int)
    out[index] = PchipInterpolator(source[known], values[known], extrapolate=True)(time[index])
    return out


def _everywhere(recording: Recording, name: str, time: _Array) -> _Array:
    """Input at all instants; a long gap is an error, because the system's input is unknown there."""
    values = recording.channels[name].values
    known = np.isfinite(values)
    t = recording.time[known]
    usual = float(np.median(np.diff(recording.time)))
    gaps = np.diff(np.r_[recording.time[0], t, recording.time[-1]]) if len(t) else np.array([np.inf])
    if gaps.max() > SHORT_GAP * usual:
        raise InputError(
            f"the input {name!r} has a gap of {gaps.max():.3g} s",
            where=f"recording {recording.name!r}",
            allowed=f"gaps of at most {SHORT_GAP * usual:.3g} s",
            remedy="Use a part of the recording without it",
        )
    return np.asarray(np.interp(time, t, values[known]))


def between_samples(
    event: InputSignal, names: tuple[str, ...], every: int, interpolation: str
) -> NDArray[np.float64]:
    """Inputs at the beginning, middle and end of each step, (K + 1, 3, n_inputs), with `every` steps between samples.

    ``"hold"`` suits digital controllers, ``"bandlimited"`` signals behind an anti-aliasing filter.
    """
    time = event.time
    steps = every * (len(time) - 1)
    at = time[0] + (time[-1] - time[0]) * np.arange(2 * steps + 1) / max(2 * steps, 1)
    out = np.empty((steps + 1, 3, len(names)))
    for j, name in enumerate(names):
        samples = np.asarray(event.signals[name], dtype=float)
        if interpolation == "hold":
            held = np.repeat(samples, every)[: steps + 1]
            held[-1] = samples[-1]
            out[:, :, j] = held[:, None]
            continue
        if interpolation == "cubic":
            fine = CubicSpline(time, samples)(at)
        elif interpolation == "bandlimited":
            fine = resample_poly(samples, 2 * every, 1, window=("kaiser", 8.0), padtype="line")[: len(at)]
        else:
            fine = np.interp(at, time, samples)
        out[:, 0, j] = fine[::2]
        out[:, 1, j] = np.r_[fine[1::2], fine[-1]]
        out[:, 2, j] = np.r_[fine[2::2], fine[-1]]
    return out
