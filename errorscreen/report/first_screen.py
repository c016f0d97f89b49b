"""What the first screen of the report says: the answer, how sure it is, and the errors before and after."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from errorscreen.calibration.result import Estimate
from errorscreen.discovery import ModelFit
from errorscreen.discovery.conclusions import acting_text, probable
from errorscreen.discovery.diagnosis import EXTENDED
from errorscreen.report.result import Result, Role

#: values that are told in a sentence; the others stand in a table
_TOLD = 4
#: units of powers beside pu
_POWERS = {"P": "MW", "Q": "Mvar", "Pm": "MW"}


@dataclass(frozen=True)
class ErrorRow:
    """Rms error of one channel of one recording.

    Parameters
    ----------
    recording : str
    role : {"fit", "together", "held_out"}
    channel, unit : str
    before, after : float
        In `unit`, of the model as it was and of the one to use; NaN where there is none.
    power : str
        ``"MW"`` or ``"Mvar"``; empty for a channel that is no power.
    base : float
        1 pu in that unit.
    """

    recording: str
    role: Role
    channel: str
    unit: str
    before: float
    after: float
    power: str
    base: float


def statement(result: Result) -> str:
    """The answer in one or two sentences."""
    found = result.diagnosis
    kind, first = found.final.kind, found.named
    told = all(effect.read for effect in first.effects)
    values = (
        "" if told or not first.parameters else f" Its values: {_values(first.parameters, nominal=False)}"
    )
    if kind == "within-noise":
        return "The model reproduces the recording within its noise. Nothing has to change."
    if kind == "parameters":
        changed = _changed(result)
        if not changed:
            return "Parameter values within their bounds explain the error. No single one of them stands out."
        return f"Wrong parameter values explain the error: {_values(changed)}"
    if kind == "measurement":
        return f"The measurement is wrong, not the model: {_lower(first.title)}.{values}"
    if kind == "effect" and first.event:
        return f"Something happened during this recording: {_lower(first.title)}.{values} The model does not lack it."
    if kind == "effect":
        return f"{first.title}.{values}{_beside(result)}"
    if kind == "nearest":
        return f"The model lacks a mechanism. The nearest of the library: {_lower(first.title)}.{values}"
    if found.input_locations:
        one = found.input_locations[0]
        return f"The cause is unknown. It enters at {one.place} of the {one.device}: {one.text}."
    return "The cause is unknown."


def certainty(result: Result) -> str:
    """How sure the answer is, and what it was confirmed by."""
    found = result.diagnosis
    first = found.named
    text = ""
    if found.final.kind not in ("within-noise", "unknown"):
        tried = f", with {len(found.tried)} effects tried" if found.tried else ""
        text = f"Probability {probable(first.probability)}{tried}. "
    gain = found.gain
    held_out = [one for one in result.recordings if one.role == "held_out"]
    events = f"{len(held_out)} recordings that were" if len(held_out) > 1 else "one recording that was"
    if found.final.kind == "unknown":
        return f"What the search told first did not hold on {events} not fitted." if found.refuted else ""
    if not held_out:
        return f"{text}No recording was held out, so nothing confirms it on another event."
    if gain is not None and math.isfinite(gain.gain) and not first.event:
        low, high = gain.interval
        between = f" [{100 * low:.0f}, {100 * high:.0f}]" if math.isfinite(low) else ""
        removed = f"{100 * gain.gain:.0f} %{between}"
        text += f"On {events} not fitted, the extension removes {removed} of the squared error of a recalibrated model."
    elif found.confirmed is not None:
        many = len(held_out) > 1
        agrees = ("contradict{}" if found.refuted else "agree{} with").format("" if many else "s")
        text += f"{events[0].upper()}{events[1:]} not fitted {agrees} the answer."
    return text.strip()


def error_rows(result: Result) -> Iterator[ErrorRow]:
    """Errors of the model as it was, and of the extended or the calibrated one."""
    before, after = result.models[0], model_to_use(result)
    role = {one.name: one.role for one in result.recordings}
    for one in before.channels:
        other = after.channel(one.recording, one.channel) if after else None
        power = (
            _POWERS.get(one.channel, "") if one.unit == "pu" and math.isfinite(result.study.base_mva) else ""
        )
        yield ErrorRow(
            one.recording,
            role.get(one.recording, "fit"),
            one.channel,
            one.unit,
            one.rms,
            other.rms if other else math.nan,
            power,
            result.study.base_mva,
        )


def model_to_use(result: Result) -> ModelFit | None:
    """Errors of the extended model, or else of the calibrated one; None without any."""
    if result.diagnosis.extension:
        return result.diagnosis.model(EXTENDED)
    return result.models[1] if len(result.models) > 1 else None


def acting(result: Result) -> str:
    """From when to when the named effects act; empty where none is named."""
    found = result.diagnosis
    return acting_text(found.named.effects).strip() if found.extension else ""


def _beside(result: Result) -> str:
    """Numbers of the model file that are wrong beside a named effect."""
    correction = result.correction
    own = {p.name for p in result.diagnosis.named.parameters}
    changed = [] if correction is None else [p for p in correction.parameters if p.name not in own]
    return f" Wrong in the model file: {_values(changed)}" if changed else ""


def _changed(result: Result) -> Sequence[Estimate]:
    """Parameters that have to change: those of the corrected file, or those whose interval excludes nominal."""
    if result.correction is not None:
        return result.correction.parameters
    fitted = result.diagnosis.calibration.parameters
    away = [p for p in fitted if p.low > p.nominal or p.high < p.nominal]
    return sorted(away, key=lambda p: -abs(p.value - p.nominal) / max(p.high - p.low, 1e-300))


def _values(parameters: Sequence[Estimate], nominal: bool = True) -> str:
    """Values in words, the first ones, with those of the model as it was."""
    told = []
    for p in parameters[:_TOLD]:
        was = f" instead of {p.nominal:.3g}" if nominal and math.isfinite(p.nominal) else ""
        told.append(f"{p.name} {p.value:.3g}{f' {p.unit}' if p.unit else ''}{was}")
    more = len(parameters) - _TOLD
    return ", ".join(told) + (f", and {more} more" if more > 0 else "") + "."


def _lower(title: str) -> str:
    """A title inside a sentence: names and abbreviations keep their capitals."""
    second = title[1:2]
    return title[:1].lower() + title[1:] if second.islower() or second == " " else title
