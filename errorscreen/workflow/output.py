"""From the outcome of a study to ``result.json`` and ``report.html``."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import errorscreen
from errorscreen.data.observations import Observation
from errorscreen.metrics import top_k_overlap
from errorscreen.report import Result, write_report, write_result
from errorscreen.report.discovery_schema import (
    Cause,
    Contribution,
    Discovery,
    Extension,
    ExtensionFit,
    Gain,
    Group,
    HypothesisFit,
    InputLocation,
    RemainingCell,
)
from errorscreen.report.parts import ParameterResult, Role
from errorscreen.report.result_schema import (
    Calibration,
    CalibrationMethod,
    ChannelData,
    Diagnosis,
    MethodFit,
    RecordingData,
    RecordingDiagnosis,
    Run,
    Screening,
    ScreeningMethod,
    diagnose_recording,
    fit_of,
)
from errorscreen.report.result_schema import Study as StudyData
from errorscreen.report.result_schema import Verdict as VerdictData
from errorscreen.workflow.figures import figures
from errorscreen.workflow.screen import selector
from errorscreen.workflow.study import Calibrated, Discovered, Outcome

_PACKAGES = ("numpy", "scipy", "scikit-learn", "numba", "PyWavelets", "torch")
#: instants of a signal in the result, at most
_POINTS = 200


def write_outputs(outcome: Outcome, out: str | Path) -> tuple[Path, Path]:
    """Write ``result.json`` and ``report.html`` into a folder, each complete or not at all.

    Returns
    -------
    tuple of Path
        The two files.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    result = build_result(outcome)
    out = Path(out)
    return (
        write_result(result, out / "result.json"),
        write_report(result, figures(outcome), out / "report.html"),
    )


def build_result(outcome: Outcome) -> Result:
    """What stands in ``result.json``."""
    study = outcome.study
    device = getattr(study.simulator, "device", None)
    found = outcome.discovered.meta if outcome.discovered else {}
    data = zip_longest(outcome.observations, study.roles, study.paths)
    simulations = [*outcome.screened, *(c.meta["n_simulations"] for c in outcome.calibrated)]
    simulations.append(found.get("n_simulations", 0))
    return Result(
        verdict=VerdictData(
            kind=outcome.verdict.kind,  # type: ignore[arg-type]
            text=outcome.verdict.text,
            causes=[Cause(**cause) for cause in found.get("causes", [])],
            hints=outcome.hints,
        ),
        study=StudyData(
            title=study.title,
            device=device.name if device else type(study.simulator).__name__,
            device_title=device.title if device else repr(study.simulator),
            base_mva=study.base_mva,
            f_nominal=study.f_nominal,
            parameters=len(study.simulator.parameters),
        ),
        data=[_data(*one) for one in data],
        diagnosis=Diagnosis(recordings=list(_diagnoses(outcome))),
        screening=_screening(outcome),
        calibration=Calibration(methods=[_calibration(c, outcome) for c in outcome.calibrated]),
        groups=[_group(group) for group in found.get("groups", [])],
        gain=Gain.model_validate(found["gain"]) if found.get("gain") else None,
        discovery=_discovery(outcome.discovered, outcome) if outcome.discovered else None,
        run=Run(
            version=errorscreen.__version__,
            python=platform.python_version(),
            packages=_versions(),
            random_state=study.run.random_state,
            n_jobs=study.run.n_jobs,
            threads=next((s.threads for s in outcome.screened if s.threads), None),
            step=getattr(study.simulator, "step", None),
            n_simulations=sum(s if isinstance(s, int) else s.n_simulations for s in simulations),
            n_failed=sum(s.n_failed for s in outcome.screened)
            + sum(c.meta["n_failed"] for c in outcome.calibrated),
            seconds=outcome.seconds,
            started=outcome.started,
            reused=outcome.reused,
        ),
    )


def _group(group: dict[str, Any]) -> Group:
    events = [dict(zip(("event", "channel", "distance"), item, strict=True)) for item in group["separating"]]
    states = [dict(zip(("device", "state", "share"), item, strict=True)) for item in group["states"]]
    return Group.model_validate({"names": group["names"], "separating": events, "states": states})


def _discovery(discovered: Discovered, outcome: Outcome) -> Discovery:
    found = discovered.meta
    signals = map(thinned, discovered.waveforms)
    return Discovery(
        tried=found["tried"],
        hypotheses=[HypothesisFit(**h) for h in found["hypotheses"]],
        extension=[Extension(**effect) for effect in found["extension"]],
        parameters=[ParameterResult(**p) for p in found["parameters"]],
        step=found["step"],
        fits=list(_extension_fits(discovered, outcome)),
        cells=[RemainingCell(**cell) for cell in found["cells"]],
        places=[
            InputLocation(**place, time=time.tolist(), waveform=signal.tolist())
            for place, (time, signal) in zip(found["places"], signals, strict=True)
        ],
        first_look=[Contribution(**c) for c in found["first_look"]],
        first_look_compared=found["first_look_compared"],
        advice=found["advice"],
        n_simulations=found["n_simulations"],
        seconds=found["seconds"],
    )


def _extension_fits(discovered: Discovered, outcome: Outcome) -> Iterator[ExtensionFit]:
    """Errors of what the search fitted, channel by channel."""
    recordings = zip(outcome.study.roles, discovered.fits_alone, discovered.fits, strict=True)
    for role, alone, extended in recordings:
        for one, two in zip(alone, extended, strict=True):
            yield ExtensionFit(
                recording=one.recording,
                role=role,
                channel=one.channel,
                unit=one.unit,
                parameters=fit_of(one),
                extended=fit_of(two) if discovered.label else None,
            )


def thinned(series: NDArray[np.float64]) -> NDArray[np.float64]:
    """At most `_POINTS` columns of an array (2, L), the first and the last among them.

    Of each stretch in between the lowest and the highest value of the second row: a short peak stays.

    Examples
    --------
    >>> thinned(np.arange(1002.0).reshape(2, 501)).shape
    (2, 200)
    """
    length = series.shape[1]
    if length <= _POINTS:
        return series
    stretches = np.array_split(np.arange(1, length - 1), (_POINTS - 2) // 2)
    kept = {0, length - 1}
    for columns in stretches:
        values = series[1, columns]
        kept |= {int(columns[np.argmin(values)]), int(columns[np.argmax(values)])}
    return series[:, sorted(kept)]


def _data(observation: Observation, role: Role, path: str | None) -> RecordingData:
    return RecordingData(
        name=observation.event.name,
        role=role,
        path=path,
        start=observation.time[0],
        stop=observation.time[-1],
        dt=observation.event.dt,
        event_time=observation.event.start,
        channels=[
            ChannelData(name=name, unit=unit, noise=noise, missing=1 - mask.mean())
            for name, unit, noise, mask in zip(
                observation.channels, observation.units, observation.noise, observation.mask, strict=True
            )
        ],
        assumptions=list(observation.assumptions),
    )


def _diagnoses(outcome: Outcome) -> Iterator[RecordingDiagnosis]:
    for n, observation in enumerate(outcome.observations):
        yield diagnose_recording(
            observation.event.name,
            outcome.study.roles[n],
            outcome.fits[n],
            outcome.best.fits[n],
            outcome.stages[n],
            outcome.best.stages[n],
        )


def _screening(outcome: Outcome) -> Screening:
    truth = outcome.true_contributions
    rule = selector(outcome.study.screening)
    words = (
        f"the {rule.k} largest" if hasattr(rule, "k") else f"those above {rule.threshold:g} of the largest"
    )
    return Screening(
        rule=words,
        truth=None if truth is None else outcome.named(truth),
        methods=[
            ScreeningMethod(
                method=s.method,
                contributions=outcome.named(s.contributions),
                selected=list(s.names),
                overlap=None
                if truth is None
                else top_k_overlap(truth[None], s.contributions[None], k=len(s.names)),
                n_simulations=s.n_simulations,
                n_failed=s.n_failed,
                seconds=s.seconds,
            )
            for s in outcome.screened
        ],
    )


def _calibration(calibrated: Calibrated, outcome: Outcome) -> CalibrationMethod:
    meta = calibrated.meta
    fits = [
        MethodFit(
            recording=observation.event.name,
            role=role,
            channel=before.channel,
            unit=before.unit,
            before=fit_of(before),
            after=fit_of(after),
        )
        for observation, role, befores, afters in zip(
            outcome.observations, outcome.study.roles, outcome.fits, calibrated.fits, strict=True
        )
        for before, after in zip(befores, afters, strict=True)
    ]
    return CalibrationMethod(
        method=calibrated.method,
        label=calibrated.label,
        parameters=_parameters(calibrated, outcome),
        fits=fits,
        groups=meta.get("groups", []),
        level=outcome.study.calibration.level if "intervals" in calibrated.arrays else None,
        converged=meta.get("converged"),
        chi2_per_sample=meta.get("chi2_per_sample"),
        n_simulations=meta["n_simulations"],
        n_failed=meta["n_failed"],
        seconds=meta["seconds"],
    )


def _parameters(calibrated: Calibrated, outcome: Outcome) -> list[ParameterResult]:
    space = outcome.study.simulator.parameters
    arrays: dict[str, Any] = calibrated.arrays
    truth = outcome.study.truth
    out = []
    for k, name in enumerate(calibrated.names):
        p = space[name]
        extra: dict[str, Any] = {}
        if "intervals" in arrays:
            low, high = arrays["intervals"][k]
            extra = {"low": low, "high": high, "identifiable": bool(arrays["identifiable"][k])}
        value = float(calibrated.theta[space.index(name)])
        margin = 1e-6 * (p.upper - p.lower)
        out.append(
            ParameterResult(
                name=name,
                symbol=p.symbol,
                unit=p.unit,
                description=p.description,
                nominal=p.nominal,
                lower=p.lower,
                upper=p.upper,
                scale=p.scale,
                value=value,
                truth=None if truth is None else truth[name],
                at_bound=not p.lower + margin < value < p.upper - margin,
                **extra,
            )
        )
    return out


def _versions() -> dict[str, str]:
    """Versions of the libraries that decide the result, of those that are installed."""
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
