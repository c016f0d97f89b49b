r"""Hypotheses about what a model lacks, each fitted to the recordings, and how probable each is.

A hypothesis is the model with no, one or several effects of its library; all parameters are fitted together with those
of the effects. Its evidence is Laplace's approximation of the marginal likelihood at the most probable values,

.. math:: \ln Z = -\tfrac12 \Big(\chi^2 + \sum_j u_j^2/s^2\Big) - \tfrac12 \ln\det(I + s^2 J^T J)            \qquad (D1)

with deviations u in multiples of each parameter's scale, their prior standard deviation s and the sensitivities J of
the residuals (D. J. C. MacKay, *Information Theory, Inference, and Learning Algorithms*, 2003, section 28.1). Its
second term is what BIC counts as :math:`\tfrac12 k \ln N`, but only for directions that the recordings determine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cho_factor, cho_solve

from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.search import BoundedSearch
from errorscreen.effects.base import Effect
from errorscreen.observations import Observation
from errorscreen.parameters import Parameter, ParameterSpace
from errorscreen.sampling import generator, latin_hypercube
from errorscreen.simulators.base import Simulator

#: standard deviation of the prior in multiples of each parameter's scale, as `MAPCalibrator` has it by default
PRIOR = 0.3
_TOL, _STEP = 1e-2, 1e-4
_ENDED = ("converged", "kink")
#: draws of later rounds scatter by these shares of the ranges around so many of the best
_SPREADS, _ELITE = (0.1, 0.03, 0.01), 8
#: draws of an effect with a single parameter; with d parameters so many times d squared, up to what is asked for
_DRAWS_PER_SQUARE = 12
#: a parameter whose bounds have at least this ratio is drawn in the logarithm
_WIDE = 10.0
#: values of one parameter that are tried in a search for a way out of a local minimum
_LINE = 48

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Hypothesis:
    """A model with some effects, fitted to the recordings.

    Parameters
    ----------
    effects : tuple of Effect
        None: only the parameters deviate.
    simulator : Simulator
        With the effects; its nominal values are those before the fit.
    observations : tuple of Observation
    theta : ndarray of shape (m,)
        Fitted values of all parameters of `simulator`.
    names : tuple of str
        Parameters that were fitted.
    chi2, objective, evidence : float
        χ², χ² with the prior's term, and (D1).
    residuals : ndarray of shape (N,)
    jacobian : ndarray of shape (N, k)
        In units of each parameter's scale.
    u : ndarray of shape (k,)
        Fitted deviations in multiples of the scale.
    free : ndarray of shape (k,), bool
        Parameters that do not lie at a bound.
    state : str
        How the best start ended, see `Track`.
    """

    effects: tuple[Effect, ...]
    simulator: Simulator
    observations: tuple[Observation, ...]
    theta: _Array
    names: tuple[str, ...]
    chi2: float
    objective: float
    evidence: float
    residuals: _Array = field(repr=False)
    jacobian: _Array = field(repr=False)
    u: _Array = field(repr=False)
    free: NDArray[np.bool_] = field(repr=False)
    state: str = "converged"

    @property
    def name(self) -> str:
        """Names of its effects joined by `` + ``; ``"parameters"`` without any."""
        return " + ".join(effect.name for effect in self.effects) or "parameters"

    @property
    def converged(self) -> bool:
        """Whether the search ended at a minimum."""
        return self.state in _ENDED

    @property
    def chi2_per_sample(self) -> float:
        """χ²/N."""
        return self.chi2 / len(self.residuals)

    @property
    def covariance(self) -> _Array:
        """Posterior covariance (k, k) in units of the scales, of parameters inside their bounds; 0 for the others."""
        J = self.jacobian * self.free
        A = J.T @ J + np.eye(len(self.u)) / PRIOR**2
        covariance = np.linalg.inv(A)
        return np.asarray(covariance * np.outer(self.free, self.free))

    def parameters_of(self, effect: Effect, width: float) -> dict[str, tuple[float, float, float]]:
        """Value, lower and upper end of the interval of each parameter of an effect.

        Parameters
        ----------
        effect : Effect
        width : float
            Half width of the intervals in standard deviations, 1.645 for 90 %.
        """
        deviation = np.sqrt(np.diag(self.covariance))
        found = {}
        for parameter in effect.parameters:
            name = effect.local(parameter.name)
            if name not in self.names:
                continue
            own = self.simulator.parameters[name]
            value = float(self.theta[self.simulator.parameters.index(name)])
            half = width * float(deviation[self.names.index(name)]) * float(own.scale or 1.0)
            found[parameter.name] = (value, max(own.lower, value - half), min(own.upper, value + half))
        return found

    def predict(self, event: Any) -> _Array:
        """Response (R, L) to an event."""
        return self.simulator.simulate(self.theta, event).require_ok("the fitted model").values[0]


class JointFit:
    """Fit of all parameters and those of some effects, which can be stopped and gone on with.

    Parameters
    ----------
    effects : sequence of Effect
        Those of the problem's simulator.
    problem : FitProblem
    starts : array-like of shape (s, k)
        Deviations from the nominal values in multiples of the scales.

    Raises
    ------
    SimulationError
        If no start can be simulated.
    """

    def __init__(self, effects: Sequence[Effect], problem: FitProblem, starts: ArrayLike) -> None:
        self.effects, self.problem = tuple(effects), problem
        self._search = _search(problem)
        self._search.begin(starts)
        if not self._search.tracks:
            raise problem.no_success()
        self.gained = np.inf

    @property
    def objective(self) -> float:
        """Lowest so far."""
        return self._search.best.cost

    def run(self, iterations: int) -> JointFit:
        """Go on for so many iterations at most; `gained` is by how much they lowered the objective."""
        before = self.objective
        for _ in range(iterations):
            if not self._search.iterate():
                break
        self.gained = before - self.objective
        return self

    @property
    def active(self) -> bool:
        """Whether a start has not ended."""
        return any(track.state == "active" for track in self._search.tracks)

    def keep(self, n: int) -> JointFit:
        """Drop all but the best starts."""
        self._search.tracks = sorted(self._search.tracks, key=lambda track: track.cost)[:n]
        return self

    def hypothesis(self) -> Hypothesis:
        """What has been reached."""
        best = self._search.best
        self._search.differentiate([best])
        assert best.jacobian is not None
        return described(self.effects, self.problem, best.u, best.residuals, best.jacobian, best.state)


def fit_hypothesis(
    effects: Sequence[Effect], problem: FitProblem, starts: ArrayLike, *, max_iterations: int = 30
) -> Hypothesis:
    """Fit all parameters of a problem from some starts in lockstep, see `JointFit`."""
    return JointFit(effects, problem, starts).run(max_iterations).hypothesis()


def described(
    effects: Sequence[Effect], problem: FitProblem, u: _Array, residuals: _Array, jacobian: _Array, state: str
) -> Hypothesis:
    """Hypothesis from where a search ended."""
    chi2 = float(residuals @ residuals)
    objective = chi2 + float(u @ u) / PRIOR**2
    lower, upper = problem.scaled_bounds
    margin = 1e-6 * (upper - lower)
    singular = np.linalg.svd(np.linalg.qr(jacobian * PRIOR, mode="r"), compute_uv=False)
    return Hypothesis(
        tuple(effects),
        problem.simulator,
        tuple(problem.observations),
        problem.embed(problem.values(u))[0],
        problem.names,
        chi2,
        objective,
        -0.5 * objective - 0.5 * float(np.log1p(singular**2).sum()),
        residuals,
        jacobian,
        u,
        (u > lower + margin) & (u < upper - margin),
        state,
    )


def linearised(problem: FitProblem, u: ArrayLike) -> tuple[_Array, _Array]:
    """Residuals (N,) and sensitivities (N, k) at a point in units of the scales.

    Raises
    ------
    SimulationError
        If the point cannot be simulated.
    """
    search = _search(problem)
    search.begin(u)
    if not search.tracks:
        raise problem.no_success()
    search.differentiate(search.tracks)
    track = search.tracks[0]
    assert track.jacobian is not None
    return track.residuals, track.jacobian


@dataclass(frozen=True)
class Signature:
    """How well one effect could explain what is left, before any joint fit.

    Parameters
    ----------
    effect : Effect
    objective : float
        Lowest objective of the linear model.
    starts : ndarray of shape (s, k)
        Where joint fits should begin, in units of the scales.
    problem : FitProblem
        Of the extended simulator.
    """

    effect: Effect
    objective: float
    starts: _Array
    problem: FitProblem


def signature(
    simulator: Simulator,
    observations: Sequence[Observation],
    effect: Effect,
    points: Sequence[tuple[_Array, _Array]],
    n_draws: int,
    random_state: Any,
    n_matches: int = 0,
) -> Signature | None:
    r"""Score an effect by variable projection: its own parameters are drawn, all others follow from the linear model.

    For each draw p of the effect's parameters the model is simulated at some points u of the other parameters, and

    .. math:: \min_\delta |z(u, p) + J\delta|^2 + |u + \delta|^2/s^2
       = |z|^2 + |u|^2/s^2 - g^T (J^T J + I/s^2)^{-1} g,\quad g = J^T z + u/s^2                     \qquad (D2)

    is what the joint fit can be expected to reach (Golub and Pereyra, Inverse Problems 19, 2003). Rounds of draws
    around the best so far follow the first, over ever smaller parts of the ranges, because some effects have many local
    minima (the frequency and phase of an oscillation).

    Parameters
    ----------
    simulator : Simulator
        Without the effect.
    observations : sequence of Observation
    effect : Effect
    points : sequence of (ndarray of shape (k,), ndarray of shape (N, k))
        Deviations u of the parameters of `simulator`, and the sensitivities there.
    n_draws : int
        In each round; in the first as many for each of `Effect.minima`.
    n_matches : int
        Simulations with all other parameters drawn as well, the best of which are starts of their own.
    random_state : None, int, SeedSequence, Generator or RandomState

    Returns
    -------
    Signature or None
        None where no draw can be simulated.
    """
    problem = FitProblem(simulator.extend(effect), list(observations))
    k = len(simulator.parameters)
    d = len(problem.space) - k
    unit = ParameterSpace(Parameter(f"p{i}", 0.5, 0.0, 1.0) for i in range(d))
    rng = generator(random_state)
    n_draws = min(n_draws, _DRAWS_PER_SQUARE * d**2)  # one or two parameters need fewer
    found: list[tuple[float, _Array]] = []
    for u, J in points:
        A = cho_factor(J.T @ J + np.eye(k) / PRIOR**2)
        shares = latin_hypercube(unit, n_draws * effect.minima, rng)
        best: list[tuple[float, _Array, _Array]] = []
        for spread in (*_SPREADS, None):
            draws = spread_over(problem.space, k, shares)
            rows = np.hstack([np.tile(u, (len(draws), 1)), draws])
            z = problem.residuals(problem.values(rows))
            failed = np.isnan(z).any(axis=1)
            z[failed] = 0.0
            g = z @ J + u / PRIOR**2
            steps = -cho_solve(A, g.T).T
            objective = (z**2).sum(axis=1) + u @ u / PRIOR**2 + (g * steps).sum(axis=1)
            objective += ((rows[:, k:] / PRIOR) ** 2).sum(axis=1)
            objective[failed] = np.inf
            best += [(float(o), x, step) for o, x, step in zip(objective, shares, steps, strict=True)]
            best.sort(key=lambda item: item[0])
            del best[_ELITE:]
            if spread is None:
                break
            parents = np.array([x for _, x, _ in best])[rng.integers(len(best), size=n_draws)]
            shares = np.clip(parents + spread * rng.standard_normal(parents.shape), 0.0, 1.0)
        lowest, x, step = best[0]
        if np.isfinite(lowest):
            own = spread_over(problem.space, k, x[None])[0]
            found.append((lowest, np.concatenate([u + step, own])))
            found.append((lowest, np.concatenate([u, own])))
    if not found:
        return None
    found.sort(key=lambda item: item[0])
    starts = [start for _, start in found]
    starts += _matches(problem, np.array([start[k:] for start in starts]), n_matches, rng)
    return Signature(effect, found[0][0], np.array(starts), problem)


def escapes(hypothesis: Hypothesis, problem: FitProblem) -> list[_Array]:
    """Points from which a fit may reach a lower minimum, the most promising first.

    One parameter of an effect at a time is moved through its range, and the others follow by the linear model, as in
    (D2). What counts are timers, instants and frequencies: of these a fit finds the nearest minimum only.

    Parameters
    ----------
    hypothesis : Hypothesis
        Fitted.
    problem : FitProblem
        It was fitted to.

    Returns
    -------
    list of ndarray of shape (k,)
        Only those that promise less than the hypothesis has reached.
    """
    space, u = problem.space, hypothesis.u
    own = {effect.local(p.name) for effect in hypothesis.effects for p in effect.parameters}
    found: list[tuple[float, _Array]] = []
    for j in (j for j, name in enumerate(problem.names) if name in own):
        lines = spread_over(
            space, 0, np.repeat((np.arange(_LINE) + 0.5)[:, None] / _LINE, len(space), axis=1)
        )
        rows = np.tile(u, (_LINE, 1))
        rows[:, j] = lines[:, j]
        z = problem.residuals(problem.values(rows))
        failed = np.isnan(z).any(axis=1)
        z[failed] = 0.0
        others = hypothesis.free & (np.arange(len(u)) != j)
        J = hypothesis.jacobian[:, others]
        g = z @ J + u[others] / PRIOR**2
        steps = -cho_solve(cho_factor(J.T @ J + np.eye(J.shape[1]) / PRIOR**2), g.T).T
        objective = (z**2).sum(axis=1) + ((rows / PRIOR) ** 2).sum(axis=1) + (g * steps).sum(axis=1)
        objective[failed] = np.inf
        best = int(np.argmin(objective))
        if objective[best] < hypothesis.objective:
            start = rows[best].copy()
            start[others] += steps[best]
            found.append((float(objective[best]), start))
    return [start for _, start in sorted(found, key=lambda item: item[0])]


def spread_over(space: ParameterSpace, first: int, shares: _Array) -> _Array:
    """Deviations of the parameters from number `first` on, at shares (n, d) of their ranges.

    Ranges over more than a decade are divided evenly in the logarithm: time constants and rates are known by order of
    magnitude.
    """
    lower, upper = space.bounds[first:].T
    values = lower + (upper - lower) * shares
    wide = (lower > 0) & (upper > _WIDE * lower)
    values[:, wide] = lower[wide] * (upper[wide] / lower[wide]) ** shares[:, wide]
    return np.asarray((values - space.nominal[first:]) / space.scales[first:])


def _matches(problem: FitProblem, own: _Array, n: int, rng: np.random.Generator) -> list[_Array]:
    """Best two of n simulations with all other parameters drawn, and the effect's among those given."""
    if not n:
        return []
    k = len(problem.space) - own.shape[1]
    library = latin_hypercube(problem.space, n, rng)
    u = (library - problem.space.nominal) / problem.space.scales
    u[:, k:] = own[rng.integers(len(own), size=n)]
    costs = problem.chi_square(problem.values(u)) + ((u / PRIOR) ** 2).sum(axis=1)
    return list(u[np.argsort(costs, kind="stable")[:2]])  # NaN comes last


def parameters_only(
    simulator: Simulator, observations: Sequence[Observation], theta: ArrayLike, state: str
) -> Hypothesis:
    """Hypothesis without effects, at values that a calibrator found."""
    problem = FitProblem(simulator, list(observations))
    u = (np.asarray(theta, dtype=float) - problem.space.nominal) / problem.space.scales
    residuals, jacobian = linearised(problem, u)
    return described((), problem, u, residuals, jacobian, state)


def _search(problem: FitProblem) -> BoundedSearch:
    lower, upper = problem.scaled_bounds
    return BoundedSearch(
        lambda u: problem.residuals(problem.values(u)), lower, upper, prior=PRIOR, tol=_TOL, step=_STEP
    )
