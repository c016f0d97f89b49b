r"""Joint fits of all parameters and some effects, and the evidence of each.

The evidence is Laplace's approximation of the marginal likelihood at the most probable values,

.. math:: \ln Z = -\tfrac12 \Big(\chi^2 + \sum_j u_j^2/s^2\Big) - \tfrac12 \ln\det(I + s^2 J^T J)            \qquad (D1)

with deviations u in multiples of each parameter's scale, their prior standard deviation s and the sensitivities J of
the residuals (D. J. C. MacKay, *Information Theory, Inference, and Learning Algorithms*, 2003, section 28.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.display import Displayed
from errorscreen.calibration.attenuation import bias_corrected, noise_slope
from errorscreen.calibration.intervals import posterior_covariance
from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.search import BoundedSearch, Track
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.noise import inflation_of
from errorscreen.effects.base import Effect
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.plant.injection_noise import typical

#: standard deviation of the prior in multiples of each parameter's scale, the default of `MAPCalibrator`
PRIOR = 0.3
_TOL, _STEP = 1e-2, 1e-4
#: iterations of a slice, and slices of a whole fit
SLICE, SLICES = 5, 6
#: iterations with the problem's own step after those with a longer one
_EXACT = 10
#: states of a fit at a minimum
_ENDED = ("converged", "kink")
#: state of a fit that stalled, although no start around it leads lower
CORNER = "corner"
#: a joint fit continues while its distance from the best is less than so many times its last gain
HOPE = 20.0
#: least noise level in multiples of the one that was counted: an estimate from an energy may come out too low
_LEAST_LEVEL = 0.1

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Hypothesis(Displayed):
    """A model with some effects, fitted to the recordings.

    Parameters
    ----------
    effects : tuple of Effect
        Empty: only the parameters deviate.
    simulator : Simulator
        With the effects; its nominal values are those before the fit.
    observations : tuple of Observation
    theta : ndarray of shape (m,)
        Fitted values of all parameters of `simulator`.
    names : tuple of str
        Parameters that were fitted.
    chi2 : float
        χ² less the noise of injected signals that passes beyond what was counted, see `propagated`.
    objective : float
        Lowest χ² with the prior's term that the search has reached.
    evidence : float
        (D1).
    residuals : ndarray of shape (N,)
    jacobian : ndarray of shape (N, k)
        In units of each parameter's scale.
    u : ndarray of shape (k,)
        Fitted deviations in multiples of the scale.
    free : ndarray of shape (k,), bool
        Parameters that do not lie at a bound.
    slope : ndarray of shape (k,)
        Noise-bias correction of χ², see `errorscreen.calibration.attenuation`.
    propagated : ndarray of shape (S,)
        Energy of noise that passes beyond what was counted, for each channel of each recording.
    state : str
        How the best start ended, see `Track`; ``"corner"`` where starts around it led no lower either.
    """

    effects: tuple[Effect, ...]
    simulator: Simulator
    observations: tuple[Observation, ...]
    theta: _Array
    names: tuple[str, ...]
    chi2: float
    objective: float
    evidence: float
    residuals: _Array
    jacobian: _Array
    u: _Array
    free: NDArray[np.bool_]
    slope: _Array
    propagated: _Array
    state: str = "converged"

    def _facts(self) -> dict[str, Any]:
        return {"effects": self.name, "χ²/N": f"{self.chi2_per_sample:.4g}", "state": self.state}

    @property
    def name(self) -> str:
        """Names of its effects joined by `` + ``; ``"parameters"`` without any."""
        return name_of(self.effects)

    @property
    def converged(self) -> bool:
        """Whether the search ended at a smooth minimum or a kink."""
        return self.state in _ENDED

    @property
    def ended(self) -> bool:
        """Whether the search ended: at a minimum, or because no step led lower."""
        return self.state != "active"

    @property
    def at_rest(self) -> bool:
        """Whether it is at a minimum: a smooth one, a kink, or a corner that no start around it leads out of."""
        return self.converged or self.state == CORNER

    @property
    def chi2_per_sample(self) -> float:
        """χ²/N."""
        return self.chi2 / len(self.residuals)

    @property
    def inflation(self) -> float:
        """How much larger and smoother the residuals are than noise, see `noise_inflation`."""
        return inflation_of(self.observations, self.residuals)

    @property
    def levels(self) -> list[_Array]:
        """Noise level (R,) of each recording, in multiples of the one that was counted."""
        counts = [o.mask.sum(axis=1) for o in self.observations]
        parts = np.split(self.propagated, np.cumsum([len(n) for n in counts])[:-1])
        shares = [1.0 + p / np.maximum(n, 1) for p, n in zip(parts, counts, strict=True)]
        return [np.sqrt(np.maximum(share, _LEAST_LEVEL**2)) for share in shares]

    @property
    def covariance(self) -> _Array:
        """Posterior covariance (k, k) in units of the scales; 0 for parameters at a bound."""
        covariance = posterior_covariance(self.jacobian * self.free, PRIOR)
        return np.asarray(covariance * np.outer(self.free, self.free))

    def deviations(self, names: Sequence[str]) -> _Array:
        """Fitted deviations of named parameters in multiples of their scales; 0 for unknown names."""
        found = dict(zip(self.names, self.u, strict=True))
        return np.array([found.get(name, 0.0) for name in names])

    def parameters_of(self, effect: Effect, width: float) -> dict[str, tuple[float, float, float]]:
        """Value, lower and upper end of the interval of each parameter of an effect.

        Parameters
        ----------
        effect : Effect
        width : float
            Half width of the intervals in standard deviations, 1.645 for 90 %.
        """
        every, local = self.intervals(width), {p.name: effect.local(p.name) for p in effect.parameters}
        return {name: every[own] for name, own in local.items() if own in every}

    def intervals(self, width: float) -> dict[str, tuple[float, float, float]]:
        """Value, lower and upper end of each fitted parameter, for a half width in standard deviations."""
        space, half = self.simulator.parameters, width * np.sqrt(np.diag(self.covariance))
        found = {}
        for name, deviation in zip(self.names, half.tolist(), strict=True):
            own, value = space[name], float(self.theta[space.index(name)])
            margin = deviation * float(own.scale or 1.0)
            found[name] = (value, max(own.lower, value - margin), min(own.upper, value + margin))
        return found

    def predict(self, event: Any) -> _Array:
        """Response (R, L) to an event."""
        return self.simulator.simulate(self.theta, event).require_ok("the fitted model").values[0]


class JointFit:
    """Fit of all parameters and some effects, from starts (s, k), that can be stopped and continued.
    With `step` it uses that integration step until `exact` (see `rough_step`); `hypothesis` needs `central`. Raises
    `SimulationError` if no start can be simulated.
    """

    def __init__(
        self,
        effects: Sequence[Effect],
        problem: FitProblem,
        starts: ArrayLike,
        central: bool = True,
        step: float | None = None,
    ) -> None:
        self.effects, self.problem, self._step = tuple(effects), problem, step
        self._search = _search(problem.with_step(step), starts, central)
        self.gained = np.inf

    @property
    def objective(self) -> float:
        """Lowest so far."""
        return self._search.best.cost

    @property
    def reached(self) -> _Array:
        """Current points (s, k) of all starts, the best first."""
        return np.array([track.u for track in self._ordered])

    def scattered(self, widths: ArrayLike, random_state: Any = 0) -> _Array:
        """Points (s, n, k) around the current ones, the best first; for widths (n,) see (D6)."""
        return np.array([self._search.scattered(track, widths, random_state) for track in self._ordered])

    @property
    def _ordered(self) -> list[Track]:
        return sorted(self._search.tracks, key=lambda track: track.cost)

    def run(self, iterations: int) -> JointFit:
        """Continue for at most so many iterations; `gained` is the decrease of the objective."""
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

    def may_reach(self, objective: float) -> bool:
        """Whether an objective is within reach, judged by the last gain."""
        return self.objective - objective < HOPE * max(self.gained, 1.0)

    def pursue(self, objective: float) -> JointFit:
        """Continue for up to six slices, as long as an objective is within reach."""
        for _ in range(SLICES):
            if self.active and self.may_reach(objective):
                self.run(SLICE)
        return self

    def exact(self) -> JointFit:
        """Fit from the best point, with the problem's own integration step."""
        if self._step is None:
            return self
        return JointFit(self.effects, self.problem, self.reached[0]).run(_EXACT)

    def keep(self, n: int) -> JointFit:
        """Drop all but the best n starts."""
        self._search.tracks = self._ordered[:n]
        return self

    def hypothesis(self, smooth: ArrayLike = True) -> Hypothesis:
        """Hypothesis at the best point, with the noise-bias correction; for `smooth` see `bias_corrected`."""
        fit = self.exact()
        fit._search.follow_prior(fit._search.best)
        found = bias_corrected(fit._search, fit.problem, smooth)
        return hypothesis_of(fit.effects, fit.problem, found, fit.objective)


def name_of(effects: Sequence[Effect]) -> str:
    """See `Hypothesis.name`."""
    return " + ".join(effect.name for effect in effects) or "parameters"


def fit_hypothesis(effects: Sequence[Effect], problem: FitProblem, starts: ArrayLike) -> Hypothesis:
    """Fit all parameters of a problem from several starts together, see `JointFit`."""
    return JointFit(effects, problem, starts).run(SLICE * SLICES).hypothesis()


def hypothesis_of(
    effects: Sequence[Effect], problem: FitProblem, search: BoundedSearch, objective: float
) -> Hypothesis:
    """Hypothesis at the best point of a search."""
    best = search.best
    assert best.jacobian is not None
    u, jacobian = best.u, best.jacobian
    propagated = np.nan_to_num(typical(problem.propagated_noise(problem.values(u))[:, 0]))
    chi2 = float(best.residuals @ best.residuals) - float(propagated.sum())
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
        -0.5 * (chi2 + float(u @ u) / PRIOR**2 + float(np.log1p(singular**2).sum())),
        best.residuals,
        jacobian,
        u,
        (u > lower + margin) & (u < upper - margin),
        search.slope,
        propagated,
        best.state,
    )


def linearised(problem: FitProblem, u: ArrayLike) -> tuple[_Array, _Array]:
    """Residuals (N,) and sensitivities (N, k) at a point in units of the scales; `SimulationError` if it fails."""
    track = _linearised(problem, u).best
    assert track.jacobian is not None
    return track.residuals, track.jacobian


def parameters_only(problem: FitProblem, theta: ArrayLike, state: str) -> Hypothesis:
    """Hypothesis without effects at a calibrator's values."""
    search = _linearised(problem, problem.scaled(theta))
    search.best.state = state
    lowest = search.best.cost - search.promise(search.best)
    if problem.passes_noise:
        search.tilt(noise_slope(problem, search.best.u)[0])
    return hypothesis_of((), problem, search, lowest)


def hypothesis_at(
    effects: Sequence[Effect],
    problem: FitProblem,
    u: ArrayLike,
    slope: ArrayLike,
    objective: float,
    state: str,
) -> Hypothesis:
    """Hypothesis at a point that a fit has reached, by one linearisation."""
    search = _linearised(problem, u)
    search.best.state = state
    search.tilt(slope)
    return hypothesis_of(effects, problem, search, objective)


def _linearised(problem: FitProblem, u: ArrayLike) -> BoundedSearch:
    search = _search(problem, u)
    search.differentiate(search.tracks)
    return search


def _search(problem: FitProblem, starts: ArrayLike, central: bool = True) -> BoundedSearch:
    search = problem.search(prior=PRIOR, tol=_TOL, step=_STEP, central=central)
    search.begin(starts)
    if not search.tracks:
        raise problem.no_success()
    return search
