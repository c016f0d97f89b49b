"""A small result with every part, as a workflow makes it."""

import numpy as np

from errorscreen.discovery import ChannelFit, StageError
from errorscreen.report.discovery_schema import (
    Cause,
    CauseParameter,
    Discovery,
    EventGain,
    Extension,
    ExtensionFit,
    Gain,
    HypothesisFit,
    InputLocation,
)
from errorscreen.report.parts import ParameterResult
from errorscreen.report.result_schema import (
    Calibration,
    CalibrationMethod,
    ChannelData,
    Diagnosis,
    MethodFit,
    RecordingData,
    Result,
    Run,
    Screening,
    ScreeningMethod,
    Study,
    Verdict,
    diagnose_recording,
    fit_of,
)


def fit(rms, recording="trip", channel="P"):
    return ChannelFit(recording, channel, "pu", rms, 10 * rms, 1e4 * rms**2, 0.01)


def stage(share, name="fault"):
    return StageError("trip", "P", name, 1.0, 1.2, share, 40 * share)


def method(name, **options):
    parameter = ParameterResult(
        name="Xd", unit="pu", nominal=0.95, lower=0.5, upper=1.4, value=np.float64(1.2), low=1.1, high=1.3,
        at_bound=False, identifiable=True, description="synchronous reactance",
    )  # fmt: skip
    loose = ParameterResult(
        name="D", nominal=1.0, lower=0.0, upper=2.0, value=2.0, at_bound=True, identifiable=False
    )
    pairs = [
        MethodFit(
            recording=rec, role=role, channel="P", unit="pu", before=fit_of(fit(0.1)), after=fit_of(fit(0.02))
        )
        for rec, role in (("trip", "fit"), ("second trip", "held_out"))
    ]
    return CalibrationMethod(
        method=name, label=f"{name}, two parameters", parameters=[parameter, loose], fits=pairs, **options
    )


def result(**changes):
    parts = {
        "verdict": Verdict(kind="parameters", text="All that is left is noise."),
        "study": Study(title="Line trip", device="synchronous_machine", base_mva=50, f_nominal=50, parameters=8),
        "data": [
            RecordingData(
                name=name, role=role, path="data/rec.csv", start=0.0, stop=np.float64(4.1), dt=0.02, event_time=1.0,
                channels=[ChannelData(name="P", unit="pu", noise=0.01, missing=0.25)],
                assumptions=[f"{name}: the sign of P was turned."],
            )
            for name, role in (("trip", "fit"), ("second trip", "held_out"))
        ],
        "diagnosis": Diagnosis(
            recordings=[
                diagnose_recording("trip", "fit", [fit(0.1)], [fit(0.02)], [stage(0.9)], [stage(0.5)]),
                diagnose_recording("second trip", "held_out", [fit(0.2)], [fit(float("nan"))]),
            ]
        ),
        "screening": Screening(
            rule="the largest contribution",
            methods=[
                ScreeningMethod(method="cnn", contributions={"Xd": 2.0, "D": 0.5}, selected=["Xd"], n_simulations=600),
                ScreeningMethod(method="random", contributions={"Xd": 0.1, "D": 0.5}, selected=["D"]),
            ],
        ),
        "calibration": Calibration(
            methods=[method("map", groups=[["Xd", "Xd1"]], level=0.9, converged=True, seconds=2.5), method("pso")]
        ),
        "run": Run(
            version="0.1.0", python="3.11", packages={"numpy": "2.4"}, random_state=7, n_simulations=1234, n_failed=5,
            seconds=61.5, started="2025-11-21T10:00:00Z",
        ),
    }  # fmt: skip
    return Result(**{**parts, **changes})


def cause(name="exciter", probability=0.97, **changes):
    parts = {
        "title": "Excitation control", "kind": "effect", "place": "Efd", "explained": 0.999,
        "parameters": [
            CauseParameter(name="exciter.K", unit="pu", description="gain", value=50.0, low=40.0, high=60.0),
            CauseParameter(name="exciter.T", unit="s", value=0.02, low=None, high=None, at_bound=True),
        ],
        "equation": "T v' = K e - v", "explanation": "The machine holds its voltage.",
        "confused_with": ["a governor"],
    }  # fmt: skip
    return Cause(name=name, probability=probability, **{**parts, **changes})


UNKNOWN = Cause(name="unknown", title="Unknown", kind="unknown", place="", probability=0.03)


def gain(value=0.6, low=0.4, high=0.7, events=3, **changes):
    parts = {
        "baseline": 9.0, "recalibrated": 5.0, "extended": 3.0, "gain": value, "interval": [low, high], "level": 0.9,
        "placebo": 0.1, "placebo_parameters": 2, "extension_parameters": 3,
        "events": [
            EventGain(recording=f"trip {n}", baseline=9.0, recalibrated=5.0, extended=3.0) for n in range(events)
        ],
    }  # fmt: skip
    return Gain(**{**parts, **changes})


def discovery(**changes):
    parts = {
        "tried": ["exciter", "governor"],
        "hypotheses": [HypothesisFit(name="exciter", chi2_per_sample=1.0, p_value=0.5, evidence=200.0)],
        "fits": [
            ExtensionFit(
                recording=name, role=role, channel="P", unit="pu",
                parameters=fit_of(fit(0.1)), extended=fit_of(fit(0.03)),
            )
            for name, role in (("trip", "fit"), ("third trip", "together"), ("second trip", "held_out"))
        ],
        "extension": [Extension(name="exciter")],
        "parameters": [
            ParameterResult(name="D", nominal=1.0, lower=0.0, upper=2.0, value=1.5, low=1.25, high=1.75),
            ParameterResult(name="exciter.T", unit="s", nominal=0.1, lower=0.02, upper=1.0, value=0.02, at_bound=True),
        ],
        "step": 0.005, "cells": [], "advice": ["Record the field voltage."], "n_simulations": 100, "seconds": 2.0,
    }  # fmt: skip
    return Discovery(**{**parts, **changes})


def found(causes=None, **changes):
    """Result of a study that searched causes and named one."""
    verdict = Verdict(kind="effect", text="So it is.", causes=causes or [cause(), UNKNOWN])
    return result(**{"verdict": verdict, "discovery": discovery(), "gain": gain(), **changes})


def withdrawn():
    """Result of a study that named a cause which held-out recordings refute."""
    unknown = UNKNOWN.model_copy(update={"probability": 1.0})
    verdict = Verdict(
        kind="unknown", text="It gains nothing.", causes=[unknown, cause(probability=0.0, withdrawn=True)]
    )
    place = InputLocation(
        device="synchronous_machine", place="Efd", probability=0.9, chi2_per_sample=1.2, follows=[("V", -0.8)],
        explained=0.95, unit="pu", time=[0.0, 1.0], waveform=[0.0, 0.2],
    )  # fmt: skip
    fits = [f.model_copy(update={"extended": None}) for f in discovery().fits]
    return found(
        verdict=verdict,
        discovery=discovery(fits=fits, extension=[], places=[place], advice=["Fit both together."]),
        gain=gain(-0.2, -0.5, 0.1, placebo=0.05),
    )
