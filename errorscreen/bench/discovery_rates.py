"""Rates, held-out errors and calibration of probabilities over many searched scenarios."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from errorscreen.bench.scenarios import MIX, NOTHING

#: bins of the reliability, and probability of the intervals of rates
_BINS, _LEVEL = 10, 0.95
#: outcomes of a scenario that hides something, see `discovery_study`
OUTCOMES = ("correct", "wrong", "unknown", "missed")

_Record = dict[str, Any]


def summarise(rows: Sequence[_Record], kinds: Iterable[str] = tuple(dict(MIX))) -> dict[str, Any]:
    """Rates with exact binomial intervals, ratios of held-out errors, and calibration of the probabilities."""

    def of_kind(*kinds: str) -> list[_Record]:
        return [r for r in rows if r["truth"]["kind"] in kinds]

    single, both = [r for r in rows if hides_one(r)], of_kind("two effects")
    outside = of_kind("outside")
    places = [(r["place"] or {}, r["truth"]) for r in outside]
    devices = [place.get("device") == truth["device"] for place, truth in places]
    ports = [place.get("port") == truth["place"] for place, truth in places]
    intervals = [(found["true"], found["interval"]) for r in rows for found in r.get("intervals", [])]
    rates = {
        **{outcome: rate_of([r["outcome"] == outcome for r in single]) for outcome in OUTCOMES},
        "false_alarm": rate_of([r["outcome"] == "false alarm" for r in of_kind(*NOTHING)]),
        "outside_unknown": rate_of([r["verdict"] == "unknown" for r in outside]),
        "outside_place": rate_of(devices),
        "outside_port": rate_of([d and p for d, p in zip(devices, ports, strict=True)]),
        "both_found": rate_of([r["outcome"] == "correct" for r in both]),
        "both_wrong": rate_of([not set(r["named"]) <= set(r["truth"]["right"]) for r in both]),
        "interval_holds": rate_of([bool(low <= true <= high) for true, (low, high) in intervals]),
    }
    hiding = [r for r in rows if r["truth"]["kind"] not in NOTHING]
    by_device = {
        device: _counts([r for r in hiding if r["truth"]["device"] == device], OUTCOMES)
        for device in sorted({r["truth"]["device"] for r in rows} - {""})
    }
    right = [r for r in rows if r["truth"]["right"] and r["outcome"] == "correct"]
    return {
        "rates": rates,
        "by_kind": {kind: _counts(of_kind(kind), (*OUTCOMES, "false alarm")) for kind in kinds},
        "by_device": by_device,
        "held_out_ratio_median": _ratio(right, "extended", "recalibrated"),
        "true_structure_ratio_median": _ratio(right, "extended", "true_structure"),
        "true_structure_ratio_p90": _ratio(right, "extended", "true_structure", 0.9),
        **_calibration(rows),
        "seconds_median": float(np.median([r["seconds"] for r in rows])),
        "seconds_max": float(max(r["seconds"] for r in rows)),
        "simulations_median": float(np.median([r["simulations"] for r in rows])),
    }


def hides_one(row: _Record) -> bool:
    """Whether a scenario hides one thing that the library can name."""
    return row["truth"]["kind"] not in (*NOTHING, "outside", "two effects")


def _counts(rows: Sequence[_Record], outcomes: Sequence[str]) -> dict[str, int]:
    return {outcome: sum(r["outcome"] == outcome for r in rows) for outcome in outcomes}


def rate_of(hits: Sequence[bool]) -> dict[str, Any]:
    """Share of hits: ``value``, exact binomial 95 % ``interval`` and ``n``; None of no trials."""
    if not hits:
        return {"value": None, "interval": None, "n": 0}
    # exact: a bootstrap of rates of 0 or 1 has no width
    interval = binomtest(sum(hits), len(hits)).proportion_ci(_LEVEL)
    return {"value": float(np.mean(hits)), "interval": [interval.low, interval.high], "n": len(hits)}


def _ratio(rows: Sequence[_Record], above: str, below: str, quantile: float = 0.5) -> float | None:
    ratios = [
        r["held_out"][above] / r["held_out"][below]
        for r in rows
        if r["held_out"][above] is not None and r["held_out"][below]
    ]
    return float(np.quantile(ratios, quantile)) if ratios else None


def _calibration(rows: Sequence[_Record]) -> dict[str, Any]:
    """Reliability of the probability of the first cause, and its expected calibration error."""
    p = np.array([r["probability"] for r in rows])
    right = np.array([r["top_is_right"] for r in rows], dtype=float)
    bins = np.minimum((p * _BINS).astype(int), _BINS - 1)
    reliability, error = [], 0.0
    for b in range(_BINS):
        inside = bins == b
        if inside.any():
            probability, share = float(p[inside].mean()), float(right[inside].mean())
            reliability.append({"probability": probability, "share": share, "n": int(inside.sum())})
            error += inside.mean() * abs(probability - share)
    return {"reliability": reliability, "expected_calibration_error": float(error)}
