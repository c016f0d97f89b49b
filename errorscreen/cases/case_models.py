"""Sections of a case file for recordings and for the stages of a study: keys, meaning, defaults."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from errorscreen.calibration import CALIBRATORS
from errorscreen.cases.model_sections import (
    EVENTS,
    EventSection,
    FaultSection,
    LineTripSection,
    LoadStepSection,
)
from errorscreen.cases.section import Count, NameIn, Positive, Section, each_once
from errorscreen.data import READERS, Column, read_recording
from errorscreen.data.recordings import Recording
from errorscreen.exceptions import InputError
from errorscreen.screening import SCREENERS

#: fewer cannot be divided into a training and a validation set
_LEAST_SAMPLES = 20


class ColumnSection(Section):
    """Source of a channel and meaning of its numbers, see `errorscreen.data.Column`."""

    column: str | None = Field(default=None, description="header of the column")
    unit: str | None = Field(default=None, description="unit of its numbers; pu, rad or Hz if not given")
    base: Positive | None = Field(
        default=None, description="value of 1 pu: MVA for P and Q, kV line to line for V"
    )
    sign: Literal["generator", "load"] = Field(
        default="generator", description="P and Q: positive when generated, or when consumed"
    )
    scale: float = Field(default=1.0, description="factor on the numbers in the file")
    per_phase: bool = Field(default=False, description="P and Q: one of three equal phases")
    line_neutral: bool = Field(default=False, description="V: measured from line to neutral")
    real: str | None = Field(default=None, description="V: header of the real part, instead of column")
    imag: str | None = Field(default=None, description="V: header of the imaginary part")
    value: float | None = Field(default=None, description="stated pre-event value of an unmeasured channel")


class RecordingSection(Section):
    """A recorded disturbance."""

    path: str = Field(description="file, relative to the case file; csv: text with one header row")
    format: Annotated[str, NameIn(READERS)] | None = Field(
        default=None, description="format of the file; recognised by its content if not given"
    )
    name: str | None = Field(default=None, description="for tables and plots; the file's name if not given")
    base_mva: Positive = Field(
        description="base of the device or grid in MVA, which P and Q are converted to"
    )
    base_kv: Positive | None = Field(default=None, description="base voltage in kV, line to line")
    f_nominal: Positive = Field(description="nominal frequency in Hz")
    columns: dict[str, ColumnSection] = Field(
        min_length=1, description="source of each channel: V, angle, f, P, Q, or a name of your own"
    )
    time: str = Field(default="time", description="header of the time stamps")
    time_unit: Literal["s", "ms", "us", "min", "h", "iso"] = Field(
        default="s", description="unit of the time stamps"
    )
    event_time: float | None = Field(
        default=None, description="start of the event in s; detected if not given"
    )
    t_start: float | None = Field(default=None, description="first instant of the file that is used, in s")
    t_end: float | None = Field(default=None, description="last instant of the file that is used, in s")
    shift: dict[str, float] = Field(default={}, description="seconds added to the time stamps of a channel")
    noise: dict[str, Positive] = Field(default={}, description="known noise of a channel, in pu, rad or Hz")
    held: Literal["drop", "keep"] = Field(default="drop", description="stale repeats of a slow meter")
    on_backward: Literal["error", "sort", "drop"] = Field(
        default="error", description="where time runs backwards"
    )
    max_missing: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.4, description="largest part of a channel that may be missing"
    )
    missing: list[str] = Field(default=[], description="further texts that mark a gap")
    delimiter: str | None = Field(default=None, description="between fields; recognised if not given")
    decimal: Literal[".", ","] = Field(default=".", description="decimal mark")
    encoding: str = Field(default="utf-8-sig", description="of the file")
    skip_rows: Annotated[int, Field(ge=0)] = Field(default=0, description="lines above the header")
    load_level: Positive = Field(
        default=1.0, description="grid: factor on all loads and generators before the event"
    )
    fault: FaultSection | None = Field(default=None, description="grid: the event")
    line_trip: LineTripSection | None = Field(default=None, description="grid: the event")
    load_step: LoadStepSection | None = Field(default=None, description="grid: the event")

    @model_validator(mode="after")
    def _some_window(self) -> RecordingSection:
        if self.t_start is not None and self.t_end is not None and self.t_start >= self.t_end:
            raise InputError(
                f"the window from {self.t_start:g} to {self.t_end:g} s is empty", allowed="t_start < t_end"
            )
        return self

    @property
    def events(self) -> dict[str, EventSection]:
        """Events in the grid by key; a recording of a grid needs exactly one."""
        found = {key: getattr(self, key) for key in EVENTS}
        return {key: section for key, section in found.items() if section is not None}

    def load(self, folder: Path, dt: float | None = None) -> Recording:
        """Read the window of the file and apply the shift, which resamples to `dt` seconds."""
        direct = {"path", "format", "columns", "shift", *EVENTS, "load_level"}
        columns = {role: Column(**dict(section)) for role, section in self.columns.items()}
        options = {key: value for key, value in self if key not in direct}
        recording = read_recording(folder / self.path, columns, self.format, **options)
        return recording.resample(dt, shift=self.shift) if self.shift else recording


class SimulationSection(Section):
    """How the model is integrated."""

    step: Positive = Field(default=0.0025, description="longest integration step in s")
    dt: Positive | None = Field(
        default=None,
        description="step in s at which signals are compared; that of the recording if not given",
    )


class ScreeningSection(Section):
    """How the parameters that carry the error are found."""

    methods: Annotated[list[Annotated[str, NameIn(SCREENERS)]], AfterValidator(each_once)] = Field(
        default=["cnn", "sensitivity", "random"],
        min_length=1,
        description="screeners; `pso` calibrates the selection of each",
    )
    samples: Annotated[int, Field(ge=_LEAST_SAMPLES)] = Field(
        default=600,
        description="cnn: labelled errors it learns from; each costs a simulation for every parameter and one more",
    )
    epochs: Count = Field(default=60, description="cnn: most passes over them")
    frequencies: Annotated[int, Field(ge=8)] = Field(
        default=16, description="cnn: height of the time-frequency images"
    )
    columns: Annotated[int, Field(ge=8)] = Field(default=32, description="cnn: width of the images")
    top_k: Count | None = Field(default=None, description="how many parameters are selected")
    threshold: Annotated[float, Field(gt=0, le=1)] | None = Field(
        default=None,
        description="or those above this part of the largest contribution; 0.1 if neither is given",
    )

    @model_validator(mode="after")
    def _one_rule(self) -> ScreeningSection:
        if self.top_k is not None and self.threshold is not None:
            raise InputError("top_k and threshold are both given", allowed="one of them")
        return self


class CalibrationSection(Section):
    """How the selected parameters are fitted."""

    methods: Annotated[list[Annotated[str, NameIn(CALIBRATORS)]], AfterValidator(each_once)] = Field(
        default=["map", "pso"], min_length=1, description="calibrators; the diagnosis shows the first one"
    )
    prior_scale: Positive = Field(default=0.3, description="map: relative standard deviation of the prior")
    starts: Count = Field(default=8, description="map: number of starts")
    library: Count = Field(default=2048, description="map: simulations from which the starts are taken")
    level: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.9, description="map: probability of the intervals"
    )
    particles: Annotated[int, Field(ge=2)] = Field(default=30, description="pso: number of particles")
    iterations: Count = Field(default=80, description="pso: number of iterations")
    inertia: Positive = Field(default=0.7298, description="pso: inertia weight")
    cognitive: Positive = Field(
        default=1.4962, description="pso: learning factor towards a particle's own best"
    )
    social: Positive = Field(default=1.4962, description="pso: learning factor towards the best of all")

    @model_validator(mode="after")
    def _enough_simulations(self) -> CalibrationSection:
        if self.library < self.starts - 1:
            raise InputError(
                f"{self.starts} starts cannot be taken from a library of {self.library}",
                allowed="library >= starts - 1",
            )
        return self


class DiscoverySection(Section):
    """How causes other than parameters are searched."""

    enabled: bool = Field(default=True, description="whether they are searched")
    effects: Annotated[list[str], Field(min_length=1), AfterValidator(each_once)] | None = Field(
        default=None, description="effects to try; all of the library if not given"
    )
    max_effects: Annotated[int, Field(ge=1, le=3)] = Field(
        default=2, description="largest number of effects that are named together"
    )
    fits: Count = Field(default=6, description="effects whose joint fit goes on to the end")
    draws: Annotated[int, Field(ge=8)] = Field(
        default=128, description="draws of an effect's parameters in each round of its signature"
    )
    starts: Count = Field(default=4, description="starts of the fit without effects")
    significance: Annotated[float, Field(ge=0.001, lt=1)] = Field(
        default=0.002,
        description="the remainder counts as more than noise below this probability; the test resolves 0.001",
    )
    step: Positive | None = Field(
        default=None,
        description="longest integration step of the search in s, a quarter of it for fits near the noise; if not "
        "given that of the simulation, for a grid twice as much up to 0.005",
    )
    first_look: int = Field(
        default=0,
        description="samples of a network that ranks parameters and effects before the search, at least 20; 0: none",
    )

    @model_validator(mode="after")
    def _none_or_enough(self) -> DiscoverySection:
        if 0 != self.first_look < _LEAST_SAMPLES:
            raise InputError(
                f"first_look is {self.first_look}",
                allowed=f"0 for none, or a whole number >= {_LEAST_SAMPLES}",
            )
        return self


class RunSection(Section):
    """How the computation is run."""

    random_state: Annotated[int, Field(ge=0)] = Field(default=0, description="seed of all random numbers")
    n_jobs: int = Field(
        default=1, description="processes that simulate for the network; -1 for one on each core"
    )
    out: str | None = Field(
        default=None,
        description="folder for results, relative to the case file; `errorscreen diagnose` writes to diagnose in it",
    )

    @model_validator(mode="after")
    def _some_job(self) -> RunSection:
        if self.n_jobs == 0:
            raise InputError("n_jobs is 0", allowed="a number of processes, or -1")
        return self
