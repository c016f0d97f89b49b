"""Figures of the report of a study."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from errorscreen.calibration.result import Calibration
from errorscreen.data.observations import Observation
from errorscreen.data.panels import with_unit
from errorscreen.discovery import Cell, NamedEffect, residual_test
from errorscreen.discovery.diagnosis import EXTENDED, NOMINAL
from errorscreen.discovery.judge.errors import stage_limits, stage_names
from errorscreen.events import Playback
from errorscreen.exceptions import InputError
from errorscreen.features import CWTTransformer
from errorscreen.plotting import (
    plot_error_images,
    plot_intervals,
    plot_rankings,
    plot_responses,
    plot_waveform,
)
from errorscreen.plotting.error_images import Outlined
from errorscreen.report import ReportFigure
from errorscreen.report.charts import Chart, Curve, Panel
from errorscreen.report.result import Role
from errorscreen.workflow.outcome import Outcome

#: rows and columns of the error images in the report
_IMAGE = (64, 256)
#: seconds over which a frequency is averaged that follows from an angle
_SMOOTH = 0.1
#: units of injected signals
_UNITS = {"V": "pu", "f": "Hz", "Efd": "pu", "Pm": "pu", "P": "pu", "Q": "pu"}
#: use of a recording in captions
_ROLES: dict[Role, str] = {"fit": "fitted", "together": "fitted", "held_out": "not fitted"}


def figures(outcome: Outcome) -> Iterator[ReportFigure]:
    """Figures of the report, in their order."""
    result, study = outcome.result, outcome.study
    best = result.calibration[0].label
    found = result.diagnosis
    for n, (observation, role) in enumerate(zip(study.observations, study.roles, strict=True)):
        responses = {"before": outcome.responses[NOMINAL][n], "after": outcome.responses[best][n]}
        if found.extension:
            label = _extended(found.extension, observation.event.name)
            responses[label] = found.responses[EXTENDED][n]
        chart = chart_of(observation, responses, study.f_nominal)
        thinned = " Long stretches are thinned; their extremes are kept." if chart.thinned else ""
        yield ReportFigure(
            "responses",
            f"{observation.event.name} ({_ROLES[role]}): measured, and simulated by the model as it was, after "
            f"calibration{' and with the extension' if found.extension else ''}.{thinned}",
            plot_responses(observation, responses),
            chart,
        )
    yield _error_image(outcome, best)
    if result.screening:
        rankings = {s.method: s.contributions for s in result.screening}
        if result.contributions is not None:
            rankings["truth"] = result.contributions
        yield ReportFigure(
            "screening",
            "Contribution of each parameter to the error by each screener, relative to its largest; selected ones "
            "dark.",
            plot_rankings(rankings, selected={s.method: s.selected for s in result.screening}),
        )
    for calibration in result.calibration:
        if np.isfinite(calibration.level):
            yield _interval_figure(calibration)
    yield from _diagnosis_figures(outcome)


def chart_of(
    observation: Observation, responses: Mapping[str, NDArray[np.float64]], f_nominal: float
) -> Chart:
    """Curves of the compared channels, then of the signals that the event injects.

    The angle is drawn as the frequency that follows from it.
    """
    roles: tuple[Literal["before", "after", "extended"], ...] = ("before", "after", "extended")
    panels = []
    for r in np.flatnonzero(observation.mask.any(axis=1)):
        curves = [Curve("measured", "measured", observation.values[r])]
        curves += [
            Curve(label, role, y[r]) for role, (label, y) in zip(roles, responses.items(), strict=False)
        ]
        panels.append(Panel(observation.labels(np.arange(len(observation.channels)) == r)[0], tuple(curves)))
    event = observation.event
    compared = set(observation.channels)
    for name, values in getattr(event, "signals", {}).items():
        if name in compared:
            continue
        if name == "angle" and isinstance(event, Playback):
            width = max(round(_SMOOTH / event.dt), 1)
            slope = np.gradient(np.asarray(values), event.dt) / (2 * np.pi)
            ends = np.pad(slope, (width // 2, width - 1 - width // 2), mode="edge")
            smooth = np.convolve(ends, np.full(width, 1.0 / width), mode="valid")
            panels.append(_input("f in Hz", "frequency", f_nominal + smooth))
        else:
            unit = _UNITS.get(name, "") if isinstance(event, Playback) else ""
            panels.append(_input(with_unit(name, unit), name, np.asarray(values)))
    return Chart(observation.time, event.start, tuple(panels))


def _input(label: str, name: str, values: NDArray[np.float64]) -> Panel:
    return Panel(label, (Curve(name, "input", values),))


def _error_image(outcome: Outcome, best: str) -> ReportFigure:
    """Wavelet energy of the error before and after, of the first recording."""
    observation = outcome.study.observation
    responses = {"before": outcome.responses[NOMINAL][0], "after": outcome.responses[best][0]}
    errors = {k: np.where(observation.mask, observation.values - y, 0.0) for k, y in responses.items()}
    cwt = CWTTransformer(
        sampling_period=observation.event.dt,
        n_frequencies=_IMAGE[0],
        n_columns=_IMAGE[1],
        energy="linear",
    )
    images = cwt.fit_transform(np.array(list(errors.values())))
    cells = {k: _cells(observation, y, outcome.study.run.random_state) for k, y in responses.items()}
    return ReportFigure(
        "errors",
        f"{observation.event.name}: energy of the error over time and frequency. The dashed line marks the event; pale "
        f"parts are distorted by the ends of the record.{_outlines_told(cells)}",
        plot_error_images(
            dict(zip(errors, images, strict=True)),
            cwt.frequencies_,
            cwt.times_ + observation.time[0],
            observation.channels,
            event_time=observation.event.start,
            cone=cwt.cone_of_influence_,
            outlined={k: _outlined(observation, every) for k, every in cells.items()},
        ),
    )


def _cells(observation: Observation, responses: NDArray[np.float64], random_state: int) -> tuple[Cell, ...]:
    """Error of a response by channel, stage and band; none where too little was measured."""
    try:
        z = observation.deviations(responses)[observation.mask]
        return residual_test([observation], z, random_state=random_state).cells
    except InputError:  # the picture says something all the same
        return ()


def _outlined(observation: Observation, cells: Sequence[Cell]) -> list[Outlined]:
    """Where the significant ones of some cells lie."""
    spans = dict(zip(stage_names(observation), pairwise(stage_limits(observation).tolist()), strict=True))
    return [(cell.channel, spans[cell.stage], cell.band) for cell in cells if cell.significant]


def _outlines_told(cells: Mapping[str, Sequence[Cell]]) -> str:
    """What is outlined, for the caption; empty where nothing could be tested."""
    if not all(cells.values()):
        return ""
    counts = (
        f"{sum(c.significant for c in every)} of {len(every)} {label}" for label, every in cells.items()
    )
    return (
        " Outlined: stages of the event and frequency bands in which the error is more than noise, at most about "
        f"5 % of them by chance; {', '.join(counts)}."
    )


def _diagnosis_figures(outcome: Outcome) -> Iterator[ReportFigure]:
    """The unknown input at the likeliest port."""
    found, study = outcome.result.diagnosis, outcome.study
    if not found.extension and found.input_locations:
        first, event = found.input_locations[0], study.observation.event
        yield ReportFigure(
            "discovery",
            f"Input that would have to enter at {first.place} of the {first.device} to explain {event.name}, in "
            f"{first.unit or 'the unit of that port'}.",
            plot_waveform(first.time, first.waveform, first.place, event_time=event.start),
        )


def _extended(effects: Sequence[NamedEffect], recording: str) -> str:
    """The extended model in one recording, for a legend: an effect of another recording alone is off."""
    if any(e.recording in ("", recording) for e in effects):
        return "extended"
    names = dict.fromkeys(e.original for e in effects)
    return f"parameters fitted beside {' + '.join(names)}, which is off here"


def _interval_figure(calibration: Calibration) -> ReportFigure:
    fitted = calibration.parameters
    return ReportFigure(
        "calibration",
        f"{calibration.label}: values with {100 * calibration.level:.0f} % intervals, as deviation from nominal, "
        "within their bounds.",
        plot_intervals(
            calibration.names,
            [p.nominal for p in fitted],
            [(p.lower, p.upper) for p in fitted],
            [p.value for p in fitted],
            [(p.low, p.high) for p in fitted],
            identifiable=[bool(p.identifiable) for p in fitted],
            scales=[p.scale for p in fitted],
        ),
    )
