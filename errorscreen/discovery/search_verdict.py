"""Verdict of a finished search, and the diagnosis that rests on it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from errorscreen._runtime.estimators import RecordingEstimator
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
    Responses,
    simulated,
)
from errorscreen.discovery.fits.hypotheses import Hypothesis
from errorscreen.discovery.judge.errors import ModelFit
from errorscreen.discovery.judge.gain import Gain
from errorscreen.discovery.judge.ranking import Cause, NamedEffect, half_width
from errorscreen.discovery.judge.residual_test import ResidualTest
from errorscreen.discovery.judge.separation import Group, differing, group_of
from errorscreen.discovery.judge.verdict import Verdict, judge
from errorscreen.discovery.search.journal import Journal
from errorscreen.discovery.unknown_input.locations import InputLocation, rank_input_locations
from errorscreen.events import Event
from errorscreen.simulators.base import Simulator

#: most cells of the error that a result holds
_CELLS = 12
#: verdicts that name something
NAMED = ("effect", "measurement")


class SearchVerdict(RecordingEstimator):
    """Part of `CauseFinder` that fits no hypothesis: what its search found, as a verdict."""

    simulator: Simulator
    effects: Sequence[str] | None
    events: Sequence[Event] | None
    significance: float
    calibrator_: MAPCalibrator
    tried_: tuple[str, ...]
    causes_: list[Cause]
    hypotheses_: list[Hypothesis]
    residual_tests_: dict[str, ResidualTest]
    scores_: dict[str, float]
    input_locations_: list[InputLocation]
    diagnosis_: Diagnosis
    n_simulations_: int
    _base: Hypothesis
    _nominal: Any
    _nothing_to_explain: bool
    _journal: Journal

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

    def _verdict(self) -> Verdict:
        first = self.causes_[0]
        if self._nothing_to_explain or first.kind == "parameters":
            return self._judged()
        if first.kind == "unknown":
            text = conclusions.unknown_text(
                self.tried_, self.effects is None, self._base, self.hypotheses_[0]
            )
            # other parameters may fit better, so nobody can tell where the rest enters
            if not self._base.at_rest:
                return Verdict("unknown", text)
            self.input_locations_, self.groups_, count = self._located()
            self.n_simulations_ += count
            return Verdict("unknown", f"{text} {self._location_text(self.input_locations_)}")
        alone = " No recording was held out, so the gain is not confirmed on another event."
        return Verdict(first.kind, self._named_text() + ("" if first.event else alone))

    def _named_text(self) -> str:
        return conclusions.named_text(self.causes_[0], self._chosen, self._base, self._alike)

    @property
    def _alike(self) -> tuple[str, ...]:
        """Explanations that the recordings cannot tell from the first one."""
        return self.groups_[0].names[1:] if self.groups_ else ()

    def _judged(self, held_out: Sequence[Observation] = ()) -> Verdict:
        """Verdict where no effect is needed."""
        passes = self._nothing_to_explain, True
        verdict = judge(self._base.observations, self._nominal, self.calibrator_, held_out, passes=passes)
        if verdict.kind != "parameters":
            return verdict
        left = conclusions.conspicuous_text(self.residual_tests_[self._base.name], self.significance)
        return replace(verdict, text=verdict.text + left + conclusions.alike_text(self._alike))

    def _confirmed_effects(self, gain: Gain) -> dict[str, Any]:
        """Changes of the diagnosis from the gain of the named effects on held-out recordings."""
        first = self.causes_[0]
        # an effect of one recording alone gains nothing on others: only a loss speaks against it
        if gain.interval[1] >= 0 if first.event else gain.holds:
            text = self._named_text() + conclusions.placebo_text(gain)
            return {"gain": gain, "confirmed": Verdict(self.verdict_.kind, text)}
        locations, groups, count = self._located()
        text = f"{conclusions.withdrawn_text(first, gain)} {self._location_text(locations)}"
        return {
            "gain": gain,
            "confirmed": Verdict("unknown", text),
            "causes": tuple(conclusions.withdrawn(self.causes_)),
            "groups": tuple(groups),
            "input_locations": tuple(one.thinned() for one in locations),
            "extension": (),
            "parameters": tuple(self._estimates(self._base, None)),
            "step": _step(self.recalibrated_simulator_),
            "extended": self.recalibrated_simulator_,
            "n_simulations": self.diagnosis_.n_simulations + count,
        }

    @one_blas_thread
    def _located(self) -> tuple[list[InputLocation], list[Group], int]:
        """Where an unknown input enters, locations that cannot be told apart, and the simulations that it took."""
        locations, count = rank_input_locations(self._base, self._journal)
        alike = conclusions.alike_locations(locations)
        if len(alike) < 2:
            return locations, [], count
        states = differing([one.states for one in alike])
        return locations, [Group(tuple(one.name for one in alike), (), states)], count

    def _location_text(self, locations: Sequence[InputLocation]) -> str:
        return conclusions.location_text(locations, self.simulator)

    def _diagnosis(self, observations: Sequence[Observation], seconds: float) -> Diagnosis:
        """The verdict of the fit with all that it rests on."""
        base, best = self._base, self._chosen
        named = self.verdict_.kind in NAMED
        cause = next((c for c in self.causes_ if c.name == best.name), None)
        found = Diagnosis(
            verdict=self.verdict_,
            causes=tuple(self.causes_),
            groups=tuple(self.groups_),
            input_locations=tuple(one.thinned() for one in self.input_locations_),
            cells=self.residual_tests_[base.name].significant[:_CELLS],
            tried=self.tried_,
            hypotheses=tuple(map(self._fit_of, self.hypotheses_)),
            extension=tuple(NamedEffect.of(effect) for effect in best.effects) if named else (),
            parameters=tuple(self._estimates(best, cause)),
            calibration=Calibration.of(self.calibrator_, "map"),
            models=(),
            step=_step(self.extended_simulator_),
            n_simulations=self.n_simulations_,
            seconds=0.0,
            calibrated=self.recalibrated_simulator_,
            extended=self.extended_simulator_,
        )
        responses: Responses = {
            NOMINAL: self._nominal,
            PARAMETERS: simulated(self.recalibrated_simulator_, observations),
        }
        if found.extension:
            responses[EXTENDED] = simulated(self.extended_simulator_, observations)
        return with_models(found, tuple(observations), responses, seconds)

    def _fit_of(self, hypothesis: Hypothesis) -> HypothesisFit:
        name, evidence = hypothesis.name, self.scores_[hypothesis.name] - self.scores_[self._base.name]
        return HypothesisFit(name, hypothesis.chi2_per_sample, self.residual_tests_[name].p_value, evidence)

    def _estimates(self, hypothesis: Hypothesis, cause: Cause | None) -> Iterator[Estimate]:
        """All parameters of a fitted model: those of the cause as profiled, all others by the linear model."""
        linear = hypothesis.intervals(half_width(hypothesis, exact=cause is not None and cause.exact))
        profiled = {p.name: p for p in cause.parameters} if cause is not None else {}
        for p in hypothesis.simulator.parameters:
            yield profiled.get(p.name) or Estimate.of(p, *linear[p.name])


def _step(simulator: Simulator) -> float:
    return float(getattr(simulator, "step", np.nan))


def with_models(
    found: Diagnosis, observations: tuple[Observation, ...], responses: Responses, seconds: float
) -> Diagnosis:
    """The same with the errors of its models."""
    models = tuple(ModelFit.of(label, observations, every) for label, every in responses.items())
    return replace(
        found, models=models, observations=observations, responses=responses, seconds=found.seconds + seconds
    )
