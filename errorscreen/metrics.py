"""Errors of simulations, and quality of rankings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.exceptions import InputError, check_integer

_Array = NDArray[np.float64]
EPSILON = 1e-12


def quiet_level(y_meas: ArrayLike, time: ArrayLike, start: float) -> _Array:
    """Level of each channel before the event: the y_meas(t₀) of equation (23).

    The level is the mean of the measured values before `start`, because a single sample would carry its noise into
    every ratio; the first measured value where there is none before it.

    Parameters
    ----------
    y_meas : array-like of shape (R, L)
        NaN where nothing was measured.
    time : array-like of shape (L,)
        Seconds.
    start : float
        Time of the event in seconds.

    Returns
    -------
    ndarray of shape (R,)
        In the channels' units; NaN for a channel without a measured value.

    Examples
    --------
    >>> quiet_level([[1.0, np.nan, 1.2, 5.0]], [0, 1, 2, 3], start=2.5)
    array([1.1])
    """
    y_meas = np.atleast_2d(np.asarray(y_meas, dtype=float))
    quiet = np.asarray(time, dtype=float) < start
    levels = np.full(len(y_meas), np.nan)
    for r, values in enumerate(y_meas):
        measured = np.isfinite(values)
        if np.any(measured & quiet):
            levels[r] = values[measured & quiet].mean()
        elif measured.any():
            levels[r] = values[measured][0]
    return levels


def response_error(
    y_sim: ArrayLike, y_meas: ArrayLike, reference: ArrayLike, *, eps: float = EPSILON
) -> NDArray[np.float64]:
    r"""Relative squared error of each channel, equation (23).

    .. math:: E = \frac{\sum (y_{sim} - y_{meas})^2}{\sum (y_{meas} - y_{meas}(t_0))^2 + \epsilon}

    Parameters
    ----------
    y_sim : array-like of shape (..., R, L)
        Simulated.
    y_meas : array-like of shape (R, L)
        Measured; both sums skip NaN.
    reference : array-like of shape (R,)
        Level before the event, y_meas(t₀), see `quiet_level`.
    eps : float, default 1e-12
        ε, in the square of the channel's unit; keeps the error of a constant channel finite.

    Returns
    -------
    ndarray of shape (..., R)
        0 for a perfect simulation, 1 for a constant one at the level before the event, NaN for a failed one.

    Raises
    ------
    InputError
        If the shapes do not fit.

    Examples
    --------
    >>> response_error([[0.0, 0.0, 1.0]], [[0.0, 0.0, 2.0]], reference=[0.0])
    array([0.25])
    """
    y_sim, y_meas, mask = _pair(y_sim, y_meas)
    level = np.asarray(reference, dtype=float).reshape(-1, 1)
    squares = np.where(mask, (y_sim - y_meas) ** 2, 0.0).sum(axis=-1)
    return squares / (np.where(mask, (y_meas - level) ** 2, 0.0).sum(axis=-1) + eps)


def objective(errors: ArrayLike, weights: ArrayLike | None = None) -> NDArray[np.float64]:
    r"""Weighted error of all channels, equation (24): :math:`J = \sum_r \lambda_r E_r`.

    Parameters
    ----------
    errors : array-like of shape (..., R)
        E of each channel, see `response_error`.
    weights : array-like of shape (R,), optional
        λ; 1/R each where not given, the paper's 0.5 for two channels.

    Returns
    -------
    ndarray of shape (...)

    Examples
    --------
    >>> float(objective([0.2, 0.4]))
    0.3...
    """
    errors = np.asarray(errors, dtype=float)
    return errors @ channel_weights(weights, errors.shape[-1])


def channel_weights(weights: ArrayLike | None, n_channels: int) -> NDArray[np.float64]:
    """Return λ of each channel, 1/R each where none is given.

    Raises
    ------
    InputError
        If there is not one finite, nonnegative weight for each channel, or all are 0.
    """
    if weights is None:
        return np.full(n_channels, 1.0 / n_channels)
    values = np.asarray(weights, dtype=float)
    if values.shape != (n_channels,) or not np.all(np.isfinite(values) & (values >= 0)) or not values.any():
        allowed = f"{n_channels} finite numbers >= 0, one for each channel and not all 0"
        raise InputError(f"the channel weights are {weights!r}", allowed=allowed)
    return values


def rms(y_sim: ArrayLike, y_meas: ArrayLike) -> NDArray[np.float64]:
    """Root mean square of the error of each channel, in the channel's unit.

    Parameters
    ----------
    y_sim : array-like of shape (..., R, L)
    y_meas : array-like of shape (R, L)
        NaN where nothing was measured.

    Returns
    -------
    ndarray of shape (..., R)
        NaN for a channel without a measured value.

    Examples
    --------
    >>> rms([[1.0, 1.0]], [[0.0, np.nan]])
    array([1.])
    """
    y_sim, y_meas, mask = _pair(y_sim, y_meas)
    counts = mask.sum(axis=-1)
    squares = np.where(mask, (y_sim - y_meas) ** 2, 0.0).sum(axis=-1)
    return np.sqrt(squares / np.where(counts, counts, np.nan))


def chi_square(y_sim: ArrayLike, y_meas: ArrayLike, noise: ArrayLike) -> NDArray[np.float64]:
    r"""Squared error in multiples of the noise: :math:`\chi^2 = \sum ((y_{sim} - y_{meas}) / \sigma_r)^2`.

    Divided by the number of measured values it is about 1 where noise is the only error.

    Parameters
    ----------
    y_sim : array-like of shape (..., R, L)
    y_meas : array-like of shape (R, L)
        NaN where nothing was measured.
    noise : array-like of shape (R,)
        Standard deviation σ of each channel's noise, in the channel's unit.

    Returns
    -------
    ndarray of shape (...)

    Examples
    --------
    >>> float(chi_square([[1.0, 1.0]], [[0.0, np.nan]], noise=[0.5]))
    4.0
    """
    y_sim, y_meas, mask = _pair(y_sim, y_meas)
    sigma = np.asarray(noise, dtype=float).reshape(-1, 1)
    return np.where(mask, ((y_sim - y_meas) / sigma) ** 2, 0.0).sum(axis=(-2, -1))


def reduction(before: ArrayLike, after: ArrayLike) -> NDArray[np.float64]:
    """Share of an error that is gone, 0.85 for the paper's -85 %; negative for a larger error.

    Examples
    --------
    >>> float(reduction(0.05684, 0.00833))
    0.853...
    """
    before = np.asarray(before, dtype=float)
    if not np.all(before > 0):
        raise InputError("the error before is not positive, so its reduction is undefined", allowed="> 0")
    return 1.0 - np.asarray(after, dtype=float) / before


def ranking(contributions: ArrayLike) -> NDArray[np.int64]:
    """Columns from the largest contribution to the smallest; equal ones keep their order.

    Parameters
    ----------
    contributions : array-like of shape (..., m)

    Returns
    -------
    ndarray of shape (..., m)

    Examples
    --------
    >>> ranking([0.1, 0.7, 0.1, 0.3])
    array([1, 3, 0, 2])
    """
    return np.argsort(-np.asarray(contributions, dtype=float), axis=-1, kind="stable")


def top_k_overlap(y_true: ArrayLike, y_pred: ArrayLike, k: int = 10) -> float:
    """Share of the k largest contributions that are among the k largest predicted ones, mean over rows.

    Parameters
    ----------
    y_true, y_pred : array-like of shape (n, m) or (m,)
    k : int, default 10

    Raises
    ------
    InputError
        If the shapes differ, a value is not finite, or k is not between 1 and m.

    Examples
    --------
    >>> top_k_overlap([3, 2, 1, 0], [9, 0, 5, 1], k=2)
    0.5
    """
    true, predicted = _contributions(y_true, y_pred)
    k = check_integer(k, "k", high=true.shape[1])
    members = np.zeros((2, *true.shape), dtype=bool)
    for member, values in zip(members, (true, predicted), strict=True):
        np.put_along_axis(member, ranking(values)[:, :k], True, axis=1)
    return float(np.mean(members.all(axis=0).sum(axis=1) / k))


def ndcg(y_true: ArrayLike, y_pred: ArrayLike, k: int | None = None) -> float:
    """Normalised discounted cumulative gain of predicted contributions, mean over rows.

    It is 1 for a ranking by the true contributions, and misses near the top cost most; see
    `sklearn.metrics.ndcg_score`.

    Parameters
    ----------
    y_true : array-like of shape (n, m) or (m,)
        Nonnegative.
    y_pred : array-like of the same shape
    k : int, optional
        Only the first k ranks count; all where not given.

    Raises
    ------
    InputError
        If the shapes differ, a value is not finite, a true contribution is negative, m < 2, or k is not
        between 1 and m.

    Examples
    --------
    >>> ndcg([3, 2, 1, 0], [9, 5, 1, 0])
    1.0
    """
    from sklearn.metrics import ndcg_score

    true, predicted = _contributions(y_true, y_pred)
    if true.shape[1] < 2 or np.any(true < 0):
        problem = (
            f"the true contributions have {true.shape[1]} columns and a smallest value of {true.min():g}"
        )
        raise InputError(problem, allowed="at least two columns, all values >= 0")
    if k is not None:
        check_integer(k, "k", high=true.shape[1])
    return float(ndcg_score(true, predicted, k=k))


def overlap_scorer(k: int = 10) -> Callable[..., Any]:
    """Return `top_k_overlap` as a scikit-learn scorer, for example for ``GridSearchCV(scoring=...)``."""
    from sklearn.metrics import make_scorer

    return make_scorer(top_k_overlap, k=k)


def ndcg_scorer(k: int | None = None) -> Callable[..., Any]:
    """Return `ndcg` as a scikit-learn scorer."""
    from sklearn.metrics import make_scorer

    return make_scorer(ndcg, k=k)


def _pair(y_sim: ArrayLike, y_meas: ArrayLike) -> tuple[_Array, _Array, NDArray[np.bool_]]:
    """Simulated and measured values as arrays, and the mask of the measured ones."""
    sim, meas = np.asarray(y_sim, dtype=float), np.asarray(y_meas, dtype=float)
    if meas.ndim != 2 or sim.shape[-2:] != meas.shape:
        problem = (
            f"simulated responses of shape {sim.shape} and measured ones of shape {meas.shape} do not fit"
        )
        raise InputError(problem, allowed="(..., R, L) and (R, L)")
    return sim, meas, np.isfinite(meas)


def _contributions(y_true: ArrayLike, y_pred: ArrayLike) -> tuple[_Array, _Array]:
    true, predicted = (np.atleast_2d(np.asarray(y, dtype=float)) for y in (y_true, y_pred))
    if true.shape != predicted.shape or true.ndim != 2 or not true.size:
        problem = f"true contributions of shape {true.shape} and predicted ones of shape {predicted.shape} do not fit"
        raise InputError(problem, allowed="two arrays of the same shape (n, m)")
    if not (np.isfinite(true).all() and np.isfinite(predicted).all()):
        raise InputError("a contribution is not finite", remedy="Leave failed rows out (ErrorDataset.valid)")
    return true, predicted
