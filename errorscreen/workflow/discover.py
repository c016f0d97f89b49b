"""Discovery stage: what the model lacks, what that gains on held-out recordings, and what to measure next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from time import perf_counter
from typing import Any

import numpy as np

from errorscreen.cases.case_models import DiscoverySection, RunSection
from errorscreen.discovery import CauseFinder, FirstLook, Gain, Verdict
from errorscreen.discovery.hypotheses import Hypothesis
from errorscreen.observations import Observation
from errorscreen.regressors import import_network
from errorscreen.simulators.base import Simulator

#: cells of the remaining error that are told, at most
_CELLS = 12


def discover_causes(
    simulator: Simulator,
    observation: Observation,
    held_out: Sequence[Observation],
    section: DiscoverySection,
    run: RunSection,
    report: Callable[[str], None],
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Search the causes of one recording and measure the gain on the others.

    Returns
    -------
    arrays : dict
        ``response-<n>`` (R, L) of the extended model for the fitted recording and each held-out one, and
        ``waveform-<n>`` (2, L): time and unknown signal at each place that was ranked.
    meta : dict
        ``verdict``, ``causes``, ``groups``, ``gain``, ``places``, ``cells``, ``hypotheses``, ``first_look``,
        ``advice``, counts.
    """
    started = perf_counter()
    looked = _first_look(simulator, observation, section, run, report) if section.first_look else []
    finder = CauseFinder(
        simulator,
        section.effects,
        max_effects=section.max_effects,
        n_fits=section.fits,
        n_draws=section.draws,
        significance=section.significance,
        events=[o.event for o in held_out],
        random_state=run.random_state,
        report=report,
    ).fit(observation)
    named = finder.verdict_.kind in ("effect", "measurement")
    gain = finder.confirm(held_out) if held_out else None
    if named and not held_out:
        finder.verdict_ = Verdict(
            finder.verdict_.kind,
            f"{finder.verdict_.text} No recording was held out, so the gain is not confirmed on another event.",
        )
    base = next(h for h in finder.hypotheses_ if not h.effects)
    extended = finder.extended_simulator_
    arrays: dict[str, Any] = {}
    for n, o in enumerate((observation, *held_out)):
        arrays[f"response-{n}"] = extended.simulate(extended.parameters.nominal, o.event).values[0]
    for n, place in enumerate(finder.places_):
        arrays[f"waveform-{n}"] = np.array([place.time, place.waveform])
    cells = finder.remainders_[base.name].significant[:_CELLS]
    meta = {
        "verdict": asdict(finder.verdict_),
        "label": finder.best_.name if named and finder.verdict_.kind != "unknown" else "",
        "causes": [_cause(cause, finder) for cause in finder.causes_],
        "groups": [
            {"names": list(g.names), "separating": [list(item) for item in g.separating]}
            for g in finder.groups_
        ],
        "gain": None if gain is None else asdict(gain),
        "places": [
            {
                "device": p.device,
                "place": p.place,
                "probability": p.probability,
                "chi2_per_sample": p.chi2_per_sample,
                "follows": [list(item) for item in p.follows],
            }
            for p in finder.places_
        ],
        "cells": [
            {k: v for k, v in asdict(cell).items() if k not in ("significant", "expected")} for cell in cells
        ],
        "hypotheses": [
            {
                "name": h.name,
                "chi2_per_sample": h.chi2_per_sample,
                "p_value": finder.remainders_[h.name].p_value,
                "evidence": finder.scores_[h.name] - finder.scores_[base.name],
            }
            for h in finder.hypotheses_
        ],
        "first_look": looked,
        "advice": advice(finder, gain),
        "n_simulations": finder.n_simulations_,
        "seconds": perf_counter() - started,
    }
    return arrays, meta


def _first_look(
    simulator: Simulator,
    observation: Observation,
    section: DiscoverySection,
    run: RunSection,
    report: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Contributions that a network reads off the error, the largest first."""
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
    return [
        {
            "name": name,
            "kind": "effect" if name in look.effects_ else "parameter",
            "value": float(found[name]),
        }
        for name in look.ranking_
    ]


def _cause(cause: Any, finder: CauseFinder) -> dict[str, Any]:
    """What stands in the result about one cause: equation, values and explanation."""
    hypothesis: Hypothesis | None = next((h for h in finder.hypotheses_ if h.name == cause.name), None)
    effects = hypothesis.effects if hypothesis else ()
    parameters = []
    for effect in effects:
        for p in effect.parameters:
            name = effect.local(p.name)
            if name in cause.parameters:
                value, low, high = cause.parameters[name]
                parameters.append(
                    {
                        "name": name,
                        "unit": p.unit,
                        "description": p.description,
                        "value": value,
                        "low": low,
                        "high": high,
                    }
                )
    return {
        "name": cause.name,
        "title": cause.title,
        "kind": cause.kind,
        "place": cause.place,
        "probability": cause.probability,
        "explained": cause.explained,
        "exact": cause.exact,
        "parameters": parameters,
        "equation": "; ".join(e.formula for e in effects),
        "explanation": " ".join(e.description for e in effects),
        "confused_with": [text for e in effects for text in e.confused_with],
    }


def advice(finder: CauseFinder, gain: Gain | None) -> list[str]:
    """What to measure next, in sentences."""
    out = []
    ports = getattr(getattr(finder.simulator, "device", None), "ports", {})
    for group in finder.groups_:
        if group.separating:
            event, channel, distance = group.separating[0]
            out.append(
                f"{' and '.join(group.names[:2])} differ most in {channel} of an event like {event!r}, by "
                f"{distance:.0f} standard deviations in all: fit that recording together with this one."
            )
        else:
            out.append(
                f"{', '.join(group.names)} cannot be told apart from this recording: record an event of another depth "
                "or duration."
            )
    for place in finder.places_[:1]:
        what = ports.get(place.place, place.place)
        out.append(f"Something unknown enters at {place.place}: record the {what}, and whatever acts on it.")
    if finder.verdict_.kind in ("effect", "measurement") and gain is None:
        out.append("Record another event of the same unit: only that can confirm what was named.")
    return out
