"""Names what a model lacks, or says honestly that it is unknown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from errorscreen._runtime.checkpoint import Checkpoint, digest, program
from errorscreen._runtime.sampling import generator
from errorscreen._runtime.threads import one_blas_thread
from errorscreen.calibration import MAPCalibrator
from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery import conclusions
from errorscreen.discovery.fits.candidates import candidates
from errorscreen.discovery.fits.hypotheses import PRIOR, Hypothesis, parameters_only
from errorscreen.discovery.judge.gain import Gain, measure_gain
from errorscreen.discovery.judge.profiles import with_profiles
from errorscreen.discovery.judge.ranking import rank_causes
from errorscreen.discovery.judge.residual_test import ResidualTest, residual_test
from errorscreen.discovery.judge.separation import Group, differing, group_of
from errorscreen.discovery.judge.verdict import Verdict, judge
from errorscreen.discovery.search.journal import Journal
from errorscreen.discovery.search.model_search import ModelSearch
from errorscreen.discovery.unknown_input.locations import InputLocation, rank_input_locations
from errorscreen.effects.base import Effect
from errorscreen.events import Event
from errorscreen.exceptions import InputError, check_integer, check_real
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import as_observations, with_initial_states
from errorscreen.simulators.user_functions import identity

#: least significance: what the bootstrap of `residual_test` can tell apart
_LEAST = 0.001

_Array = NDArray[np.float64]


class CauseFinder(BaseEstimator):
    r"""Find what a simulator lacks to reproduce recordings.

    All hypotheses (parameters only, each effect of the library, pairs of them) are fitted together with all
    parameters. One is *adequate* if what it leaves passes the test for noise (`residual_test`). Adequate ones are
    compared by their evidence. If there is none, an effect that explains nearly all of what parameters leave (95 %;
    two together 99.7 %) is named, with the remark that its form is not the library's; otherwise the verdict is
    "unknown", with the place where something enters (`rank_input_locations`).

    Parameters
    ----------
    simulator : Simulator
    effects : sequence of str, optional
        Names of the effects to try; all of the simulator's where not given. What belongs to one recording
        (`Effect.event_specific`) is tried in each of them by itself, and is off in others; the names of their
        events tell recordings apart.
    max_effects : int, default 2
        Largest number of effects that are named together.
    n_fits : int, default 6
        Effects whose joint fit goes on to the end: those that get furthest in a few iterations.
    n_draws : int, default 128
        Draws of an effect's parameters for its signature.
    significance : float, default 0.002
        What is left counts as more than noise where noise alone would be so conspicuous with this probability, at
        least 0.001.
    n_starts, library_size : int
        Of the fit without effects, see `MAPCalibrator`.
    events : sequence of Event, optional
        Events that could be recorded in addition; the one that separates a group best is named.
    random_state : None, int, SeedSequence, Generator or RandomState
    report : callable, optional
        Takes lines of text while it works.
    checkpoint : path-like, optional
        Folder for the parts of the search that are finished: after an interruption the same fit goes on from there. It
        needs a `random_state` that is given.

    Attributes
    ----------
    verdict_ : Verdict
        Its kind is ``"within-noise"``, ``"parameters"``, ``"effect"``, ``"measurement"`` or ``"unknown"``.
    tried_ : tuple of str
        Names of the effects that were tried; none where nothing is to be explained.
    causes_ : list of Cause
        The most probable first; probabilities sum to 1.
    groups_ : list of Group
        Explanations that the recordings do not tell from the first one; where the verdict is unknown, places of the
        unknown signal that they do not tell apart.
    hypotheses_ : list of Hypothesis
        All that were fitted, by falling evidence, with `ResidualTest.excess` in place of χ². Those of probable
        causes are fitted once more in the end, with the noise of injected signals as it passes through them; they
        were compared before that.
    residual_tests_ : dict of str to ResidualTest
        Test of what each of them leaves, by its name.
    scores_ : dict of str to float
        Logarithm of the evidence of each hypothesis, (D1) with `ResidualTest.excess` in place of χ².
    signatures_ : dict of str to float
        Objective that each effect promised.
    input_locations_ : list of InputLocation
        Where an unknown signal would enter, the most probable first; empty unless the verdict is unknown.
    extended_simulator_ : Simulator
        The simulator with what was found, at its fitted values; without an effect the calibrated one.
    recalibrated_simulator_ : Simulator
        The simulator without effects at its fitted values.
    placebo_ : Hypothesis or None
        A wrong effect that was fitted, to compare a gain with.
    n_simulations_ : int
        Those of part of a recording count like whole ones. How noise of injected signals passes through a model is not
        counted: some hundred runs for each recording and model that comes near to noise.

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
        max_effects: int = 2,
        n_fits: int = 6,
        n_draws: int = 128,
        significance: float = 0.002,
        n_starts: int = 4,
        library_size: int = 2048,
        events: Sequence[Event] | None = None,
        random_state: Any = None,
        report: Callable[[str], None] | None = None,
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
        self.events = events
        self.random_state = random_state
        self.report = report
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
        self._check()
        observations = as_observations(self.simulator, X)
        library = candidates(self.simulator, observations, self._names())
        self._seed = int(generator(self.random_state).integers(2**31))
        self.input_locations_: list[InputLocation] = []
        self._tell("fit without effects")
        self._calibrator = self._calibrate(observations)
        self._count = self._calibrator.n_simulations_ + len(observations)  # those of the baseline
        self._kept = self._journal(observations, library)
        problem = FitProblem(self.simulator, list(observations))
        best = min(self._calibrator.starts_, key=lambda start: start["objective"])
        first = parameters_only(problem, self._calibrator.theta_, best["state"])
        found = ModelSearch(
            first,
            max_effects=self.max_effects,
            n_fits=self.n_fits,
            n_draws=self.n_draws,
            significance=self.significance,
            seed=self._seed,
            journal=self._kept,
        )
        self._count += problem.n_simulations
        self._nominal = self._baseline(observations)
        self.tried_: tuple[str, ...] = ()
        if self.max_effects and not self._nothing_to_explain:
            self.tried_ = tuple(effect.name for effect in library)
            found.run(library)
        elif not self._nothing_to_explain:
            found.improve_base()
        self._base = base = found.base
        if base is not first:  # a better minimum, or a smaller step
            self._calibrator = self._calibrate(base.observations, base)
            self._count += self._calibrator.n_simulations_
        self.residual_tests_, self.scores_, self.signatures_ = (
            found.residual_tests,
            found.scores,
            found.signatures,
        )
        ranked = sorted(found.hypotheses, key=lambda h: -found.scores[h.name])
        self.causes_, self.hypotheses_, count = with_profiles(
            rank_causes(found), ranked, found.measured, self._seed
        )
        self.n_simulations_ = self._count + found.n_simulations + count
        self._choose()
        return self

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

    @property
    def best_(self) -> Hypothesis:
        """The hypothesis that the verdict is about: the most probable one, or the parameters alone."""
        check_is_fitted(self, "extended_simulator_")
        return self._chosen

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False  # what is fitted is a recording
        tags.target_tags.required = False
        return tags

    def _check(self) -> None:
        """Refuse arguments that cannot be used."""
        check_integer(self.max_effects, "max_effects", low=0)
        for name in ("n_fits", "n_draws", "n_starts", "library_size"):
            check_integer(getattr(self, name), name)
        check_real(self.significance, "significance", low=_LEAST, high=1.0)
        if self.report is not None and not callable(self.report):
            raise InputError(
                f"report is {self.report!r}", allowed="a function that takes a line of text, or None"
            )
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
        if not chosen and self.max_effects:
            raise InputError("the list of effects is empty", allowed="at least one effect, or max_effects=0")
        return tuple(chosen)

    def _journal(self, observations: Sequence[Observation], library: Sequence[Effect]) -> Journal:
        """Finished parts of this very search."""
        if self.checkpoint is None:
            return Journal()
        arguments = (self.max_effects, self.n_fits, self.n_draws, self.significance)
        fingerprint = {
            "program": program(),
            "simulator": digest(type(self.simulator).__name__, self.simulator.settings()),
            "parameters": digest(list(self.simulator.parameters)),
            "effects": digest([(effect, identity(effect.equations)) for effect in library]),
            "recordings": digest(observations),
            "arguments": digest(*arguments, self.n_starts, self.library_size),
            "seed": digest(self._seed),
        }
        return Journal(Checkpoint(self.checkpoint, fingerprint))

    def _tell(self, line: str) -> None:
        if self.report is not None:
            self.report(line)

    def _calibrate(
        self, observations: Sequence[Observation], base: Hypothesis | None = None
    ) -> MAPCalibrator:
        """Only parameters deviate: from many starts, because a local minimum looks exactly like a missing effect.

        Where a better fit has been found it starts from there alone.
        """
        simulator = self.simulator if base is None else self.simulator.with_step_of(base.simulator)
        return MAPCalibrator(
            simulator,
            prior_scale=PRIOR,
            n_starts=self.n_starts if base is None else 1,
            starts=None if base is None else base.theta,
            library_size=max(self.library_size, self.n_starts),
            random_state=self._seed,
        ).fit(list(observations))

    def _baseline(self, observations: Sequence[Observation]) -> tuple[list[_Array], ResidualTest]:
        """Responses at the nominal parameters, and the test of what they leave."""
        responses = [self.simulator.baseline(o.event) for o in observations]
        z = [o.deviations(y)[o.mask] for o, y in zip(observations, responses, strict=True)]
        return responses, residual_test(observations, np.concatenate(z), random_state=self._seed)

    @property
    def _nothing_to_explain(self) -> bool:
        return self._nominal[1].p_value > self.significance

    def _choose(self) -> None:
        """Verdict, groups and the extended simulator."""
        by_name, first = {h.name: h for h in self.hypotheses_}, self.causes_[0]
        self._chosen = by_name.get(first.name, self._base)
        self.groups_: list[Group] = []
        least = conclusions.ALIKE * first.probability
        alike = [by_name[c.name] for c in self.causes_ if c.name in by_name and c.probability >= least]
        if first.kind != "unknown" and len(alike) > 1:
            self.groups_ = [group_of(alike, self.events or ())]
        fair = self.simulator.with_step_of(self._chosen.simulator)
        self.recalibrated_simulator_ = fair.with_nominal(self._base.theta)
        self.placebo_ = conclusions.placebo(self.hypotheses_, self._chosen, self.causes_)
        self.extended_simulator_ = self._chosen.simulator.with_nominal(self._chosen.theta)
        self.verdict_ = self._verdict()

    def measure_gain(self, held_out: Any) -> Gain:
        """Gain of the extended simulator on recordings that were not fitted; an extension without gain is withdrawn.

        The placebo is the best fitted wrong effect, with as many parameters if there is one. What belongs to the fitted
        recordings alone is off: there, the gain is that of the parameters which were fitted beside it, and only a loss
        speaks against it.

        Parameters
        ----------
        held_out : Observation, or anything ``simulator.observe`` takes, or a list of them

        Returns
        -------
        Gain
            If its interval does not exclude zero, or the placebo gains more, the verdict becomes "unknown",
            `extended_simulator_` the recalibrated one, and places are ranked. Where a placebo within the interval gains
            no more, the verdict says so.

        Raises
        ------
        InputError
            If one of the recordings was fitted.
        """
        check_is_fitted(self, "extended_simulator_")
        held_out = self._others(held_out)
        extended, placebo = self.extended_simulator_, None
        if self.placebo_ is not None:
            placebo = self.placebo_.simulator.with_step_of(extended).with_nominal(self.placebo_.theta)
        gain = measure_gain(
            self.simulator.with_step_of(extended),
            extended,
            held_out,
            recalibrated=self.recalibrated_simulator_,
            placebo=placebo,
            random_state=self._seed,
        )
        first = self.causes_[0]
        holds = gain.interval[1] >= 0 if first.event else gain.holds
        if self.verdict_.kind not in ("effect", "measurement"):
            return gain
        if holds:
            verdict = self._verdict()
            self.verdict_ = replace(verdict, text=verdict.text + conclusions.placebo_text(gain))
        else:
            self.extended_simulator_ = self.recalibrated_simulator_
            self.causes_, self._chosen = conclusions.withdrawn(self.causes_), self._base
            self.verdict_ = Verdict("unknown", f"{conclusions.withdrawn_text(first, gain)} {self._located()}")
        return gain

    def confirm(self, held_out: Any) -> Gain | None:
        """Judge the verdict on recordings that were not fitted.

        Parameters
        ----------
        held_out : Observation, or anything ``simulator.observe`` takes, or a list of them

        Returns
        -------
        Gain or None
            Of what was named, see `measure_gain`; None where nothing was. The verdicts "parameters" and "within-noise"
            become "unknown" if the calibrated parameters, or those as they were, do not reproduce these recordings.

        Raises
        ------
        InputError
            If one of the recordings was fitted.
        """
        check_is_fitted(self, "extended_simulator_")
        if self.verdict_.kind in ("effect", "measurement"):
            return self.measure_gain(held_out)
        if self.verdict_.kind in ("parameters", "within-noise"):
            self.verdict_ = self._judged(self._others(held_out))
            if self.verdict_.kind == "unknown":
                self.groups_ = []  # none of these explanations holds
        return None

    def _others(self, held_out: Any) -> list[Observation]:
        """Recordings as observations, if none of them was fitted."""
        others = as_observations(self.simulator, held_out)
        for other in others:
            if any(np.array_equal(other.values, o.values, equal_nan=True) for o in self._base.observations):
                raise InputError(
                    f"the recording {other.event.name!r} is held out and was fitted: it confirms nothing",
                    allowed="recordings that were not fitted",
                )
        return others

    def _verdict(self) -> Verdict:
        first = self.causes_[0]
        if self._nothing_to_explain or first.kind == "parameters":
            return self._judged()
        if first.kind == "unknown":
            text = conclusions.unknown_text(
                self.tried_, self.effects is None, self._base, self.hypotheses_[0]
            )
            # of parameters that may leave less nobody can tell where the rest enters
            return Verdict("unknown", f"{text} {self._located()}" if self._base.at_rest else text)
        return Verdict(first.kind, conclusions.named_text(first, self._chosen, self._base, self._alike))

    @property
    def _alike(self) -> tuple[str, ...]:
        """Explanations that the recordings do not tell from the first one."""
        return self.groups_[0].names[1:] if self.groups_ else ()

    def _judged(self, held_out: Sequence[Observation] = ()) -> Verdict:
        """Verdict where no effect is needed."""
        passes = self._nothing_to_explain, True
        verdict = judge(self._base.observations, self._nominal[0], self._calibrator, held_out, passes=passes)
        if verdict.kind != "parameters":
            return verdict
        left = conclusions.conspicuous_text(self.residual_tests_[self._base.name], self.significance)
        return replace(verdict, text=verdict.text + left + conclusions.alike_text(self._alike))

    @one_blas_thread
    def _located(self) -> str:
        """Where something unknown enters, in words; places are kept, and those that cannot be told apart."""
        self._tell("places of an unknown signal")
        self.input_locations_, count = rank_input_locations(self._base, self._kept)
        self.n_simulations_ += count
        alike = conclusions.alike_places(self.input_locations_)
        states = differing([place.states for place in alike]) if len(alike) > 1 else ()
        self.groups_ = [Group(tuple(place.name for place in alike), (), states)] if len(alike) > 1 else []
        return conclusions.place_text(self.input_locations_, self.simulator)
