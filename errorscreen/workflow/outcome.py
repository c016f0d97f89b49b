"""Outcome of a study: the result that is written, and the responses that are drawn."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import NDArray

import errorscreen
from errorscreen._runtime.files import sha256
from errorscreen.calibration.result import Calibration
from errorscreen.data.observations import Observation
from errorscreen.discovery import Contribution, Diagnosis, ModelFit
from errorscreen.discovery.diagnosis import EXTENDED
from errorscreen.events import Playback
from errorscreen.learning.generation import local_sensitivity
from errorscreen.metrics import top_k_overlap
from errorscreen.report import Result
from errorscreen.report.result import ChannelInfo, RecordingInfo, Role, Run, Screening, StudyInfo
from errorscreen.validation import Validation, validate
from errorscreen.workflow.advice import advice
from errorscreen.workflow.study import Study
from errorscreen.workflow.suspect_readings import doubts

#: libraries whose versions decide the result
_PACKAGES = ("numpy", "scipy", "scikit-learn", "numba", "PyWavelets", "torch")


@dataclass(frozen=True)
class Outcome:
    """Outcome of a study.

    Parameters
    ----------
    study : Study
    result : Result
    responses : dict of str to tuple of ndarray of shape (R, L)
        Of each model of ``result.models`` to each of ``study.observations``, by label.
    """

    study: Study
    result: Result
    responses: dict[str, tuple[NDArray[np.float64], ...]]


def run_info(study: Study, **counts: Any) -> Run:
    """How a result was computed: versions and settings, with counts and seconds as given."""
    return Run(
        version=errorscreen.__version__,
        python=platform.python_version(),
        packages=_versions(),
        random_state=study.run.random_state,
        n_jobs=study.run.n_jobs,
        step=float(getattr(study.simulator, "step", np.nan)),
        **counts,
    )


def result_of(
    study: Study,
    diagnosis: Diagnosis,
    screened: Sequence[Screening],
    calibrations: Sequence[Calibration],
    responses: Mapping[str, Sequence[NDArray[np.float64]]],
    first_look: tuple[Contribution, ...],
    run: Run,
) -> Result:
    """Result of a study, with true values where those are known."""
    device = getattr(study.simulator, "device", None)
    suspects = doubts(study.observations)
    contributions = _true_contributions(study)
    return Result(
        StudyInfo(
            study.title,
            device.name if device else type(study.simulator).__name__,
            device.title if device else repr(study.simulator),
            study.base_mva,
            study.f_nominal,
            len(study.simulator.parameters),
            *(
                (str(file.path), sha256(file.path))
                if (file := study.model_file and study.model_file.file)
                else ()
            ),
        ),
        tuple(
            _recording(*one)
            for one in zip_longest(study.observations, study.roles, study.paths, study.digests)
        ),
        diagnosis,
        tuple(_overlapping(one, contributions) for one in screened),
        contributions,
        tuple(_with_truth(one, study) for one in calibrations),
        tuple(ModelFit.of(label, study.observations, every) for label, every in responses.items()),
        first_look,
        (*suspects, *filter(None, [study.typical])),
        tuple(advice(diagnosis, study, suspects)),
        run,
    )


def validated(
    study: Study, diagnosis: Diagnosis, responses: Mapping[str, Sequence[NDArray[np.float64]]]
) -> Validation | None:
    """Validation by rule of the model as it was, and of the extended or else the calibrated one; None for no plant."""
    if not any(isinstance(one.event, Playback) for one in study.observations):
        return None
    before, *after = responses.values()
    new = diagnosis.responses[EXTENDED] if diagnosis.extension else (after or [before])[0]
    limits, title = (study.limits.limits(), study.limits.title) if study.limits else (None, "")
    return validate(study.observations, list(before), list(new), limits, title)


def _true_contributions(study: Study) -> dict[str, float] | None:
    """Contributions (14) at the true parameters, where those are known."""
    if study.truth is None:
        return None
    simulator = study.simulator
    theta = np.array([study.truth[name] for name in simulator.parameters.names])
    sensitivity = local_sensitivity(simulator, theta, study.observation.event).values[0]
    values = simulator.parameters.deviation(theta)[0] * sensitivity
    return dict(zip(simulator.parameters.names, values.tolist(), strict=True))


def _overlapping(screening: Screening, truth: dict[str, float] | None) -> Screening:
    """The same with the share of the selection that belongs to the largest true contributions."""
    if truth is None:
        return screening
    values = np.array([screening.contributions[name] for name in truth])
    overlap = top_k_overlap(np.array([list(truth.values())]), values[None], k=len(screening.selected))
    return replace(screening, overlap=float(overlap))


def _with_truth(calibration: Calibration, study: Study) -> Calibration:
    """The same with true values, where those are known."""
    if study.truth is None:
        return calibration
    return replace(
        calibration, parameters=tuple(replace(p, truth=study.truth[p.name]) for p in calibration.parameters)
    )


def _recording(observation: Observation, role: Role, path: str | None, digest: str | None) -> RecordingInfo:
    channels = zip(observation.channels, observation.units, observation.noise, observation.mask, strict=True)
    return RecordingInfo(
        observation.event.name,
        role,
        path,
        float(observation.time[0]),
        float(observation.time[-1]),
        observation.event.dt,
        observation.event.start,
        tuple(
            ChannelInfo(name, unit, float(noise), float(1 - mask.mean()))
            for name, unit, noise, mask in channels
        ),
        tuple(map(str, observation.assumptions)),
        {name: float(value) for name, value in getattr(observation.event, "initial", {}).items()},
        digest,
    )


def _versions() -> dict[str, str]:
    """Versions of the libraries that decide the result, of those that are installed."""
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
