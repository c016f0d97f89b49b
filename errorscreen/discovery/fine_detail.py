r"""How well an unknown signal explains the recordings once it may have detail that its knots are too coarse for.

A power step has edges that no signal between knots follows, and what it leaves there makes a wrong place look better:
one whose inertia smooths them anyway. So signals are compared with fine detail, to which responses are linear,

.. math::

    \ln Z = \max_\tau \Big(-\tfrac12 \min_u \big(r^T K^{-1} r + \textstyle\sum_j u_j^2/s^2\big)
    - \tfrac12 \ln\det K - \tfrac12 \ln\det(I + s^2 J^T K^{-1} J)\Big), \quad K = I + \tau^2 G G^T  \qquad (D7)

with residuals r and their sensitivities J to the deviations u of parameters and knots, whose prior has the standard
deviation s as in (D1), and G to narrow pulses all over the window. Their heights are a sample of white noise of
standard deviation τ, so that responses have the covariance K of a Gaussian process, and this is its marginal likelihood
at the τ that makes it largest (C. E. Rasmussen and C. K. I. Williams, *Gaussian Processes for Machine Learning*, 2006,
equation 2.30 and section 5.4.1). At the right place little detail explains much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.search import bounded_minimum
from errorscreen.discovery.hypotheses import PRIOR, Hypothesis
from errorscreen.discovery.noise import inflation_of
from errorscreen.effects.latent_input import PULSE

#: pulses in the window of each recording
_PULSES = 256
#: standard deviations τ of their heights that are compared, in multiples of a signal's scale
_HEIGHTS = np.r_[0.0, 10.0 ** np.arange(-4.0, 1.0, 0.5)]
#: step of the differences, in multiples of a signal's scale
_STEP = 1e-4

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Detailed:
    """An unknown signal with fine detail.

    Parameters
    ----------
    hypothesis : Hypothesis
        With the signal between knots alone.
    evidence : float
        (D7).
    height : float
        τ, in multiples of the signal's scale.
    residuals : ndarray of shape (N,)
        What is left at the most probable deviations and detail, by the linear model.
    n_simulations : int
    """

    hypothesis: Hypothesis
    evidence: float
    height: float
    residuals: _Array
    n_simulations: int

    @property
    def chi2(self) -> float:
        """χ² of what is left, less the noise that passes, as that of `Hypothesis`."""
        return float(self.residuals @ self.residuals) - float(self.hypothesis.passed.sum())

    @property
    def chi2_per_sample(self) -> float:
        """χ²/N."""
        return self.chi2 / len(self.residuals)

    @property
    def inflation(self) -> float:
        """How much larger, and smoother, what is left is than noise, see `noise_inflation`."""
        return inflation_of(self.hypothesis.observations, self.residuals)


class Covariance:
    r"""Covariance :math:`K = I + \tau^2 G G^T` of a recording's residuals, for any τ.

    One decomposition serves all τ, and nothing is as large as N by N.

    Parameters
    ----------
    pulses : ndarray of shape (n, p)
        G.

    Examples
    --------
    >>> covariance = Covariance(np.array([[3.0], [4.0]]))
    >>> covariance.solve(1.0, np.array([[3.0], [4.0]])).ravel() * 26
    array([3., 4.])
    >>> bool(np.isclose(np.exp(covariance.log_determinant(1.0)), 26.0))
    True
    """

    def __init__(self, pulses: _Array) -> None:
        powers, axes = np.linalg.eigh(pulses.T @ pulses)
        self._powers = np.maximum(powers, 0.0)
        self._pulses = pulses @ axes

    def __len__(self) -> int:
        return len(self._pulses)

    def log_determinant(self, height: float) -> float:
        """Of K."""
        return float(np.log1p(height**2 * self._powers).sum())

    def solve(self, height: float, columns: _Array) -> _Array:
        """The inverse of K times columns (n, m)."""
        share = height**2 / (1.0 + height**2 * self._powers)
        return np.asarray(columns - self._pulses @ (share[:, None] * (self._pulses.T @ columns)))


def detailed(hypothesis: Hypothesis) -> Detailed:
    """Give a fitted unknown signal fine detail.

    Parameters
    ----------
    hypothesis : Hypothesis
        Its effects are unknown signals at one port, see `errorscreen.effects.latent_input`.

    Returns
    -------
    Detailed
    """
    pulses, n_simulations = _sensitivities(hypothesis)
    covariances = [Covariance(g) for g in pulses]
    J, u = hypothesis.jacobian, hypothesis.u
    # residuals by the linear model: the last column and, by the deviations, all others
    columns = np.column_stack([J, hypothesis.residuals - J @ u])
    parts = np.split(columns, np.cumsum([len(g) for g in pulses])[:-1])
    bounds = FitProblem(hypothesis.simulator, list(hypothesis.observations), hypothesis.names).scaled_bounds
    found = [_at(float(height), covariances, parts, bounds) for height in _HEIGHTS]
    evidence, height, residuals = max(found, key=lambda item: item[0])
    passed = 0.5 * float(hypothesis.passed.sum())
    return Detailed(hypothesis, evidence + passed, height, residuals, n_simulations)


def _at(
    height: float, covariances: Sequence[Covariance], parts: Sequence[_Array], bounds: _Array
) -> tuple[float, float, _Array]:
    """(D7) for one τ, this, and what is left."""
    solved = [k.solve(height, part) for k, part in zip(covariances, parts, strict=True)]
    products = np.sum([part.T @ z for part, z in zip(parts, solved, strict=True)], axis=0)
    A, g = products[:-1, :-1] + np.eye(len(products) - 1) / PRIOR**2, products[:-1, -1]
    u = bounded_minimum(A, g, *bounds)
    least = float(products[-1, -1] + 2.0 * g @ u + u @ A @ u)
    determinants = sum(k.log_determinant(height) for k in covariances) + np.linalg.slogdet(A * PRIOR**2)[1]
    return -0.5 * (least + float(determinants)), height, np.concatenate(solved) @ np.r_[u, 1.0]


def _sensitivities(hypothesis: Hypothesis) -> tuple[list[_Array], int]:
    """Change of each recording's residuals (n, p) for a pulse of the signal's scale, and how many simulations it took.

    Recordings have signals of their own: pulses of all of them share a simulation.
    """
    names = [signal.local(name) for signal in hypothesis.effects for name in PULSE]
    simulator = hypothesis.simulator.with_nominal(hypothesis.theta)
    problem = FitProblem(simulator, list(hypothesis.observations), names)
    step = _STEP * float(problem.space.scales[0])
    places = (1.0 + np.arange(_PULSES)) / _PULSES
    pulses = np.column_stack([np.full(_PULSES, step), places, np.full(_PULSES, 1.0 / _PULSES)])
    rows = np.concatenate([np.tile(pulses, len(hypothesis.effects)), problem.space.nominal[None]])
    found = []
    for observation, z in zip(problem.observations, problem.deviations(rows), strict=True):
        change = (z[:-1] - z[-1])[:, observation.mask] / _STEP
        found.append(np.nan_to_num(change).T)  # what cannot be simulated shows nothing
    return found, problem.n_simulations
