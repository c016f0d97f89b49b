"""Results of schema version 1, written until 0.1.0.dev, as results of version 2."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

_Json = dict[str, Any]
#: cause of a study that searched none
_NOT_SEARCHED: _Json = {"name": "unknown", "title": "Unknown", "kind": "unknown", "probability": None}


def upgraded(old: _Json) -> _Json:
    """Values of a ``result.json`` of version 1 in the tree of version 2, with null for what version 1 does not know."""
    found = old.get("discovery") or {}
    methods = old["calibration"]["methods"]
    calibrations = [_calibration(method) for method in methods]
    base = next((c for c in calibrations if c["method"] == "map"), None)
    nominal = {"label": "nominal", **_model(old, "before")}
    searched = _searched(found)
    return {
        "study": {"device_title": "", "base_mva": None, "f_nominal": None, **old["study"]},
        "recordings": [{"path": None, "assumptions": [], **_channels(one)} for one in old["data"]],
        "diagnosis": {
            "verdict": {key: old["verdict"][key] for key in ("kind", "text")},
            "causes": [_cause(cause) for cause in old["verdict"].get("causes", [])] or [_NOT_SEARCHED],
            "groups": old.get("groups", []),
            "input_locations": found.get("places", []),
            "cells": [{"expected": None, "significant": True, **cell} for cell in found.get("cells", [])],
            "tried": found.get("tried", []),
            "hypotheses": found.get("hypotheses", []),
            "extension": [
                {
                    "name": e["name"],
                    "original": e["name"].partition("@")[0],
                    "recording": e.get("recording", ""),
                }
                for e in found.get("extension", [])
            ],
            "parameters": [_estimate(p) for p in found.get("parameters", [])],
            "calibration": base or {"method": "map", "selection": "all", "parameters": []},
            "models": [nominal, *searched],
            "step": found.get("step"),
            "base_step": old["run"].get("step"),
            "n_simulations": found.get("n_simulations", 0),
            "seconds": found.get("seconds"),
            "gain": old.get("gain"),
        },
        "screening": [
            {
                **method,
                "rule": old["screening"]["rule"],
                "threads": old["run"].get("threads") if method["method"] == "cnn" else None,
            }
            for method in old["screening"]["methods"]
        ],
        "contributions": old["screening"].get("truth"),
        "calibration": calibrations,
        "models": [
            nominal,
            *(
                {"label": m["label"], "channels": list(_fits(m["fits"], "after")), "stages": []}
                for m in methods
            ),
        ],
        "first_look": found.get("first_look", []),
        "hints": old["verdict"].get("hints", []),
        "advice": found.get("advice", old["verdict"].get("hints", [])),
        "run": {
            "n_jobs": 1,
            "packages": {},
            "n_failed": 0,
            "step": None,
            **{key: value for key, value in old["run"].items() if key != "threads"},
        },
        "schema_version": 2,
    }


def _channels(recording: _Json) -> _Json:
    return {**recording, "channels": [{"missing": 0.0, **channel} for channel in recording["channels"]]}


def _estimate(p: _Json) -> _Json:
    return {**p, "at_bound": bool(p.get("at_bound"))}


def _cause(cause: _Json) -> _Json:
    words = {key: cause.get(key, "") for key in ("equation", "explanation")}
    dropped = ("equation", "explanation", "confused_with", "parameters")
    kept = {key: value for key, value in cause.items() if key not in dropped}
    effect = {
        "name": cause["name"],
        "original": cause["name"].partition("@")[0],
        "place": cause["place"],
        **words,
        "confused_with": cause.get("confused_with", []),
    }
    named = cause["kind"] in ("effect", "measurement")
    return {
        **kept,
        "parameters": [_estimate(p) for p in cause.get("parameters", [])],
        "effects": [effect] if named else [],
    }


def _calibration(method: _Json) -> _Json:
    kept = {k: v for k, v in method.items() if k not in ("label", "fits")}
    selection = method["label"].removeprefix(f"{method['method']} on ")
    return {**kept, "selection": selection, "parameters": [_estimate(p) for p in method["parameters"]]}


def _model(old: _Json, key: str) -> _Json:
    """Errors of all recordings before or after calibration."""
    every = old["diagnosis"]["recordings"]
    kept = {"channels": ("channel", "unit", "noise"), "stages": ("channel", "stage", "start", "stop")}
    return {
        part: [
            {"recording": r["recording"], **{name: row[name] for name in names}, **row[key]}
            for r in every
            for row in (r[part] if part == "channels" else r.get(part, []))
            if row.get(key)
        ]
        for part, names in kept.items()
    }


def _fits(rows: Iterable[_Json], key: str) -> Iterator[_Json]:
    for row in rows:
        if row.get(key):
            own = {name: row[name] for name in ("recording", "channel", "unit")}
            yield {**own, "noise": None, **row[key]}


def _searched(found: _Json) -> list[_Json]:
    """Errors of the models that the search fitted."""
    fits = found.get("fits", [])
    pairs = (("parameters only", "parameters"), ("extended", "extended"))
    models = [{"label": label, "channels": list(_fits(fits, key)), "stages": []} for label, key in pairs]
    return [model for model in models if model["channels"]]
