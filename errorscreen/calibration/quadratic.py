"""Exact minima of quadratic functions inside bounds."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from errorscreen.exceptions import InputError

#: rounds without progress before one guess is changed at a time; rounds for each of k numbers before the fallback
_PATIENCE, _ROUNDS = 3, 10
#: fallback: iterations for each of k numbers, and the relative decrease of the cost at which it stops. The cost holds a
#: constant that hides any decrease where A is nearly singular, so it goes on until nothing is wrong
_ITERATIONS, _DECREASE = 100, 1e-300
#: ends of the active set method
_FOUND, _NOT_FOUND, _INDEFINITE = 0, 1, 2

_Array = NDArray[np.float64]


def bounded_minimum(matrix: ArrayLike, slope: ArrayLike, lower: ArrayLike, upper: ArrayLike) -> _Array:
    r"""Minimiser (k,) of :math:`\tfrac12 d^T A d + g^T d` inside bounds, for a positive definite matrix A."""
    return damped_minima(matrix, slope, lower, upper, [0.0])[0]


def damped_minima(
    matrix: ArrayLike, slope: ArrayLike, lower: ArrayLike, upper: ArrayLike, dampings: ArrayLike
) -> _Array:
    r"""Minimisers (n, k) of :math:`\tfrac12 d^T (A + \lambda_i I) d + g^T d` inside bounds, for several
    :math:`\lambda_i`.

    An infeasible active set method guesses which numbers lie at a bound, solves for the others, and corrects all wrong
    guesses at once (K. Kunisch and F. Rendl, *SIAM Journal on Optimization* 14(1), 2003). If it cycles, only the last
    wrong guess is corrected (J. J. Júdice and F. M. Pires, *Computers & Operations Research* 21(5), 1994). If ten
    rounds for each number are not enough, `scipy.optimize.lsq_linear` takes over. Each minimum starts from the bounds
    of the one before. Raises `LinAlgError` if the free part of A is not positive definite or finite, `InputError` if
    shapes do not fit.
    """
    A, g = np.ascontiguousarray(matrix, dtype=float), np.ascontiguousarray(slope, dtype=float)
    low, high = np.ascontiguousarray(lower, dtype=float), np.ascontiguousarray(upper, dtype=float)
    added = np.ascontiguousarray(dampings, dtype=float)
    if not (g.ndim == added.ndim == 1 and g.shape == low.shape == high.shape and A.shape == 2 * g.shape):
        raise InputError(f"the matrix has shape {A.shape}", allowed="(k, k), and vectors of k numbers")
    d = np.full((len(added), len(g)), np.nan)
    found = 0
    while True:
        found, end = _minima(A, g, low, high, added, found, d, _PATIENCE, _ROUNDS * max(1, len(g)))
        if end == _INDEFINITE:
            raise np.linalg.LinAlgError("the matrix is not positive definite, or something is not finite")
        if end == _FOUND:
            return d
        C = cholesky(A + added[found] * np.eye(len(g)))
        one = lsq_linear(
            C, -solve_triangular(C, g, trans="T"), bounds=(low, high), method="bvls",
            tol=_DECREASE, max_iter=_ITERATIONS * len(g),
        ).x  # fmt: skip
        d[found] = np.clip(one, low, high)
        found += 1


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _minima(
    A: _Array,
    g: _Array,
    low: _Array,
    high: _Array,
    added: _Array,
    first: int,
    d: _Array,
    patience: int,
    most: int,
) -> tuple[int, int]:
    """Write the minima from number `first` on to d (n, k); return how many are found, and how the last one ended."""
    damped = A.copy()
    for number in range(first, len(added)):
        for i in range(len(g)):
            damped[i, i] = A[i, i] + added[number]
        before = d[max(number - 1, 0)]
        side = (before >= high).astype(np.int64) - (before <= low)
        end = _active_set(damped, g, low, high, side, d[number], patience, most)
        if end != _FOUND:
            return number, end
    return len(added), _FOUND


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _active_set(
    A: _Array,
    g: _Array,
    low: _Array,
    high: _Array,
    side: NDArray[np.int64],
    d: _Array,
    patience: int,
    most: int,
) -> int:
    """Write one minimum to d (k,) and return how that ended; `side` is -1 at a lower bound, 1 at an upper one, 0 if
    free. Written out, because the systems are so small that the overhead of a library takes ten times as long.
    """
    k = len(g)
    free, new, L, x = np.empty(k, np.int64), np.empty(k, np.int64), np.empty((k, k)), np.empty(k)
    fewest, left = k + 1, patience
    for _ in range(most):
        m = 0
        for i in range(k):
            if side[i] == 0:
                free[m] = i
                m += 1
            d[i] = 0.0 if side[i] == 0 else (low[i] if side[i] < 0 else high[i])
        # Cholesky factor L of the free part of A, and forward substitution
        for a in range(m):
            row = A[free[a]]
            rest = -g[free[a]] - np.dot(row, d)
            for b in range(a):
                L[a, b] = (row[free[b]] - np.dot(L[a, :b], L[b, :b])) / L[b, b]
                rest -= L[a, b] * x[b]
            square = row[free[a]] - np.dot(L[a, :a], L[a, :a])
            if not square > 0.0:
                return _INDEFINITE
            L[a, a] = np.sqrt(square)
            x[a] = rest / L[a, a]
        for a in range(m - 1, -1, -1):
            rest = x[a]
            for b in range(a + 1, m):
                rest -= L[b, a] * x[b]
            x[a] = rest / L[a, a]
        for a in range(m):
            d[free[a]] = x[a]
        count, last = 0, 0
        for i in range(k):
            if not np.isfinite(d[i]):
                return _INDEFINITE
            new[i] = side[i]
            if side[i] == 0:
                new[i] = np.int64(d[i] > high[i]) - np.int64(d[i] < low[i])
            elif not side[i] * (g[i] + np.dot(A[i], d)) < 0.0:
                new[i] = 0
            if new[i] != side[i]:
                count, last = count + 1, i
        if count == 0:
            return _FOUND
        if count < fewest:
            fewest, left = count, patience
        else:
            left -= 1
        if left >= 0:
            side[:] = new
        else:
            side[last] = new[last]
    return _NOT_FOUND
