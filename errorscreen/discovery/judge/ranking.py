"""Probabilities of what could explain the recordings, from the hypotheses that were fitted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from errorscreen._runtime.typed import Real
from errorscreen.calibration.result import Estimate
from errorscreen.discovery.fits.hypotheses import Hypothesis
from errorscreen.discovery.judge.acting import Acting
from errorscreen.discovery.judge.candidate_set import CandidateSet
from errorscreen.effects.base import Effect
from errorscreen.events import Playback

#: prior probability that something is missing at all
_MISSING = 0.5
#: logarithm of the evidence by which an effect must beat parameters that leave only noise: otherwise unmodelled errors
#: of the size of the noise would be named
_MARGIN = 13.0
#: where parameters suffice, an effect is considered only if its p-value is so many times theirs
_CLEARLY = 10.0
#: an effect whose form differs from the library's leaves at most this share of the excess of the parameters (22 % in
#: amplitude); beside effects that no library holds, the nearest one leaves twice as much and more
_FORM = 0.05
#: two effects together can also imitate a wrong form, so they must leave less
_FORM_OF_TWO = 0.003
#: a second effect that explains less than this only corrects the form of the first, such as a harder limit
_TRACE = 0.001
#: beside an effect that explains nearly everything, a second one must leave at most this share of its excess
_LEFT_BY_TWO = 0.5
#: hypotheses whose χ² differ by less than this are the same prediction
_SAME = 1.0
#: readings below which no effect is certain
_FEW_READINGS = 60
#: half width of intervals for 90 % in standard deviations
_WIDTH = 1.645


@dataclass(frozen=True)
class NamedEffect:
    """One effect of a cause, in words.

    Parameters
    ----------
    name : str
        Of the effect; with a recording, also without it (`original`).
    original : str
        Name by which the model knows it.
    recording : str
        The only recording in which it acts; empty for all.
    place : str
        Port, or measured channel, at which it acts.
    equation, explanation : str
    confused_with : tuple of str
        Causes of similar errors.
    title : str
        Name in words, with the meaning of its fitted values.
    acts : tuple of Acting
        From when to when it acts in each recording; only told of probable causes.
    read : bool
        Whether the title tells all of its fitted values.
    """

    name: str
    original: str
    recording: str = ""
    place: str = ""
    equation: str = ""
    explanation: str = ""
    confused_with: tuple[str, ...] = ()
    title: str = ""
    acts: tuple[Acting, ...] = ()
    read: bool = False

    @classmethod
    def of(
        cls,
        effect: Effect,
        values: Mapping[str, tuple[float, float, float]] | None = None,
        acts: tuple[Acting, ...] = (),
    ) -> NamedEffect:
        """Words of an effect; fitted values, each with the ends of its interval, by full names."""
        title, read = effect.title, effect.reading is not None and values is not None
        if effect.reading is not None and values is not None:
            title = effect.reading(title, {p.name: values[effect.local(p.name)] for p in effect.fitted})
        return cls(
            effect.name, effect.original, effect.recording, effect.place, effect.formula, effect.description,
            effect.confused_with, title, acts, read,
        )  # fmt: skip


@dataclass(frozen=True)
class Cause:
    """One explanation of the error.

    Parameters
    ----------
    name : str
        Names of its effects joined by `` + ``; ``"parameters"`` or ``"unknown"`` without any.
    title : str
        For reports.
    kind : {"parameters", "effect", "measurement", "unknown"}
    probability : float
    place : str
        Port, or measured channel.
    parameters : tuple of Estimate
        Values and intervals of the parameters of its effects.
    explained : float
        Share of the error beyond noise that parameters leave and that it explains, 0 to 1.
    exact : bool
        Whether it leaves only noise. If not, the form differs from the library's: the effect is of this kind, and its
        values are the nearest ones.
    event : bool
        Whether it belongs to one recording only (`Effect.event_specific`) and is off in others.
    withdrawn : bool
        Whether held-out recordings refute it; its probability is 0 then.
    effects : tuple of NamedEffect
    """

    name: str
    title: str
    kind: Literal["parameters", "effect", "measurement", "unknown"]
    probability: Real
    place: str = ""
    parameters: tuple[Estimate, ...] = ()
    explained: Real = 0.0
    exact: bool = False
    event: bool = False
    withdrawn: bool = False
    effects: tuple[NamedEffect, ...] = ()

    @property
    def values(self) -> dict[str, tuple[float, float, float]]:
        """Value, lower and upper end of each parameter by its name."""
        return {p.name: (p.value, p.low, p.high) for p in self.parameters}

    def holds(self, effects: Iterable[Effect]) -> bool:
        """Whether all of some effects are among its own."""
        return {effect.name for effect in effects} <= {effect.name for effect in self.effects}


def rank_causes(found: CandidateSet) -> list[Cause]:
    """Causes and "unknown", the most probable first; their probabilities sum to 1.
    Adequate hypotheses are compared by their evidence. Without any, an effect that explains nearly all of the error
    counts as being of the right kind, in another form than the library's. No effect counts beside parameters that are
    not at a minimum. "Unknown" comes first only if it is more probable than the first cause and all that predict the
    same.
    """
    causes = _exact(found)
    if not causes:
        causes = _of_a_kind(found)
    elif _form_alone(found, causes):
        causes = _with_two(found, _of_a_kind(found), causes)
    certain = certainty(found.base)
    causes = [replace(c, probability=certain * c.probability) if c.effects else c for c in causes]
    causes.sort(key=lambda c: -c.probability)
    unknown = 1.0 - sum(c.probability for c in causes)
    # two names for the same thing share a probability, but what they stand for has all of it
    chi2 = {h.name: h.chi2 for h in found.hypotheses}
    same = [c.probability for c in causes if abs(chi2[c.name] - chi2[causes[0].name]) < _SAME]
    place = len([c for c in causes if c.probability >= unknown])
    if causes and sum(same) >= unknown:
        place = max(place, 1)
    causes.insert(place, Cause("unknown", "Unknown", "unknown", unknown))
    return causes


def certainty(base: Hypothesis) -> float:
    """Largest probability of an effect: a few readings can be explained by many forms."""
    return min(1.0, 0.5 + 0.5 * len(base.residuals) / _FEW_READINGS)


def _exact(found: CandidateSet) -> list[Cause]:
    """Hypotheses that leave only noise, compared by their evidence."""
    adequate, base, scores = found.adequate, found.base, found.scores
    if not adequate:
        return []
    if base not in adequate and scores[adequate[0].name] - scores[base.name] < _MARGIN:
        adequate.append(base)  # a conspicuous cell, but nothing that an effect explains better
    adequate = [h for h in adequate if base.at_rest or not h.effects]
    if not adequate:
        return []
    tried = max(1, len(found.signatures))
    suffice = base in adequate
    if suffice:  # an effect is not needed, unless its residuals look clearly more like noise
        p = _CLEARLY * found.residual_tests[base.name].p_value
        adequate = [h for h in adequate if not h.effects or found.residual_tests[h.name].p_value >= p]
    logs = []
    for h in adequate:
        prior = 1.0 - _MISSING if not h.effects else _MISSING / tried ** len(h.effects)
        logs.append(scores[h.name] + np.log(prior) - (_MARGIN if suffice and h.effects else 0.0))
    weights = np.exp(np.array(logs) - max(logs))
    # what nobody has thought of, the more probable the less what is left looks like noise
    p = max(found.residual_tests[adequate[int(np.argmax(logs))].name].p_value, found.significance)
    weights /= weights.sum() * (1.0 + found.significance / p)
    return [_cause(found, h, float(w)) for h, w in zip(adequate, weights, strict=True)]


def _form_alone(found: CandidateSet, causes: list[Cause]) -> bool:
    """Whether the second of two named effects only makes up for the form of the first: the first alone leaves a trace,
    or explains nearly all while the second hardly lowers the rest.
    """
    first = max(causes, key=lambda c: c.probability)
    if len(first.effects) < 2:
        return False
    left = found.residual_tests[first.name].excess
    for h in found.with_effects(1):
        if first.holds(h.effects):
            explained, alone = _explained(found, h), found.residual_tests[h.name].excess
            if explained > 1.0 - _TRACE or (explained > 1.0 - _FORM and left > _LEFT_BY_TWO * alone):
                return True
    return False


def _with_two(found: CandidateSet, alone: list[Cause], exact: list[Cause]) -> list[Cause]:
    """Single effects in another form than the library's, and the two that leave only noise if the second lowers the
    rest. The rest of the one may be its form or a weak second effect: both get the same probability.
    """
    two = max(exact, key=lambda c: c.probability)
    one = max((c for c in alone if set(c.effects) <= set(two.effects)), key=lambda c: c.probability)
    if found.residual_tests[two.name].excess > _LEFT_BY_TWO * found.residual_tests[one.name].excess:
        return alone
    half = 0.5 * one.probability
    return [replace(c, probability=half) if c is one else c for c in alone] + [replace(two, probability=half)]


def _of_a_kind(found: CandidateSet) -> list[Cause]:
    """Effects in another form than the library's, the more probable the less they leave: single ones, or pairs where
    only these explain nearly everything.
    """
    if not found.base.at_rest:
        return []
    sizes = ((1, _FORM), (2, _FORM_OF_TWO))
    left = {
        size: np.array([1.0 - _explained(found, h) for h in found.with_effects(size)]) for size, _ in sizes
    }
    size, most = next(((n, m) for n, m in sizes if (left[n] < m).any()), sizes[0])
    if not len(left[size]):
        return []
    # errors of form are no noise: how much better one is tells less than its evidence says
    weights = np.maximum(left[size], 1e-12) ** -2.0
    weights /= weights.sum() * (1.0 + left[size].min() / most)
    members = zip(found.with_effects(size), weights, left[size], strict=True)
    return [_cause(found, h, float(w), exact=False) for h, w, rest in members if rest < 1.0]


def _explained(found: CandidateSet, hypothesis: Hypothesis) -> float:
    """Share of the excess of the parameters that a hypothesis explains."""
    whole = found.residual_tests[found.base.name].excess
    left = found.residual_tests[hypothesis.name].excess
    return float(np.clip(1.0 - left / whole, 0.0, 1.0)) if whole > 0 else 0.0


def _cause(found: CandidateSet, hypothesis: Hypothesis, probability: float, exact: bool = True) -> Cause:
    effects = hypothesis.effects
    kinds = {effect.kind for effect in effects}
    estimates = tuple(estimate for e in effects for estimate in _estimates(hypothesis, e, exact))
    named = tuple(NamedEffect.of(e, {p.name: (p.value, p.low, p.high) for p in estimates}) for e in effects)
    return Cause(
        hypothesis.name,
        titles(named) or "Parameters of the model",
        "parameters" if not effects else "measurement" if kinds == {"measurement"} else "effect",
        probability,
        ", ".join(e.place for e in effects),
        estimates,
        _explained(found, hypothesis),
        exact,
        bool(effects) and all(effect.event_specific and effect.recording for effect in effects),
        effects=named,
    )


def titles(effects: Iterable[NamedEffect]) -> str:
    """Titles of effects in one."""
    return " and ".join(effect.title for effect in effects)


def _estimates(hypothesis: Hypothesis, effect: Effect, exact: bool) -> Iterator[Estimate]:
    """Values and intervals of the parameters of an effect, by the linear model."""
    for name, interval in hypothesis.parameters_of(effect, half_width(hypothesis, exact)).items():
        name = effect.local(name)
        parameter = hypothesis.simulator.parameters[name]
        yield Estimate.of(parameter, *stamped(hypothesis, name, interval))


def stamped(
    hypothesis: Hypothesis, name: str, interval: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Value and ends of a parameter's interval; a time is known no better than its readings were stamped."""
    own = hypothesis.simulator.parameters[name]
    played = [o.event for o in hypothesis.observations if isinstance(o.event, Playback)]
    timers = [e.local(p.name) for e in hypothesis.effects if e.minima > 1 for p in e.parameters]
    late = max((max(e.age, e.dt if name in timers else 0.0) for e in played), default=0.0)
    half = _WIDTH * late / 12**0.5 if own.unit == "s" else 0.0
    value, low, high = interval
    low, high = value - float(np.hypot(value - low, half)), value + float(np.hypot(high - value, half))
    return value, max(own.lower, low), min(own.upper, high)


def half_width(hypothesis: Hypothesis, exact: bool) -> float:
    """Half width of intervals for 90 % in standard deviations; errors of form count as noise as large and as smooth."""
    return _WIDTH if exact else _WIDTH * float(np.sqrt(hypothesis.inflation))
