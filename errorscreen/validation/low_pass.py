r"""The low-pass filter of IEC 61400-27-2: second order, critically damped, 15 Hz, without delay.

.. math:: H(s) = \frac{1}{(1 + s/\omega)^2}, \quad \omega = \frac{2\pi f_c}{\sqrt{\sqrt2 - 1}}              \qquad (V1)

so that one pass leaves :math:`1/\sqrt2` of the amplitude at the cut-off frequency :math:`f_c`. It runs forward and
backward: nothing is delayed, and the amplitude at a frequency f is multiplied by

.. math:: |H|^2 = \big(1 + (2\pi f/\omega)^2\big)^{-2}                                                      \qquad (V2)

The standard states order, damping and frequency; that it runs in both directions is the practice of RTE's rules.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import bilinear, filtfilt

from errorscreen.exceptions import InputError, check_real

#: cut-off frequency in Hz
CUTOFF = 15.0
#: samples that a part must have at least, so that its ends can be continued
SHORTEST = 10
#: cut-off as a part of the sampling frequency from which a record holds too little above it to be filtered
_COARSE = 0.35
#: time constants, and samples beside them, by which the ends are continued: what the start of the filter leaves of a
#: slope is then below its movement in 10 µs
_CONTINUED, _SAMPLES = 10.0, 11


def low_pass(values: ArrayLike, dt: float, cutoff: float = CUTOFF) -> NDArray[np.float64]:
    """Filter signals along their last axis, (V2).

    Parameters
    ----------
    values : array-like of shape (..., L)
        Finite; at least 10 samples.
    dt : float
        Step in seconds.
    cutoff : float
        Hz.

    Returns
    -------
    ndarray of shape (..., L)
        The values as they are where the cut-off lies beyond 0.35 of the sampling frequency: they hold little above it.

    Raises
    ------
    InputError
        If there are too few samples, or a value is not finite.

    References
    ----------
    IEC 61400-27-2:2020, clause 6.4.2.

    Examples
    --------
    >>> time = np.arange(0.0, 4.0, 0.001)
    >>> tone = low_pass(np.sin(2 * np.pi * 15.0 * time), 0.001)
    >>> round(float(np.abs(tone[1000:3000]).max()), 3)
    0.5
    """
    values = np.asarray(values, dtype=float)
    check_real(dt, "dt", low=0.0, above=True)
    check_real(cutoff, "cutoff", low=0.0, above=True)
    if values.shape[-1] < SHORTEST or not np.isfinite(values).all():
        raise InputError(
            f"{values.shape[-1]} samples, {np.count_nonzero(~np.isfinite(values))} of them not finite",
            allowed=f"at least {SHORTEST} finite samples",
        )
    if cutoff * dt >= _COARSE:
        return values
    wanted = 2.0 * math.pi * cutoff
    # the bilinear transform bends frequencies: exact at the cut-off
    corner = 2.0 / dt * math.tan(0.5 * wanted * dt) / math.sqrt(math.sqrt(2.0) - 1.0)
    b, a = bilinear([corner**2], [1.0, 2.0 * corner, corner**2], fs=1.0 / dt)
    constant = math.sqrt(math.sqrt(2.0) - 1.0) / wanted
    more = math.ceil(_CONTINUED * constant / dt) + _SAMPLES
    return np.asarray(filtfilt(b, a, values, axis=-1, padlen=min(more, values.shape[-1] - 1)))
