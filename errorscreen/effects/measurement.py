r"""Measurement effects: faults of a transducer, a meter or a clock.

.. math::

    y &= (1 + a)\,u                                                                     & (N1)\\
    y &= u + b                                                                          & (N2)\\
    y(t) &= u(t - d)                                                                     & (N3)\\
    T\,\dot y &= u - y                                                                    & (N4)\\
    y_{k+1} &= \alpha\,y_k + \beta_0 u_k + \beta_1 u_{k+1},\quad \alpha = e^{-h/T},\quad
    \beta_0 = \tfrac{T}{h}(1 - \alpha) - \alpha,\quad \beta_1 = 1 - \tfrac{T}{h}(1 - \alpha)     & (N5)

Scale (N1), offset (N2), clock skew (N3) and lag (N4). (N5) is the first-order-hold equivalent of (N4), exact for a
signal that is linear between the steps h of the integration (Franklin, Powell, Workman, *Digital Control of Dynamic
Systems*, 3rd ed., section 6.3.2); it is stable for any T and becomes the identity at T = 0. A playback starts from the
recorded power; with (N1) and (N2) it starts from the true power, which differs.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from errorscreen.effects.base import ALL_CHANNELS, CHANNEL, Effect, strength
from errorscreen.parameters import Parameter

#: scale of scale errors and offsets, which are a few per cent: standard deviation of the prior, 5 %, over 0.3
_USUAL = 0.05 / 0.3

_Array = NDArray[np.float64]


def scaled(values: _Array, h: float, a: _Array) -> _Array:
    """Channel with a scale error, (N1)."""
    return np.asarray((1.0 + a)[:, None] * values)


def offset(values: _Array, h: float, b: _Array) -> _Array:
    """Channel with an offset, (N2)."""
    return np.asarray(values + b[:, None])


def skewed(values: _Array, h: float, d: _Array) -> _Array:
    """Channel that is d seconds late, linear between steps, (N3); the first or last value goes on at the ends."""
    return np.asarray(_skewed(values, h, d))


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _skewed(values: _Array, h: float, d: _Array) -> _Array:
    n, length = values.shape
    out = np.empty((n, length))
    for row in range(n):
        late = d[row] / h
        for k in range(length):
            first = min(max(int(np.floor(k - late)), 0), length - 1)
            part = min(max(k - late - first, 0.0), 1.0)
            following = min(first + 1, length - 1)
            out[row, k] = values[row, first] + part * (values[row, following] - values[row, first])
    return out


def lagged(values: _Array, h: float, T: _Array) -> _Array:
    """Smoothed channel, at rest before the record begins, (N5)."""
    return np.asarray(_lagged(values, h, T))


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _lagged(values: _Array, h: float, T: _Array) -> _Array:
    n, length = values.shape
    out = values.copy()
    for row in range(n):
        if T[row] > 0:
            alpha = np.exp(-h / T[row])
            ratio = T[row] / h * (1 - alpha)
            for k in range(1, length):
                driven = (ratio - alpha) * values[row, k - 1] + (1 - ratio) * values[row, k]
                out[row, k] = alpha * out[row, k - 1] + driven
    return out


def true_of_scaled(value: Any, a: Any) -> Any:
    """Value before the event without the scale error."""
    return value / (1.0 + a)


def true_of_offset(value: Any, b: Any) -> Any:
    """Value before the event without the offset."""
    return value - b


def measurement_effects(
    channels: Iterable[str], unit: str = "pu", size: float = 1.0, late: float = 0.2
) -> tuple[Effect, ...]:
    """Scale, offset, clock skew and lag of each measured channel.

    Parameters
    ----------
    channels : iterable of str
    unit : str
        Of the channels.
    size : float
        Of the measured quantities, in that unit; offsets are at most a fifth of it.
    late : float
        Largest clock skew in seconds; lags are at most 2.5 times as long.

    Returns
    -------
    tuple of Effect

    Examples
    --------
    >>> [effect.name for effect in measurement_effects(["P"])]
    ['scale_P', 'offset_P', 'skew_P', 'lag_P']
    """
    return tuple(effect for channel in channels for effect in _of_channel(channel, unit, size, late))


def common_skew(late: float = 0.2) -> Effect:
    """Clock skew of all compared channels together against the injected voltage.

    Parameters
    ----------
    late : float
        Largest clock skew in seconds.

    Examples
    --------
    >>> common_skew().place
    'channels'
    """
    return Effect(
        "skew", "Clock skew of all compared channels", ALL_CHANNELS, skewed,
        (_skew("measurement", late),),
        kind="measurement", formula="measured(t) = true(t − d), for every channel",
        description="The injected voltage and the channels that are compared were stamped by different clocks, or "
        "filtered differently before they were recorded: every edge of all channels is moved by the same time. A "
        "voltage that is late looks like channels that are early.",
        source="IEEE Std C37.118.1, time error",
        confused_with=("clock skew of a single channel", "a delay in the control"),
    )  # fmt: skip


def _skew(of: str, late: float) -> Parameter:
    text = "time by which it is late against the injected signals; 0: none"
    return strength("d", 0.1 * late, late, "s", of, "d", text, -late)


def _of_channel(channel: str, unit: str, size: float, late: float) -> tuple[Effect, ...]:
    of = f"measurement of {channel}"
    port = f"{CHANNEL}{channel}"
    return (
        Effect(
            f"scale_{channel}", f"Scale error of {channel}", port, scaled,
            (strength("a", 0.05, 0.25, "", of, "a", "relative scale error; 0: none", -0.25, _USUAL),),
            recorded=true_of_scaled, kind="measurement", formula="measured = (1 + a) · true",
            description=f"A transformer ratio, a calibration or a base is wrong: all of {channel}, its level before "
            "the event included, is too large or too small by the same factor.",
            source="IEEE Std C57.13, ratio error",
            confused_with=("another base power", "parameters that scale the whole response"),
        ),
        Effect(
            f"offset_{channel}", f"Offset of {channel}", port, offset,
            (strength("b", 0.02 * size, 0.2 * size, unit, of, "b", "offset; 0: none", -0.2 * size, _USUAL * size),),
            recorded=true_of_offset, kind="measurement", formula="measured = true + b",
            description=f"A constant is added to {channel}: auxiliaries or other feeders behind the meter, or a zero "
            "error.",
            source="JCGM 200:2012 (VIM), 4.28, zero error",
            confused_with=("another operating point", "losses between meter and terminal"),
        ),
        Effect(
            f"skew_{channel}", f"Clock skew of {channel}", port, skewed,
            (_skew(of, late),),
            kind="measurement", formula="measured(t) = true(t − d)",
            description=f"{channel} is stamped too late or too early against the other channels: every edge is moved "
            "by the same time.",
            source="IEEE Std C37.118.1, time error",
            confused_with=("a lag in the measurement", "a delay in the control"),
        ),
        Effect(
            f"lag_{channel}", f"Lag in the measurement of {channel}", port, lagged,
            (strength("T", 0.25 * late, 2.5 * late, "s", of, "T", "time constant; 0: none"),),
            kind="measurement", formula="measured = true / (1 + s T)",
            description=f"The transducer or the meter smooths {channel}: fast edges arrive late and rounded, while "
            "slow swings are right.",
            source="Franklin, Powell, Workman, Digital Control of Dynamic Systems, 3rd ed., section 6.3.2",
            confused_with=("clock skew of the channel", "a slower current regulator"),
        ),
    )  # fmt: skip
