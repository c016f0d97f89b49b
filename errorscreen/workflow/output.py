"""From the outcome of a study to ``result.json`` and ``report.html``."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from itertools import zip_longest
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import errorscreen
from errorscreen.features import CWTTransformer
from errorscreen.metrics import top_k_overlap
from errorscreen.observations import Observation
from errorscreen.plotting import (
    plot_error_images,
    plot_intervals,
    plot_rankings,
    plot_responses,
    plot_waveform,
)
from errorscreen.report import ReportFigure, Result, write_report, write_result
from errorscreen.report.discovery_schema import (
    Cause,
    Contribution,
    Discovery,
    Gain,
    Group,
    HypothesisFit,
    Place,
    RemainingCell,
    Separation,
)
from errorscreen.report.result_schema import (
    Calibration,
    CalibrationMethod,
    ChannelData,
    Diagnosis,
    MethodFit,
    ParameterResult,
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
from errorscreen.workflow.screen import selector
from errorscreen.workflow.study import Calibrated, Discovered, Outcome

_PACKAGES = ("numpy", "scipy", "scikit-learn", "numba", "PyWavelets", "torch")
#: rows and columns of the error images in the report
_IMAGE = (64, 256)


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
    simulations = [*outcome.screened, *(c.meta["n_simulations"] for c in outcome.calibrated)]
    simulations.append(found.get("n_simulations", 0))
    return Result(
        verdict=VerdictData(
            kind=outcome.verdict.kind,  # type: ignore[arg-type]
            text=outcome.verdict.text,
            causes=[Cause(**cause) for cause in found.get("causes", [])],
        ),
        study=StudyData(
            title=study.title,
            device=device.name if device else type(study.simulator).__name__,
            device_title=device.title if device else repr(study.simulator),
            base_mva=study.base_mva,
            f_nominal=study.f_nominal,
            parameters=len(study.simulator.parameters),
        ),
        data=[_data(o, role, path) for (o, role), path in zip_longest(_with_roles(outcome), study.paths)],
        diagnosis=Diagnosis(recordings=list(_diagnoses(outcome))),
        screening=_screening(outcome),
        calibration=Calibration(methods=[_calibration(c, outcome) for c in outcome.calibrated]),
        groups=[_group(group) for group in found.get("groups", [])],
        gain=Gain.model_validate(found["gain"]) if found.get("gain") else None,
        discovery=_discovery(found) if found else None,
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
    keys = ("event", "channel", "distance")
    separating = [Separation(**dict(zip(keys, item, strict=True))) for item in group["separating"]]
    return Group(names=group["names"], separating=separating)


def _discovery(found: dict[str, Any]) -> Discovery:
    return Discovery(
        hypotheses=[HypothesisFit(**h) for h in found["hypotheses"]],
        cells=[RemainingCell(**cell) for cell in found["cells"]],
        places=[Place(**place) for place in found["places"]],
        first_look=[Contribution(**c) for c in found["first_look"]],
        advice=found["advice"],
        n_simulations=found["n_simulations"],
        seconds=found["seconds"],
    )


def figures(outcome: Outcome) -> Iterator[ReportFigure]:
    """Figures of the report, in the order in which they stand there."""
    best = outcome.best
    for n, observation in enumerate(outcome.observations):
        role = "fitted" if n == 0 else "not used for fitting"
        responses = {"before": outcome.before[n], f"after ({best.label})": best.responses[n]}
        yield ReportFigure(
            "responses",
            f"{observation.event.name} ({role}): measured against simulated before and after calibration.",
            plot_responses(observation, responses),
        )
    yield _error_image(outcome)
    rankings = {s.method: _named(outcome, s.contributions) for s in outcome.screened}
    if outcome.true_contributions is not None:
        rankings["truth"] = _named(outcome, outcome.true_contributions)
    yield ReportFigure(
        "screening",
        "Contribution of each parameter to the error by each screener, relative to its largest; selected ones dark.",
        plot_rankings(rankings, selected={s.method: s.names for s in outcome.screened}),
    )
    for calibrated in outcome.calibrated:
        if "intervals" in calibrated.arrays:
            yield _interval_figure(calibrated, outcome)
    if outcome.discovered is not None:
        yield from _discovery_figures(outcome, outcome.discovered)


def _error_image(outcome: Outcome) -> ReportFigure:
    """Wavelet energy of the error before and after, on the fitted recording."""
    observation = outcome.study.observation
    responses = {"before": outcome.before[0], f"after ({outcome.best.label})": outcome.best.responses[0]}
    errors = {k: np.where(observation.mask, observation.values - y, 0.0) for k, y in responses.items()}
    cwt = CWTTransformer(
        sampling_period=observation.event.dt,
        n_frequencies=_IMAGE[0],
        n_columns=_IMAGE[1],
        energy="linear",
        precision=15,
    )
    images = cwt.fit_transform(np.array(list(errors.values())))
    return ReportFigure(
        "errors",
        f"{observation.event.name}: energy of the error over time and frequency. The dashed line marks the event, the "
        "pale parts what the ends of the record distort.",
        plot_error_images(
            dict(zip(errors, images, strict=True)),
            cwt.frequencies_,
            cwt.times_ + observation.time[0],
            observation.channels,
            event_time=observation.event.start,
            cone=cwt.cone_of_influence_,
        ),
    )


def _discovery_figures(outcome: Outcome, found: Discovered) -> Iterator[ReportFigure]:
    """Responses of the extended model, or the unknown signal at the likeliest place."""
    if found.label:
        for n, observation in enumerate(outcome.observations):
            role = "fitted" if n == 0 else "not used for fitting"
            responses = {
                f"parameters only ({outcome.best.label})": outcome.best.responses[n],
                f"extended ({found.label})": found.responses[n],
            }
            yield ReportFigure(
                "discovery",
                f"{observation.event.name} ({role}): the calibrated model without and with {found.label}.",
                plot_responses(observation, responses),
            )
    elif found.waveforms:
        place = found.meta["places"][0]
        time, signal = found.waveforms[0]
        yield ReportFigure(
            "discovery",
            f"Signal that would have to enter at {place['place']} of the {place['device']} to explain it, in "
            "the unit of that port.",
            plot_waveform(time, signal, place["place"], event_time=outcome.study.observation.event.start),
        )


def _interval_figure(calibrated: Calibrated, outcome: Outcome) -> ReportFigure:
    space = outcome.study.simulator.parameters.subset(calibrated.names)
    values = [calibrated.theta[outcome.study.simulator.parameters.index(n)] for n in calibrated.names]
    level = 100 * outcome.study.calibration.level
    return ReportFigure(
        "calibration",
        f"{calibrated.label}: values with {level:.0f} % intervals, as deviation from nominal, within their bounds.",
        plot_intervals(
            space.names,
            space.nominal,
            space.bounds,
            values,
            calibrated.arrays["intervals"],
            identifiable=calibrated.arrays["identifiable"],
            scales=space.scales,
        ),
    )


def _named(outcome: Outcome, values: NDArray[np.float64]) -> dict[str, Any]:
    """Values of all parameters by name."""
    return dict(zip(outcome.study.simulator.parameters.names, values.tolist(), strict=True))


def _with_roles(outcome: Outcome) -> list[tuple[Observation, Literal["fit", "held_out"]]]:
    return [(o, "fit" if n == 0 else "held_out") for n, o in enumerate(outcome.observations)]


def _data(observation: Observation, role: Literal["fit", "held_out"], path: str | None) -> RecordingData:
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
    for n, (observation, role) in enumerate(_with_roles(outcome)):
        yield diagnose_recording(
            observation.event.name,
            role,
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
        truth=None if truth is None else _named(outcome, truth),
        methods=[
            ScreeningMethod(
                method=s.method,
                contributions=_named(outcome, s.contributions),
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
        for (observation, role), befores, afters in zip(
            _with_roles(outcome), outcome.fits, calibrated.fits, strict=True
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
