"""What many searched scenarios say together: rates, held-out errors, and how well probabilities are calibrated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from errorscreen.bench.scenarios import MIX

#: bins of the reliability, and probability of the intervals of rates
_BINS, _LEVEL = 10, 0.95

_Record = dict[str, Any]


def summarise(rows: Sequence[_Record]) -> dict[str, Any]:
    """Rates with exact binomial intervals, ratios of held-out errors, and how well probabilities are calibrated."""
    single = [r for r in rows if r["truth"]["kind"] in ("effect", "other form", "measurement")]
    outside = [r for r in rows if r["truth"]["kind"] == "outside"]
    both = [r for r in rows if r["truth"]["kind"] == "two effects"]
    nothing = [r for r in rows if r["truth"]["kind"] == "nothing"]

    def rate(chosen: Sequence[_Record], holds: Callable[[_Record], bool]) -> dict[str, Any]:
        return rate_of([holds(r) for r in chosen])

    rates = {
        "correct": rate(single, lambda r: r["outcome"] == "correct"),
        "wrong": rate(single, lambda r: r["outcome"] == "wrong"),
        "unknown": rate(single, lambda r: r["outcome"] == "unknown"),
        "missed": rate(single, lambda r: r["outcome"] == "missed"),
        "false_alarm": rate(nothing, lambda r: r["outcome"] == "false alarm"),
        "outside_unknown": rate(outside, lambda r: r["verdict"] == "unknown"),
        "outside_place": rate(outside, lambda r: _device(r) == r["truth"]["device"]),
        "outside_port": rate(outside, lambda r: _port(r) == (r["truth"]["device"], r["truth"]["place"])),
        "both_found": rate(both, lambda r: r["outcome"] == "correct"),
        "both_wrong": rate(both, lambda r: not set(r["named"]) <= set(r["truth"]["right"])),
        "interval_holds": rate_of([_holds(found) for r in rows for found in r.get("intervals", [])]),
    }
    by_kind = {
        kind: {
            outcome: sum(r["outcome"] == outcome for r in rows if r["truth"]["kind"] == kind)
            for outcome in ("correct", "wrong", "unknown", "missed", "false alarm")
        }
        for kind, _ in MIX
    }
    by_device = {
        device: {
            outcome: sum(
                r["outcome"] == outcome
                for r in rows
                if r["truth"]["device"] == device and r["truth"]["kind"] != "nothing"
            )
            for outcome in ("correct", "wrong", "unknown", "missed")
        }
        for device in sorted({r["truth"]["device"] for r in rows} - {""})
    }
    right = [r for r in rows if r["truth"]["right"] and r["outcome"] == "correct"]
    return {
        "rates": rates,
        "by_kind": by_kind,
        "by_device": by_device,
        "held_out_ratio_median": _ratio(right, "extended", "recalibrated"),
        "true_structure_ratio_median": _ratio(right, "extended", "true_structure"),
        "true_structure_ratio_p90": _ratio(right, "extended", "true_structure", 0.9),
        **_calibration(rows),
        "seconds_median": float(np.median([r["seconds"] for r in rows])),
        "seconds_max": float(max(r["seconds"] for r in rows)),
        "simulations_median": float(np.median([r["simulations"] for r in rows])),
    }


def rate_of(hits: Sequence[bool]) -> dict[str, Any]:
    """How often something holds: ``value``, exact binomial 95 % ``interval``, and ``n``; of none, no value.

    Parameters
    ----------
    hits : sequence of bool

    Examples
    --------
    >>> rate_of([True, True, False, True])["value"]
    0.75
    """
    if not hits:
        return {"value": None, "interval": None, "n": 0}
    # exact: a bootstrap of rates of 0 or 1 has no width
    interval = binomtest(sum(hits), len(hits)).proportion_ci(_LEVEL)
    return {"value": float(np.mean(hits)), "interval": [interval.low, interval.high], "n": len(hits)}


def _device(record: _Record) -> str | None:
    return record["place"]["device"] if record["place"] else None


def _port(record: _Record) -> tuple[str, str] | None:
    return (record["place"]["device"], record["place"]["port"]) if record["place"] else None


def _holds(found: _Record) -> bool:
    low, high = found["interval"]
    return bool(low <= found["true"] <= high)


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
            reliability.append(
                {
                    "probability": float(p[inside].mean()),
                    "share": float(right[inside].mean()),
                    "n": int(inside.sum()),
                }
            )
            error += inside.mean() * abs(p[inside].mean() - right[inside].mean())
    return {"reliability": reliability, "expected_calibration_error": float(error)}
