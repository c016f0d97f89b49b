r"""Frequency and damping of the oscillation in a signal.

A damped oscillation beside a background, a polynomial of low order,

.. math:: e^{-\zeta\omega_n t}(a\cos\omega_d t + b\sin\omega_d t) + \sum_k c_k t^k, \quad
   \omega_d = \omega_n\sqrt{1-\zeta^2}                                                                      \qquad (V6)

is linear in a, b and c: frequency and damping are searched on a grid, then refined by least squares (variable
projection; Golub, Pereyra, SIAM J. Numer. Anal. 10, 1973).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

#: least number of periods in the signal
_PERIODS = 1.5
#: frequencies, and damping ratios, of the search
_FREQUENCIES, _DAMPINGS = 80, (-0.03, 0.0, 0.03, 0.07, 0.15)

_Array = NDArray[np.float64]


def oscillation(
    time: ArrayLike, signal: ArrayLike, *, most_damped: float = 0.25, order: int = 0
) -> tuple[float, float, float]:
    """Frequency in Hz and damping ratio of the best oscillation, and the share of the energy that all of it explains.

    Parameters
    ----------
    time, signal : array-like of shape (L,)
        At even steps.
    most_damped : float
        Largest damping ratio; with 0.25 the second swing is less than half the first.
    order : int
        Of the background, (V6).

    Returns
    -------
    frequency, damping, explained : float
        NaN, NaN and 0 where the signal is too short for one and a half periods of any frequency it resolves.

    Examples
    --------
    >>> time = np.arange(0.0, 8.0, 0.02)
    >>> swing = np.exp(-0.4 * time) * np.cos(2 * np.pi * 0.9 * time) + 0.1 * time
    >>> frequency, damping, explained = oscillation(time, swing, order=1)
    >>> round(frequency, 3), round(damping, 3), round(explained, 3)
    (0.9, 0.071, 1.0)
    """
    t, y = np.asarray(time, dtype=float), np.asarray(signal, dtype=float)
    t = t - t[0]
    lowest, highest = _PERIODS / t[-1], 0.25 * (len(t) - 1) / t[-1]
    if highest <= lowest or not y.any():
        return np.nan, np.nan, 0.0
    background = [(t / t[-1]) ** k for k in range(order + 1)]

    def left(point: _Array) -> _Array:
        natural = 2 * np.pi * np.exp(point[0]) / np.sqrt(1.0 - point[1] ** 2)
        envelope = np.exp(np.clip(-point[1] * natural * t, -50.0, 50.0))
        phase = 2 * np.pi * np.exp(point[0]) * t
        columns = np.column_stack([envelope * np.cos(phase), envelope * np.sin(phase), *background])
        return np.asarray(y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0])

    grid = [(f, d) for f in np.linspace(np.log(lowest), np.log(highest), _FREQUENCIES) for d in _DAMPINGS]
    first = min(grid, key=lambda point: float(np.sum(left(np.array(point)) ** 2)))
    bounds = ([np.log(lowest), -most_damped], [np.log(highest), most_damped])
    found = least_squares(left, np.array(first), bounds=bounds, max_nfev=50)
    explained = 1.0 - float(2 * found.cost) / float(y @ y)
    return float(np.exp(found.x[0])), float(found.x[1]), explained
