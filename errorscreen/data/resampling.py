"""Interpolation of irregular readings onto a time grid, with a low-pass filter and without bridging long gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter1d

from errorscreen.exceptions import InputError

#: Longest gap that is interpolated, in multiples of the usual distance between readings.
SHORT_GAP = 5.0
#: A grid coarser than this many readings needs a low-pass filter.
COARSE = 2.0
#: Largest number of instants of a grid and of steps of a simulation; more suggest a wrong unit or step.
MAX_STEPS = 1_000_000
#: instants of a grid for each reading; more hold no reading, and might be more than any memory holds
_MOST_INSTANTS = 20


def check_steps(span: float, step: float, where: str) -> None:
    """Raise `InputError` if `span` seconds take more than `MAX_STEPS` steps of `step` seconds."""
    if span > step * MAX_STEPS:
        raise InputError(
            f"{span:g} s in steps of {step:g} s are {span / step:.3g} steps",
            where=where,
            allowed=f"at most {MAX_STEPS:.0e}, here from {span / MAX_STEPS:.3g} s on",
            remedy="Choose a longer step or a shorter window, and check the unit of the time stamps",
        )


def check_holes(time: NDArray[np.float64], step: float, where: str) -> None:
    """Raise `InputError` if a grid of `step` seconds would be nearly empty, as with a stamp far from the others."""
    span = float(time[-1] - time[0])
    if span > step * _MOST_INSTANTS * len(time):
        raise InputError(
            f"only {len(time)} samples lie between {time[0]:g} and {time[-1]:g} s",
            where=where,
            allowed=f"at least {span / step / _MOST_INSTANTS:.3g} at a step of {step:.3g} s",
            remedy="Correct or cut the rows whose stamps lie far from the others, or choose a longer step",
        )


def spacing(time: ArrayLike, values: ArrayLike) -> float:
    """Median distance between readings that are not NaN, in seconds."""
    readings = np.asarray(time, dtype=float)[np.isfinite(np.asarray(values, dtype=float))]
    return float(np.median(np.diff(readings))) if len(readings) > 1 else float("inf")


def uniform_grid(start: float, stop: float, dt: float) -> NDArray[np.float64]:
    """Instants ``start, start + dt, ...`` up to and including `stop`, in seconds."""
    if not (np.isfinite(dt) and dt > 0):
        raise InputError(f"the step is {dt} s", where="dt", allowed="a positive number of seconds")
    check_steps(stop - start, dt, "dt")
    count = int(np.floor((stop - start) / dt + 1e-6)) + 1
    if count < 2:
        problem = f"a step of {dt:g} s leaves fewer than two instants between {start:g} and {stop:g} s"
        raise InputError(problem, where="dt", allowed=f"less than {max(stop - start, 0.0):g} s")
    return float(start) + float(dt) * np.arange(count, dtype=float)


def compared_step(time: ArrayLike, f_nominal: float) -> float:
    """Step in seconds on which simulations of rms quantities are compared with readings.

    It is the distance of the readings. Of much denser ones it is the largest multiple of that within a quarter of a
    nominal period: a model of phasors knows nothing faster, and what is simulated and kept grows with the grid.

    Parameters
    ----------
    time : array-like of shape (L,)
        Seconds.
    f_nominal : float
        Hz.

    Examples
    --------
    >>> time = np.arange(1000.0)
    >>> round(compared_step(0.01 * time, 50.0), 9), round(compared_step(0.001 * time, 50.0), 9)
    (0.01, 0.005)
    """
    t = np.asarray(time, dtype=float)
    distance = float(np.median(np.diff(t)))
    # a record within some milliseconds has a wrong unit of time, which is told elsewhere
    readings = min(int(0.25 / f_nominal / distance * (1 + 1e-6)), len(t) // 10)
    # where no low-pass would average the readings, leaving some out would lose what they say
    return readings * distance if readings > COARSE else distance


def low_pass_needed(step: float, distance: float) -> bool:
    """Whether a grid of `step` seconds is so coarse that faster content of the readings would fold back."""
    return bool(step > COARSE * distance)


def interpolate(
    time: ArrayLike, values: ArrayLike, grid: ArrayLike, *, max_gap: float | None = None
) -> NDArray[np.float64]:
    """Bring readings onto a grid by linear interpolation.

    A gap longer than `max_gap` seconds, by default five median distances, stays NaN, and so does the time before the
    first and after the last reading. For a grid coarser than two readings the signal first passes a Gaussian low-pass
    of half a grid step (a factor 0.29 at the grid's Nyquist frequency), so that faster content does not fold back.
    """
    t, x, grid = (np.asarray(a, dtype=float) for a in (time, values, grid))
    keep = np.isfinite(x)
    t, x = t[keep], x[keep]
    if len(t) == 0:
        return np.full(grid.shape, np.nan)
    distance = spacing(t, x)
    step = float(np.median(np.diff(grid))) if len(grid) > 1 else 0.0
    source, signal = t, x
    if low_pass_needed(step, distance):
        fine = step / np.ceil(step / distance)
        check_holes(t, fine, "low-pass filter")
        source = t[0] + fine * np.arange(int(np.ceil((t[-1] - t[0]) / fine)) + 1)
        signal = gaussian_filter1d(np.interp(source, t, x), 0.5 * step / fine, mode="nearest")
    out = np.interp(grid, source, signal)
    # rounding must not turn the first or last instant, or one beside a long gap, into a gap
    tolerance = 1e-6 * min(distance, step) if step > 0 else 0.0
    before = t[np.clip(np.searchsorted(t, grid + tolerance, side="right") - 1, 0, len(t) - 1)]
    after = t[np.clip(np.searchsorted(t, grid - tolerance, side="left"), 0, len(t) - 1)]
    longest = SHORT_GAP * distance if max_gap is None else max_gap
    gap = (after - before > longest * (1 + 1e-9)) | (grid < t[0] - tolerance) | (grid > t[-1] + tolerance)
    out[gap] = np.nan
    return out
