"""Error of a simulation in each channel and stage of an event, and what follows from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.events import Playback
from errorscreen.metrics import quiet_level, response_error, rms
from errorscreen.recordings import Observation

#: seconds after the fault until which a stage lasts; the end of the fault is read off the voltage
RECOVERY, OSCILLATION = 0.5, 3.0
STAGES = ("before", "fault", "first recovery", "oscillation", "end")


@dataclass(frozen=True)
class ChannelFit:
    """How well one channel of one recording is reproduced.

    Parameters
    ----------
    recording, channel, unit : str
    rms : float
        Of the error from the start of the event on, in `unit`.
    E : float
        Equation (23).
    chi2_per_sample : float
        Mean square of the error in multiples of the noise.
    noise : float
        Standard deviation of the noise, in `unit`.
    """

    recording: str
    channel: str
    unit: str
    rms: float
    E: float
    chi2_per_sample: float
    noise: float


@dataclass(frozen=True)
class StageError:
    """Error of one channel in one stage of an event.

    Parameters
    ----------
    recording, channel, stage : str
    start, stop : float
        Seconds.
    share : float
        Of the channel's error energy, 0 to 1.
    rms_over_noise : float
        1 if only noise is left.
    """

    recording: str
    channel: str
    stage: str
    start: float
    stop: float
    share: float
    rms_over_noise: float


@dataclass(frozen=True)
class Verdict:
    """What the errors come from, as far as the recordings tell.

    Parameters
    ----------
    kind : str
        ``"within-noise"``: nothing to explain; ``"parameters"``: calibration explains the errors; ``"unknown"``:
        it does not, or that cannot be told.
    text : str
        The reasons in plain words.
    """

    kind: str
    text: str


def channel_fits(observation: Observation, responses: ArrayLike) -> list[ChannelFit]:
    """Figures of each channel that was measured.

    Parameters
    ----------
    observation : Observation
    responses : array-like of shape (R, L)
        Simulated channels.
    """
    responses = np.asarray(responses, dtype=float)
    level = quiet_level(observation.values, observation.time, observation.event.start)
    measured = np.flatnonzero(observation.mask.any(axis=1))
    pair = responses[measured], observation.values[measured]
    from_event = observation.time >= observation.event.start - 1e-9
    z = (pair[0] - pair[1]) / observation.noise[measured, None]
    return [
        ChannelFit(
            observation.event.name, observation.channels[r], observation.units[r], *map(float, figures)
        )
        for r, *figures in zip(
            measured,
            rms(pair[0][:, from_event], pair[1][:, from_event]),
            response_error(*pair, level[measured]),
            np.nanmean(z**2, axis=1),
            observation.noise[measured],
            strict=True,
        )
    ]


def stage_limits(observation: Observation) -> NDArray[np.float64]:
    """Instants in seconds between which the stages of `STAGES` lie, shape (6,).

    The fault ends where the voltage has come back by half of its largest deviation within the first second; without a
    voltage, or if it never comes back (a step), after 0.2 s.
    """
    time, start = observation.time, observation.event.start
    end = start + 0.2
    if isinstance(observation.event, Playback):
        voltage = observation.event.signals["V"]
        deviation = np.abs(voltage - observation.event.initial["V"])
        near = (time >= start) & (time <= start + 1.0)
        if near.any():
            worst = np.flatnonzero(near)[np.argmax(deviation[near])]
            back = np.flatnonzero(deviation[worst:] < 0.5 * deviation[worst])
            if len(back) and time[worst + back[0]] <= start + 1.0:
                end = float(time[worst + back[0]])
    limits = np.array([time[0], start, end, end + RECOVERY, end + OSCILLATION, time[-1]])
    return np.clip(limits, time[0], time[-1])


def stage_errors(observation: Observation, responses: ArrayLike) -> list[StageError]:
    """Where in time the error of each channel lies.

    Parameters
    ----------
    observation : Observation
    responses : array-like of shape (R, L)
    """
    errors = np.asarray(responses, dtype=float) - observation.values
    limits = stage_limits(observation)
    out = []
    for r in np.flatnonzero(observation.mask.any(axis=1)):
        total = float(np.nansum(errors[r] ** 2))
        for stage, start, stop in zip(STAGES, limits[:-1], limits[1:], strict=True):
            last = stop == limits[-1]
            part = (observation.time >= start) & (
                (observation.time <= stop) if last else (observation.time < stop)
            )
            part &= observation.mask[r]
            if start == stop or not part.any():  # the record ends before
                continue
            energy = float(np.sum(errors[r, part] ** 2))
            out.append(
                StageError(
                    observation.event.name,
                    observation.channels[r],
                    stage,
                    float(start),
                    float(stop),
                    energy / total if total > 0 else 0.0,
                    float(np.sqrt(energy / part.sum()) / observation.noise[r]),
                )
            )
    return out


def noise_limit(observations: Sequence[Observation]) -> float:
    """Largest χ²/N that noise alone explains, three standard deviations above 1.

    χ²/N of N values scatters by √(2/N), and the noise variance itself is estimated from n quiet values, with a relative
    scatter of √(2/n).
    """
    total = sum(int(o.mask.sum()) for o in observations)
    quiet = sum(int(o.mask[:, o.time < o.event.start].sum()) for o in observations)
    return 1.0 + 3.0 * float(np.sqrt(2.0 / max(total, 1) + 2.0 / max(quiet, 1)))


def judge(observations: Sequence[Observation], before: Sequence[ArrayLike], calibrator: Any) -> Verdict:
    """Compare the errors before and after the calibration of all parameters with the noise.

    Parameters
    ----------
    observations : sequence of Observation
        What was fitted.
    before : sequence of array-like of shape (R, L)
        Responses of the uncalibrated simulator.
    calibrator : MAPCalibrator
        Fitted on `observations` with all parameters free, because only then a remainder says something about the
        model's structure.
    """
    limit = noise_limit(observations)
    z = [
        ((np.asarray(y) - o.values) / o.noise[:, None])[o.mask]
        for o, y in zip(observations, before, strict=True)
    ]
    nominal = float(np.mean(np.concatenate(z) ** 2))
    fitted = calibrator.chi2_per_sample_
    figures = f"χ²/N is {nominal:.3g} before and {fitted:.3g} after calibration; noise alone explains up to {limit:.3g}"
    if nominal <= limit:
        return Verdict(
            "within-noise", f"The simulation agrees with the recording within its noise. {figures}."
        )
    moved = _moved(calibrator)
    if fitted <= limit:
        names = ", ".join(moved) if moved else "several parameters together, none of them alone"
        return Verdict(
            "parameters",
            f"The parameters explain the error, all that is left is noise. {figures}. "
            f"Their intervals exclude the nominal value for: {names}.",
        )
    if not calibrator.converged_:
        return Verdict(
            "unknown",
            f"The search did not converge, so it cannot be told whether parameters explain the error. {figures}. "
            "Allow more iterations or starts, or narrow the bounds.",
        )
    share = 1.0 - fitted / nominal
    bounds = [name for name, at in zip(calibrator.names_, calibrator.at_bound_, strict=True) if at]
    pressed = (
        f" At a bound: {', '.join(bounds)}, which points to a missing effect or a wrong bound."
        if bounds
        else ""
    )
    return Verdict(
        "unknown",
        f"No values of these parameters inside their bounds reproduce the recording. {figures}. Calibration removes "
        f"{100 * share:.0f} % of the weighted squared error; the rest is not parameters of this model, but its "
        f"cause is not named here. Calibrated values then also make up for what the model lacks and must not be taken "
        f"for measured ones; the rankings assume that parameters carry the error.{pressed}",
    )


def _moved(calibrator: Any) -> list[str]:
    """Names of the parameters whose interval excludes the nominal value."""
    space = calibrator.simulator.parameters.subset(calibrator.names_)
    low, high = np.asarray(calibrator.intervals_).T
    return [p.name for p, a, b in zip(space, low, high, strict=True) if not a <= p.nominal <= b]
