"""Sections of a case file for recordings and for the stages of a study: keys, meaning, defaults."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from errorscreen.calibration import CALIBRATORS
from errorscreen.cases.model_sections import (
    EVENTS,
    EventSection,
    FaultSection,
    LineTripSection,
    LoadStepSection,
    StepSection,
)
from errorscreen.cases.section import Count, NameIn, Positive, Section, each_once, setting
from errorscreen.data import READERS, Column, read_recording
from errorscreen.data.recordings import Recording
from errorscreen.events import SetPointStep
from errorscreen.exceptions import InputError
from errorscreen.screening import SCREENERS

#: fewer cannot be divided into a training and a validation set
_LEAST_SAMPLES = 20


def _as_text(found: Any) -> Any:
    """A date of the TOML format as text."""
    return found.isoformat() if isinstance(found, datetime) else found


#: an instant in seconds, or as a date
Instant = Annotated[float | str | None, BeforeValidator(_as_text)]


class ColumnSection(Section):
    """Source of a channel and meaning of its numbers, see `errorscreen.data.Column`."""

    column: str | None = setting(None, "header of the column")
    unit: str | None = setting(None, "unit of its numbers; pu, rad or Hz if not given")
    base: Positive | None = setting(None, "value of 1 pu: MVA for P and Q, kV line to line for V")
    sign: Literal["generator", "load"] = setting(
        "generator", "P and Q: positive when generated, or when consumed"
    )
    scale: float = setting(1.0, "factor on the numbers in the file")
    per_phase: bool = setting(False, "P and Q: one of three equal phases")
    line_neutral: bool = setting(False, "V: measured from line to neutral")
    real: str | None = setting(None, "V: header of the real part, instead of column")
    imag: str | None = setting(None, "V: header of the imaginary part")
    value: float | None = setting(None, "stated pre-event value of an unmeasured channel")


class WaveformsSection(Section):
    """Sampled voltages and currents of three phases, from which V, angle, f, P and Q follow."""

    voltage: list[str] = setting(..., "headers of the three voltages", min_length=3, max_length=3)
    current: list[str] = setting([], "headers of the three currents", max_length=3)
    sign: Literal["generator", "load"] = setting(
        "generator", "currents are positive out of the plant, or into it"
    )
    line_to_line: bool = setting(False, "voltages between phases: ab, bc, ca")
    method: Literal["cycle", "P", "M"] = setting(
        "cycle", "window: one period, or the filter of class P or M of IEEE C37.118"
    )
    rate: Positive | None = setting(None, "phasors in one second; two in each period if not given")
    voltage_unit: Literal["V", "kV", "pu"] | None = setting(
        None, "that of the file if not given; 1 pu is the peak value of base_kv"
    )
    current_unit: Literal["A", "kA", "pu"] | None = setting(
        None, "that of the file if not given; 1 pu is the peak value of the current of base_mva and base_kv"
    )


#: header of a column with texts such as 230.1+12.3j, or two headers
_Phasor = str | Annotated[list[str], Field(min_length=2, max_length=2)]


class PhasorsSection(Section):
    """Rms phasors of three phases, or of the positive sequence, from which V, angle, f, P and Q follow."""

    voltage: list[_Phasor] = setting(
        ...,
        "three phasors from line to neutral, or that of the positive sequence; each is two headers, or that of a "
        "column with texts such as `230.1+12.3j` or `230.1@12.5`",
        min_length=1,
        max_length=3,
    )
    current: list[_Phasor] = setting([], "as many phasors", max_length=3)
    form: Literal["polar", "rectangular"] = setting(
        "polar", "the two columns: magnitude and angle, or real and imaginary part"
    )
    angle_unit: Literal["deg", "rad"] | None = setting(None, "that of the file if not given")
    magnitude: Literal["rms", "peak"] = setting("rms", "of all phasors")
    sign: Literal["generator", "load"] = setting(
        "generator", "currents are positive out of the plant, or into it"
    )
    line_to_line: bool = setting(
        False, "voltages between phases: ab, bc, ca; or √3 times the positive sequence"
    )
    voltage_unit: Literal["V", "kV", "pu"] | None = setting(
        None, "that of the file if not given; pu of base_kv"
    )
    current_unit: Literal["A", "kA", "pu"] | None = setting(
        None, "that of the file if not given; pu of base_mva and base_kv"
    )


class QualitySection(Section):
    """Status of the rows of a file."""

    column: str = setting(..., "header of the column with the status")
    good: list[str] = setting(..., "its texts in rows that hold readings", min_length=1)


class LongSection(Section):
    """Columns of a file with one reading in each row."""

    tag: str = setting(..., "header of the column with the tags, which `columns` then names")
    value: str = setting(..., "header of the column with the readings")


def _listed(found: Any) -> Any:
    """A single table as a list of one."""
    return [found] if isinstance(found, dict) else found


def _headed(found: Any) -> Any:
    """A bare header as the table of a column."""
    return {"column": found} if isinstance(found, str) else found


class RecordingSection(Section):
    """A recorded disturbance."""

    path: str = setting(..., "file, relative to the case file; csv: text of columns")
    format: Annotated[str, NameIn(READERS)] | None = setting(
        None, "format of the file; recognised by its content if not given"
    )
    name: str | None = setting(None, "for tables and plots; the file's name if not given")
    base_mva: Positive = setting(..., "base of the device or grid in MVA, which P and Q are converted to")
    base_kv: Positive | None = setting(None, "base voltage in kV, line to line")
    f_nominal: Positive = setting(..., "nominal frequency in Hz")
    columns: dict[str, Annotated[ColumnSection, BeforeValidator(_headed)]] = setting(
        {}, "source of each channel: V, angle, f, P, Q, or a name of your own; a header, or a table"
    )
    waveforms: WaveformsSection | None = setting(None, "sampled three-phase voltages and currents")
    phasors: PhasorsSection | None = setting(None, "rms phasors of a phasor measurement unit")
    time: str | Annotated[list[str], Field(min_length=2, max_length=2)] = setting(
        "time", "header of the time stamps; two headers: whole seconds and fractions, or date and time of day"
    )
    time_unit: Literal["s", "ms", "us", "ns", "ticks", "min", "h", "d", "iso"] | None = setting(
        None, "unit of the time stamps, iso for dates; that in the file, or s, if not given"
    )
    time_format: str | None = setting(None, "of time stamps that are texts, as `%d.%m.%Y %H:%M:%S.%f`")
    time_base: Positive | None = setting(None, "fractions in one second, in the second column of time")
    event_time: Instant = setting(None, "start of the event in s, or as a date; detected if not given")
    t_start: Instant = setting(None, "first instant of the file that is used, in s or as a date")
    t_end: Instant = setting(None, "last instant of the file that is used, in s or as a date")
    shift: dict[str, float] = setting({}, "seconds added to the time stamps of a channel")
    noise: dict[str, Positive] = setting({}, "known noise of a channel, in pu, rad or Hz")
    level: dict[str, float] = setting(
        {}, "values before the event, in pu, rad or Hz, of a recording that begins in it: V, P, Q, perhaps f"
    )
    held: Literal["drop", "keep"] = setting("drop", "stale repeats of a slow meter")
    on_backward: Literal["error", "sort", "drop"] = setting("error", "where time runs backwards")
    on_duplicate: Literal["mean", "last", "keep-step"] = setting(
        "mean", "different readings at one instant: their mean, the last, or the first and the last as a step"
    )
    max_missing: float = setting(0.4, "largest part of a channel that may be missing", ge=0, le=1)
    missing: list[str | float] = setting([], "further texts and numbers that mark a gap")
    quality: QualitySection | None = setting(
        None, "rows that hold no readings, by a column with their status"
    )
    delimiter: str | None = setting(None, "between fields, or `whitespace`; recognised if not given")
    decimal: Literal[".", ","] = setting(".", "decimal mark")
    encoding: str = setting("utf-8-sig", "of the file")
    skip_rows: int = setting(0, "lines above the header", ge=0)
    header_rows: Count = setting(1, "rows of the header, whose cells are joined by `|`")
    header: list[str] | None = setting(None, "names of the columns of a file without headers")
    sheet: str | None = setting(None, "of a workbook; the first one if not given")
    long: LongSection | None = setting(None, "of a file with a tag, a time and a value in each row")
    load_level: Positive = setting(1.0, "grid: factor on all loads and generators before the event")
    fault: FaultSection | None = setting(None, "grid: the event")
    line_trip: LineTripSection | None = setting(None, "grid: the event")
    load_step: LoadStepSection | None = setting(None, "grid: the event")
    step: Annotated[list[StepSection], BeforeValidator(_listed)] = setting([], "device: steps of set-points")

    @model_validator(mode="after")
    def _some_window(self) -> RecordingSection:
        if isinstance(self.t_start, float) and isinstance(self.t_end, float) and self.t_start >= self.t_end:
            raise InputError(
                f"the window from {self.t_start:g} to {self.t_end:g} s is empty", allowed="t_start < t_end"
            )
        return self

    @model_validator(mode="after")
    def _steps_in_event(self) -> RecordingSection:
        first = self.steps[0] if self.step else None
        if first is not None and isinstance(self.event_time, float) and first.time < self.event_time:
            raise InputError(
                f"{first.quantity} steps at {first.time:g} s, but event_time is {self.event_time:g} s",
                allowed="the event begins at the first step, or before",
                remedy="Leave event_time out, or correct it: before it, the unit rests",
            )
        return self

    @property
    def steps(self) -> tuple[SetPointStep, ...]:
        """Steps of set-points, the first one first."""
        return tuple(sorted((section.step for section in self.step), key=lambda step: step.time))

    @property
    def events(self) -> dict[str, EventSection]:
        """Events in the grid by key; a recording of a grid needs exactly one."""
        found = {key: getattr(self, key) for key in EVENTS}
        return {key: section for key, section in found.items() if section is not None}

    def load(self, folder: Path, dt: float | None = None) -> Recording:
        """Read the window of the file and apply the shift, which resamples to `dt` seconds.

        Without an event time and a stated level, the event begins at the first step of a set-point.
        """
        direct = {"path", "format", "columns", "shift", "step", *EVENTS, "load_level"}
        columns = {role: Column(**dict(section)) for role, section in self.columns.items()}
        options = {key: value for key, value in self if key in self.model_fields_set - direct}
        for key in options.keys() & {"quality", "waveforms", "phasors", "long"}:
            options[key] = {k: v for k, v in options[key] if v is not None}
        if self.steps and self.event_time is None and not self.level:
            options["event_time"] = self.steps[0].time
        recording = read_recording(folder / self.path, columns or None, self.format, **options)
        recording = replace(recording, steps=self.steps)
        return recording.resample(dt, shift=self.shift) if self.shift else recording


class SimulationSection(Section):
    """How the model is integrated and compared."""

    step: Positive = setting(0.0025, "longest integration step in s")
    dt: Positive | None = setting(
        None,
        "s between compared instants; if not given, that of the recording, or near a quarter period",
    )
    model_error: dict[str, Positive] = setting(
        {},
        "standard deviation of a slow error of the model that is allowed, by channel and in its unit; it counts as "
        "uncertainty",
    )
    model_error_time: Positive = setting(1.0, "s within which that error changes")


class ScreeningSection(Section):
    """How the parameters that carry the error are found."""

    methods: Annotated[list[Annotated[str, NameIn(SCREENERS)]], AfterValidator(each_once)] = setting(
        ["cnn", "sensitivity", "random"], "screeners; `pso` calibrates the selection of each", min_length=1
    )
    samples: int = setting(
        600,
        "cnn: labelled errors it learns from; each costs a simulation for every parameter and one more",
        ge=_LEAST_SAMPLES,
    )
    epochs: Count = setting(60, "cnn: most passes over them")
    frequencies: int = setting(16, "cnn: height of the time-frequency images", ge=8)
    columns: int = setting(32, "cnn: width of the images", ge=8)
    top_k: Count | None = setting(None, "how many parameters are selected")
    threshold: Annotated[float, Field(gt=0, le=1)] | None = setting(
        None, "or those above this part of the largest contribution; 0.1 if neither is given"
    )

    @model_validator(mode="after")
    def _one_rule(self) -> ScreeningSection:
        if self.top_k is not None and self.threshold is not None:
            raise InputError("top_k and threshold are both given", allowed="one of them")
        return self


class CalibrationSection(Section):
    """How the selected parameters are fitted."""

    methods: Annotated[list[Annotated[str, NameIn(CALIBRATORS)]], AfterValidator(each_once)] = setting(
        ["map", "pso"], "calibrators; the diagnosis shows the first one", min_length=1
    )
    prior_scale: Positive = setting(0.3, "map: relative standard deviation of the prior")
    starts: Count = setting(4, "starts of the fit of all parameters")
    library: Count = setting(2048, "simulations from which these starts are taken")
    level: float = setting(0.9, "probability of the intervals", gt=0, lt=1)
    particles: int = setting(30, "pso: number of particles", ge=2)
    iterations: Count = setting(80, "pso: number of iterations")
    inertia: Positive = setting(0.7298, "pso: inertia weight")
    cognitive: Positive = setting(1.4962, "pso: learning factor towards a particle's own best")
    social: Positive = setting(1.4962, "pso: learning factor towards the best of all")

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

    enabled: bool = setting(True, "whether they are searched")
    effects: Annotated[list[str], Field(min_length=1), AfterValidator(each_once)] | None = setting(
        None, "effects to try; all of the library if not given"
    )
    max_effects: int | None = setting(
        None,
        "largest number of effects that are named together; 3 for a machine of a DYR file, else 2",
        ge=1,
        le=3,
    )
    fits: Count = setting(6, "effects whose joint fit goes on to the end")
    draws: int = setting(128, "draws of an effect's parameters in each round of its signature", ge=8)
    significance: float = setting(
        0.002,
        "residuals count as more than noise below this probability; the test resolves 0.001",
        ge=0.001,
        lt=1,
    )
    step: Positive | None = setting(
        None,
        "longest integration step of the search in s, a quarter of it for fits near the noise; if not given "
        "that of the simulation, for a grid twice as much up to 0.005",
    )
    first_look: int = setting(
        0, "samples of a network that ranks parameters and effects before the search, at least 20; 0: none"
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

    random_state: int = setting(0, "seed of all random numbers", ge=0)
    n_jobs: int = setting(1, "processes that simulate for the network; -1 for one on each core")
    out: str | None = setting(
        None, "folder for results, relative to the case file; `errorscreen diagnose` writes to diagnose in it"
    )

    @model_validator(mode="after")
    def _some_job(self) -> RunSection:
        if self.n_jobs == 0:
            raise InputError("n_jobs is 0", allowed="a number of processes, or -1")
        return self
