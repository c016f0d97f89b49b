"""The result of a study, as it stands in ``result.json``: models, JSON schema, reading and writing."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from errorscreen._runtime.persistence import write_json_atomic, write_text_atomic
from errorscreen.discovery import ChannelFit, StageError
from errorscreen.exceptions import InputError
from errorscreen.report.discovery_schema import Cause, Discovery, Gain, Group
from errorscreen.report.parts import Fit, Number, ParameterResult, Part, Role

#: Raised whenever a reader of the old version would misread the new one.
SCHEMA_VERSION: Literal[1] = 1


class Verdict(Part):
    """What the errors come from, as far as the recordings tell."""

    kind: Literal["within-noise", "parameters", "measurement", "effect", "unknown"]
    text: str = Field(description="the reasons in plain words")
    causes: list[Cause] = Field(
        default=[], description="the most probable first; empty if they were not searched"
    )
    hints: list[str] = Field(
        default=[], description="doubts about unit, base or sign of what was recorded, to be settled first"
    )


class Study(Part):
    """What was compared with what."""

    title: str
    device: str = Field(description="name of the model")
    device_title: str = ""
    base_mva: Number = None
    f_nominal: Number = None
    parameters: int = Field(description="number of candidate parameters")


class ChannelData(Part):
    """One recorded channel."""

    name: str
    unit: str
    noise: Number = Field(description="standard deviation of the measurement noise, in unit")
    missing: Number = Field(default=0.0, description="part of the samples without reading, 0 to 1")


class RecordingData(Part):
    """One recording, and what was assumed about it."""

    name: str
    role: Role = Field(
        description="fit; together: fitted with it in the search for causes only; held_out: only judged on"
    )
    path: str | None = None
    start: Number = Field(description="first instant that was used, in s")
    stop: Number = Field(description="last instant that was used, in s")
    dt: Number = Field(description="step at which signals were compared, in s")
    event_time: Number = Field(description="start of the event, in s")
    channels: list[ChannelData]
    assumptions: list[str] = []


class ChannelDiagnosis(Part):
    """Error of one channel before and after calibration."""

    channel: str
    unit: str
    noise: Number
    before: Fit
    after: Fit | None = None


class StageFigures(Part):
    """Error of one channel in one stage of the event."""

    share: Number = Field(description="part of the channel's error energy, 0 to 1")
    rms_over_noise: Number = Field(description="1 if only noise is left")


class StageDiagnosis(Part):
    """Error of one channel in one stage, before and after calibration."""

    channel: str
    stage: str = Field(
        description="before, fault, first recovery, oscillation, end; of equations of your own: before, and quarters"
    )
    start: Number = Field(description="seconds")
    stop: Number = Field(description="seconds")
    before: StageFigures
    after: StageFigures | None = None


class RecordingDiagnosis(Part):
    """What the simulation of one recording gets wrong."""

    recording: str
    role: Role
    channels: list[ChannelDiagnosis]
    stages: list[StageDiagnosis] = []


class Diagnosis(Part):
    """What the simulation gets wrong, recording by recording."""

    recordings: list[RecordingDiagnosis]


class ScreeningMethod(Part):
    """Ranking of the parameters by one screener."""

    method: str
    contributions: dict[str, Number]
    selected: list[str] = Field(description="the most suspicious first")
    overlap: Number = Field(
        default=None,
        description="part of the selection that belongs to the largest true contributions, if known",
    )
    n_simulations: int = 0
    n_failed: int = 0
    seconds: Number = None


class Screening(Part):
    """Which parameters carry the error."""

    truth: dict[str, Number] | None = Field(
        default=None,
        description="true contributions, where the recording was simulated with known parameters",
    )

    rule: str = Field(description="what was selected, in words, for example 'the 3 largest'")
    methods: list[ScreeningMethod]


class MethodFit(Part):
    """How well a calibrated model reproduces one channel of one recording."""

    recording: str
    role: Role
    channel: str
    unit: str
    before: Fit
    after: Fit


class CalibrationMethod(Part):
    """Result of one calibrator."""

    method: str
    label: str = Field(description="for tables, for example 'map on all'")
    parameters: list[ParameterResult] = Field(description="those that were calibrated")
    fits: list[MethodFit]
    groups: list[list[str]] = Field(default=[], description="determined only together")
    level: Number = Field(default=None, description="probability of the intervals")
    converged: bool | None = None
    chi2_per_sample: Number = None
    n_simulations: int = 0
    n_failed: int = 0
    seconds: Number = None


class Calibration(Part):
    """Calibrated models; the diagnosis shows the first one.

    The verdict is that of bounded least squares on all parameters, or of the search for causes.
    """

    methods: list[CalibrationMethod]


class Run(Part):
    """How the result was computed."""

    version: str = Field(description="of errorscreen")
    python: str
    packages: dict[str, str] = {}
    random_state: int
    n_jobs: int = 1
    threads: int | None = Field(
        default=None, description="of the training of the network, whose rounding errors depend on them"
    )
    step: Number = Field(default=None, description="longest integration step, in s")
    n_simulations: int
    n_failed: int = 0
    seconds: Number
    started: str = Field(description="ISO 8601")
    reused: list[str] = Field(default=[], description="stages taken over from an interrupted run")


class Result(Part):
    """Result of a study."""

    schema_version: Literal[1] = SCHEMA_VERSION
    verdict: Verdict
    study: Study
    data: list[RecordingData]
    diagnosis: Diagnosis
    screening: Screening
    calibration: Calibration
    groups: list[Group] = Field(default=[], description="explanations that cannot be told apart")
    gain: Gain | None = Field(default=None, description="of what was named, on held-out recordings")
    discovery: Discovery | None = Field(
        default=None,
        description="search for causes, with all values of the extended model; null if they were not searched",
    )
    run: Run


def diagnose_recording(
    recording: str,
    role: Role,
    before: Iterable[ChannelFit],
    after: Iterable[ChannelFit] = (),
    stages_before: Iterable[StageError] = (),
    stages_after: Iterable[StageError] = (),
) -> RecordingDiagnosis:
    """Pair the figures of `errorscreen.discovery` before and after calibration.

    Examples
    --------
    >>> one = [ChannelFit("trip", "P", "pu", 0.1, 0.5, 100.0, 0.01)]
    >>> two = [ChannelFit("trip", "P", "pu", 0.01, 0.005, 1.0, 0.01)]
    >>> diagnose_recording("trip", "fit", one, two).channels[0].after.rms
    0.01
    """
    fits = {f.channel: f for f in after}
    later = {(s.channel, s.stage): s for s in stages_after}
    return RecordingDiagnosis(
        recording=recording,
        role=role,
        channels=[
            ChannelDiagnosis(
                channel=f.channel,
                unit=f.unit,
                noise=f.noise,
                before=fit_of(f),
                after=fit_of(fits[f.channel]) if f.channel in fits else None,
            )
            for f in before
        ],
        stages=[
            StageDiagnosis(
                channel=s.channel,
                stage=s.stage,
                start=s.start,
                stop=s.stop,
                before=_figures(s),
                after=_figures(later[s.channel, s.stage]) if (s.channel, s.stage) in later else None,
            )
            for s in stages_before
        ],
    )


def fit_of(fit: ChannelFit) -> Fit:
    """Figures of a channel for the result."""
    return Fit(rms=fit.rms, E=fit.E, chi2_per_sample=fit.chi2_per_sample)


def _figures(stage: StageError) -> StageFigures:
    return StageFigures(share=stage.share, rms_over_noise=stage.rms_over_noise)


def write_result(result: Result, path: str | os.PathLike[str]) -> Path:
    """Write ``result.json``, complete or not at all, with null for what is not a number.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    return write_json_atomic(path, result.model_dump(mode="json"))


def read_result(path: str | os.PathLike[str]) -> Result:
    """Read and check a ``result.json``.

    Raises
    ------
    InputError
        If it is missing, is no result, or has another version.
    """
    where = f"file {path}"
    try:
        data = json.loads(Path(path).read_bytes())
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read as JSON: {error}", where=where) from error
    version = data.get("schema_version") if isinstance(data, dict) else None
    if version != SCHEMA_VERSION:
        raise InputError(
            f"schema_version is {version!r}",
            where=where,
            allowed=str(SCHEMA_VERSION),
            remedy="Run the case again",
        )
    try:
        return Result.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise InputError(f"{first['msg']} (key {key})", where=where, remedy="Run the case again") from error


def json_schema() -> dict[str, Any]:
    """JSON schema of ``result.json``."""
    schema = Result.model_json_schema(mode="serialization")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def write_json_schema(path: str | os.PathLike[str]) -> Path:
    """Write the JSON schema, for the documentation."""
    return write_text_atomic(path, json.dumps(json_schema(), indent=2) + "\n")
