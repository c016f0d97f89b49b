"""Discovery stage: what the model lacks, what that gains on held-out recordings, and what to measure next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from errorscreen.cases.case_models import DiscoverySection, RunSection
from errorscreen.data.observations import Observation
from errorscreen.discovery import Cause, CauseFinder, FirstLook, InputLocation, Verdict
from errorscreen.discovery.fits.hypotheses import Hypothesis
from errorscreen.discovery.judge.ranking import half_width
from errorscreen.effects.base import Effect
from errorscreen.learning.regressors import import_network
from errorscreen.simulators.base import Simulator
from errorscreen.workflow.advice import advice, doubts

#: cells of the remaining error that are told, at most
_CELLS = 12


def discover_causes(
    simulator: Simulator,
    observations: Sequence[Observation],
    held_out: Sequence[Observation],
    section: DiscoverySection,
    run: RunSection,
    report: Callable[[str], None],
    checkpoint: Path | None = None,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Search the causes of some recordings together and measure the gain on others.

    Parameters
    ----------
    simulator : Simulator
    observations : sequence of Observation
        What is fitted; the first look is at the first of them.
    held_out : sequence of Observation
    section : DiscoverySection
    run : RunSection
    report : callable
        Takes lines of text.
    checkpoint : Path, optional
        Folder for finished parts of the search.

    Returns
    -------
    arrays : dict
        ``parameters-<n>`` and ``response-<n>`` (R, L) of the model with parameters alone and of the extended one for
        each fitted recording and each held-out one, and ``waveform-<n>`` (2, L): time and unknown signal at each place
        that was ranked.
    meta : dict
        ``verdict``, ``label``, ``labels``, ``causes``, ``groups``, ``gain``, ``extension``, ``parameters``, ``step``,
        ``places``, ``cells``, ``tried``, ``hypotheses``, ``first_look``, ``first_look_compared``, ``advice``, counts.
    """
    started = perf_counter()
    looked, count = (
        _first_look(simulator, observations[0], section, run, report) if section.first_look else ([], 0)
    )
    finder = CauseFinder(
        simulator,
        section.effects,
        max_effects=section.max_effects,
        n_fits=section.fits,
        n_draws=section.draws,
        significance=section.significance,
        n_starts=section.starts,
        events=[o.event for o in held_out],
        random_state=run.random_state,
        report=report,
        checkpoint=checkpoint,
    ).fit(list(observations))
    kind = finder.verdict_.kind
    gain = finder.confirm(held_out) if held_out else None
    # errors of the event's record can be confirmed by no other event
    if kind in ("effect", "measurement") and not held_out and not finder.causes_[0].event:
        finder.verdict_ = Verdict(
            finder.verdict_.kind,
            f"{finder.verdict_.text} No recording was held out, so the gain is not confirmed on another event.",
        )
    everything = (*observations, *held_out)
    meta = {
        **_told(finder),
        "labels": [_label(finder, o) for o in everything],
        "gain": None if gain is None else asdict(gain),
        "first_look": looked,
        "first_look_compared": compared(looked, finder.best_.effects),
        "advice": advice(
            finder,
            gain,
            doubts(everything),
            refuted=finder.verdict_.kind != kind,
            confirmed=bool(held_out),
        ),
        "n_simulations": finder.n_simulations_ + count,
        "seconds": perf_counter() - started,
    }
    return _responses(finder, everything), meta


def _responses(finder: CauseFinder, observations: Sequence[Observation]) -> dict[str, Any]:
    """Responses without and with what was named, and the signal at each place."""
    arrays: dict[str, Any] = {}
    models = {"parameters": finder.recalibrated_simulator_, "response": finder.extended_simulator_}
    for n, observation in enumerate(observations):
        for name, model in models.items():
            batch = model.simulate(model.parameters.nominal, observation.event)
            arrays[f"{name}-{n}"] = batch.values[0]
    for n, place in enumerate(finder.input_locations_):
        arrays[f"waveform-{n}"] = np.array([place.time, place.waveform])
    return arrays


def _named(finder: CauseFinder) -> bool:
    """Whether the extended model has an effect: what was withdrawn is not in it."""
    return finder.verdict_.kind in ("effect", "measurement")


def _label(finder: CauseFinder, observation: Observation) -> str:
    """What the extended model is in one recording, for a legend."""
    effects = finder.best_.effects if _named(finder) else ()
    acting = [effect.original for effect in effects if effect.acts_in(observation.event)]
    if acting:
        return f"extended ({' + '.join(acting)})"
    names = list(dict.fromkeys(effect.original for effect in effects))
    return f"parameters fitted beside {' + '.join(names)}, which is off here" if names else ""


def _told(finder: CauseFinder) -> dict[str, Any]:
    """What the search found, as JSON values."""
    base = next(h for h in finder.hypotheses_ if not h.effects)
    cells = finder.residual_tests_[base.name].significant[:_CELLS]
    best = finder.best_
    return {
        "verdict": asdict(finder.verdict_),
        "label": finder.best_.name if _named(finder) else "",
        "causes": [_cause(cause, finder) for cause in finder.causes_],
        "groups": [
            {
                "names": list(g.names),
                "separating": [list(item) for item in g.separating],
                "states": [list(item) for item in g.states],
            }
            for g in finder.groups_
        ],
        "extension": [{"name": e.name, "recording": e.recording} for e in best.effects],
        "parameters": fitted_parameters(best, next((c for c in finder.causes_ if c.name == best.name), None)),
        "step": getattr(finder.extended_simulator_, "step", None),
        "places": [_place(place) for place in finder.input_locations_],
        "cells": [
            {k: v for k, v in asdict(cell).items() if k not in ("significant", "expected")} for cell in cells
        ],
        "tried": list(finder.tried_),
        "hypotheses": [
            {
                "name": h.name,
                "chi2_per_sample": h.chi2_per_sample,
                "p_value": finder.residual_tests_[h.name].p_value,
                "evidence": finder.scores_[h.name] - finder.scores_[base.name],
            }
            for h in finder.hypotheses_
        ],
    }


def _place(place: InputLocation) -> dict[str, Any]:
    """What stands in the result about one place beside its signal."""
    names = ("device", "place", "probability", "chi2_per_sample", "explained", "unit")
    return {name: getattr(place, name) for name in names} | {
        "follows": [list(item) for item in place.follows]
    }


def _first_look(
    simulator: Simulator,
    observation: Observation,
    section: DiscoverySection,
    run: RunSection,
    report: Callable[[str], None],
) -> tuple[list[dict[str, Any]], int]:
    """Contributions that a network reads off the error, the largest first, and the number of simulations."""
    import_network()  # what is missing must be told before the simulations, not after them
    report(f"first look: network trained on {section.first_look} samples")
    look = FirstLook(
        simulator,
        section.effects,
        n_samples=section.first_look,
        random_state=run.random_state,
        n_jobs=run.n_jobs,
    ).fit(observation)
    found = dict(zip(look.names_, look.contributions_, strict=True))
    report("  " + ", ".join(look.ranking_[:3]))
    ranked = [
        {
            "name": name,
            "kind": "effect" if name in look.effects_ else "parameter",
            "value": float(found[name]),
        }
        for name in look.ranking_
    ]
    return ranked, look.dataset_.metadata["n_simulations"]


def compared(looked: Sequence[dict[str, Any]], effects: Sequence[Effect]) -> str:
    """Where the first look ranks what the search names, in one sentence; empty without a first look.

    Parameters
    ----------
    looked : sequence of dict
        The first look, the largest contribution first.
    effects : sequence of Effect
        Those that the search names.
    """
    if not looked:
        return ""
    ranks = {one["name"]: f"rank {n} of {len(looked)}" for n, one in enumerate(looked, start=1)}
    names = dict.fromkeys(effect.original for effect in effects)
    if names:
        told = ", and ".join(f"{name}, which has {ranks[name]} here" for name in names)
        return f"The search names {told}."
    first = next(one["name"] for one in looked if one["kind"] == "effect")
    return f"The search names no effect; the first one here, {first}, has {ranks[first]}."


def fitted_parameters(hypothesis: Hypothesis, cause: Cause | None) -> list[dict[str, Any]]:
    """Values of all parameters of a fitted model; what lies at a bound has an interval only if it was profiled.

    Parameters
    ----------
    hypothesis : Hypothesis
    cause : Cause or None
        What it stands for: intervals of its effects are profiled. None if it leaves more than what was named.
    """
    width = half_width(hypothesis, exact=cause is not None and cause.exact)
    half = dict(zip(hypothesis.names, width * np.sqrt(np.diag(hypothesis.covariance)), strict=True))
    free = dict(zip(hypothesis.names, hypothesis.free.tolist(), strict=True))
    known = {} if cause is None else cause.parameters
    found = []
    for p, value in zip(hypothesis.simulator.parameters, hypothesis.theta.tolist(), strict=True):
        margin = float(half[p.name]) * float(p.scale or 1.0)
        linear = (value, max(p.lower, value - margin), min(p.upper, value + margin))
        _, low, high = known.get(p.name, linear)
        found.append(
            {
                "name": p.name,
                "symbol": p.symbol,
                "unit": p.unit,
                "description": p.description,
                "nominal": p.nominal,
                "lower": p.lower,
                "upper": p.upper,
                "scale": p.scale,
                "value": value,
                "low": low if free[p.name] or low < high else None,
                "high": high if free[p.name] or low < high else None,
                "at_bound": not free[p.name],
            }
        )
    return found


def _cause(cause: Cause, finder: CauseFinder) -> dict[str, Any]:
    """What stands in the result about one cause: equation, values and explanation."""
    hypothesis: Hypothesis | None = next((h for h in finder.hypotheses_ if h.name == cause.name), None)
    effects = hypothesis.effects if hypothesis else ()
    keys = ("name", "unit", "description", "value", "low", "high", "at_bound")
    own = [] if hypothesis is None else fitted_parameters(hypothesis, cause)
    return {
        "name": cause.name,
        "title": cause.title,
        "kind": cause.kind,
        "place": cause.place,
        "probability": cause.probability,
        "explained": cause.explained,
        "exact": cause.exact,
        "withdrawn": cause.withdrawn,
        "event": cause.event,
        "parameters": [{key: p[key] for key in keys} for p in own if p["name"] in cause.parameters],
        "equation": "; ".join(e.formula for e in effects),
        "explanation": " ".join(e.description for e in effects),
        "confused_with": [text for e in effects for text in e.confused_with],
    }
