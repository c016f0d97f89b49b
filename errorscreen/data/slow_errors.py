"""A slow error of a model that its user allows: modes of a smooth random course."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from errorscreen.exceptions import InputError

#: spacing of the modes over the time of the error: the covariance is that of (M1) within 3e-4 of its size
_SPACING = 0.75
#: modes beyond the ends of a record, in spacings: what lies further away has died down to e^-9
_BEYOND = 4
#: most modes of one channel, which fill memory in proportion
_MOST = 300


def slow_modes(time: NDArray[np.float64], start: float, correlation: float) -> NDArray[np.float64]:
    r"""Modes of a smooth stationary error of unit size that begins with an event.

    Independent standard normal weights of the modes give a course with the covariance

    .. math:: \mathrm{cov}(e(t), e(t')) = \exp\Big(-\frac{(t - t')^2}{2 T^2}\Big), \quad t, t' \ge t_0 \qquad (M1)

    It is white noise, smoothed by :math:`\exp(-t^2/T^2)`, on a grid finer than that.

    Parameters
    ----------
    time : ndarray of shape (L,)
        Seconds.
    start : float
        t0, the event; there is no error before it.
    correlation : float
        T in seconds.

    Returns
    -------
    ndarray of shape (K, L)

    Raises
    ------
    InputError
        If T is so short that more than 300 modes were needed.

    References
    ----------
    C. E. Rasmussen, C. K. I. Williams: *Gaussian Processes for Machine Learning*, MIT Press 2006, section 4.2.1
    (the squared exponential as white noise that is smoothed).

    Examples
    --------
    >>> modes = slow_modes(np.linspace(0.0, 5.0, 501), 1.0, 0.5)
    >>> spread = (modes**2).sum(axis=0)
    >>> spread[[0, 99, 100, 500]].round(2).tolist(), round(float(modes[:, 200] @ modes[:, 250]), 2)
    ([0.0, 0.0, 1.0, 1.0], 0.61)
    """
    spacing = _SPACING * correlation
    span = float(time[-1]) - start
    if span > spacing * _MOST:
        raise InputError(
            f"the model error has a time of {correlation:g} s, in a record of {span:g} s after the event",
            allowed=f"at least {span / (_SPACING * _MOST):.2g} s",
            remedy="Give a longer time, or take faster errors as noise of the channel",
        )
    knots = start + spacing * np.arange(-_BEYOND, np.ceil(max(span, 0.0) / spacing) + _BEYOND + 1)
    size = np.sqrt(spacing / (correlation * np.sqrt(np.pi / 2)))
    courses = size * np.exp(-(((time - knots[:, None]) / correlation) ** 2))
    return np.where(time >= start - 1e-9, courses, 0.0)
