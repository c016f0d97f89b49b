"""Exact minimum of a quadratic function inside bounds."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.linalg.lapack import dposv
from scipy.optimize import lsq_linear

#: guesses of what lies at a bound, before an algorithm that cannot cycle takes over
_GUESSES = 30


def bounded_minimum(
    matrix: ArrayLike, slope: ArrayLike, lower: ArrayLike, upper: ArrayLike, near: ArrayLike | None = None
) -> NDArray[np.float64]:
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

    Examples
    --------
    >>> bounded_minimum([[2.0, 0.0], [0.0, 1.0]], [-2.0, -3.0], [-1.0, -1.0], [5.0, 2.0])
    array([1., 2.])
    """
    A, g = np.asarray(matrix, dtype=float), np.asarray(slope, dtype=float)
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    at = np.full(len(g), np.nan) if near is None else np.asarray(near, dtype=float)
    side = (at >= high).astype(int) - (at <= low)  # -1 at the lower bound, 1 at the upper one, 0 free
    for _ in range(_GUESSES):
        free = side == 0
        d = np.where(side < 0, low, np.where(free, 0.0, high))
        if free.any():
            # straight to LAPACK: these systems are so small that checking them takes longer than solving them
            _, d[free], info = dposv(A[free][:, free], -(g + A @ d)[free])
            if info or not np.isfinite(d).all():
                raise np.linalg.LinAlgError("the matrix is not positive definite, or something is not finite")
        pull = g + A @ d
        new = np.where(free, (d > high).astype(int) - (d < low), np.where(side * pull < 0, side, 0))
        if np.array_equal(new, side):
            return d
        side = new
    C = cholesky(A)
    d = lsq_linear(C, -solve_triangular(C, g, trans="T"), bounds=(low, high), method="bvls").x
    return np.clip(d, low, high)
