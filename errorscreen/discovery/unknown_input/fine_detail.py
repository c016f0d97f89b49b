r"""Evidence of an unknown signal with fine detail between its knots.

A power step has edges that no signal between knots follows; the rest favours a wrong location whose inertia
smooths the edges. So signals are compared with fine detail, to which responses are linear,

.. math::

    \ln Z = \max_\tau \Big(-\tfrac12 \min_u \big(r^T K^{-1} r + \textstyle\sum_j u_j^2/s^2\big)
    - \tfrac12 \ln\det K - \tfrac12 \ln\det(I + s^2 J^T K^{-1} J)\Big), \quad K = I + \tau^2 G G^T  \qquad (D7)

with residuals r, sensitivities J to the deviations u of parameters and knots inside their bounds, the prior's s as in
(D1), and G those to narrow pulses all over the window, whose heights are white noise of standard deviation τ: the
marginal likelihood of a Gaussian process (C. E. Rasmussen and C. K. I. Williams, *Gaussian Processes for Machine
Learning*, 2006, equation 2.30 and section 5.4.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.quadratic import bounded_minimum
from errorscreen.discovery.fits.hypotheses import PRIOR, Hypothesis, linearised
from errorscreen.discovery.fits.noise import inflation_of
from errorscreen.effects.latent_input import KNOTS, PULSE
from errorscreen.exceptions import SimulationError

#: most pulses in the window of a recording, at most its samples
_PULSES = 256
#: step of the differences, in multiples of a signal's scale
_STEP = 1e-4
#: decades of τ, from where the most visible pulse makes a tenth of the noise, and values in a decade
_DECADES, _PER_DECADE = 7, 2
#: tolerance of ln τ
_NEAR = 0.02
#: most steps, shares of each that are tried, and the decrease of the cost that makes another one worthwhile
_STEPS, _SHARES, _WORTH = 3, np.array([0.125, 0.25, 0.5, 0.75, 1.0]), 4.0
#: keeps a normal matrix of unit diagonal positive definite in floating point
_JITTER = 1e-12

_Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class DetailedSignal:
    """An unknown signal with fine detail, at the most probable τ (`height`, in multiples of the signal's scale).
    `evidence` is (D7) for χ² less the propagated noise; noise alone leaves a χ² of N less `freedom`. `knots` (KNOTS,)
    and `pulses` (p,) are those of the first recording, in the unit of the port.
    """

    hypothesis: Hypothesis
    evidence: float
    height: float
    residuals: _Array
    freedom: float
    knots: _Array
    pulses: _Array
    n_simulations: int

    @property
    def excess(self) -> float:
        """χ² of the residuals beyond that of noise."""
        chi2 = float(self.residuals @ self.residuals) - float(self.hypothesis.propagated.sum())
        return chi2 - (len(self.residuals) - self.freedom)

    @property
    def chi2_per_sample(self) -> float:
        """χ² over the degrees of freedom that are left."""
        return 1.0 + self.excess / (len(self.residuals) - self.freedom)

    @property
    def inflation(self) -> float:
        """How much larger and smoother the residuals are than noise, see `noise_inflation`."""
        return inflation_of(self.hypothesis.observations, self.residuals, self.freedom)


class Covariance:
    r"""Covariance :math:`K = I + \tau^2 G G^T` of residuals for any τ, by one decomposition of the pulses G (n, p)."""

    def __init__(self, pulses: _Array) -> None:
        powers, self._axes = np.linalg.eigh(pulses.T @ pulses)
        self._powers = np.maximum(powers, 0.0)
        self._pulses = pulses @ self._axes

    @property
    def largest(self) -> float:
        """Largest eigenvalue of GᵀG, 0 without pulses."""
        return float(self._powers.max(initial=0.0))

    def log_determinant(self, height: float) -> float:
        """Of K."""
        return float(np.log1p(height**2 * self._powers).sum())

    def freedom(self, height: float) -> float:
        """Degrees of freedom of the detail: trace of the identity less the inverse of K."""
        return float((self._powers * self._share(height)).sum())

    def solve(self, height: float, values: _Array) -> _Array:
        """The inverse of K times values (n,) or (n, m)."""
        return np.asarray(values - self._pulses @ (self._share(height) * (self._pulses.T @ values).T).T)

    def products(self, values: _Array) -> tuple[_Array, _Array]:
        """Products of values (n, m) that serve `product` for all τ."""
        return values.T @ values, self._pulses.T @ values

    def product(self, height: float, products: tuple[_Array, _Array]) -> _Array:
        """Products (m, m) of values with the inverse of K between them."""
        whole, along = products
        return np.asarray(whole - along.T @ (self._share(height)[:, None] * along))

    def heights(self, height: float, solved: _Array) -> _Array:
        """Most probable heights (p,) of the pulses, from the inverse of K times the residuals (n,)."""
        return np.asarray(-(height**2) * self._axes @ (self._pulses.T @ solved))

    def _share(self, height: float) -> _Array:
        return height**2 / (1.0 + height**2 * self._powers)


def with_fine_detail(hypothesis: Hypothesis) -> DetailedSignal:
    """Give a fitted unknown signal at one port fine detail; `SimulationError` if it cannot be simulated.
    Some Gauss-Newton steps with K as covariance follow, because without detail a fit may have drawn parameters far off.
    """
    fit = _DetailedFit(hypothesis)
    for _ in range(_STEPS):
        if not fit.step():
            break
    return fit.result()


class _DetailedFit:
    """Signal and detail of one hypothesis at the current parameters and knots; K stays that of the fit."""

    def __init__(self, hypothesis: Hypothesis) -> None:
        self.hypothesis = hypothesis
        self._problem = FitProblem(hypothesis.simulator, hypothesis.observations, hypothesis.names)
        pulses, self._count = _sensitivities(hypothesis)
        # recordings of the same name share signal and detail; others have nothing in common
        ends = np.cumsum([len(g) for g in pulses])
        names = [o.event.name for o in hypothesis.observations]
        recordings = [np.arange(end - len(g), end) for g, end in zip(pulses, ends, strict=True)]
        self._rows = [
            np.concatenate([rows for rows, n in zip(recordings, names, strict=True) if n == name])
            for name in dict.fromkeys(names)
        ]
        self._covariances = [Covariance(np.concatenate(pulses)[rows]) for rows in self._rows]
        self._move(hypothesis.u, hypothesis.residuals, hypothesis.jacobian)

    def _move(self, u: _Array, residuals: _Array, jacobian: _Array) -> None:
        """Take over another point and its linear model."""
        self._u, self._residuals = u, residuals
        columns = np.column_stack([jacobian, residuals - jacobian @ u])
        pairs = zip(self._covariances, self._rows, strict=True)
        self._products = [k.products(columns[rows]) for k, rows in pairs]
        self._tau = self._height()

    def step(self) -> bool:
        """Go towards the minimum of the linear model as far as (D7) grows; return whether it grew enough."""
        *_, u = self._at(self._tau)
        trials = self._u + _SHARES[:, None] * (u - self._u)
        found = self._problem.residuals(self._problem.values(trials))
        values = [self._cost(v, z) for v, z in zip(trials, found, strict=True)]
        best = int(np.argmin(values))
        if not self._cost(self._u, self._residuals) - values[best] > _WORTH:
            return False
        self._move(trials[best], *linearised(self._problem, trials[best]))
        return True

    def result(self) -> DetailedSignal:
        """Signal at the current point, at the best τ."""
        _, determinants, A, _ = self._at(self._tau)
        solved = self._solve(self._tau, self._residuals)
        free = len(A) - float(np.trace(np.linalg.inv(A))) / PRIOR**2
        parameters = self.hypothesis.simulator.parameters
        local = self.hypothesis.effects[0].local
        theta = self._problem.embed(self._problem.values(self._u))[0]
        scale = float(parameters[local(PULSE[0])].scale or 1.0)
        freedom = free + sum(k.freedom(self._tau) for k in self._covariances)
        # residuals after the detail are no noise: detail of their size must not be shown as if it were known
        shown = self._tau / np.sqrt(inflation_of(self.hypothesis.observations, solved, freedom))
        pulses = self._covariances[0].heights(shown, self._solve(shown, self._residuals)[self._rows[0]])
        return DetailedSignal(
            self.hypothesis,
            -0.5 * (self._cost(self._u, self._residuals) + determinants),
            self._tau,
            solved,
            freedom,
            theta[[parameters.index(local(f"a{i}")) for i in range(KNOTS)]],
            scale * pulses,
            self._count + self._problem.n_simulations,
        )

    def _cost(self, u: _Array, residuals: _Array) -> float:
        """Quadratic terms of (D7) less the propagated noise; infinite where a simulation failed."""
        if not np.isfinite(residuals).all():
            return np.inf
        propagated = float(self.hypothesis.propagated.sum() + self.hypothesis.slope @ (u - self.hypothesis.u))
        return float(residuals @ self._solve(self._tau, residuals) + u @ u / PRIOR**2) - propagated

    def _height(self) -> float:
        """τ of the largest evidence by the linear model."""
        largest = max(k.largest for k in self._covariances)
        if largest == 0.0:
            return 0.0
        logs = np.log(0.1 / np.sqrt(largest)) + np.log(10.0) / _PER_DECADE * np.arange(
            _DECADES * _PER_DECADE + 1
        )
        found = [self._linear(log) for log in logs]
        best = int(np.argmax(found))
        near = logs[max(best - 1, 0)], logs[min(best + 1, len(logs) - 1)]
        finer = minimize_scalar(
            lambda log: -self._linear(log), bounds=near, method="bounded", options={"xatol": _NEAR}
        )
        log, evidence = max([(logs[best], found[best]), (finer.x, -finer.fun)], key=lambda item: item[1])
        return float(np.exp(log)) if evidence > self._linear(-np.inf) else 0.0

    def _linear(self, log: float) -> float:
        """(D7) by the linear model, for one ln τ."""
        least, determinants, _, _ = self._at(float(np.exp(log)))
        return -0.5 * (least + determinants)

    def _at(self, height: float) -> tuple[float, float, _Array, _Array]:
        """Minimum of the quadratic terms of (D7), both determinants, matrix of the terms, and the minimiser."""
        pairs = zip(self._covariances, self._products, strict=True)
        products = np.sum([k.product(height, values) for k, values in pairs], axis=0)
        A = products[:-1, :-1] + np.eye(len(products) - 1) / PRIOR**2
        # noise-bias correction, see `BoundedSearch.tilt`
        slope = 2.0 * products[:-1, -1] - self.hypothesis.slope
        scale = np.sqrt(np.diag(A))
        scaled = A / np.outer(scale, scale) + _JITTER * np.eye(len(A))
        u = bounded_minimum(scaled, 0.5 * slope / scale, *self._problem.scaled_bounds * scale) / scale
        least = products[-1, -1] + slope @ u + u @ A @ u
        determinants = sum(k.log_determinant(height) for k in self._covariances)
        return float(least), float(determinants + np.linalg.slogdet(A * PRIOR**2)[1]), A, u

    def _solve(self, height: float, residuals: _Array) -> _Array:
        solved = np.empty_like(residuals)
        for k, rows in zip(self._covariances, self._rows, strict=True):
            solved[rows] = k.solve(height, residuals[rows])
        return solved


def _sensitivities(hypothesis: Hypothesis) -> tuple[list[_Array], int]:
    """Change of each recording's residuals (n, p) for a pulse of the signal's scale, and the simulations it took."""
    names = [signal.local(name) for signal in hypothesis.effects for name in PULSE]
    simulator = hypothesis.simulator.with_nominal(hypothesis.theta)
    samples = [int((o.time > o.event.start).sum()) for o in hypothesis.observations]
    n = max(1, min(_PULSES, *samples))
    found, count = [], 0
    for observation in hypothesis.observations:
        problem = FitProblem(simulator, [observation], names)
        step = _STEP * float(problem.space.scales[0])
        pulses = np.column_stack([np.full(n, step), (1.0 + np.arange(n)) / n, np.full(n, 1.0 / n)])
        rows = np.concatenate([np.tile(pulses, len(hypothesis.effects)), problem.space.nominal[None]])
        z = problem.residuals(rows)
        if not np.isfinite(z[-1]).all():
            raise SimulationError(f"{hypothesis.name} cannot be simulated where its fit has ended")
        found.append(np.nan_to_num((z[:-1] - z[-1]) / _STEP).T)  # a failed pulse shows nothing
        count += problem.n_simulations
    return found, count
