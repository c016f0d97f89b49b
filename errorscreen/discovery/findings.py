"""Everything that a finished search has found, and the diagnosis that follows from it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.threads import one_blas_thread
from errorscreen.calibration import MAPCalibrator
from errorscreen.calibration.result import Calibration, Estimate
from errorscreen.data.observations import Observation
from errorscreen.discovery import conclusions
from errorscreen.discovery.diagnosis import (
    EXTENDED,
    NOMINAL,
    PARAMETERS,
    Diagnosis,
    HypothesisFit,
    simulated,
)
from errorscreen.discovery.fits.hypotheses import Hypothesis
from errorscreen.discovery.judge.candidate_set import CandidateSet
from errorscreen.discovery.judge.errors import ModelFit
from errorscreen.discovery.judge.gain import Gain, deviations_of, measure_gain
from errorscreen.discovery.judge.ranking import Cause, half_width
from errorscreen.discovery.judge.separation import Group, differing, group_of
from errorscreen.discovery.judge.verdict import Verdict, judge
from errorscreen.discovery.search.journal import Journal
from errorscreen.discovery.unknown_input.locations import InputLocation, rank_input_locations
from errorscreen.events import Event
from errorscreen.simulators.base import Simulator

#: most cells of the error that a result holds
_CELLS = 12
#: verdicts that name something
_NAMED = ("effect", "measurement")
#: least correlation of what two effects change in held-out recordings to be forms of the same mechanism
_TWIN = 0.9
#: explanations that are compared with the named one on held-out recordings, at most
_RIVALS = 6

_Array = NDArray[np.float64]


@dataclass
class Findings:
    """A finished search: its fits, causes and simulators.

    Parameters
    ----------
    simulator : Simulator
    observations : list of Observation
        As they were given; those of the fits may have the propagated noise of a model.
    calibrator : MAPCalibrator
        Fit of all parameters.
    search : CandidateSet
        All hypotheses, with their tests and scores.
    nominal : tuple of ndarray of shape (R, L)
        Responses at the nominal parameters.
    nothing_to_explain : bool
        Whether these leave only noise.
    causes, hypotheses
        As in `CauseFinder`.
    tried : tuple of str
        Names of the effects that were tried; `whole` if they are the whole library.
    events : sequence of Event
        Events that could be recorded in addition.
    journal : Journal
    seed : int
    n_simulations : int
    """

    simulator: Simulator
    observations: list[Observation]
    calibrator: MAPCalibrator
    search: CandidateSet
    nominal: tuple[_Array, ...]
    nothing_to_explain: bool
    causes: list[Cause]
    hypotheses: list[Hypothesis]
    tried: tuple[str, ...]
    whole: bool
    events: Sequence[Event]
    journal: Journal
    seed: int
    n_simulations: int

    @property
    def base(self) -> Hypothesis:
        """Parameters alone."""
        return self.search.base

    @cached_property
    def chosen(self) -> Hypothesis:
        """The most probable hypothesis, or the parameters alone."""
        return next((h for h in self.hypotheses if h.name == self.causes[0].name), self.base)

    @cached_property
    def recalibrated(self) -> Simulator:
        """The simulator without effects at its fitted values, with the step of the chosen hypothesis."""
        return self.simulator.with_step_of(self.chosen.simulator).with_nominal(self.base.theta)

    @cached_property
    def extended(self) -> Simulator:
        """The simulator with the named effects at its fitted values."""
        return self.chosen.simulator.with_nominal(self.chosen.theta)

    @cached_property
    def placebo(self) -> Hypothesis | None:
        """A wrong effect that was fitted, to compare a gain with."""
        return conclusions.placebo(self.hypotheses, self.chosen, self.causes)

    @cached_property
    @one_blas_thread
    def located(self) -> tuple[list[InputLocation], tuple[Group, ...], int]:
        """Where an unknown input enters, locations that cannot be told apart, and the simulations that it took."""
        locations, count = rank_input_locations(self.base, self.journal)
        alike = conclusions.alike_locations(locations)
        if len(alike) < 2:
            return locations, (), count
        states = differing([one.states for one in alike])
        return locations, (Group(tuple(one.name for one in alike), (), states),), count

    def diagnosis(self) -> Diagnosis:
        """The verdict of the fitted recordings with all that it rests on."""
        started = perf_counter()
        first, base = self.causes[0], self.base
        locations: list[InputLocation] = []
        groups, count = self._groups(), 0
        if self.nothing_to_explain or first.kind == "parameters":
            verdict = self._judged(groups)
        elif first.kind != "unknown":
            text = conclusions.named_text(first, self.chosen, base, _others_of(groups))
            if not first.event:
                text += " No recording was held out, so the gain is not confirmed on another event."
            verdict = Verdict(first.kind, text)
        else:
            near = conclusions.nearest(self.causes)
            test = self.search.residual_tests[base.name]
            text = conclusions.unknown_text(self.tried, self.whole, base, test, self.hypotheses[0], near)
            # unless the fit ended, other parameters may fit better, and nobody can tell where the rest enters
            if base.at_rest:
                locations, groups, count = self.located
                where = conclusions.location_text(locations, self.simulator)
                text = f"{where} {text}" if locations else f"{text} {where}"
            verdict = Verdict("unknown", text)
        tests, scores = self.search.residual_tests, self.search.scores
        found = Diagnosis(
            verdict=verdict,
            causes=tuple(self.causes),
            groups=groups,
            input_locations=tuple(one.thinned() for one in locations),
            cells=tests[base.name].significant[:_CELLS],
            tried=self.tried,
            hypotheses=tuple(
                HypothesisFit(
                    h.name, h.chi2_per_sample, tests[h.name].p_value, scores[h.name] - scores[base.name]
                )
                for h in self.hypotheses
            ),
            extension=first.effects if verdict.kind in _NAMED else (),
            parameters=tuple(self._estimates(self.chosen)),
            calibration=Calibration.of(self.calibrator, "map"),
            models=(),
            step=_step(self.extended),
            base_step=_step(self.calibrator.simulator),
            n_simulations=self.n_simulations + count,
            seconds=0.0,
            calibrated=self.recalibrated,
            extended=self.extended,
        )
        responses = {NOMINAL: self.nominal, PARAMETERS: simulated(self.recalibrated, self.observations)}
        if found.extension:
            responses[EXTENDED] = simulated(self.extended, self.observations)
        return _with_models(found, tuple(self.observations), responses, perf_counter() - started)

    def confirmed(self, found: Diagnosis, others: Sequence[Observation]) -> Diagnosis:
        """The diagnosis with a second verdict, from recordings that were not fitted."""
        started = perf_counter()
        changes: dict[str, Any] = {"confirmed": found.verdict}
        if found.verdict.kind in _NAMED:
            changes = self._confirmed_effects(found, others)
        elif found.verdict.kind == "unknown":
            changes = self._confirmed_nearest(found, others)
        else:
            verdict = self._judged(found.groups, others)
            changes = {"confirmed": verdict, "groups": () if verdict.kind == "unknown" else found.groups}
        found = replace(found, **changes)
        models = {NOMINAL: self.simulator, PARAMETERS: self.recalibrated}
        if found.extension and found.extended is not None:
            models[EXTENDED] = found.extended
        before = {label: found.responses.get(label) for label in models}
        responses = {
            label: (*(before[label] or simulated(model, self.observations)), *simulated(model, others))
            for label, model in models.items()
        }
        return _with_models(found, (*found.observations, *others), responses, perf_counter() - started)

    def gain(self, others: Sequence[Observation]) -> Gain:
        """Gain of the extended simulator on recordings that were not fitted."""
        placebo = None
        if self.placebo is not None:
            placebo = self.placebo.simulator.with_step_of(self.extended).with_nominal(self.placebo.theta)
        return measure_gain(
            self.simulator.with_step_of(self.extended),
            self.extended,
            others,
            recalibrated=self.recalibrated,
            placebo=placebo,
            random_state=self.seed,
        )

    def _groups(self) -> tuple[Group, ...]:
        """Explanations that the recordings cannot tell from the first one, together with it."""
        first, *others = self.causes
        least = conclusions.ALIKE * first.probability
        alike = [c.name for c in others if c.probability >= least]
        return self._grouped(alike) if first.kind != "unknown" else ()

    def _grouped(self, names: Iterable[str]) -> tuple[Group, ...]:
        """The first explanation and others by name, in this order; none without others."""
        by_name = {h.name: h for h in self.hypotheses}
        members = [by_name[n] for n in dict.fromkeys([self.causes[0].name, *names]) if n in by_name]
        return (group_of(members, self.events),) if len(members) > 1 else ()

    def _judged(self, groups: Sequence[Group], others: Sequence[Observation] = ()) -> Verdict:
        """Verdict where no effect is needed."""
        passes = self.nothing_to_explain, True
        verdict = judge(self.base.observations, self.nominal, self.calibrator, others, passes=passes)
        if verdict.kind != "parameters":
            return verdict
        test = self.search.residual_tests[self.base.name]
        left = conclusions.conspicuous_text(test, self.search.significance)
        return replace(verdict, text=verdict.text + left + conclusions.alike_text(_others_of(groups)))

    def _confirmed_effects(self, found: Diagnosis, others: Sequence[Observation]) -> dict[str, Any]:
        """Changes of the diagnosis from the gain of the named effects on held-out recordings."""
        first, gain = self.causes[0], self.gain(others)
        # an effect of one recording alone gains nothing on others: only a loss speaks against it
        twins = () if first.event else self._twins(gain, others)
        if gain.interval[1] >= 0 if first.event else self._stands(gain, twins):
            groups = self._grouped([*_others_of(found.groups), *twins]) if twins else found.groups
            text = conclusions.named_text(first, self.chosen, self.base, _others_of(groups))
            verdict = Verdict(found.verdict.kind, text + conclusions.placebo_text(gain))
            return {"gain": gain, "confirmed": verdict, "groups": groups}
        locations, groups, count = self.located
        where = conclusions.location_text(locations, self.simulator)
        return {
            "gain": gain,
            "confirmed": Verdict("unknown", f"{conclusions.withdrawn_text(first, gain)} {where}"),
            "causes": tuple(conclusions.withdrawn(self.causes)),
            "groups": groups,
            "input_locations": tuple(one.thinned() for one in locations),
            "extension": (),
            "parameters": tuple(self._estimates(self.base)),
            "step": _step(self.recalibrated),
            "extended": self.recalibrated,
            "n_simulations": found.n_simulations + count,
        }

    def _confirmed_nearest(self, found: Diagnosis, others: Sequence[Observation]) -> dict[str, Any]:
        """Changes of an unknown verdict where a mechanism explains most of the error of held-out recordings too."""
        near = conclusions.nearest(self.causes)
        if near is None:
            return {"confirmed": found.verdict}
        as_named = replace(self, causes=[near, *(cause for cause in self.causes if cause is not near)])
        gain = as_named.gain(others)
        twins = as_named._twins(gain, others)
        if gain.interval[0] < conclusions.NEAR or not as_named._stands(gain, twins):
            return {"confirmed": found.verdict}
        return {
            "gain": gain,
            "confirmed": Verdict("nearest", conclusions.nearest_text(near, gain, twins)),
            "groups": as_named._grouped(twins),
            "extension": near.effects,
            "parameters": tuple(as_named._estimates(as_named.chosen)),
            "step": _step(as_named.extended),
            "extended": as_named.extended,
        }

    def _stands(self, gain: Gain, twins: Sequence[str]) -> bool:
        """Whether a gain holds; a placebo that is another form of the same mechanism does not refute it."""
        placebo = None if self.placebo is not None and self.placebo.name in twins else gain.placebo
        return replace(gain, placebo=placebo).holds

    def _twins(self, gain: Gain, others: Sequence[Observation]) -> tuple[str, ...]:
        """Other explanations that gain as much on held-out recordings and correct the model there as the named effects
        do: they are other forms of the same mechanism.
        """
        names = [c.name for c in self.causes[1:] if c.effects][:_RIVALS]
        names += [self.placebo.name] if self.placebo is not None else []
        rivals = [h for h in self.hypotheses if h.name in names]

        def errors(model: Simulator) -> _Array:
            return np.concatenate(
                [z.ravel() for z in deviations_of(model.with_step_of(self.extended), others)]
            )

        if not np.isfinite(gain.interval[0]):
            return ()
        before, twins = errors(self.recalibrated), []
        removed = before - errors(self.extended)
        for rival in rivals:
            left = errors(rival.simulator.with_nominal(rival.theta))
            if not np.isfinite(left).all():
                continue
            alike = float(removed @ (before - left))
            size = float(np.linalg.norm(removed) * np.linalg.norm(before - left))
            as_much = before @ before - left @ left >= gain.interval[0] * (before @ before)
            if as_much and alike >= _TWIN * size > 0:
                twins.append(rival.name)
        return tuple(twins)

    def _estimates(self, hypothesis: Hypothesis) -> Iterator[Estimate]:
        """All parameters of a fitted model: those of its cause as profiled, all others by the linear model."""
        cause = next((c for c in self.causes if c.name == hypothesis.name), None)
        width = half_width(hypothesis, exact=cause is not None and cause.exact)
        half = dict(zip(hypothesis.names, width * np.sqrt(np.diag(hypothesis.covariance)), strict=True))
        profiled = {p.name: p for p in cause.parameters} if cause is not None else {}
        space = hypothesis.simulator.parameters
        for p, value in zip(space, hypothesis.theta.tolist(), strict=True):
            if p.name not in half:  # a switch is on: that is no estimate
                continue
            margin = float(half[p.name]) * float(p.scale or 1.0)
            linear = Estimate.of(p, value, max(p.lower, value - margin), min(p.upper, value + margin))
            yield profiled.get(p.name, linear)


def _others_of(groups: Sequence[Group]) -> tuple[str, ...]:
    """Explanations beside the first one."""
    return groups[0].names[1:] if groups else ()


def _step(simulator: Simulator) -> float:
    return float(getattr(simulator, "step", np.nan))


def _with_models(
    found: Diagnosis,
    observations: tuple[Observation, ...],
    responses: dict[str, tuple[_Array, ...]],
    seconds: float,
) -> Diagnosis:
    """The same with the errors of its models."""
    models = tuple(ModelFit.of(label, observations, every) for label, every in responses.items())
    return replace(
        found, models=models, observations=observations, responses=responses, seconds=found.seconds + seconds
    )
