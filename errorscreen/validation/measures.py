r"""Errors in a window, and figures of a step and of a recovery.

With :math:`e_k` as simulated minus measured value of the K samples of a window (IEC 61400-27-2, clause 6.4.3):

.. math::

    ME &= \frac1K \sum_k e_k                                                                   & (V3)\\
    MAE &= \frac1K \sum_k |e_k|                                                                & (V4)\\
    MXE &= \max_k |e_k|                                                                        & (V5)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.typed import Real
from errorscreen.exceptions import InputError

#: shares of a step at which it counts as begun and as done, and half width of the band in which it has settled
REACTED, DONE, SETTLED = 0.1, 0.9, 0.05
#: last part of a response that tells its final level
_LAST = 0.1

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class WindowErrors:
    """Errors (V3) to (V5), in the unit of the signal.

    Parameters
    ----------
    ME, MAE, MXE : float
        Mean error, mean absolute error, largest absolute error.
    """

    ME: Real
    MAE: Real
    MXE: Real


@dataclass(frozen=True)
class StepFigures:
    """Figures of a response to a step, NaN where it does not get that far.

    Parameters
    ----------
    reaction : float
        Seconds until a tenth of the step.
    rise : float
        Seconds from a tenth to nine tenths.
    settling : float
        Seconds until it stays within 5 % of the step around its final level.
    overshoot : float
        Beyond the final level, in parts of the step; 0 for none.
    steady : float
        Final level, in the unit of the signal: the mean of the last tenth of the response.
    """

    reaction: Real
    rise: Real
    settling: Real
    overshoot: Real
    steady: Real


def window_errors(simulated: ArrayLike, measured: ArrayLike) -> WindowErrors:
    """Errors of the samples of a window that were measured.

    Raises
    ------
    InputError
        If the shapes differ, or nothing was measured.

    Examples
    --------
    >>> window_errors([1.0, 2.0, 3.0], [1.0, 2.5, 2.0])
    WindowErrors(ME=0.16666666666666666, MAE=0.5, MXE=1.0)
    """
    y, z = _floats(simulated), _floats(measured)
    if y.shape != z.shape:
        raise InputError(f"simulated values have shape {y.shape}", allowed=f"{z.shape}")
    error = (y - z)[np.isfinite(z)]
    if not error.size:
        raise InputError("no value was measured in this window", allowed="at least one")
    return WindowErrors(float(error.mean()), float(np.abs(error).mean()), float(np.abs(error).max()))


def step_figures(time: ArrayLike, values: ArrayLike, start: float) -> StepFigures:
    """Figures of a response to a step at `start`.

    The step of the signal itself counts: from its mean before `start` to the mean of the last tenth.

    Parameters
    ----------
    time, values : array-like of shape (L,)
    start : float
        Seconds.

    Raises
    ------
    InputError
        If there are no values before or after the step.

    References
    ----------
    IEC 61400-27-2:2020, clause 6.4.5; IEC 61400-21-1:2019, definitions of reaction, rise and settling time.

    Examples
    --------
    >>> time = np.arange(0.0, 10.0, 0.01)
    >>> found = step_figures(time, np.where(time < 1.0, 0.0, 1.0 - np.exp(-(time - 1.0))), 1.0)
    >>> round(found.reaction, 2), round(found.rise, 2), round(found.settling, 2), round(found.overshoot, 2)
    (0.11, 2.2, 3.0, 0.0)
    """
    known = np.isfinite(_floats(values))
    instants, levels = _floats(time)[known], _floats(values)[known]
    before, after = instants < start, instants >= start
    if not before.any() or not after.any():
        raise InputError(f"the step at {start:g} s", allowed="readings before and after it")
    old, t, y = float(levels[before].mean()), instants[after], levels[after]
    final = float(y[t >= t[-1] - _LAST * (t[-1] - start)].mean())
    size = final - old
    if size == 0.0:
        return StepFigures(np.nan, np.nan, np.nan, 0.0, final)
    share = (y - old) / size
    begun, done = _first(t, share, REACTED) - start, _first(t, share, DONE) - start
    outside = np.flatnonzero(np.abs(share - 1.0) > SETTLED)
    settled = t[min(outside[-1] + 1, len(t) - 1)] - start if len(outside) else 0.0
    if len(outside) and outside[-1] == len(t) - 1:
        settled = float("nan")
    overshoot = max(float(share.max()) - 1.0, 0.0)
    return StepFigures(float(begun), float(done - begun), float(settled), overshoot, final)


def recovery_time(
    time: ArrayLike, values: ArrayLike, before: float, end: float, share: float = DONE
) -> float:
    """Seconds after the end of a fault until a signal has come back to a share of its level before; NaN if it does not.

    Examples
    --------
    >>> time = np.arange(0.0, 5.0, 0.01)
    >>> round(recovery_time(time, np.clip(time - 1.0, 0.0, 1.0), before=1.0, end=1.2), 2)
    0.7
    """
    instants, levels = _floats(time), _floats(values)
    after = (instants >= end) & np.isfinite(levels)
    return _first(instants[after], levels[after] / before, share) - end


def _floats(values: ArrayLike) -> _Array:
    return np.asarray(values, dtype=float)


def _first(time: _Array, share: _Array, level: float) -> float:
    """First instant at which a signal reaches a level, between samples; NaN if it does not."""
    reached = np.flatnonzero(share >= level)
    if not len(reached):
        return float("nan")
    k = int(reached[0])
    if k == 0 or share[k] == share[k - 1]:
        return float(time[k])
    return float(time[k - 1] + (time[k] - time[k - 1]) * (level - share[k - 1]) / (share[k] - share[k - 1]))
