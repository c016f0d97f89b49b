"""Exact minimum of a quadratic function inside bounds."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from errorscreen.exceptions import InputError

#: guesses of what lies at a bound, before an algorithm that cannot cycle takes over
_GUESSES = 30
#: how guessing ended
_FOUND, _NOT_FOUND, _INDEFINITE = 0, 1, 2

_Array = NDArray[np.float64]


def bounded_minimum(
    matrix: ArrayLike, slope: ArrayLike, lower: ArrayLike, upper: ArrayLike, near: ArrayLike | None = None
) -> _Array:
    r"""Minimiser of :math:`\tfrac12 d^T A d + g^T d` inside bounds, for a positive definite matrix A.

    An infeasible active set method: what would leave a bound is put there, what is pulled inwards from one is let go,
    all at once, until nothing changes (K. Kunisch and F. Rendl, "An infeasible active set method for quadratic
    problems with simple bounds", *SIAM Journal on Optimization* 14(1), 2003). That is exact, and takes a few
    factorisations of the free part of A. It may cycle; then `scipy.optimize.lsq_linear` takes over, whose method
    (BVLS) moves one variable at a time, with a singular value decomposition for each.

    Parameters
    ----------
    matrix : array-like of shape (k, k)
        A.
    slope : array-like of shape (k,)
        g.
    lower, upper : array-like of shape (k,)
    near : array-like of shape (k,), optional
        Where a similar problem has its minimum: what lies at a bound there is put there first.

    Returns
    -------
    ndarray of shape (k,)

    Raises
    ------
    numpy.linalg.LinAlgError
        If A is not positive definite, or A or g are not finite.
    InputError
        If shapes do not fit: compiled code looks for no end of an array.

    Examples
    --------
    >>> bounded_minimum([[2.0, 0.0], [0.0, 1.0]], [-2.0, -3.0], [-1.0, -1.0], [5.0, 2.0])
    array([1., 2.])
    """
    A, g = np.ascontiguousarray(matrix, dtype=float), np.ascontiguousarray(slope, dtype=float)
    low, high = np.ascontiguousarray(lower, dtype=float), np.ascontiguousarray(upper, dtype=float)
    at = np.full(len(g), np.nan) if near is None else np.asarray(near, dtype=float)
    if not (g.shape == low.shape == high.shape == at.shape and A.shape == 2 * g.shape):
        raise InputError(f"the matrix has shape {A.shape}", allowed="(k, k), and vectors of k numbers")
    side = (at >= high).astype(np.int64) - (at <= low)
    d = np.empty(len(g))
    end = _active_set(A, g, low, high, side, d, _GUESSES)
    if end == _INDEFINITE:
        raise np.linalg.LinAlgError("the matrix is not positive definite, or something is not finite")
    if end == _FOUND:
        return d
    C = cholesky(A)
    d = lsq_linear(C, -solve_triangular(C, g, trans="T"), bounds=(low, high), method="bvls").x
    return np.clip(d, low, high)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _active_set(
    A: _Array, g: _Array, low: _Array, high: _Array, side: NDArray[np.int64], d: _Array, guesses: int
) -> int:
    """Guess what lies at a bound until nothing changes, and say how that ended; d and side are changed.

    `side` is -1 for what lies at its lower bound, 1 at its upper one, 0 for what is free. Written out, because the
    systems are so small that what a library does around solving them takes ten times as long.
    """
    k = len(g)
    free, L, x = np.empty(k, np.int64), np.empty((k, k)), np.empty(k)
    for _ in range(guesses):
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
        found = True
        for i in range(k):
            if not np.isfinite(d[i]):
                return _INDEFINITE
            new = side[i]
            if side[i] == 0:
                new = np.int64(d[i] > high[i]) - np.int64(d[i] < low[i])
            elif not side[i] * (g[i] + np.dot(A[i], d)) < 0.0:
                new = 0
            found &= new == side[i]
            side[i] = new
        if found:
            return _FOUND
    return _NOT_FOUND
