"""Noise of a recording, estimated from its quiet part before the event."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import detrend

from errorscreen.calibration.intervals import noise_inflation
from errorscreen.data.observations import Observation
from errorscreen.data.signals import correlation_time

#: fewest quiet samples for an estimate; with fewer the noise level is the one that was stated
_FEWEST_QUIET = 10
#: widens the uncertainty of the estimated level: noise differs between operating points
_LEVEL = 1.5


def quiet_part(observation: Observation) -> NDArray[np.bool_]:
    """Samples before the event, shape (L,), bool; none where they are too few for an estimate."""
    quiet = observation.time < observation.event.start - 1e-9
    return quiet & (quiet.sum() >= _FEWEST_QUIET)


def noise_model(observations: Sequence[Observation], residuals: ArrayLike) -> tuple[float, list[float]]:
    """Correlation time of the quiet residuals in samples, and relative error of each recording's noise level."""
    # about a slow trend, as for the level: an offset before the event is an error, not noise
    tau = correlation_time(*_quiet_rows(observations, residuals, "linear"))
    counts = [int(quiet_part(observation).sum()) for observation in observations]
    return tau, [_LEVEL * float(np.sqrt(tau / (2 * n))) if n else 0.0 for n in counts]


def noise_limit(observations: Sequence[Observation], responses: Sequence[ArrayLike]) -> float:
    r"""Largest χ²/N that noise alone explains.

    .. math:: 1 + 3\sqrt{2\tau/N + 2\tau/n}

    three standard deviations above 1: with a correlation time of τ samples, χ²/N of N values scatters by
    :math:`\sqrt{2\tau/N}`, and the noise variance is estimated from n quiet values. Without a quiet part the noise is
    the stated one, and the second term is left out.

    Parameters
    ----------
    observations : sequence of Observation
    responses : sequence of array-like of shape (R, L)
        A simulation of each; τ comes from its quiet part, which parameters do not change.

    Returns
    -------
    float

    Examples
    --------
    >>> from errorscreen.events import Event
    >>> event = Event(0.1 * np.arange(100), "step", start=0.0)
    >>> seen = Observation(event, np.ones((1, 100)), np.array([0.1]), ("P",), ("pu",))
    >>> round(noise_limit([seen], [np.ones((1, 100))]), 3)
    1.424
    """
    residuals = [
        ((y - o.values) / o.sigma)[o.mask]
        for o, y in zip(observations, map(np.asarray, responses), strict=True)
    ]
    # about the mean only: a line would remove the low frequencies of slow noise
    tau = correlation_time(*_quiet_rows(observations, np.concatenate(residuals), "constant"))
    total = sum(map(len, residuals))
    quiet = sum(int(o.mask[:, quiet_part(o)].sum()) for o in observations)
    variance = 2.0 * tau / max(total, 1) + (2.0 * tau / quiet if quiet else 0.0)
    return 1.0 + 3.0 * float(np.sqrt(variance))


def _quiet_rows(
    observations: Sequence[Observation], residuals: ArrayLike, trend: str
) -> list[NDArray[np.float64]]:
    """Each channel in each quiet part, without a trend."""
    parts = [z[:, quiet_part(observation)] for observation, z in by_recording(observations, residuals)]
    return [row for part in parts if part.size for row in detrend(part, axis=1, type=trend)]


def by_recording(
    observations: Sequence[Observation], residuals: ArrayLike
) -> list[tuple[Observation, NDArray[np.float64]]]:
    """Observations and their residuals (..., N) as channels (..., R, L); 0 where nothing was measured."""
    z = np.asarray(residuals, dtype=float)
    out, first = [], 0
    for observation in observations:
        mask = observation.mask
        count = int(mask.sum())
        full = np.zeros((*z.shape[:-1], *mask.shape))
        full[..., mask] = z[..., first : first + count]
        out.append((observation, full))
        first += count
    return out


def inflation_of(
    observations: Sequence[Observation], residuals: ArrayLike, n_parameters: float = 0.0
) -> float:
    """How much larger and smoother residuals (N,) are than noise, see `noise_inflation`."""
    left = by_recording(observations, residuals)
    return noise_inflation([np.where(o.mask, z, np.nan) for o, z in left], n_parameters)
