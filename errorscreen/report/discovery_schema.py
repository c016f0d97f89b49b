"""What ``result.json`` tells about causes: explanations, groups, gain, places and what was fitted."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from errorscreen.report.parts import Fit, Number, ParameterResult, Part, Role


class CauseParameter(Part):
    """One fitted parameter of an effect."""

    name: str
    unit: str = ""
    description: str = ""
    value: Number
    low: Number = Field(description="lower end of the 90 % interval; null at a bound, where none is known")
    high: Number = Field(description="and upper end")
    at_bound: bool = Field(default=False, description="whether the search was stopped by a bound there")


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
    withdrawn: bool = Field(
        default=False,
        description="true: named by the search, but not confirmed by recordings that were not fitted",
    )
    event: bool = Field(
        default=False,
        description="true: about what happened during one recording, and not about the model; off in other recordings",
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


class StateDifference(Part):
    """How far explanations differ inside a device, where nothing was recorded."""

    device: str
    state: str
    share: Number = Field(description="rms difference over the range of the state")


class Group(Part):
    """Explanations, or places of an unknown signal, that the recordings cannot tell apart."""

    names: list[str]
    separating: list[Separation] = Field(default=[], description="other events that would, the best first")
    states: list[StateDifference] = Field(
        default=[], description="other quantities to record that would, the best first"
    )


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
    placebo: Number = Field(description="gain of a wrong effect, null if none was fitted")
    extension_parameters: int = Field(default=0, description="number of parameters of the extension")
    placebo_parameters: int = Field(default=0, description="and of the wrong effect")
    events: list[EventGain]


class InputLocation(Part):
    """A port at which an unknown signal would explain the recording."""

    device: str
    place: str
    probability: Number
    chi2_per_sample: Number = Field(description="with the signal and detail that is finer than its knots")
    follows: list[tuple[str, Number]] = Field(description="quantities it moves with, and the correlation")
    explained: Number = Field(
        default=None,
        description="share of what parameters leave beyond noise that the signal explains, without that detail, 0 to 1",
    )
    unit: str = Field(default="", description="of the signal")
    time: list[Number] = Field(default=[], description="s, at most 200 instants of the first recording")
    waveform: list[Number] = Field(default=[], description="the signal there")


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


class ExtensionFit(Part):
    """How well a channel is reproduced by models that the search fitted, to the same recordings."""

    recording: str
    role: Role
    channel: str
    unit: str
    parameters: Fit = Field(description="with calibrated parameters alone")
    extended: Fit | None = Field(default=None, description="with what was named; null if nothing was")


class Extension(Part):
    """An effect that the model is extended by."""

    name: str
    recording: str = Field(default="", description="the only one in which it acts; empty for all")


class Discovery(Part):
    """Search for what the model lacks."""

    tried: list[str] = Field(default=[], description="effects; empty if there was nothing to explain")
    hypotheses: list[HypothesisFit]
    extension: list[Extension] = Field(
        default=[], description="effects of the extended model in their order; empty if none was named"
    )
    parameters: list[ParameterResult] = Field(
        default=[],
        description="values of all parameters of the extended model, fitted together: those of the model, then those "
        "of the effects; 90 % intervals, null at a bound. Without an effect those of parameters alone",
    )
    step: Number = Field(default=None, description="longest integration step of the extended model, in s")
    fits: list[ExtensionFit] = []
    cells: list[RemainingCell] = Field(description="what parameters alone leave beyond noise")
    places: list[InputLocation] = []
    first_look: list[Contribution] = Field(
        default=[], description="the largest first; empty if not asked for"
    )
    first_look_compared: str = Field(
        default="", description="where the first look ranks what the search names; empty without one"
    )
    advice: list[str] = Field(default=[], description="what to measure next")
    n_simulations: int
    seconds: Number
