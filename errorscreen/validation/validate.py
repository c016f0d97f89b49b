"""Each criterion of a validation by rule: passed, failed, or not evaluated and why."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.typed import Real
from errorscreen.data.disturbances import fault_end
from errorscreen.data.observations import Observation
from errorscreen.events import Playback
from errorscreen.validation.limits import Limits, WindowLimits
from errorscreen.validation.low_pass import SHORTEST, low_pass
from errorscreen.validation.measures import DONE, StepFigures, recovery_time, step_figures, window_errors
from errorscreen.validation.oscillation import oscillation
from errorscreen.validation.windows import Window, windows

#: signals that limits are for; others are told and not judged
_JUDGED = ("P", "Q", "Ip", "Iq")
#: a step smaller than this, in multiples of the noise, has no figures; an overshoot below this is noise
_STEP, _NOISE = 10.0, 3.0
#: of an oscillation: readings that it needs, readings that it is fitted to at most, order of the background, least
#: share of the energy that both explain, and the largest damping ratio that has a frequency
_LEAST_SWING, _POINTS, _BACKGROUND, _SWINGS, _MOST_DAMPED = 40, 400, 2, 0.9, 0.5
#: multiples of the noise below which a signal is still
_STILL = 3.0
#: share of the voltage before the event below which a current has no meaning
_VOLTAGE = 0.05

_Array = NDArray[np.float64]
Outcome = Literal["passed", "failed", "not evaluated", "no limit"]


@dataclass(frozen=True)
class Criterion:
    """One figure of one signal, of the model as it was and of the one to use.

    Parameters
    ----------
    recording : str
    signal : str
        ``"P"``, ``"Q"``, ``"Ip"`` or ``"Iq"``, or another compared channel.
    measure : str
        ``"ME"``, ``"MAE"``, ``"MXE"``, or a figure of a step or of the recovery.
    window : str
        ``"before"``, ``"during"``, ``"after"``, or ``"step"``.
    unit : str
    before, after : float
        Value of the model as it was, and of the one to use; NaN where it was not evaluated.
    limit : float
        Largest magnitude; NaN for none. Where it was not evaluated, the stated one, which may be a part of a measured
        figure.
    outcome : {"passed", "failed", "not evaluated", "no limit"}
        Of the model to use.
    reason : str
        Why it was not evaluated.
    """

    recording: str
    signal: str
    measure: str
    window: str
    unit: str
    before: Real
    after: Real
    limit: Real
    outcome: Outcome
    reason: str = ""


@dataclass(frozen=True)
class Validation:
    """A validation by rule.

    Parameters
    ----------
    title, source, set_by : str
        Of the limits; empty where no limits were set.
    windows : dict of str to tuple of Window
        By recording.
    criteria : tuple of Criterion
    """

    title: str
    source: str
    set_by: str
    windows: dict[str, tuple[Window, ...]]
    criteria: tuple[Criterion, ...]

    def count(self, outcome: str) -> int:
        """Number of criteria with an outcome."""
        return sum(one.outcome == outcome for one in self.criteria)

    def summary(self) -> str:
        """How many criteria passed, in one sentence; empty without limits."""
        judged = [one.outcome for one in self.criteria if np.isfinite(one.limit)]
        if not judged:
            return ""
        text = f"{judged.count('passed')} of {len(judged)} criteria passed ({self.title})"
        failed, unjudged = judged.count("failed"), judged.count("not evaluated")
        text += f", {failed} failed" if failed else ""
        return text + (f", {unjudged} not evaluated" if unjudged else "") + "."


def validate(
    observations: Sequence[Observation],
    before: Sequence[_Array],
    after: Sequence[_Array],
    limits: Limits | None = None,
    title: str = "",
) -> Validation:
    """Compare two models with recordings by the rules of IEC 61400-27-2.

    Signals are filtered (`low_pass`) in each window by itself, so that no edge of a fault reaches into another window.

    Parameters
    ----------
    observations : sequence of Observation
        Recordings of a plant; others have no criteria.
    before, after : sequence of ndarray of shape (R, L)
        Responses of the model as it was, and of the one to use.
    limits : Limits, optional
        Only the figures where not given, with the windows of the standard.
    title : str
        Of the limits.

    Returns
    -------
    Validation

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> from errorscreen.validation import PROFILES
    >>> recording, _, _ = demo_recordings(0)
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> seen = plant.observe(recording)
    >>> found = validate([seen], [plant.baseline()], [seen.values], PROFILES["rte-measurement"].limits)
    >>> found.count("failed"), found.criteria[0].signal, found.criteria[0].outcome
    (0, 'P', 'passed')
    """
    chosen = limits or Limits("")
    criteria: list[Criterion] = []
    parts: dict[str, tuple[Window, ...]] = {}
    for observation, old, new in zip(observations, before, after, strict=True):
        if not isinstance(observation.event, Playback):
            continue
        parts[observation.event.name] = windows(observation, chosen.begin, chosen.end)
        signals = list(_signals(observation, old, new))
        criteria += _window_criteria(observation, signals, parts[observation.event.name], chosen)
        criteria += _step_criteria(observation, signals, chosen)
        criteria += _recovery(observation, signals, chosen)
        criteria += _swing(observation, signals, parts[observation.event.name])
    return Validation(title, chosen.source, chosen.set_by, parts, tuple(criteria))


def _signals(observation: Observation, old: _Array, new: _Array) -> Iterator[tuple[str, str, _Array, float]]:
    """Name, unit, values (3, L) measured and of both models, and noise of each signal.

    Currents follow from the powers and the recorded voltage, which both models have in common.
    """
    channels = dict(zip(observation.channels, range(len(observation.channels)), strict=True))
    event = observation.event
    assert isinstance(event, Playback)
    for name, r in channels.items():
        if observation.mask[r].any():
            rows = np.stack([observation.values[r], old[r], new[r]])
            yield name, observation.units[r], rows, float(observation.noise[r])
    voltage = event.signals.get("V")
    if voltage is None:
        return
    for power, current in (("P", "Ip"), ("Q", "Iq")):
        r = channels.get(power, -1)
        if r >= 0 and observation.mask[r].any():
            known = np.where(voltage > _VOLTAGE, voltage, np.nan)
            rows = np.stack([observation.values[r], old[r], new[r]]) / known
            yield current, "pu", rows, float(observation.noise[r])


def _window_criteria(
    observation: Observation,
    signals: Sequence[tuple[str, str, _Array, float]],
    parts: Sequence[Window],
    limits: Limits,
) -> Iterator[Criterion]:
    recording, time = observation.event.name, observation.time
    for window in parts:
        own = limits.windows.get(window.name, WindowLimits())
        part = (time >= window.start - 1e-9) & (time <= window.stop + 1e-9)
        for name, unit, rows, _ in signals:
            inside = rows[:, part]
            known = np.isfinite(inside).all(axis=0)
            reason = _too_few(inside) if known.sum() < SHORTEST else ""
            figures = []
            if not reason:
                # gaps are bridged for the filter, and do not count
                filled = [np.interp(time[part], time[part][known], row[known]) for row in inside]
                measured, *models = low_pass(np.array(filled), observation.event.dt)
                figures = [window_errors(one[known], measured[known]) for one in models]
            for measure in ("ME", "MAE", "MXE"):
                values = [
                    abs(getattr(f, measure)) if measure == "MXE" else getattr(f, measure) for f in figures
                ]
                limit = getattr(own, measure) if name in _JUDGED else None
                yield _criterion(recording, name, measure, window.name, unit, values, limit, reason)


def _too_few(rows: _Array) -> str:
    """Why too few values can be compared of rows (3, l): measured, and both models."""
    for row, who in zip(rows[1:], ("as it was", "to use"), strict=True):
        if not np.isfinite(row).any() and np.isfinite(rows[0]).any():
            return f"the model {who} cannot be simulated here, or its current has no meaning without voltage"
    return f"{np.isfinite(rows[0]).sum()} values in this window, at least {SHORTEST} are needed"


def _step_criteria(
    observation: Observation, signals: Sequence[tuple[str, str, _Array, float]], limits: Limits
) -> Iterator[Criterion]:
    """Figures of a test with steps, of the signals that follow them."""
    event = observation.event
    assert isinstance(event, Playback)
    if event.kind not in ("step test", "open-circuit test"):
        return
    figures = ("reaction", "rise", "settling", "overshoot", "steady")
    units = {"overshoot": "parts of the step"}
    time = observation.time
    for name, unit, rows, noise in signals:
        reason, models, limits_of = "", [], dict.fromkeys(figures)
        known = np.isfinite(rows).all(axis=0)
        before = known & (time < event.start)
        if before.sum() < SHORTEST or (known & ~before).sum() < SHORTEST:
            reason = _too_few(rows)
        else:
            filled = [np.interp(time, time[known], row[known]) for row in rows]
            smooth = low_pass(np.array(filled), event.dt)
            measured, *models = (step_figures(time[known], row[known], event.start) for row in smooth)
            size = abs(measured.steady - float(smooth[0][before].mean()))
            if size < _STEP * noise:
                reason = "the signal does not follow the step"
            elif name in _JUDGED:
                least = _NOISE * noise / size
                limits_of = _step_limits(limits, measured, event.dt, least)
        for figure in figures:
            true = np.nan if reason else getattr(measured, figure)
            own = reason or ("" if np.isfinite(true) else "the measured response does not get that far")
            values = [] if own else [getattr(one, figure) - true for one in models]
            told = unit if figure == "steady" else units.get(figure, "s")
            yield _criterion(event.name, name, figure, "step", told, values, limits_of[figure], own)


def _step_limits(limits: Limits, measured: StepFigures, dt: float, least: float) -> dict[str, float | None]:
    """Largest differences of the figures of a step: parts of the measured ones, but not below what can be told: a time
    to one reading, an overshoot to the noise (`least`).
    """
    found: dict[str, float | None] = {"steady": limits.steady}
    for figure in ("reaction", "rise", "settling"):
        time = getattr(measured, figure)
        found[figure] = None if limits.times is None else max(limits.times * time, dt)
    found["overshoot"] = (
        None if limits.overshoot is None else max(limits.overshoot * measured.overshoot, least)
    )
    return found


def _recovery(
    observation: Observation, signals: Sequence[tuple[str, str, _Array, float]], limits: Limits
) -> Iterator[Criterion]:
    """Time until 90 % of the active power before a fault."""
    end, event = fault_end(observation), observation.event
    power = next((rows for name, _, rows, _ in signals if name == "P"), None)
    if end is None or power is None:
        return
    assert isinstance(event, Playback)
    level = event.initial["P"]
    reason, values, limit = "", [], None if limits.recovery is None else limits.recovery[1]
    if not level > 0.1:
        reason = "the unit hardly generated before the fault"
    else:
        measured, *models = (recovery_time(observation.time, row, level, end, DONE) for row in power)
        values = [one - measured for one in models]
        if not np.isfinite(measured):
            reason = "the measured power does not come back to 90 %"
        elif limits.recovery is not None:
            share, seconds = limits.recovery
            # a difference below one reading cannot be told
            limit = max(min(share * measured, seconds), event.dt)
    yield _criterion(event.name, "P", "recovery to 90 %", "after", "s", values, limit, reason)


def _swing(
    observation: Observation, signals: Sequence[tuple[str, str, _Array, float]], parts: Sequence[Window]
) -> Iterator[Criterion]:
    """Frequency and damping of the swings of the active power behind the event."""
    after = next((w for w in parts if w.name == "after"), None)
    power, noise = next(((rows, noise) for name, _, rows, noise in signals if name == "P"), (None, 0.0))
    if after is None or power is None:
        return
    part = (observation.time >= after.start) & np.isfinite(power).all(axis=0)
    reason = "no oscillation stands out"
    values: dict[str, list[float]] = {"frequency": [], "damping ratio": []}
    if part.sum() >= _LEAST_SWING and np.std(power[0, part]) > _STILL * noise:
        every = -(-int(part.sum()) // _POINTS)
        time, rows = observation.time[part][::every], power[:, part][:, ::every]
        found = [
            oscillation(time, row - row.mean(), most_damped=_MOST_DAMPED, order=_BACKGROUND) for row in rows
        ]
        if found[0][2] >= _SWINGS and found[0][1] < 0.99 * _MOST_DAMPED:
            reason = ""
            (frequency, damping, _), *models = found
            values["frequency"] = [one[0] - frequency for one in models]
            values["damping ratio"] = [one[1] - damping for one in models]
    for measure, unit in (("frequency", "Hz"), ("damping ratio", "")):
        yield _criterion(observation.event.name, "P", measure, "after", unit, values[measure], None, reason)


def _criterion(
    recording: str, signal: str, measure: str, window: str, unit: str, values: Sequence[float], limit: float | None,
    reason: str,
) -> Criterion:  # fmt: skip
    before, after = values if values and not reason else (np.nan, np.nan)
    if reason:
        outcome: Outcome = "not evaluated"
    elif limit is None:
        outcome = "no limit"
    elif not np.isfinite(after):
        outcome = "failed"  # it does not get that far where the plant does
    else:
        outcome = "passed" if abs(after) <= limit else "failed"
    bound = np.nan if limit is None else float(limit)
    return Criterion(
        recording, signal, measure, window, unit, float(before), float(after), bound, outcome, reason
    )
