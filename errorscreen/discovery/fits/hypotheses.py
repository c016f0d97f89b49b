r"""Hypotheses about what a model lacks, each fitted to the recordings, and how probable each is.

A hypothesis is the model with no, one or several effects of its library; all parameters are fitted together with those
of the effects. Its evidence is Laplace's approximation of the marginal likelihood at the most probable values,

.. math:: \ln Z = -\tfrac12 \Big(\chi^2 + \sum_j u_j^2/s^2\Big) - \tfrac12 \ln\det(I + s^2 J^T J)            \qquad (D1)

with deviations u in multiples of each parameter's scale, their prior standard deviation s and the sensitivities J of
the residuals (D. J. C. MacKay, *Information Theory, Inference, and Learning Algorithms*, 2003, section 28.1). Its
second term is what BIC counts as :math:`\tfrac12 k \ln N`, but only for directions that the recordings determine.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.calibration.attenuation import bias_corrected, noise_slope
from errorscreen.calibration.intervals import posterior_covariance
from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.search import BoundedSearch, Track
from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.noise import inflation_of
from errorscreen.effects.base import Effect
from errorscreen.events import Event
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.plant.injection_noise import typical

#: standard deviation of the prior in multiples of each parameter's scale, as `MAPCalibrator` has it by default
PRIOR = 0.3
_TOL, _STEP = 1e-2, 1e-4
#: iterations at a time, and how many times a fit goes on for so many
SLICE, SLICES = 5, 6
#: iterations with the problem's own step after those with a longer one
_EXACT = 10
_ENDED = ("converged", "kink")
#: state of a fit from which no start around it leads lower, although the linear model promises that
CORNER = "corner"
#: a joint fit goes on while its distance from the best is less than so many times what it gained last
HOPE = 20.0
#: noise never counts for less than this part of what was counted: a level from an energy may come out too low
_LEAST_LEVEL = 0.1

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
    chi2 : float
        χ² less the noise of injected signals that passes beyond what was counted, see `propagated`.
    objective : float
        χ² with the prior's term, as low as the search has come.
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
        By which χ² was taken to fall from letting less noise pass, see `errorscreen.calibration.attenuation`.
    propagated : ndarray of shape (S,)
        Energy of noise that passes beyond what was counted, for each channel of each recording.
    state : str
        How the best start ended, see `Track`; ``"corner"`` where starts around it have led no lower either.
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
    slope: _Array = field(repr=False)
    propagated: _Array = field(repr=False)
    state: str = "converged"

    @property
    def name(self) -> str:
        """Names of its effects joined by `` + ``; ``"parameters"`` without any."""
        return name_of(self.effects)

    @property
    def converged(self) -> bool:
        """Whether the search ended at a minimum."""
        return self.state in _ENDED

    @property
    def ended(self) -> bool:
        """Whether no step led lower by enough, be it at a minimum or where a kink or a jump is in the way."""
        return self.state != "active"

    @property
    def at_rest(self) -> bool:
        """Whether it is at a minimum: a smooth one, or a corner that nothing around it leads out of."""
        return self.converged or self.state == CORNER

    @property
    def chi2_per_sample(self) -> float:
        """χ²/N."""
        return self.chi2 / len(self.residuals)

    @property
    def inflation(self) -> float:
        """How much larger, and smoother, what is left is than noise, see `noise_inflation`."""
        return inflation_of(self.observations, self.residuals)

    @property
    def levels(self) -> list[_Array]:
        """Level (R,) of what is noise in the residuals of each recording, in multiples of what was counted."""
        counts = [o.mask.sum(axis=1) for o in self.observations]
        parts = np.split(self.propagated, np.cumsum([len(n) for n in counts])[:-1])
        shares = [1.0 + p / np.maximum(n, 1) for p, n in zip(parts, counts, strict=True)]
        return [np.sqrt(np.maximum(share, _LEAST_LEVEL**2)) for share in shares]

    @property
    def covariance(self) -> _Array:
        """Posterior covariance (k, k) in units of the scales, of parameters inside their bounds; 0 for the others."""
        covariance = posterior_covariance(self.jacobian * self.free, PRIOR)
        return np.asarray(covariance * np.outer(self.free, self.free))

    def deviations(self, names: Sequence[str]) -> _Array:
        """Fitted deviations of some parameters in multiples of their scales; 0 for those it does not have."""
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
    central : bool
        See `BoundedSearch`; without, it has no `hypothesis`.
    step : float, optional
        Of the integration until `exact`, see `rough_step`; the problem's own where not given.

    Raises
    ------
    SimulationError
        If no start can be simulated.
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
        self._search = _search(problem.with_step(step), central)
        self._search.begin(starts)
        if not self._search.tracks:
            raise problem.no_success()
        self.gained = np.inf

    @property
    def objective(self) -> float:
        """Lowest so far."""
        return self._search.best.cost

    @property
    def reached(self) -> _Array:
        """Where all starts have got to (s, k), the best first."""
        return np.array([track.u for track in self._ordered])

    def scattered(self, widths: ArrayLike, random_state: Any = 0) -> _Array:
        """Points (s, n, k) around where all starts have got to, the best first; for widths (n,) see (D6)."""
        return np.array([self._search.scattered(track, widths, random_state) for track in self._ordered])

    @property
    def _ordered(self) -> list[Track]:
        return sorted(self._search.tracks, key=lambda track: track.cost)

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

    def may_reach(self, objective: float) -> bool:
        """Whether an objective is within reach, by what was gained last."""
        return self.objective - objective < HOPE * max(self.gained, 1.0)

    def pursue(self, objective: float) -> JointFit:
        """Go on for up to six slices of five iterations, as long as an objective may be reached."""
        for _ in range(SLICES):
            if self.active and self.may_reach(objective):
                self.run(SLICE)
        return self

    def exact(self) -> JointFit:
        """Fit from the best that has been reached, with the problem's own step of the integration."""
        if self._step is None:
            return self
        return JointFit(self.effects, self.problem, self.reached[0]).run(_EXACT)

    def keep(self, n: int) -> JointFit:
        """Drop all but the best starts."""
        self._search.tracks = self._ordered[:n]
        return self

    def hypothesis(self, smooth: ArrayLike = True) -> Hypothesis:
        """What has been reached, without the bias by noise of injected signals; for `smooth` see `bias_corrected`."""
        fit = self.exact()
        fit._search.follow_prior(fit._search.best)
        found = bias_corrected(fit._search, fit.problem, smooth)
        return described(fit.effects, fit.problem, found, fit.objective)


def candidates(
    simulator: Simulator, observations: Sequence[Observation], names: Iterable[str] | None = None
) -> list[Effect]:
    """Effects to try: what belongs to one recording, an error of the event's record, is one for each of them.

    An error of the record may also be the same in all of several recordings: a relay that is always late. Recordings
    are told apart by the names of their events: what has the same name counts as the same. What the simulator has been
    extended by is none of them.

    Parameters
    ----------
    simulator : Simulator
    observations : sequence of Observation
    names : iterable of str, optional
        All of the simulator's where not given.

    Raises
    ------
    InputError
        If one that is named is unknown, or the simulator has been extended by it.
    """
    events = {o.event.name: o.event for o in observations}
    found: list[Effect] = []
    for effect in simulator.effects_named(names):
        if not effect.event_specific or effect.recording:
            found.append(effect)
            continue
        happened = [name for name, event in events.items() if _applies(effect, event)]
        if len(events) == 1:
            found += [effect.during(name, rename=False) for name in happened]
            continue
        found += [effect.during(name) for name in happened]
        if effect.kind == "event" and len(happened) > 1:
            found.append(effect)
    return simulator.addable(found, asked=names is not None)


def _applies(effect: Effect, event: Event) -> bool:
    """Whether an effect can change an event: a fault of another duration says nothing about a load step."""
    if effect.kind != "event":
        return True
    return effect.equations(event, *(p.nominal for p in effect.parameters)) is not event


def name_of(effects: Sequence[Effect]) -> str:
    """Names of effects joined by `` + ``; ``"parameters"`` without any."""
    return " + ".join(effect.name for effect in effects) or "parameters"


def fit_hypothesis(effects: Sequence[Effect], problem: FitProblem, starts: ArrayLike) -> Hypothesis:
    """Fit all parameters of a problem from some starts in lockstep, see `JointFit`."""
    return JointFit(effects, problem, starts).run(SLICE * SLICES).hypothesis()


def described(
    effects: Sequence[Effect], problem: FitProblem, search: BoundedSearch, objective: float
) -> Hypothesis:
    """Hypothesis from where a search ended."""
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
    """Residuals (N,) and sensitivities (N, k) at a point in units of the scales.

    Raises
    ------
    SimulationError
        If the point cannot be simulated.
    """
    track = _linearised(problem, u).best
    assert track.jacobian is not None
    return track.residuals, track.jacobian


def parameters_only(problem: FitProblem, theta: ArrayLike, state: str) -> Hypothesis:
    """Hypothesis without effects, at values that a calibrator found."""
    u = (np.asarray(theta, dtype=float) - problem.space.nominal) / problem.space.scales
    search = _linearised(problem, u)
    best = search.best
    best.state = state
    lowest = best.cost - search.promise(best)
    if problem.passes_noise:
        search.tilt(noise_slope(problem, best.u)[0])
    return described((), problem, search, lowest)


def reached(
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
    return described(effects, problem, search, objective)


def _linearised(problem: FitProblem, u: ArrayLike) -> BoundedSearch:
    search = _search(problem)
    search.begin(u)
    if not search.tracks:
        raise problem.no_success()
    search.differentiate(search.tracks)
    return search


def _search(problem: FitProblem, central: bool = True) -> BoundedSearch:
    lower, upper = problem.scaled_bounds
    return BoundedSearch(
        lambda u: problem.residuals(problem.values(u)),
        lower,
        upper,
        prior=PRIOR,
        tol=_TOL,
        step=_STEP,
        central=central,
    )
