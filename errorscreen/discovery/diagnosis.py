"""Result of a diagnosis: the verdict and all that it rests on, as it stands in ``result.json``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.typed import InMemory, Real
from errorscreen.calibration.result import Calibration, Estimate
from errorscreen.data.observations import Observation
from errorscreen.discovery.conclusions import probable
from errorscreen.discovery.judge.errors import ModelFit
from errorscreen.discovery.judge.gain import Gain
from errorscreen.discovery.judge.ranking import Cause, NamedEffect
from errorscreen.discovery.judge.residual_test import Cell
from errorscreen.discovery.judge.separation import Group
from errorscreen.discovery.judge.verdict import Verdict
from errorscreen.discovery.search.plan import StepReport
from errorscreen.discovery.unknown_input.locations import InputLocation
from errorscreen.exceptions import InputError
from errorscreen.simulators.base import Simulator

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

#: the models that a diagnosis compares: as it was, with calibrated parameters, and with the named effects
NOMINAL, PARAMETERS, EXTENDED = "nominal", "parameters only", "extended"

Responses = dict[str, tuple[NDArray[np.float64], ...]]


@dataclass(frozen=True)
class HypothesisFit:
    """One hypothesis that was fitted.

    Parameters
    ----------
    name : str
    chi2_per_sample : float
    p_value : float
        Probability that noise alone leaves a cell so conspicuous.
    evidence : float
        Logarithm of its evidence over that of parameters alone.
    """

    name: str
    chi2_per_sample: Real
    p_value: Real
    evidence: Real


@dataclass(frozen=True, repr=False)
class Diagnosis:
    """What a simulation gets wrong, and what explains it.

    Parameters
    ----------
    verdict : Verdict
        From the fitted recordings.
    causes : tuple of Cause
        The most probable first.
    groups : tuple of Group
        Explanations, or locations of an unknown input, that the recordings cannot tell apart.
    input_locations : tuple of InputLocation
        Where an unknown input would explain the error, the most probable first; empty unless the verdict is unknown.
    cells : tuple of Cell
        Error beyond noise that calibrated parameters leave, the most conspicuous first, at most twelve.
    tried : tuple of str
        Effects that were tried; empty where nothing was to be explained.
    hypotheses : tuple of HypothesisFit
        By falling evidence.
    extension : tuple of NamedEffect
        Effects that the model is extended by.
    parameters : tuple of Estimate
        All parameters of the extended model, fitted together, with 90 % intervals.
    calibration : Calibration
        Fit of all parameters without effects.
    models : tuple of ModelFit
        Errors of the nominal model, of the one with calibrated parameters and, if effects were named, of the extended.
    step, base_step : float
        Longest integration step in s of the extended model, and of the fit without effects; NaN if it has none.
    n_simulations : int
    seconds : float
    plan : tuple of StepReport
        What each step of the search cost and gained.
    confirmed : Verdict or None
        Verdict after held-out recordings have been judged; None without any.
    gain : Gain or None
        Gain of the named effects on held-out recordings.
    observations : tuple of Observation
        Fitted ones, then held-out ones; in memory only.
    responses : dict of str to tuple of ndarray of shape (R, L)
        Of the models "nominal", "parameters only" and "extended" to each observation; in memory only.
    calibrated, extended : Simulator or None
        With calibrated parameters, and with the extension; in memory only.
    """

    verdict: Verdict
    causes: tuple[Cause, ...]
    groups: tuple[Group, ...]
    input_locations: tuple[InputLocation, ...]
    cells: tuple[Cell, ...]
    tried: tuple[str, ...]
    hypotheses: tuple[HypothesisFit, ...]
    extension: tuple[NamedEffect, ...]
    parameters: tuple[Estimate, ...]
    calibration: Calibration
    models: tuple[ModelFit, ...]
    step: Real
    base_step: Real
    n_simulations: int
    seconds: Real
    plan: tuple[StepReport, ...] = ()
    confirmed: Verdict | None = None
    gain: Gain | None = None
    observations: InMemory[tuple[Observation, ...]] = ()
    responses: InMemory[Responses] = field(default_factory=dict)
    calibrated: InMemory[Simulator | None] = None
    extended: InMemory[Simulator | None] = None

    @property
    def final(self) -> Verdict:
        """The verdict to report: the confirmed one where there are held-out recordings."""
        return self.confirmed or self.verdict

    @property
    def named(self) -> Cause:
        """The cause that the model is extended by, or the most probable one."""
        return next((c for c in self.causes if c.effects and c.effects == self.extension), self.causes[0])

    @property
    def refuted(self) -> bool:
        """Whether held-out recordings contradict the verdict."""
        return self.confirmed is not None and self.confirmed.kind not in (self.verdict.kind, "nearest")

    def model(self, label: str) -> ModelFit | None:
        """Errors of one model; None if there is no such model."""
        return next((model for model in self.models if model.label == label), None)

    def summary(self) -> str:
        """Verdict, causes and errors as text."""
        lines = [f"{self.final.kind}: {self.final.text}"]
        for cause in self.causes:
            if cause.probability >= 0.001 or cause.withdrawn:
                place = f" at {cause.place}" if cause.place else ""
                gone = ", withdrawn" if cause.withdrawn else ""
                lines.append(f"  {probable(cause.probability):>6}  {cause.title}{place}{gone}")
                lines += [
                    f"          {p.name} = {p.value:.4g} {p.unit} [{p.low:.4g}, {p.high:.4g}]"
                    for p in cause.parameters
                ]
        if self.gain is not None:
            low, high = self.gain.interval
            lines.append(
                f"Gain on held-out recordings: {100 * self.gain.gain:.0f} % of the squared error "
                f"[{100 * low:.0f}, {100 * high:.0f}]"
            )
        lines.append("χ²/N of each channel: " + ", ".join(model.label for model in self.models))
        for fit in self.models[0].channels:
            found = (model.channel(fit.recording, fit.channel) for model in self.models)
            values = ", ".join(f"{one.chi2_per_sample:.3g}" for one in found if one is not None)
            lines.append(f"  {fit.recording}, {fit.channel}: {values}")
        return "\n".join(lines)

    def plot(self, recording: int = 0) -> Figure:
        """Measured against simulated channels of one recording, by each model.

        Parameters
        ----------
        recording : int
            Number of the recording in `observations`.

        Raises
        ------
        InputError
            If the diagnosis was read from a file, which holds no recordings.
        """
        from errorscreen.plotting import plot_responses

        if not self.observations:
            raise InputError(
                "recordings and responses are not in a result that was read from a file",
                where="Diagnosis.plot",
                remedy="Open report.html, or call diagnose again",
            )
        responses = {label: every[recording] for label, every in self.responses.items()}
        return plot_responses(self.observations[recording], responses)

    def to_frame(self) -> pd.DataFrame:
        """Table of the causes, the most probable first."""
        import pandas as pd

        columns = ("name", "title", "kind", "place", "probability", "explained", "exact", "withdrawn")
        return pd.DataFrame([{name: getattr(c, name) for name in columns} for c in self.causes]).set_index(
            "name"
        )

    def __repr__(self) -> str:
        first = self.causes[0]
        return f"<Diagnosis: {self.final.kind}, {first.title} ({probable(first.probability)})>"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>{self.to_frame().to_html()}"


def simulated(model: Simulator, observations: Sequence[Observation]) -> tuple[NDArray[Any], ...]:
    """Responses (R, L) of a model at its nominal values to each recording; NaN where it fails."""
    return tuple(model.simulate(model.parameters.nominal, o.event).values[0] for o in observations)
