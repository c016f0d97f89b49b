"""Samples of a normal distribution that is cut off at bounds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_ndtr, ndtri_exp

from errorscreen._runtime.sampling import generator
from errorscreen.exceptions import InputError, check_integer

#: parallel chains, sweeps over all directions before the first sample, and sweeps between two samples of a chain
_CHAINS, _BURN_IN, _THINNING = 64, 30, 3
#: components of a direction below this share of its length do not bound a step along it
_NEGLIGIBLE = 1e-12

_Array = NDArray[np.float64]


def sample_truncated_normal(
    mean: ArrayLike,
    precision: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    n: int,
    *,
    start: ArrayLike | None = None,
    random_state: Any = None,
) -> _Array:
    r"""Draw n samples (n, k) from :math:`N(\mu, P^{-1})` inside the box :math:`l \le x \le u`, from 64 chains.

    Gibbs sampling, in turn along the eigenvectors of the precision matrix and along the axes; along a direction the cut
    normal distribution is drawn exactly. Eigenvectors cross a long and thin distribution at once; axes lead out of a
    corner of the box. The chains begin at `start`, best a point of high density; the mean, moved into the box, where
    not given.
    """
    mean, lower, upper = (np.asarray(v, dtype=float) for v in (mean, lower, upper))
    if not (np.all(np.isfinite(lower) & np.isfinite(upper)) and np.all(lower < upper)):
        raise InputError("the bounds of a parameter are not finite or not in order", allowed="lower < upper")
    P = np.asarray(precision, dtype=float)
    if not (np.isfinite(mean).all() and np.isfinite(P).all() and P.shape == (len(mean), len(mean))):
        raise InputError(
            "the mean or the precision matrix is not finite, or they do not fit",
            where="sample_truncated_normal", allowed="shapes (k,) and (k, k)",
        )  # fmt: skip
    variances, directions = np.linalg.eigh(P)
    if not variances[0] > 0:
        raise InputError("the precision matrix is not positive definite", where="sample_truncated_normal")
    n = check_integer(n, "n")
    rng = generator(random_state)
    first = np.clip(mean if start is None else np.asarray(start, dtype=float), lower, upper)
    x = np.repeat(first[None], _CHAINS, axis=0)
    moves = [(directions[:, i], 1.0 / np.sqrt(variances[i])) for i in range(len(mean))]
    moves += [(axis, 1.0 / np.sqrt(P[j, j])) for j, axis in enumerate(np.eye(len(mean)))]
    samples: list[_Array] = []
    for sweep in range(_BURN_IN + _THINNING * (-(-n // _CHAINS))):
        for i in rng.permutation(len(moves)):
            direction, deviation = moves[i]
            x = _move(x, mean, P, direction, deviation, lower, upper, rng.random(_CHAINS))
        if sweep >= _BURN_IN and (sweep - _BURN_IN) % _THINNING == 0:
            samples.append(x)
    return np.concatenate(samples)[:n]


def _move(
    x: _Array, mean: _Array, P: _Array, direction: _Array, deviation: float, lower: _Array, upper: _Array,
    uniform: _Array,
) -> _Array:  # fmt: skip
    """New positions of all chains along one direction, drawn from the density there."""
    bounding = np.abs(direction) > _NEGLIGIBLE
    ends = np.stack([lower - x, upper - x])[:, :, bounding] / direction[bounding]
    # distance from the largest density along the direction, whose deviation is (d' P d)^(-1/2)
    now = (x - mean) @ (P @ direction) * deviation**2
    low = (now + ends.min(axis=0).max(axis=1)) / deviation
    high = (now + ends.max(axis=0).min(axis=1)) / deviation
    new = deviation * _standard_normal_between(low, high, uniform)
    return np.clip(x + (new - now)[:, None] * direction, lower, upper)


def _standard_normal_between(low: _Array, high: _Array, uniform: _Array) -> _Array:
    """Quantiles of the standard normal distribution cut off at both ends, exact far out in either tail."""
    flip = low + high > 0  # the lower tail has logarithms of full precision
    a, b = np.where(flip, -high, low), np.where(flip, -low, high)
    log_a, log_b = log_ndtr(a), log_ndtr(b)
    log_p = log_b + np.log(uniform + (1.0 - uniform) * np.exp(np.minimum(log_a - log_b, 0.0)))
    y = np.clip(ndtri_exp(np.minimum(log_p, -1e-300)), a, b)
    return np.where(flip, -y, y)
