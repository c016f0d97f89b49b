"""What ``result.json`` tells about causes: explanations, groups, gain, places and what was fitted."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from errorscreen.persistence import to_jsonable


def _finite(value: Any) -> Any:
    value = to_jsonable(value)  # NumPy numbers too
    return None if isinstance(value, float) and not math.isfinite(value) else value


#: A number, or null where there is none (a failed simulation, a channel that was not measured).
Number = Annotated[float | None, BeforeValidator(_finite)]


class Part(BaseModel):
    """Base of all parts: no unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class CauseParameter(Part):
    """One fitted parameter of an effect."""

    name: str
    unit: str = ""
    description: str = ""
    value: Number
    low: Number
    high: Number


class Cause(Part):
    """One explanation of what the simulation gets wrong."""

    name: str
    title: str
    kind: Literal["parameters", "effect", "measurement", "unknown"]
    place: str = Field(description="port or channel at which it acts")
    probability: Number
    explained: Number = Field(default=None, description="share of what parameters leave beyond noise, 0 to 1")
    exact: bool = Field(
        default=True, description="false: of this kind, but in another form than the library's"
    )
    parameters: list[CauseParameter] = []
    equation: str = ""
    explanation: str = ""
    confused_with: list[str] = []


class Separation(Part):
    """How far two explanations would differ in another event."""

    event: str
    channel: str
    distance: Number = Field(description="standard deviations of the noise, root of the sum of squares")


class Group(Part):
    """Explanations that the recordings cannot tell apart."""

    names: list[str]
    separating: list[Separation] = []


class EventGain(Part):
    """Rms error on one held-out event, in multiples of what is uncertain."""

    recording: str
    baseline: Number
    recalibrated: Number
    extended: Number


class Gain(Part):
    """What the extension gains on events that were not fitted, rms errors in multiples of what is uncertain."""

    baseline: Number = Field(description="of the model as it was")
    recalibrated: Number = Field(description="of the old model with calibrated parameters")
    extended: Number = Field(description="of the extended model")
    gain: Number = Field(
        description="part of the recalibrated model's squared error that the extension removes"
    )
    interval: list[Number]
    level: Number
    placebo: Number = Field(description="gain of a wrong effect, null if there is none")
    events: list[EventGain]


class Place(Part):
    """A port at which an unknown signal would explain the recording."""

    device: str
    place: str
    probability: Number
    chi2_per_sample: Number
    follows: list[tuple[str, Number]] = Field(description="quantities it moves with, and the correlation")


class RemainingCell(Part):
    """Error that parameters leave in one channel, stage and frequency band, beyond noise."""

    recording: str
    channel: str
    stage: str
    band: list[Number] = Field(description="Hz; null: no upper limit")
    ratio: Number = Field(description="energy over what noise alone has on average")
    p_value: Number


class HypothesisFit(Part):
    """One hypothesis that was fitted."""

    name: str
    chi2_per_sample: Number
    p_value: Number = Field(description="probability that noise alone leaves so conspicuous a remainder")
    evidence: Number = Field(description="logarithm of its evidence over that of parameters alone")


class Contribution(Part):
    """What a network reads off the error before any search."""

    name: str = Field(description="parameter or effect")
    kind: Literal["parameter", "effect"]
    value: Number = Field(description="contribution in the channels' unit times the root of a second")


class Discovery(Part):
    """Search for what the model lacks."""

    hypotheses: list[HypothesisFit]
    cells: list[RemainingCell] = Field(description="what parameters alone leave beyond noise")
    places: list[Place] = []
    first_look: list[Contribution] = Field(
        default=[], description="the largest first; empty if not asked for"
    )
    advice: list[str] = Field(default=[], description="what to measure next")
    n_simulations: int
    seconds: Number
