"""A small result with every part, as a workflow makes it."""

from dataclasses import replace

import numpy as np

from errorscreen.calibration.result import Calibration, Estimate
from errorscreen.discovery import (
    Cause,
    ChannelFit,
    Contribution,
    Diagnosis,
    EventGain,
    Gain,
    HypothesisFit,
    InputLocation,
    ModelFit,
    NamedEffect,
    StageError,
    Verdict,
)
from errorscreen.report import Result
from errorscreen.report.result import ChannelInfo, RecordingInfo, Run, Screening, StudyInfo

NAMES = ("trip", "second trip")


def fit(rms, recording="trip", channel="P"):
    return ChannelFit(recording, channel, "pu", rms, 10 * rms, 1e4 * rms**2, 0.01)


def stage(share, name="fault"):
    return StageError("trip", "P", name, 1.0, 1.2, share, 40 * share)


def model(label, *rms, share=0.9, names=NAMES):
    """Errors of one model in each recording."""
    return ModelFit(label, tuple(fit(r, n) for r, n in zip(rms, names, strict=True)), (stage(share),))


def method(name, **options):
    parameter = Estimate(
        "Xd", np.float64(1.2), 1.1, 1.3, nominal=0.95, lower=0.5, upper=1.4, unit="pu", identifiable=True,
        description="synchronous reactance",
    )  # fmt: skip
    loose = Estimate("D", 2.0, at_bound=True, nominal=1.0, lower=0.0, upper=2.0, identifiable=False)
    return Calibration(name, "two parameters", (parameter, loose), n_simulations=10, **options)


def recording(name, role):
    return RecordingInfo(
        name, role, "data/rec.csv", 0.0, 4.1, 0.02, 1.0, (ChannelInfo("P", "pu", 0.01, 0.25),),
        (f"{name}: the sign of P was turned.",),
    )  # fmt: skip


PARAMETERS = Cause("parameters", "Parameters of the model", "parameters", 0.97)
UNKNOWN = Cause("unknown", "Unknown", "unknown", 0.03)


def diagnosis(verdict=None, **changes):
    parts = {
        "verdict": verdict or Verdict("parameters", "All that is left is noise."),
        "causes": (PARAMETERS, UNKNOWN), "groups": (), "input_locations": (), "cells": (), "tried": (),
        "hypotheses": (HypothesisFit("parameters", 1.0, 0.5, 0.0),), "extension": (),
        "parameters": (Estimate("D", 1.5, 1.25, 1.75, nominal=1.0, lower=0.0, upper=2.0),),
        "calibration": method("map", level=0.9, converged=True), "models": (model("nominal", 0.1, 0.2),),
        "step": 0.005, "base_step": 0.005, "n_simulations": 100, "seconds": 2.0,
    }  # fmt: skip
    return Diagnosis(**{**parts, **changes})


def result(**changes):
    parts = {
        "study": StudyInfo("Line trip", "synchronous_machine", "", 50.0, 50.0, 8),
        "recordings": (recording("trip", "fit"), recording("second trip", "held_out")),
        "diagnosis": diagnosis(),
        "screening": (
            Screening("cnn", {"Xd": 2.0, "D": 0.5}, ("Xd",), "the largest contribution", n_simulations=600),
            Screening("random", {"Xd": 0.1, "D": 0.5}, ("D",), "the largest contribution"),
        ),
        "contributions": None,
        "calibration": (
            method("map", groups=(("Xd", "Xd1"),), level=0.9, converged=True, seconds=2.5), method("pso"),
        ),
        "models": (
            model("nominal", 0.1, 0.2),
            model("map on two parameters", 0.02, float("nan"), share=0.5),
            model("pso on two parameters", 0.02, 0.04),
        ),
        "first_look": (), "hints": (), "advice": ("Record the field voltage.",),
        "run": Run(
            "0.1.0", "3.11", {"numpy": "2.4"}, 7, 1, 0.0025, 1234, 5, 61.5, "2025-11-21T10:00:00Z",
        ),
    }  # fmt: skip
    return Result(**{**parts, **changes})


def cause(name="exciter", probability=0.97, **changes):
    parts = {
        "title": "Excitation control", "kind": "effect", "place": "Efd", "explained": 0.999, "exact": True,
        "parameters": (
            Estimate("exciter.K", 50.0, 40.0, 60.0, unit="pu", description="gain"),
            Estimate("exciter.T", 0.02, at_bound=True, unit="s"),
        ),
        "effects": (
            NamedEffect(
                name, name.partition("@")[0], "", "Efd", "T v' = K e - v", "The machine holds its voltage.",
                ("a governor",),
            ),
        ),
    }  # fmt: skip
    return Cause(name, probability=probability, **{**parts, **changes})


def gain(value=0.6, low=0.4, high=0.7, events=3, placebo=0.1, placebo_parameters=2):
    found = tuple(EventGain(f"trip {n}", 9.0, 5.0, 3.0) for n in range(events))
    return Gain(9.0, 5.0, 3.0, value, (low, high), 0.9, placebo, found, 3, placebo_parameters)


def found(causes=None, **changes):
    """Result of a study that searched causes and named one."""
    causes = tuple(causes or (cause(), UNKNOWN))
    named = diagnosis(
        Verdict("effect", "So it is."), causes=causes, tried=("exciter", "governor"), gain=gain(),
        hypotheses=(HypothesisFit("exciter", 1.0, 0.5, 200.0),), extension=causes[0].effects,
        parameters=(
            Estimate("D", 1.5, 1.25, 1.75, nominal=1.0, lower=0.0, upper=2.0),
            Estimate("exciter.T", 0.02, at_bound=True, unit="s", nominal=0.1, lower=0.02, upper=1.0),
        ),
        models=(
            model("nominal", 0.1, 0.2), model("parameters only", 0.1, 0.1), model("extended", 0.03, 0.03),
        ),
    )  # fmt: skip
    return result(diagnosis=replace(named, **changes))


def withdrawn():
    """Result of a study that named a cause which held-out recordings refute."""
    place = InputLocation(
        "synchronous_machine", "Efd", 0.9, 1.2, np.array([0.0, 1.0]), np.array([0.0, 0.2]), (("V", -0.8),), "pu", 0.95
    )  # fmt: skip
    whole = found(
        confirmed=Verdict("unknown", "It gains nothing."),
        causes=(replace(UNKNOWN, probability=1.0), cause(probability=0.0, withdrawn=True)),
        extension=(), input_locations=(place,), models=(model("nominal", 0.1, 0.2), model("parameters only", 0.1, 0.1)),
        gain=gain(-0.2, -0.5, 0.1, placebo=0.05),
    )  # fmt: skip
    return replace(
        whole, advice=("Fit both together.",), first_look=(Contribution("exciter", "effect", 2.0),)
    )
