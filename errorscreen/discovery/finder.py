"""Names what a model lacks, or says that it is unknown."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from errorscreen._runtime.sampling import generator
from errorscreen._runtime.store import Store, digest, program
from errorscreen._runtime.threads import one_blas_thread
from errorscreen.calibration import MAPCalibrator
from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery.diagnosis import Diagnosis
from errorscreen.discovery.findings import Findings
from errorscreen.discovery.fits.candidates import candidates
from errorscreen.discovery.fits.hypotheses import PRIOR, Hypothesis, parameters_only
from errorscreen.discovery.judge.gain import Gain
from errorscreen.discovery.judge.profiles import with_profiles
from errorscreen.discovery.judge.ranking import rank_causes
from errorscreen.discovery.judge.residual_test import residual_test
from errorscreen.discovery.search.journal import Journal
from errorscreen.discovery.search.model_search import ModelSearch
from errorscreen.discovery.search.plan import check_plan
from errorscreen.effects.base import Effect
from errorscreen.events import Event
from errorscreen.exceptions import InputError, check_integer, check_real
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import as_observations, held_out_observations, with_initial_states
from errorscreen.simulators.user_functions import identity

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

#: least significance: smaller probabilities cannot be told apart by the bootstrap of `residual_test`
_LEAST = 0.001

_Array = NDArray[np.float64]
_log = logging.getLogger(__name__)


class CauseFinder(BaseEstimator):
    r"""Find what a simulator lacks to reproduce recordings.

    All hypotheses (parameters only, each effect of the library, pairs of effects) are fitted together with all
    parameters. A hypothesis is *adequate* if its residuals pass the test for noise (`residual_test`). Adequate ones
    are compared by their evidence. If there is none, an effect that explains nearly all of the error that parameters
    leave (95 %; two together 99.7 %) is named, with the remark that its form differs from the library's. Otherwise the
    verdict is "unknown", with the port where something enters (`rank_input_locations`).

    Parameters
    ----------
    simulator : Simulator
    effects : sequence of str, optional
        Names of the effects to try; all of the simulator's where not given. An effect that belongs to one recording
        (`Effect.event_specific`) is tried in each of them by itself, and is off in others; the names of their
        events tell recordings apart.
    max_effects : int, optional
        Largest number of effects that are named together; `Simulator.usual_effects` where not given.
    n_fits : int, default 6
        Effects whose joint fit goes on to the end: those that get furthest in a few iterations.
    n_draws : int, default 128
        Draws of an effect's parameters for its signature.
    significance : float, default 0.002
        Residuals exceed noise if noise alone would be so conspicuous with this probability, at least 0.001.
    n_starts, library_size, level
        Of the fit of all parameters, see `MAPCalibrator`.
    events : sequence of Event, optional
        Events that could be recorded in addition; the one that separates a group best is named.
    random_state : None, int, SeedSequence, Generator or RandomState
    plan : sequence of str, optional
        Steps of the search that are taken, of `errorscreen.discovery.search.plan.PLAN`; all where not given.
    checkpoint : path-like, optional
        Folder for finished parts of the search: after an interruption the same fit goes on from there. It needs a
        `random_state`.

    Attributes
    ----------
    verdict_ : Verdict
        Its kind is ``"within-noise"``, ``"parameters"``, ``"effect"``, ``"measurement"`` or ``"unknown"``.
    diagnosis_ : Diagnosis
        The verdict with all that it rests on.
    calibrator_ : MAPCalibrator
        Fit of all parameters without effects, the start of every search.
    tried_ : tuple of str
        Names of the effects that were tried; none where nothing is to be explained.
    causes_ : list of Cause
        The most probable first; probabilities sum to 1.
    groups_ : list of Group
        Explanations that the recordings cannot tell from the first one; where the verdict is unknown, locations of the
        unknown input that they cannot tell apart.
    hypotheses_ : list of Hypothesis
        All that were fitted, by falling evidence, with `ResidualTest.excess` in place of χ². Those of probable
        causes are fitted once more in the end, with the propagated noise of injected signals; they were compared
        before that.
    residual_tests_ : dict of str to ResidualTest
        Test of the residuals of each hypothesis, by its name.
    scores_ : dict of str to float
        Logarithm of the evidence of each hypothesis, (D1) with `ResidualTest.excess` in place of χ².
    signatures_ : dict of str to float
        Objective that each effect promised.
    input_locations_ : list of InputLocation
        Where an unknown input would enter, the most probable first; empty unless the verdict is unknown.
    extended_simulator_ : Simulator
        The simulator with the named effects, at its fitted values; without an effect the calibrated one.
    recalibrated_simulator_ : Simulator
        The simulator without effects at its fitted values.
    placebo_ : Hypothesis or None
        A wrong effect that was fitted, to compare a gain with.
    max_effects_ : int
        Largest number of effects that were named together.
    plan_report_ : tuple of StepReport
        What each step of the search cost and gained.
    n_simulations_ : int
        Those of part of a recording count like whole ones. Runs that propagate the noise of injected signals are not
        counted: some hundred for each recording and model that comes near to noise.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, held_out, truth = demo_recordings(0)
    >>> finder = CauseFinder(PlantSimulator("synchronous_machine", recording), random_state=0).fit(recording)
    >>> finder.verdict_.kind
    'parameters'
    """

    def __init__(
        self,
        simulator: Simulator,
        effects: Sequence[str] | None = None,
        *,
        max_effects: int | None = None,
        n_fits: int = 6,
        n_draws: int = 128,
        significance: float = 0.002,
        n_starts: int = 4,
        library_size: int = 2048,
        level: float = 0.9,
        events: Sequence[Event] | None = None,
        plan: Sequence[str] | None = None,
        random_state: Any = None,
        checkpoint: str | PathLike[str] | None = None,
    ) -> None:
        self.simulator = simulator
        self.effects = effects
        self.max_effects = max_effects
        self.n_fits = n_fits
        self.n_draws = n_draws
        self.significance = significance
        self.n_starts = n_starts
        self.library_size = library_size
        self.level = level
        self.events = events
        self.plan = plan
        self.random_state = random_state
        self.checkpoint = checkpoint

    @one_blas_thread
    def fit(self, X: Any, y: None = None) -> CauseFinder:
        """Fit all hypotheses to one recording, or to several together.

        Parameters
        ----------
        X : Observation, or anything ``simulator.observe`` takes, or a list of them
        y : None
            Not used, present for scikit-learn.

        Raises
        ------
        InputError
            If an argument or a recording cannot be used, or the checkpoint belongs to another search.
        SimulationError
            If nothing can be simulated.
        """
        started = perf_counter()
        self._check()
        observations = as_observations(self.simulator, X)
        most = self.simulator.usual_effects if self.max_effects is None else self.max_effects
        self.max_effects_ = check_integer(most, "max_effects", low=0)
        library = candidates(self.simulator, observations, self._names())
        self._seed = int(generator(self.random_state).integers(2**31))
        _log.info("fit of all parameters")
        self.calibrator_ = self._calibrate(observations)
        nominal = tuple(self.simulator.baseline(o.event) for o in observations)
        count = self.calibrator_.n_simulations_ + len(observations)
        journal = self._open_journal(observations, library)
        problem = FitProblem(self.simulator, list(observations))
        best = min(self.calibrator_.starts_, key=lambda start: start["objective"])
        first = parameters_only(problem, [*self.calibrator_.values_.values()], best["state"])
        search = ModelSearch(
            first,
            max_effects=self.max_effects_,
            n_fits=self.n_fits,
            n_draws=self.n_draws,
            significance=self.significance,
            seed=self._seed,
            journal=journal,
            plan=self.plan,
        )
        count += problem.n_simulations
        z = [o.deviations(y)[o.mask] for o, y in zip(observations, nominal, strict=True)]
        test = residual_test(observations, np.concatenate(z), random_state=self._seed)
        nothing = test.p_value > self.significance
        self.tried_: tuple[str, ...] = ()
        if self.max_effects_ and not nothing:
            self.tried_ = tuple(effect.name for effect in library)
            search.run(library)
        elif not nothing:
            search.improve_base()
        if search.base is not first:  # a better minimum, or a smaller step
            self.calibrator_ = self._calibrate(search.base.observations, search.base)
            count += self.calibrator_.n_simulations_
        self.residual_tests_, self.scores_ = search.residual_tests, search.scores
        self.signatures_, self.plan_report_ = search.signatures, search.ledger.report
        ranked = sorted(search.hypotheses, key=lambda h: -search.scores[h.name])
        causes = rank_causes(search)
        self.causes_, self.hypotheses_, more = with_profiles(causes, ranked, search.measured, self._seed)
        self._findings = found = Findings(
            self.simulator,
            list(observations),
            self.calibrator_,
            search,
            nominal,
            nothing,
            self.causes_,
            self.hypotheses_,
            self.tried_,
            self.effects is None,
            self.events or (),
            journal,
            self._seed,
            count + search.n_simulations + more,
        )
        diagnosis = found.diagnosis()
        self.diagnosis_ = replace(diagnosis, seconds=perf_counter() - started, plan=self.plan_report_)
        self.verdict_, self.groups_ = diagnosis.verdict, list(diagnosis.groups)
        self.input_locations_ = found.located[0] if diagnosis.input_locations else []
        self.n_simulations_ = diagnosis.n_simulations
        self.extended_simulator_, self.recalibrated_simulator_ = found.extended, found.recalibrated
        self.placebo_ = found.placebo
        return self

    def confirm(self, held_out: Any) -> Diagnosis:
        """Judge the verdict on recordings that were not fitted.

        Parameters
        ----------
        held_out : Observation, or anything ``simulator.observe`` takes, or a list of them

        Returns
        -------
        Diagnosis
            That of the fit with a second verdict beside the first, ``confirmed``. Named effects become "unknown" if
            their gain (`measure_gain`) does not hold; then they are withdrawn and the locations of an unknown input
            are ranked. "Parameters" and "within-noise" become "unknown" if the model does not reproduce these
            recordings. The finder itself stays as it is.

        Raises
        ------
        InputError
            If one of the recordings was fitted.
        """
        check_is_fitted(self, "diagnosis_")
        observed = held_out_observations(self.simulator, held_out, self._findings.observations)
        return self._findings.confirmed(self.diagnosis_, observed)

    def measure_gain(self, held_out: Any) -> Gain:
        """Gain of the extended simulator on recordings that were not fitted.

        The placebo is the best fitted wrong effect, with as many parameters if there is one. Effects of the fitted
        recordings alone are off: then the gain is that of the parameters that were fitted beside them.

        Parameters
        ----------
        held_out : Observation, or anything ``simulator.observe`` takes, or a list of them

        Raises
        ------
        InputError
            If one of the recordings was fitted.
        """
        check_is_fitted(self, "diagnosis_")
        observed = held_out_observations(self.simulator, held_out, self._findings.observations)
        return self._findings.gain(observed)

    def predict(self, event: Any = None) -> _Array:
        """Response (R, L) of the extended simulator to an event, or to that of a recording."""
        check_is_fitted(self, "extended_simulator_")
        if event is not None and not isinstance(event, Event):
            event = with_initial_states(self.extended_simulator_, event)[0].event
        return self.extended_simulator_.baseline(event)

    def score(self, X: Any, y: None = None) -> float:
        """Negative χ²/N of the extended simulator over recordings; -inf if one cannot be simulated."""
        check_is_fitted(self, "extended_simulator_")
        problem = FitProblem(self.extended_simulator_, with_initial_states(self.extended_simulator_, X))
        chi2 = float(problem.chi_square(self.extended_simulator_.parameters.nominal)[0])
        return -chi2 / problem.n_values if np.isfinite(chi2) else -np.inf

    def summary(self) -> str:
        """Verdict, causes and errors as text, see `Diagnosis.summary`."""
        check_is_fitted(self, "diagnosis_")
        return self.diagnosis_.summary()

    def plot(self, recording: int = 0) -> Figure:
        """Measured against simulated channels of one recording, see `Diagnosis.plot`."""
        check_is_fitted(self, "diagnosis_")
        return self.diagnosis_.plot(recording)

    def to_frame(self) -> pd.DataFrame:
        """Table of the causes, see `Diagnosis.to_frame`."""
        check_is_fitted(self, "diagnosis_")
        return self.diagnosis_.to_frame()

    @property
    def best_(self) -> Hypothesis:
        """The hypothesis that the verdict is about: the most probable one, or the parameters alone."""
        check_is_fitted(self, "diagnosis_")
        return self._findings.chosen

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False  # recordings are fitted, not a table
        tags.target_tags.required = False
        return tags

    def _check(self) -> None:
        """Refuse arguments that cannot be used."""
        for name in ("n_fits", "n_draws", "n_starts", "library_size"):
            check_integer(getattr(self, name), name)
        check_real(self.significance, "significance", low=_LEAST, high=1.0)
        check_plan(self.plan)
        if isinstance(self.events, Event):
            raise InputError("events is a single event", allowed="a list of events")
        for event in self.events or ():
            if not isinstance(event, Event):
                raise InputError(
                    f"events holds a {type(event).__name__}", allowed="objects of a class of Event"
                )
        if self.checkpoint is not None and self.random_state is None:
            raise InputError(
                "a search without random_state is another one each time, so it cannot go on from a checkpoint",
                allowed="random_state=0, or any other number",
            )

    def _names(self) -> tuple[str, ...] | None:
        """Names of the effects to try, None for all."""
        if self.effects is None:
            return None
        chosen = [effect.name for effect in self.simulator.effects_named(self.effects)]
        if len(set(chosen)) < len(chosen):
            raise InputError(f"effects holds one twice: {', '.join(chosen)}", allowed="each effect once")
        if not chosen and self.max_effects_:
            raise InputError("the list of effects is empty", allowed="at least one effect, or max_effects=0")
        return tuple(chosen)

    def _open_journal(self, observations: Sequence[Observation], library: Sequence[Effect]) -> Journal:
        """Finished parts of this very search."""
        if self.checkpoint is None:
            return Journal()
        arguments = (self.max_effects_, self.n_fits, self.n_draws, self.significance, check_plan(self.plan))
        fingerprint = {
            "program": program(),
            "simulator": digest(type(self.simulator).__name__, self.simulator.settings()),
            "parameters": digest(list(self.simulator.parameters)),
            "effects": digest([(effect, identity(effect.equations)) for effect in library]),
            "recordings": digest(observations),
            "arguments": digest(*arguments, self.n_starts, self.library_size),
            "seed": digest(self._seed),
        }
        return Journal(Store(self.checkpoint, fingerprint))

    def _calibrate(
        self, observations: Sequence[Observation], base: Hypothesis | None = None
    ) -> MAPCalibrator:
        """Fit all parameters from many starts, because a local minimum looks exactly like a missing effect.

        Where a better fit has been found it starts from there alone.
        """
        simulator = self.simulator if base is None else self.simulator.with_step_of(base.simulator)
        return MAPCalibrator(
            simulator,
            prior_scale=PRIOR,
            n_starts=self.n_starts if base is None else 1,
            starts=None if base is None else base.theta,
            library_size=max(self.library_size, self.n_starts),
            level=self.level,
            random_state=self._seed,
        ).fit(list(observations))
