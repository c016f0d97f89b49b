r"""Are the residuals of a fit noise? A test of the residuals in cells of channel, stage and frequency band.

The null distribution comes from a parametric bootstrap in the tangent space: noise w with the correlation in time of
the quiet part and an uncertain scale, without what the linear model would have fitted,

.. math:: z^* = w - J_f (J_f^T J_f + I/s^2)^{-1} J_f^T w                                               \qquad (D3)

with the sensitivities J_f of the parameters that do not lie at a bound. Energies of cells are compared through the cube
root (Wilson and Hilferty, PNAS 17, 1931), which is nearly normal; the test statistic is the largest excess.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.linalg import cho_factor, cho_solve
from scipy.signal import lfilter
from scipy.stats import false_discovery_control, norm

from errorscreen._runtime.sampling import generator
from errorscreen._runtime.typed import Limit, Real
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.hypotheses import PRIOR
from errorscreen.discovery.fits.noise import by_recording, noise_model
from errorscreen.discovery.judge.errors import stage_limits, stage_names
from errorscreen.events import InputSignal
from errorscreen.exceptions import InputError, check_integer

#: edges of the frequency bands in Hz: slow control, electromechanical swings, control modes, fast control
BANDS = (0.0, 0.4, 2.5, 8.0, np.inf)
#: cells with fewer samples than this tell nothing
_FEWEST = 3
#: draws of noise without which mean and width of a cell's energy mean nothing
_FEWEST_DRAWS = 20
#: draws of noise that are transformed at a time
_BLOCK = 16
#: values of noise that are drawn at a time, so that long recordings do not fill the memory
_MOST_VALUES = 2**21
#: draws after which no more are made if none of them comes near: what is so many times as conspicuous as all of them is
#: not reached by any
_FIRST_DRAWS, _NEVER = 200, 3.0

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cell:
    """Energy of the residuals in one channel, stage and frequency band.

    Parameters
    ----------
    recording, channel, stage : str
    band : (float, float)
        Hz.
    ratio : float
        Energy over what noise alone has on average.
    expected : float
        What noise alone has on average: the sum of so many squared deviations.
    p_value : float
        Of this cell alone.
    significant : bool
        With false discoveries controlled over all cells at 5 % (Benjamini and Hochberg 1995).
    """

    recording: str
    channel: str
    stage: str
    band: tuple[Real, Limit]
    ratio: Real
    expected: Real
    p_value: Real
    significant: bool


@dataclass(frozen=True)
class ResidualTest:
    """Result of the test.

    Parameters
    ----------
    p_value : float
        Probability that noise alone gives a cell so conspicuous.
    statistic : float
        Largest excess of a cell in standard deviations.
    cells : tuple of Cell
    """

    p_value: float
    statistic: float
    cells: tuple[Cell, ...]

    @property
    def excess(self) -> float:
        """Energy beyond the mean of noise, over all cells that have more: smoothing noise explains nothing."""
        return float(sum(max(c.ratio - 1.0, 0.0) * c.expected for c in self.cells))

    @property
    def significant(self) -> tuple[Cell, ...]:
        """Cells beyond noise, the most conspicuous first."""
        return tuple(sorted((c for c in self.cells if c.significant), key=lambda c: c.p_value))


def residual_test(
    observations: Sequence[Observation],
    residuals: ArrayLike,
    jacobian: ArrayLike | None = None,
    *,
    levels: Sequence[ArrayLike] | None = None,
    n_bootstrap: int = 1000,
    random_state: Any = 0,
) -> ResidualTest:
    """Test whether residuals are noise.

    Parameters
    ----------
    observations : sequence of Observation
    residuals : array-like of shape (N,)
        Where something was measured, as `FitProblem.residuals` orders them.
    jacobian : array-like of shape (N, k), optional
        Sensitivities of the fitted parameters that do not lie at a bound; none were fitted where not given.
    levels : sequence of array-like of shape (R,), optional
        Level of the noise in the residuals of each recording, in multiples of what its observation says, where noise of
        injected signals passes otherwise than counted; 1 where not given.
    n_bootstrap : int
        Draws of noise, at least 20; the smallest p-value is 1/(n_bootstrap + 1). Only the first 200 are made where the
        residuals are three times as conspicuous as any of these.
    random_state : None, int, SeedSequence, Generator or RandomState

    Returns
    -------
    ResidualTest

    Raises
    ------
    InputError
        If there are too few draws, or hardly any samples after the start of the event.

    Examples
    --------
    >>> from errorscreen.events import Event
    >>> event = Event(0.02 * np.arange(300), "step", start=1.0)
    >>> seen = Observation(event, np.zeros((1, 300)), np.array([1.0]), ("P",), ("pu",))
    >>> noise = np.random.default_rng(0).standard_normal(300)
    >>> swing = 2 * np.sin(2 * np.pi * event.time) * (event.time > 1)
    >>> residual_test([seen], noise).p_value > 0.05, residual_test([seen], noise + swing).p_value < 0.01
    (True, True)
    """
    check_integer(n_bootstrap, "n_bootstrap", low=_FEWEST_DRAWS)
    z = np.asarray(residuals, dtype=float)
    rng = generator(random_state)
    tau, spread = noise_model(observations, z)
    labels, energy = _energies(observations, z[None])
    if not labels:
        raise InputError(
            "no channel has enough samples after the start of the event",
            where=", ".join(o.event.name for o in observations),
            allowed=f"at least {_FEWEST} in one stage of the event",
        )
    ones = [np.ones(len(o.channels)) for o in observations]
    levels = ones if levels is None else levels
    J = np.zeros((len(z), 0)) if jacobian is None else np.asarray(jacobian, dtype=float)

    def draw(n: int) -> _Array:
        at_once = max(_BLOCK, _MOST_VALUES // len(z))
        parts = [min(at_once, n - i) for i in range(0, n, at_once)]
        nulls = (_null(observations, part, tau, spread, levels, rng) for part in parts)
        return np.concatenate([_drawn(observations, J, null) for null in nulls])

    expected, excess, largest = _compared(energy[0], draw, n_bootstrap)
    p_cells = norm.sf(excess)
    significant = false_discovery_control(p_cells) < 0.05
    cells = tuple(
        Cell(label[0], label[1], label[2], label[3], float(e / m), float(m), float(p), bool(s))
        for label, e, m, p, s in zip(labels, energy[0], expected, p_cells, significant, strict=True)
    )
    beyond = int(np.sum(largest >= excess.max()))
    return ResidualTest((1.0 + beyond) / (n_bootstrap + 1.0), float(excess.max()), cells)


def _drawn(observations: Sequence[Observation], jacobian: _Array, null: _Array) -> _Array:
    """Energies (n, cells) of draws of noise (n, N) without what would have been fitted, (D3); changes the draws."""
    if jacobian.size:
        A = cho_factor(jacobian.T @ jacobian + np.eye(jacobian.shape[1]) / PRIOR**2)
        null -= cho_solve(A, (null @ jacobian).T).T @ jacobian.T
    blocks = range(0, len(null), _BLOCK)  # of a size that stays in the processor's cache
    return np.concatenate([_energies(observations, null[i : i + _BLOCK])[1] for i in blocks])


def _compared(
    energy: _Array, draw: Callable[[int], _Array], n_bootstrap: int
) -> tuple[_Array, _Array, _Array]:
    """Mean energy of noise and excess of each cell (cells,), and the largest excess of each draw (n,).
    The mean is that of the first draws for all residuals, because fits are compared by it.
    """
    first = drawn = draw(min(n_bootstrap, _FIRST_DRAWS))
    excess, largest = _excess(energy, drawn)
    if len(drawn) < n_bootstrap and excess.max() < _NEVER * largest.max():
        drawn = np.concatenate([first, draw(n_bootstrap - len(first))])
        excess, largest = _excess(energy, drawn)
    return first.mean(axis=0), excess, largest


def _excess(energy: _Array, drawn: _Array) -> tuple[_Array, _Array]:
    """Excess of each cell (cells,), and the largest of each draw (n,), in standard deviations of the draws."""
    mean = drawn.mean(axis=0)
    roots = np.cbrt(drawn / mean)
    centre, width = roots.mean(axis=0), roots.std(axis=0)
    return (np.cbrt(energy / mean) - centre) / width, ((roots - centre) / width).max(axis=1)


def bands(observation: Observation) -> tuple[float, ...]:
    """Edges of the frequency bands in Hz: `BANDS` in a grid; else even in the logarithm, from four periods in the
    record to half of what its sampling resolves.
    """
    if not isinstance(observation.event, InputSignal):
        return BANDS
    time, dt = observation.time, observation.event.dt
    lowest, highest = 4.0 / (time[-1] - time[0]), 0.25 / dt
    return (0.0, *np.geomspace(min(lowest, 0.5 * highest), highest, 3).tolist(), np.inf)


def _energies(observations: Sequence[Observation], residuals: _Array) -> tuple[list[tuple[Any, ...]], _Array]:
    """Labels of the cells, and energies (n, cells) of residuals (n, N)."""
    labels: list[tuple[Any, ...]] = []
    energies: list[_Array] = []
    for observation, z in by_recording(observations, residuals):
        time, dt = observation.time, observation.event.dt
        limits, names = stage_limits(observation), stage_names(observation)
        # padded: 501 samples, three times a prime, take four times as long as 512
        length = next_fast_len(len(time), real=True)
        spectrum = rfft(z, length, axis=-1)
        frequency = rfftfreq(length, dt)
        for low, high in pairwise(bands(observation)):
            part = (frequency >= low) & (frequency < high)
            if not part.any():
                continue
            band = irfft(spectrum * part, length, axis=-1)[..., : len(time)]
            for stage, start, stop in zip(names[1:], limits[1:-1], limits[2:], strict=True):
                begin = int(np.searchsorted(time, start - 1e-9))
                end = int(np.searchsorted(time, stop - 1e-9)) if stop < time[-1] else len(time)
                for r in np.flatnonzero(observation.mask.any(axis=1)):
                    if observation.mask[r, begin:end].sum() < _FEWEST:
                        continue
                    labels.append((observation.event.name, observation.channels[r], stage, (low, high)))
                    energies.append((band[:, r, begin:end] ** 2).sum(axis=-1))
    return labels, np.array(energies).T + np.finfo(float).tiny


def _null(
    observations: Sequence[Observation],
    n: int,
    tau: float,
    spread: Sequence[float],
    levels: Sequence[ArrayLike],
    rng: np.random.Generator,
) -> _Array:
    """Draws (n, N) of noise, correlated over `tau` samples, of a level that is not quite certain."""
    rho = (tau - 1.0) / (tau + 1.0)
    parts = []
    for observation, width, level in zip(observations, spread, levels, strict=True):
        w = rng.standard_normal((n, *observation.values.shape))
        if rho > 0:  # first-order autoregression, whose correlation time is (1 + rho) / (1 - rho)
            w[..., 1:] *= np.sqrt(1 - rho**2)
            w = lfilter([1.0], [1.0, -rho], w, axis=-1)
        w *= np.exp(width * rng.standard_normal((n, w.shape[1], 1)))
        w *= np.asarray(level)[:, None]
        parts.append(w[:, observation.mask])
    return np.concatenate(parts, axis=1)
