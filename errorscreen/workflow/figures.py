"""Figures of the report of a study."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.observations import Observation
from errorscreen.discovery import Cell, residual_test
from errorscreen.discovery.judge.errors import stage_limits, stage_names
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
from errorscreen.report.parts import Role
from errorscreen.workflow.study import Calibrated, Discovered, Outcome

#: rows and columns of the error images in the report
_IMAGE = (64, 256)
#: what a recording is to the calibration, and to the search for causes
_CALIBRATED: dict[Role, str] = {
    "fit": "fitted",
    "together": "not used for calibration",
    "held_out": "not used for fitting",
}
_SEARCHED: dict[Role, str] = {"fit": "fitted", "together": "fitted", "held_out": "not used for fitting"}


def figures(outcome: Outcome) -> Iterator[ReportFigure]:
    """Figures of the report, in the order in which they stand there."""
    best = outcome.best
    for n, (observation, role) in enumerate(zip(outcome.observations, outcome.study.roles, strict=True)):
        responses = {"before": outcome.before[n], f"after ({best.label})": best.responses[n]}
        yield ReportFigure(
            "responses",
            f"{observation.event.name} ({_CALIBRATED[role]}): measured against simulated before and after calibration.",
            plot_responses(observation, responses),
        )
    yield _error_image(outcome)
    rankings = {s.method: outcome.named(s.contributions) for s in outcome.screened}
    if outcome.true_contributions is not None:
        rankings["truth"] = outcome.named(outcome.true_contributions)
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
    cells = {k: _cells(observation, y, outcome.study.run.random_state) for k, y in responses.items()}
    return ReportFigure(
        "errors",
        f"{observation.event.name}: energy of the error over time and frequency. The dashed line marks the event, the "
        f"pale parts what the ends of the record distort.{_outlines_told(cells)}",
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
    """Error of a response by channel, stage and band; none where too little was measured.

    Noise that fitted parameters took with them is not counted, so of what a calibration leaves rather less is
    significant.
    """
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


def _discovery_figures(outcome: Outcome, found: Discovered) -> Iterator[ReportFigure]:
    """Responses of the extended model, or the unknown signal at the likeliest place."""
    if found.label:
        for n, (observation, role) in enumerate(zip(outcome.observations, outcome.study.roles, strict=True)):
            responses = {"parameters only": found.alone[n], found.labels[n]: found.responses[n]}
            yield ReportFigure(
                "discovery",
                f"{observation.event.name} ({_SEARCHED[role]}): what the search fitted with parameters only, and "
                f"{found.labels[n]}.",
                plot_responses(observation, responses),
            )
    elif found.waveforms:
        place, (time, signal) = found.meta["places"][0], found.waveforms[0]
        first = outcome.study.observation.event
        yield ReportFigure(
            "discovery",
            f"Signal that would have to enter at {place['place']} of the {place['device']} to explain {first.name}, "
            f"in {place['unit'] or 'the unit of that port'}.",
            plot_waveform(time, signal, place["place"], event_time=first.start),
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
