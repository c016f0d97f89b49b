"""How well a fit determines its parameters: covariance, inflation, and groups of collinear parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.csgraph import connected_components

from errorscreen.data.signals import correlation_time

#: a direction is determined if its standard deviation is below this share of the one before the fit
DETERMINED = 0.5
#: least entry of the projector onto undetermined directions that links two parameters
_LINK = 0.1

_Array = NDArray[np.float64]


def posterior_covariance(jacobian: ArrayLike, prior: float, inflation: float = 1.0) -> _Array:
    r"""Covariance of the parameters at the fit, :math:`(J^T J / f + I / s^2)^{-1}`.

    Parameters
    ----------
    jacobian : array-like of shape (N, k)
        J of residuals in multiples of the noise.
    prior : float
        Standard deviation s of the prior.
    inflation : float, default 1
        f, see `noise_inflation`.

    Returns
    -------
    ndarray of shape (k, k)

    Examples
    --------
    >>> posterior_covariance([[3.0]], prior=0.25)
    array([[0.04]])
    """
    J = np.asarray(jacobian, dtype=float) / np.sqrt(inflation)
    # by singular values, because J^T J loses half the digits of a nearly collinear J
    _, s, Vt = np.linalg.svd(np.linalg.qr(J, mode="r"))
    precision = np.full(J.shape[1], prior**-2)
    precision[: len(s)] += s**2
    return (Vt.T / precision) @ Vt


def noise_inflation(deviations: Sequence[ArrayLike], n_parameters: float) -> float:
    r"""Variance of the residuals, with their correlation in time, in multiples of the noise.

    .. math:: f = \max\left(1, \frac{\chi^2}{N - p} \, \tau\right), \qquad \tau = 1 + 2 \sum_{l \ge 1} \rho_l

    τ is the integrated autocorrelation time in samples, summed up to the first lag whose correlation ρ is not
    positive. Residuals beyond noise are mostly smooth in time: their samples are not independent, and intervals from
    χ² alone would be far too narrow. The factor holds as far as the misfit acts like noise; a wrong model can bias a
    parameter by more.

    Parameters
    ----------
    deviations : sequence of array-like of shape (R, L)
        Residuals of each recording in multiples of the noise; NaN in gaps.
    n_parameters : float
        p, the number of parameters that the recordings determine.

    Returns
    -------
    float
        f, at least 1.

    Examples
    --------
    >>> round(noise_inflation([np.random.default_rng(0).standard_normal((2, 4000))], 3), 1)
    1.0
    """
    rows = [row for z in deviations for row in np.atleast_2d(np.asarray(z, dtype=float))]
    n = sum(int(np.isfinite(row).sum()) for row in rows)
    chi2 = sum(float(np.nansum(row**2)) for row in rows)
    if chi2 == 0.0:
        return 1.0
    tau = correlation_time(*rows)
    return max(1.0, float(chi2 / max(n - n_parameters, 1.0) * tau))


def correlation(covariance: ArrayLike) -> _Array:
    """Correlation matrix (k, k) of a covariance matrix.

    Examples
    --------
    >>> correlation([[4.0, 1.0], [1.0, 1.0]])
    array([[1. , 0.5],
           [0.5, 1. ]])
    """
    covariance = np.asarray(covariance, dtype=float)
    deviation = np.sqrt(np.diag(covariance))
    return covariance / np.outer(deviation, deviation)


def collinear_groups(covariance: ArrayLike, known: ArrayLike) -> list[tuple[int, ...]]:
    """Parameters that the recordings determine together but not one by one.

    In units of the standard deviations before the fit, the eigenvectors of the covariance that a fit did not narrow to
    half span the undetermined directions (the complement of the likelihood-informed subspace of Cui et al. 2014,
    Inverse Problems 30, 114015). Two parameters are linked if the projector onto these directions couples them. A
    parameter belongs to no group if it is determined by itself, or would stay undetermined with all others known: then
    it has no effect.

    Parameters
    ----------
    covariance : array-like of shape (k, k)
        Posterior covariance.
    known : array-like of shape (k,)
        Standard deviation of each parameter before the fit.

    Returns
    -------
    list of tuple of int
        Indices of the members of each group, in order.

    Examples
    --------
    Only the sum of the first two is measured, the third not at all:

    >>> collinear_groups(posterior_covariance([[9.0, 9.0, 0.0]], prior=1.0), known=[1, 1, 1])
    [(0, 1)]
    """
    known = np.asarray(known, dtype=float)
    scaled = np.asarray(covariance, dtype=float) / np.outer(known, known)
    limit = DETERMINED**2
    variances, directions = np.linalg.eigh(scaled)
    alone = 1.0 / (directions**2 @ (1.0 / np.maximum(variances, np.finfo(float).tiny)))
    candidate = (np.diag(scaled) > limit) & (alone < limit)
    free = directions[:, variances > limit]
    linked = (np.abs(free @ free.T) > _LINK) & np.outer(candidate, candidate)
    _, labels = connected_components(linked, directed=False)
    groups = [tuple(np.flatnonzero(labels == label).tolist()) for label in np.unique(labels)]
    return sorted(group for group in groups if len(group) > 1)
