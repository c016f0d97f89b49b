"""Calibration by bounded least squares with a prior at the nominal values (maximum a posteriori)."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2, norm
from sklearn.utils.validation import check_is_fitted
from tqdm import tqdm

from errorscreen._runtime.threads import one_blas_thread
from errorscreen.calibration.attenuation import bias_corrected
from errorscreen.calibration.base import BaseCalibrator, by_column
from errorscreen.calibration.intervals import (
    DETERMINED,
    collinear_groups,
    correlation,
    noise_inflation,
    posterior_covariance,
)
from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.search import BoundedSearch, Track
from errorscreen.calibration.truncated import sample_truncated_normal
from errorscreen.exceptions import DataWarning, check_integer, check_real
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.plant.injection_noise import typical

if TYPE_CHECKING:
    import pandas as pd

#: states of a start that ended at a minimum, see `BoundedSearch`
_ENDED = ("converged", "kink")
#: starts that run together
_AT_ONCE = 2
#: objectives this close count as the same minimum; one standard deviation of one parameter changes them by 1
_ALIKE = 2.0
#: probability that noise alone exceeds the limit for χ²
_CHANCE = 0.01


def _enough(tracks: list[Track], n_values: int) -> bool:
    """Whether two starts agree on the lowest objective, and noise explains its χ²."""
    best = min(tracks, key=lambda track: track.cost)
    agree = sum(track.cost < best.cost + _ALIKE for track in tracks)
    return agree >= 2 and float(np.sum(best.residuals**2)) <= chi2.isf(_CHANCE, n_values)


class MAPCalibrator(BaseCalibrator):
    r"""Most probable parameters for all recordings together, with intervals.

    Minimises

    .. math:: \chi^2(\theta) + \sum_j \left(\frac{\theta_j - \theta_{j,0}}{s\,|\theta_{j,0}|}\right)^2

    inside the bounds, where χ² sums squared errors in multiples of each channel's noise over all recordings. The second
    term is a Gaussian prior around the nominal values with the relative standard deviation s = `prior_scale`; it
    decides where the recordings say nothing. The search (`BoundedSearch`) starts at the nominal values and at the best
    of a library of Latin-hypercube simulations, because a local minimum looks exactly like a missing effect.

    Parameters
    ----------
    simulator : Simulator
    names : iterable of str, optional
        Parameters to calibrate; the others stay nominal. All where not given.
    prior_scale : float, default 0.3
        Standard deviation of the prior in multiples of each parameter's scale (its nominal value). The bounds always
        hold.
    n_starts : int, default 8
        Largest number of starts; the first is the nominal one. With 1 there is no library. Two run at a time, until two
        have ended at the lowest objective and noise explains it.
    starts : array-like of shape (s, m) or (m,), optional
        Values of all parameters for the first starts instead of the nominal ones, for example of an earlier fit.
    library_size : int, default 2048
        Simulations of each recording from which the other starts are taken.
    max_iterations : int, default 50
        For each pair of starts; a start that has not ended goes on with the next pair.
    tol : float, default 1e-2
        A start has converged where no step inside the bounds promises to lower the objective by more than
        ``tol * max(1, χ²/N, (χ² - N) / 10)``.
    step : float, default 1e-4
        Step of the differences, in multiples of each parameter's scale.
    level : float, default 0.9
        Probability that an interval holds the true value.
    random_state : None, int, SeedSequence, Generator or RandomState
        For the library.
    progress : bool, default False
        Show a progress bar.

    Attributes
    ----------
    theta_, names_, values_, simulator_, observations_, n_simulations_, n_failed_
        See `BaseCalibrator`.
    chi2_ : float
        χ² of the fit.
    chi2_per_sample_ : float
        χ²/N; about 1 if noise explains the residuals.
    state_ : str
        How the best start ended: ``"converged"``, ``"kink"`` (less than one standard deviation from the tolerance),
        ``"stalled"``, or ``"active"`` if the iterations did not suffice.
    converged_ : bool
        Whether that is ``"converged"`` or ``"kink"``.
    starts_ : list of dict
        ``"objective"``, ``"chi2_per_sample"`` and ``"state"`` at the end of each start.
    history_ : dict of str to ndarray of shape (iterations,)
        ``"chi2_per_sample"`` of the best start, ``"simulations"`` so far, ``"active"`` starts.
    covariance_ : ndarray of shape (k, k)
        Posterior covariance, in the parameters' units.
    correlation_ : ndarray of shape (k, k)
    inflation_ : float
        Factor on the noise variance for the covariance, see `noise_inflation`.
    intervals_ : ndarray of shape (k, 2)
        Lower and upper ends from the covariance, cut at the bounds.
    at_bound_ : ndarray of shape (k,), bool
        Values at a bound: the recordings pull them outside, and the interval only shows how firmly.
    identifiable_ : ndarray of shape (k,), bool
        Whether the standard deviation fell below half of what prior and bounds allow; False where the search
        did not converge.
    groups_ : list of tuple of str
        Parameters that the recordings determine only together, see `collinear_groups`.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, truth = demo_recordings(0)
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> fit = MAPCalibrator(plant, n_starts=2, library_size=64, random_state=0).fit(recording)
    >>> bool(fit.chi2_per_sample_ < 1.2)
    True
    >>> low, high = fit.intervals_[fit.names_.index("Xd1")]
    >>> bool(low < truth["Xd1"] < high)
    True
    """

    selects = False
    case_keys = {
        "prior_scale": "prior_scale",
        "n_starts": "starts",
        "library_size": "library",
        "level": "level",
    }

    chi2_: float
    chi2_per_sample_: float
    state_: str
    converged_: bool
    starts_: list[dict[str, Any]]
    history_: dict[str, NDArray[np.float64]]

    def __init__(
        self,
        simulator: Simulator,
        names: Iterable[str] | None = None,
        *,
        prior_scale: float = 0.3,
        n_starts: int = 8,
        starts: ArrayLike | None = None,
        library_size: int = 2048,
        max_iterations: int = 50,
        tol: float = 1e-2,
        step: float = 1e-4,
        level: float = 0.9,
        random_state: Any = None,
        progress: bool = False,
    ) -> None:
        self.simulator = simulator
        self.names = names
        self.prior_scale = prior_scale
        self.n_starts = n_starts
        self.starts = starts
        self.library_size = library_size
        self.max_iterations = max_iterations
        self.tol = tol
        self.step = step
        self.level = level
        self.random_state = random_state
        self.progress = progress

    @one_blas_thread
    def fit(self, X: Any, y: None = None) -> MAPCalibrator:
        """Calibrate on one recording, or on several together.

        An interrupted fit (Ctrl-C) keeps the best values so far, without intervals. See `BaseCalibrator.fit` for the
        arguments.

        Raises
        ------
        InputError
            If an argument or a recording cannot be used.
        SimulationError
            If the simulations of all starts failed.
        """
        problem = FitProblem(self.simulator, X, self.names)
        max_iterations = check_integer(self.max_iterations, "max_iterations")
        check_real(self.level, "level", low=0.0, high=1.0, above=True)
        self.__dict__.pop("intervals_", None)  # an interrupted fit has none
        search = problem.search(
            prior=check_real(self.prior_scale, "prior_scale", low=0.0, above=True),
            tol=check_real(self.tol, "tol", low=0.0, above=True),
            step=check_real(self.step, "step", low=0.0, above=True),
        )
        starts = self._starts(problem)
        history: list[tuple[float, ...]] = []
        best: BoundedSearch | None = None
        try:
            for first in range(0, len(starts), _AT_ONCE):
                search.begin(starts[first : first + _AT_ONCE])
                if search.tracks:
                    for _ in tqdm(range(max_iterations), desc="least squares", disable=not self.progress):
                        more = search.iterate()
                        active = sum(track.state == "active" for track in search.tracks)
                        chi2_per_sample = float(np.mean(search.best.residuals**2))
                        history.append((chi2_per_sample, problem.n_simulations, active))
                        if not more:
                            break
                    if _enough(search.tracks, problem.n_values):
                        break
            if not search.tracks:
                raise problem.no_success()
            best = bias_corrected(search, problem)
            self._describe(problem, best)
        finally:
            if search.tracks:
                self._take_over(problem, search, best or search, history)
        return self

    def sample_posterior(self, n: int, random_state: Any = None) -> NDArray[np.float64]:
        """Draw parameter vectors that agree with the recordings about as well as the calibrated one.

        They come from the normal distribution of the linear model at the calibrated values, cut off at the bounds, see
        `sample_truncated_normal`. Unlike intervals they show which parameters can move only together.

        Parameters
        ----------
        n : int
        random_state : None, int, SeedSequence, Generator or RandomState

        Returns
        -------
        ndarray of shape (n, m)
            All parameters; those that were not calibrated are nominal.

        Raises
        ------
        NotFittedError
            If the fit was interrupted or has not been made.

        Warns
        -----
        DataWarning
            If the search did not end at a minimum, because the linear model there says little.
        """
        check_is_fitted(self, "intervals_")
        if not self.converged_:
            text = "The search did not end at a minimum: the samples show little of the uncertainty."
            warnings.warn(DataWarning(text), stacklevel=2)
        mean, precision, lower, upper, u = self._posterior
        samples = sample_truncated_normal(
            mean, precision, lower, upper, n, start=u, random_state=random_state
        )
        space = self.simulator.parameters.subset(self.names_)
        return self.simulator.parameters.embed(space.nominal + samples * space.scales, self.names_)

    def to_frame(self) -> pd.DataFrame:
        """Table of the calibrated parameters, one row each, indexed by name; an interrupted fit has no intervals."""
        frame = super().to_frame()
        if not hasattr(self, "intervals_"):
            return frame
        group = {name: number for number, names in enumerate(self.groups_, start=1) for name in names}
        return frame.assign(
            low=self.intervals_[:, 0],
            high=self.intervals_[:, 1],
            at_bound=self.at_bound_,
            identifiable=self.identifiable_,
            group=[group.get(name, 0) for name in self.names_],
        )

    def _facts(self) -> dict[str, Any]:
        facts = super()._facts()
        if hasattr(self, "chi2_"):
            facts |= {"χ²/N": f"{self.chi2_per_sample_:.4g}", "state": self.state_}
        return facts

    def _starts(self, problem: FitProblem) -> NDArray[np.float64]:
        """Given starts or the nominal one, and the best of the library, in u."""
        first = np.zeros((1, len(problem.names)))
        if self.starts is not None:
            everything = self.simulator.parameters
            columns = [everything.index(name) for name in problem.names]
            first = problem.scaled(everything.validate(self.starts)[:, columns])
        others = max(0, check_integer(self.n_starts, "n_starts") - len(first))
        if not others:
            return first
        size = check_integer(self.library_size, "library_size", low=others)
        u = problem.drawn(size, self.random_state)
        costs = problem.chi_square(problem.values(u)) + ((u / self.prior_scale) ** 2).sum(axis=1)
        return np.vstack([first, u[np.argsort(costs, kind="stable")[:others]]])  # NaN comes last

    def _take_over(
        self,
        problem: FitProblem,
        search: BoundedSearch,
        last: BoundedSearch,
        history: list[tuple[float, ...]],
    ) -> None:
        """Store the best values, also of an interrupted search."""
        best = last.best
        values = problem.values(best.u)
        propagated = typical(problem.propagated_noise(values)[:, 0])
        self.chi2_ = float(np.sum(best.residuals**2)) - float(np.nansum(propagated))
        self._store(problem, values)
        self.chi2_per_sample_ = self.chi2_ / problem.n_values
        self.state_ = best.state
        self.converged_ = best.state in _ENDED
        self.starts_ = [
            {"objective": t.cost, "chi2_per_sample": float(np.mean(t.residuals**2)), "state": t.state}
            for t in search.tracks
        ]
        self.history_ = by_column(("chi2_per_sample", "simulations", "active"), history)

    def _describe(self, problem: FitProblem, search: BoundedSearch) -> None:
        """Store intervals and their kin, from the linear model at the best values."""
        best, space = search.best, problem.space
        assert best.jacobian is not None
        values = problem.values(best.u)
        without = posterior_covariance(best.jacobian, self.prior_scale)
        determined = len(space) - np.trace(without) / (self.prior_scale**2)
        self.inflation_ = noise_inflation([z[0] for z in problem.deviations(values)], determined)
        covariance = posterior_covariance(best.jacobian, self.prior_scale, self.inflation_)
        deviation = np.sqrt(np.diag(covariance))
        lower, upper = space.bounds.T
        width = (upper - lower) / space.scales
        # linear model without bounds; `sample_posterior` adds them
        A, g = search.normal_equations(best, self.inflation_)
        self._posterior = (best.u - np.linalg.solve(A, g), A, *problem.scaled_bounds, best.u)
        known = np.minimum(self.prior_scale, width / np.sqrt(12))  # of a uniform law
        self.covariance_ = covariance * np.outer(space.scales, space.scales)
        self.correlation_ = correlation(covariance)
        half = norm.ppf(0.5 + self.level / 2) * deviation * space.scales
        self.intervals_ = np.clip([values - half, values + half], lower, upper).T
        margin = 1e-6 * (upper - lower)
        self.at_bound_ = (values <= lower + margin) | (values >= upper - margin)
        # intervals only hold at a minimum
        self.identifiable_ = (deviation < DETERMINED * known) & (best.state in _ENDED)
        self.groups_ = [
            tuple(problem.names[j] for j in group) for group in collinear_groups(covariance, known)
        ]
