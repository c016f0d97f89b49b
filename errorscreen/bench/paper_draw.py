"""One hidden draw of the paper's case study: measured, ranked, calibrated and judged."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.frozen import FrozenEstimator

from errorscreen._runtime.sampling import latin_hypercube
from errorscreen.calibration import MAPCalibrator, PSOCalibrator
from errorscreen.calibration.problem import FitProblem
from errorscreen.cases.ieee39 import ieee39_events, load_ieee39
from errorscreen.data.observations import Observation
from errorscreen.events import GridEvent
from errorscreen.exceptions import DataWarning, check_integer
from errorscreen.learning.generation import contribution_labels
from errorscreen.metrics import quiet_level, ranking, response_error, top_k_overlap
from errorscreen.screening import (
    AttributionScreener,
    BaseScreener,
    IdentifiabilityScreener,
    RandomScreener,
    SensitivityScreener,
)
from errorscreen.simulators import PowerSystemSimulator

#: events that are measured for calibration, the paper's first; all others are held out
FIT_EVENTS = ("fault at bus 3", "fault at bus 3, impedance", "fault at bus 26")
#: rankings whose first ten parameters are calibrated by the swarm, in the order of the arrays of a draw
RANKINGS = ("random", "sensitivity", "identifiability", "cnn", "map", "oracle")
#: all calibrations: the ten of each ranking, then all parameters on one event and on three
CALIBRATED = (*RANKINGS, "map_all", "map_all_three")
TOP = 10
#: steps of the fitted model and of the truth in seconds; `step_error` is the difference
STEP, TRUE_STEP = 0.005, 0.0005
#: noise of recordings without noise, because χ² needs one
_QUIET_DB = 80.0
#: draws from which the error of the step is estimated
_STEP_DRAWS = 32

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Effort:
    """Effort of each method; the defaults are those of the published table.

    Parameters
    ----------
    samples : int
        Simulated errors with exact labels that the network learns from.
    enlarged : int
        Further samples with labels by a regression of the exact ones, see `enlarge_dataset`.
    epochs : int
        Passes over all samples.
    particles, iterations : int
        Of the swarm.
    starts, library : int
        Of the fit of all parameters, see `MAPCalibrator`.
    posterior : int
        Samples of the attribution, see `AttributionScreener`.
    """

    samples: int = 20000
    enlarged: int = 60000
    epochs: int = 8
    particles: int = 30
    iterations: int = 80
    starts: int = 8
    library: int = 1024
    posterior: int = 96

    def __post_init__(self) -> None:
        # checked at once: a number may be needed only half an hour later
        for name, value in asdict(self).items():
            check_integer(value, name, low={"samples": 20, "enlarged": 0}.get(name, 1))


@dataclass(frozen=True)
class Setting:
    """Common settings of all draws; `noise_db` as in `errorscreen.bench.scenarios.draw_scenario`, None for no noise."""

    seed: int
    noise_db: float | None
    effort: Effort
    simulator: PowerSystemSimulator = field(default_factory=lambda: load_ieee39(step=STEP, n_threads=1))

    @property
    def events(self) -> dict[str, GridEvent]:
        """Events to fit, then held-out events."""
        events = ieee39_events()
        held_out = [name for name in events if name not in FIT_EVENTS]
        return {name: events[name] for name in (*FIT_EVENTS, *held_out)}

    def streams(self, draw: int) -> list[np.random.SeedSequence]:
        """Independent seeds of one draw: of its parameters, of its noise, and of the searches."""
        return np.random.SeedSequence(self.seed, spawn_key=(draw,)).spawn(3)


def step_error(setting: Setting) -> dict[str, _Array]:
    """Error by the step of the fitted model at each sample (R, L), rms over draws, for each event."""
    theta = latin_hypercube(setting.simulator.parameters, _STEP_DRAWS, setting.seed)
    fine, found = load_ieee39(step=TRUE_STEP), {}
    for name, event in setting.events.items():
        error = setting.simulator.simulate(theta, event).values - fine.simulate(theta, event).values
        found[name] = np.sqrt(np.mean(error**2, axis=0))
    return found


def noise_of(response: _Array, event: GridEvent, noise_db: float) -> _Array:
    """Standard deviation of each channel's noise (R,) at a level below the response's deviation, see `Setting`."""
    level = quiet_level(response, event.time, event.start)[:, None]
    return np.asarray(np.sqrt(np.mean((response - level) ** 2, axis=1)) * 10 ** (-noise_db / 20))


@dataclass(frozen=True)
class Hidden:
    """A hidden parameter vector, its true responses and their recordings."""

    theta: _Array
    truths: dict[str, _Array]
    observations: dict[str, Observation]


def hidden(setting: Setting, draw: int, step_errors: dict[str, _Array], names: Iterable[str]) -> Hidden:
    """Draw parameters, uniform inside the bounds, and measure the named events."""
    fine = load_ieee39(step=TRUE_STEP, n_threads=1)
    lower, upper = fine.parameters.bounds.T
    for_theta, for_noise, _ = setting.streams(draw)
    theta = np.random.default_rng(for_theta).uniform(lower, upper)
    noise_streams = dict(zip(setting.events, for_noise.spawn(len(setting.events)), strict=True))
    truths, observations = {}, {}
    for name in names:
        event = setting.events[name]
        truth = fine.simulate(theta, event).require_ok(f"hidden draw {draw}, {name}").values[0]
        noise = noise_of(truth, event, _QUIET_DB if setting.noise_db is None else setting.noise_db)
        values = truth
        if setting.noise_db is not None:
            white = np.random.default_rng(noise_streams[name]).standard_normal(truth.shape)
            values = truth + white * noise[:, None]
        truths[name] = truth
        extra = step_errors[name]
        observations[name] = Observation(event, values, noise, fine.channels, fine.units, extra=extra)
    return Hidden(theta, truths, observations)


class Ranked(NamedTuple):
    """Contributions (m,) by one ranking, their cost, and the overlap that the ranking expects."""

    contributions: _Array
    simulations: int
    seconds: float
    expected: float = np.nan


class FullFit(NamedTuple):
    """Fit of all parameters, compared with the truth."""

    fit: MAPCalibrator
    seconds: float
    ranked: Ranked
    chi2_truth: float
    objective: tuple[float, float]
    covered: NDArray[np.bool_]


def run_draw(
    setting: Setting, draw: int, step_errors: dict[str, _Array], cnn: _Array
) -> dict[str, NDArray[Any]]:
    """Rank, calibrate and judge one hidden draw.

    `cnn` are the contributions (m,) by the network from the error of the calibration event, `step_errors` those of
    `step_error`. Arrays of the result follow the order of `RANKINGS`, `CALIBRATED` (fits) and `Setting.events`;
    ``errors`` (fits, events, R) is equation (23) against the true response, and ``measured`` (fits, R) against the
    recording that is fitted.
    """
    simulator = setting.simulator
    found = hidden(setting, draw, step_errors, setting.events)
    one, three = ([found.observations[name] for name in FIT_EVENTS[:k]] for k in (1, 3))
    seeds = [int(s.generate_state(1)[0]) for s in setting.streams(draw)[2].spawn(3)]
    on_one, on_three = (_fit_all(setting, recordings, found.theta, seeds) for recordings in (one, three))
    labels = [contribution_labels(simulator, found.theta, o.event)[0] for o in three]
    label, label_three = labels[0], np.mean(labels, axis=0)
    ranked = _rank(simulator, one, seeds[2]) | {
        "cnn": Ranked(cnn, 1, 0.0),
        "map": on_one.ranked,
        "oracle": Ranked(label, 0, 0.0),
    }
    swarms = [_swarm(setting, ranked[name].contributions, one, seeds[2]) for name in RANKINGS]
    full = (on_one, on_three)
    fits = swarms + [(f.fit, f.seconds) for f in full]
    thetas = np.array([simulator.parameters.nominal] + [fit.theta_ for fit, _ in fits])
    errors = np.stack(
        [_errors(simulator, thetas, o, found.truths[name]) for name, o in found.observations.items()]
    )
    measured = _errors(simulator, thetas, one[0], one[0].values)
    costs = [(ranked[n].simulations, ranked[n].seconds) for n in RANKINGS] + [(0, 0.0)] * 2
    return {
        "theta": found.theta,
        "label": label,
        "contributions": np.array([ranked[name].contributions for name in RANKINGS]),
        "overlap": np.array([top_k_overlap(label, ranked[name].contributions, TOP) for name in RANKINGS]),
        "overlap_three": np.array(top_k_overlap(label_three, on_three.ranked.contributions, TOP)),
        "expected_overlap": np.array([f.ranked.expected for f in full]),
        "calibrated": thetas[1:],
        "before": errors[:, 0],
        "errors": errors[:, 1:].swapaxes(0, 1),
        "measured_before": measured[0],
        "measured": measured[1:],
        "chi2": np.array([[f.fit.chi2_per_sample_, f.chi2_truth] for f in full]),
        "objective": np.array([f.objective for f in full]),
        "covered": np.array([f.covered for f in full]),
        "identifiable": np.array([f.fit.identifiable_ for f in full]),
        "converged": np.array([f.fit.converged_ for f in full]),
        "starts": np.array([len(f.fit.starts_) for f in full]),
        "simulations": np.array(
            [[c[0], fit.n_simulations_] for c, (fit, _) in zip(costs, fits, strict=True)]
        ),
        "seconds": np.array([[c[1], seconds] for c, (_, seconds) in zip(costs, fits, strict=True)]),
    }


def _fit_all(setting: Setting, recordings: list[Observation], theta: _Array, seeds: list[int]) -> FullFit:
    """Calibrate all parameters by MAP, attribute the error to them, and compare with the truth `theta`."""
    simulator, effort = setting.simulator, setting.effort
    calibrator = MAPCalibrator(
        simulator, n_starts=effort.starts, library_size=effort.library, random_state=seeds[0]
    )
    fit, seconds = _timed(calibrator, recordings)
    screener = AttributionScreener(
        simulator, FrozenEstimator(fit), n_samples=effort.posterior, random_state=seeds[1]
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # the result counts fits that have not converged
        attribution, more = _timed(screener, recordings)
    problem = FitProblem(simulator, recordings)
    chi2_truth = float(problem.chi_square(theta)[0])
    low, high = fit.intervals_.T
    prior_truth = float(np.sum((simulator.parameters.deviation(theta) / fit.prior_scale) ** 2))
    return FullFit(
        fit,
        seconds,
        Ranked(
            attribution.contributions_,
            attribution.n_simulations_,
            seconds + more,
            float(attribution.inclusion_probability(TOP)[attribution.ranking_[:TOP]].mean()),
        ),
        chi2_truth / problem.n_values,
        (min(start["objective"] for start in fit.starts_), chi2_truth + prior_truth),
        (low <= theta) & (theta <= high),
    )


def _timed(estimator: Any, recordings: list[Observation]) -> tuple[Any, float]:
    started = perf_counter()
    return estimator.fit(recordings), perf_counter() - started


def _rank(simulator: PowerSystemSimulator, recordings: list[Observation], seed: int) -> dict[str, Ranked]:
    """Rankings that need only the event and its noise."""
    m = len(simulator.parameters)
    screeners: dict[str, tuple[BaseScreener, int]] = {
        "random": (RandomScreener(simulator, random_state=seed), 0),
        "sensitivity": (SensitivityScreener(simulator), m + 1),
        "identifiability": (IdentifiabilityScreener(simulator), 2 * m + 1),
    }
    fitted = {name: (*_timed(s, recordings), n) for name, (s, n) in screeners.items()}
    return {name: Ranked(s.contributions_, n, seconds) for name, (s, seconds, n) in fitted.items()}


def _swarm(
    setting: Setting, contributions: _Array, recordings: list[Observation], seed: int
) -> tuple[PSOCalibrator, float]:
    """Calibrate the ten parameters with the largest contributions as the paper does."""
    simulator, effort = setting.simulator, setting.effort
    names = [simulator.parameters.names[j] for j in ranking(contributions)[:TOP]]
    sizes: dict[str, Any] = {"n_particles": effort.particles, "n_iterations": effort.iterations}
    return _timed(PSOCalibrator(simulator, names, random_state=seed, **sizes), recordings)


def _errors(
    simulator: PowerSystemSimulator, thetas: _Array, observation: Observation, reference: _Array
) -> _Array:
    """Equation (23) of each parameter vector and channel (fits, R) against a response; NaN where a model fails."""
    event = observation.event
    level = quiet_level(reference, event.time, event.start)
    return response_error(simulator.simulate(thetas, event).values, reference, level)
