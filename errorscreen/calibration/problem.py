"""The fit that optimisers see: parameter values in, misfit out, one simulate call for each event."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.sampling import latin_hypercube
from errorscreen._runtime.threads import parallel_map, threads_left
from errorscreen.calibration.search import BoundedSearch
from errorscreen.data.observations import Observation
from errorscreen.exceptions import SimulationError
from errorscreen.metrics import channel_weights, objective, quiet_level, response_error
from errorscreen.parameters import distinct_rows
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import as_observations, check_names

#: most simulated numbers of a thread at a time where only the misfit is kept (16 MiB)
_CHUNK = 2**21
#: fewest measured samples after the start of an event in a part of a recording
_LEAST = 8
#: a fit is refused if more unaccounted noise than this passes, in multiples of the noise
_MOST_PASSED = 0.5


class FitProblem:
    """The misfit between a simulator and recordings as a function of some of its parameters.

    Parameters
    ----------
    simulator : Simulator
    recordings : Observation, or anything ``simulator.observe`` takes, or a list of them
        All are fitted together.
    names : iterable of str, optional
        The k parameters that may change; the others stay nominal. All where not given, but for the strengths of
        switches (`Effect.switch`).

    Attributes
    ----------
    names : tuple of k str
    space : ParameterSpace
        The k parameters.
    observations : list of Observation
    n_values : int
        Number N of measured values in all recordings and channels.
    n_simulations, n_failed : int
        Simulations so far, over all events, and how many of them failed.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, truth = demo_recordings(0)
    >>> problem = FitProblem(PlantSimulator("synchronous_machine", recording), recording)
    >>> true = [truth[name] for name in problem.names]
    >>> nominal, right = problem.chi_square([problem.space.nominal, true]) / problem.n_values
    >>> bool(nominal > 10), bool(right < 1.2)
    (True, True)
    """

    def __init__(self, simulator: Simulator, recordings: Any, names: Iterable[str] | None = None) -> None:
        self.observations = as_observations(simulator, recordings)
        self.simulator = simulator
        self.names = check_names(simulator.parameters, simulator.movable if names is None else names)
        self.space = simulator.parameters.subset(self.names)
        self.n_values = int(sum(observation.mask.sum() for observation in self.observations))
        self.n_simulations = 0
        self.n_failed = 0
        self._failures = ""
        self._counts_in: FitProblem | None = None

    def until(self, share: float) -> FitProblem:
        """Fit to this share of the measured samples after the start of each event, and to all before it.

        Its simulations count here, too.
        """
        parts = [self.simulator.part(o, _samples_until(o, share)) for o in self.observations]
        return self._derived(self.simulator, parts)

    def with_step(self, step: float | None) -> FitProblem:
        """Fit with another longest step in seconds, whose simulations count here, too; itself for None."""
        if step is None:
            return self
        return self._derived(self.simulator.with_step(step), self.observations)

    def _derived(self, simulator: Simulator, observations: list[Observation]) -> FitProblem:
        """Fit of the same parameters; its simulations count here, too."""
        derived = FitProblem(simulator, observations, self.names)
        derived._counts_in = self
        return derived

    def _count(self, simulations: int, failed: int = 0, failures: str = "") -> None:
        self.n_simulations += simulations
        self.n_failed += failed
        self._failures = failures or self._failures
        if self._counts_in is not None:
            self._counts_in._count(simulations, failed, failures)

    def drawn(self, n: int, random_state: Any = None) -> NDArray[np.float64]:
        """Scaled deviations u (n, k) all over the ranges, a Latin hypercube."""
        return self.scaled(latin_hypercube(self.space, n, random_state))

    def embed(self, values: ArrayLike) -> NDArray[np.float64]:
        """Full parameter vectors (n, m) for values (n, k) of the selected parameters, kept inside the bounds."""
        lower, upper = self.space.bounds.T
        return self.simulator.parameters.embed(np.clip(values, lower, upper), self.names)

    @property
    def scaled_bounds(self) -> NDArray[np.float64]:
        """Lower and upper bounds (2, k) of u, the deviation from nominal in multiples of the scale."""
        return self.scaled(self.space.bounds.T)

    def values(self, u: ArrayLike) -> NDArray[np.float64]:
        """Values of the selected parameters for scaled deviations u, of the same shape."""
        return np.asarray(self.space.nominal + np.asarray(u) * self.space.scales)

    def scaled(self, values: ArrayLike) -> NDArray[np.float64]:
        """Scaled deviations u for values of the selected parameters, of the same shape."""
        return np.asarray((np.asarray(values, dtype=float) - self.space.nominal) / self.space.scales)

    def search(self, **options: Any) -> BoundedSearch:
        """`BoundedSearch` over u with these options."""
        lower, upper = self.scaled_bounds
        return BoundedSearch(lambda u: self.residuals(self.values(u)), lower, upper, **options)

    def deviations(self, values: ArrayLike) -> list[NDArray[np.float64]]:
        """Simulated minus measured in multiples of the noise, for each recording (n, R, L).

        See `Observation.deviations`. NaN where nothing was measured, and in rows that failed.
        """
        return self._simulated(values, Observation.deviations)

    def residuals(self, values: ArrayLike) -> NDArray[np.float64]:
        """All deviations where something was measured, shape (n, N); NaN in rows that failed."""
        parts = self._simulated(values, lambda seen, responses: seen.deviations(responses)[:, seen.mask])
        return np.concatenate(parts, axis=1)

    def chi_square(self, values: ArrayLike) -> NDArray[np.float64]:
        """χ² of each row, shape (n,); NaN in rows that failed. Any number of rows fits into memory."""
        return np.concatenate([(self.residuals(some) ** 2).sum(axis=1) for some in self.portions(values)])

    def portions(self, values: ArrayLike) -> list[NDArray[np.float64]]:
        """Rows (n, k) in portions whose responses fit into memory together."""
        rows = np.atleast_2d(np.asarray(values, dtype=float))
        size = max(o.values.size for o in self.observations)
        most = max(1, _CHUNK // (size * len(self.observations)))
        return [rows[start : start + most] for start in range(0, len(rows), most)]

    @property
    def passes_noise(self) -> bool:
        """Whether noise of injected signals moves a simulation, see `errorscreen.calibration.attenuation`."""
        return any(observation.propagated is not None for observation in self.observations)

    def propagated_noise(self, values: ArrayLike) -> NDArray[np.float64]:
        """Energy of propagated noise of injected signals beyond what was counted, see `Simulator.propagated_noise`.

        Parameters
        ----------
        values : array-like of shape (n, k)

        Returns
        -------
        ndarray of shape (D, n, S)
            In squared deviations, for D draws and each channel of each recording; at most half of the channel's noise.
            A model that amplifies noise by more, as a large lag in a control loop does, needs
            `Simulator.with_uncertainty`.
        """
        theta = self.embed(values)
        parts = []
        for observation in self.observations:
            counted = observation.propagated
            if counted is None:
                parts.append(np.zeros((1, len(theta), len(observation.channels))))
                continue
            energy = self.simulator.propagated_noise(observation, theta)
            self._count((1 + len(energy)) * len(theta))
            parts.append(np.minimum(energy - counted, _MOST_PASSED * observation.mask.sum(axis=1)))
        draws = max(map(len, parts))
        return np.concatenate([np.broadcast_to(p, (draws, *p.shape[1:])) for p in parts], axis=2)

    def objective(self, values: ArrayLike, weights: ArrayLike | None = None) -> NDArray[np.float64]:
        """J, equation (24), of each row, summed over the recordings, shape (n,); NaN in rows that failed.

        A channel without measured values adds nothing.
        """
        lambdas = channel_weights(weights, len(self.simulator.channels))

        def misfit(observation: Observation, responses: NDArray[np.float64]) -> NDArray[np.float64]:
            level = quiet_level(observation.values, observation.time, observation.event.start)
            measured = observation.mask.any(axis=1)
            errors = response_error(responses[:, measured], observation.values[measured], level[measured])
            return objective(errors, lambdas[measured])

        return np.sum(self._simulated(values, misfit), axis=0)

    def no_success(self) -> SimulationError:
        """Error of a fit without a successful simulation."""
        return SimulationError(f"no simulation of the fit ended well: {self._failures}.")

    def _simulated(
        self, values: ArrayLike, use: Callable[[Observation, NDArray[np.float64]], NDArray[np.float64]]
    ) -> list[NDArray[np.float64]]:
        """Result of `use` for each observation and the responses (n, R, L) to its event, in parallel."""
        theta = self.embed(values)
        calls = [partial(self._respond, theta, observation, use) for observation in self.observations]
        threads = threads_left(self.simulator.threads)
        # the calls left over by an even split share all threads
        even = len(calls) // threads * threads
        parts = [part for some in (calls[:even], calls[even:]) for part in parallel_map(some, threads)]
        for _, count, failed, failures in parts:
            self._count(count, failed, failures)
        return [part for part, *_ in parts]

    def _respond(
        self,
        theta: NDArray[np.float64],
        observation: Observation,
        use: Callable[[Observation, NDArray[np.float64]], NDArray[np.float64]],
    ) -> tuple[NDArray[np.float64], int, int, str]:
        """Result of `use` for one recording, simulations, how many of them failed, and why."""
        event, rows, which = observation.event, theta, None
        if any(not effect.acts_in(event) for effect in self.simulator.extensions):
            # rows that only differ in effects that are off in this event are simulated once
            rows, which = distinct_rows(self.simulator.acting(theta, event))
        responses = self.simulator.simulate(rows, event)
        failed = int(np.sum(~responses.ok))
        part = use(observation, responses.values if which is None else responses.values[which])
        return part, len(rows), failed, responses.failures() if failed else ""


def _samples_until(observation: Observation, share: float) -> int:
    """Samples until this share of the measured samples after the start of the event."""
    after = np.flatnonzero(
        observation.mask.any(axis=0) & (observation.time >= observation.event.start - 1e-9)
    )
    if not len(after):
        return len(observation.time)
    count = min(len(after), max(_LEAST, int(np.ceil(share * len(after)))))
    return max(2, int(after[count - 1]) + 1)
