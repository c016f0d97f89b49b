"""Error of a simulation in each channel and stage of an event, and what follows from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.typed import Real
from errorscreen.data.disturbances import fault_end
from errorscreen.data.observations import Observation
from errorscreen.events import InputSignal, Playback
from errorscreen.metrics import quiet_level, response_error, rms

#: seconds after the fault until which a stage lasts; the end of the fault is read off what is injected
RECOVERY, OSCILLATION = 0.5, 3.0
STAGES = ("before", "fault", "first recovery", "oscillation", "end")
#: the same of events that are no disturbance of the grid, by `errorscreen.events.Playback.kind`
TESTS = {
    "step test": ("before", "step", "first response", "later response", "end"),
    "open-circuit test": ("before", "step", "first response", "later response", "end"),
    "load rejection": ("before", "rejection", "first response", "later response", "end"),
}
QUARTERS = ("before", "first quarter", "second quarter", "third quarter", "last quarter")


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
        Mean square of the error in multiples of what is uncertain, see `Observation.deviations`.
    noise : float
        Standard deviation of the noise, in `unit`.
    """

    recording: str
    channel: str
    unit: str
    rms: Real
    E: Real
    chi2_per_sample: Real
    noise: Real


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
    start: Real
    stop: Real
    share: Real
    rms_over_noise: Real


@dataclass(frozen=True)
class ModelFit:
    """How well one model reproduces all recordings.

    Parameters
    ----------
    label : str
        The model, for tables and legends.
    channels : tuple of ChannelFit
    stages : tuple of StageError
    """

    label: str
    channels: tuple[ChannelFit, ...]
    stages: tuple[StageError, ...]

    @classmethod
    def of(cls, label: str, observations: Sequence[Observation], responses: Sequence[ArrayLike]) -> ModelFit:
        """Compare responses (R, L) with the observations that they belong to."""
        pairs = list(zip(observations, responses, strict=True))
        return cls(
            label,
            tuple(fit for o, y in pairs for fit in channel_fits(o, y)),
            tuple(stage for o, y in pairs for stage in stage_errors(o, y)),
        )

    def channel(self, recording: str, channel: str) -> ChannelFit | None:
        """Fit of one channel; None if it was not measured."""
        return next((c for c in self.channels if (c.recording, c.channel) == (recording, channel)), None)

    def stage(self, recording: str, channel: str, stage: str) -> StageError | None:
        """Error of one channel in one stage; None if nothing was measured there."""
        key = (recording, channel, stage)
        return next((s for s in self.stages if (s.recording, s.channel, s.stage) == key), None)


def channel_fits(observation: Observation, responses: ArrayLike) -> list[ChannelFit]:
    """Figures of each channel that was measured, for simulated channels of shape (R, L).

    Examples
    --------
    >>> from errorscreen.events import Event
    >>> event = Event(0.1 * np.arange(60), "step", start=1.0)
    >>> seen = Observation(event, np.ones((1, 60)), np.array([0.1]), ("P",), ("pu",))
    >>> (fit,) = channel_fits(seen, 1.2 * seen.values)
    >>> round(fit.rms, 3), round(fit.chi2_per_sample, 3)
    (0.2, 4.0)
    """
    responses = np.asarray(responses, dtype=float)
    level = quiet_level(observation.values, observation.time, observation.event.start)
    measured = np.flatnonzero(observation.mask.any(axis=1))
    pair = responses[measured], observation.values[measured]
    from_event = observation.time >= observation.event.start - 1e-9
    z = observation.deviations(responses)[measured]
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


def stage_names(observation: Observation) -> tuple[str, ...]:
    """Names of the stages: `STAGES` of a disturbance in a grid, `TESTS`, or `QUARTERS` of any other system's record."""
    event = observation.event
    if isinstance(event, Playback):
        return TESTS.get(event.kind, STAGES)
    return QUARTERS if isinstance(event, InputSignal) else STAGES


def stage_limits(observation: Observation) -> NDArray[np.float64]:
    """Instants (6,) in seconds between which the stages lie. The fault ends where the voltage, or the imposed power,
    has come back by half of its largest deviation within the first second; otherwise (a step) after 0.2 s.
    """
    time, start = observation.time, observation.event.start
    if isinstance(observation.event, InputSignal):
        return np.r_[time[0], np.linspace(start, time[-1], len(QUARTERS))]
    end = fault_end(observation)
    end = start + 0.2 if end is None else end
    limits = np.array([time[0], start, end, end + RECOVERY, end + OSCILLATION, time[-1]])
    return np.clip(limits, time[0], time[-1])


def stage_errors(observation: Observation, responses: ArrayLike) -> list[StageError]:
    """Where in time the error of each channel (R, L) lies, for each stage in which something was measured.

    Examples
    --------
    >>> from errorscreen.events import Event
    >>> event = Event(0.1 * np.arange(60), "step", start=1.0)
    >>> seen = Observation(event, np.ones((1, 60)), np.array([0.1]), ("P",), ("pu",))
    >>> late = 1 + 0.3 * (event.time > 2)
    >>> [(error.stage, round(error.share, 2)) for error in stage_errors(seen, [late])]
    [('before', 0.0), ('fault', 0.0), ('first recovery', 0.0), ('oscillation', 0.54), ('end', 0.46)]
    """
    errors = np.asarray(responses, dtype=float) - observation.values
    limits = stage_limits(observation)
    out = []
    for r in np.flatnonzero(observation.mask.any(axis=1)):
        total = float(np.nansum(errors[r] ** 2))
        for stage, start, stop in zip(stage_names(observation), limits[:-1], limits[1:], strict=True):
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
