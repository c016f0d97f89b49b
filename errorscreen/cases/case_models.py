"""Sections of a case file: keys, meaning, defaults, allowed values."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from errorscreen.exceptions import InputError
from errorscreen.io import Column, read_csv
from errorscreen.parameters import Parameter, ParameterSpace
from errorscreen.recordings import Recording

Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]


class Section(BaseModel):
    """Base of all sections: no unknown keys, no silent conversion of types."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class ColumnSection(Section):
    """Where a channel comes from and what its numbers mean, see `errorscreen.io.Column`."""

    column: str | None = Field(default=None, description="header of the column")
    unit: str | None = Field(default=None, description="unit of its numbers; pu, rad or Hz if not given")
    base: Positive | None = Field(
        default=None, description="what 1 pu is: MVA for P and Q, kV line to line for V"
    )
    sign: Literal["generator", "load"] = Field(
        default="generator", description="P and Q: positive when generated, or when consumed"
    )
    scale: float = Field(default=1.0, description="factor on the numbers in the file")
    per_phase: bool = Field(default=False, description="P and Q: one of three equal phases")
    line_neutral: bool = Field(default=False, description="V: measured from line to neutral")
    real: str | None = Field(default=None, description="V: header of the real part, instead of column")
    imag: str | None = Field(default=None, description="V: header of the imaginary part")
    value: float | None = Field(default=None, description="stated pre-event value of what was not measured")


class RecordingSection(Section):
    """A recorded disturbance."""

    path: str = Field(description="text file with one header row, relative to the case file")
    name: str | None = Field(default=None, description="for tables and plots; the file's name if not given")
    base_mva: Positive = Field(description="base of the device in MVA, which P and Q are converted to")
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

    @model_validator(mode="after")
    def _some_window(self) -> RecordingSection:
        if self.t_start is not None and self.t_end is not None and self.t_start >= self.t_end:
            raise InputError(
                f"the window from {self.t_start:g} to {self.t_end:g} s is empty", allowed="t_start < t_end"
            )
        return self

    def load(self, folder: Path, dt: float | None = None) -> Recording:
        """Read the window of the file and apply the shift, which resamples to `dt` seconds."""
        direct = {"path", "columns", "shift"}
        columns = {role: Column(**dict(section)) for role, section in self.columns.items()}
        options = {key: value for key, value in self if key not in direct}
        recording = read_csv(folder / self.path, columns, **options)
        return recording.resample(dt, shift=self.shift) if self.shift else recording


class ParameterSection(Section):
    """Changes to one candidate parameter."""

    nominal: float | None = Field(
        default=None, description="value before calibration; typical value if not given"
    )
    relative: Positive | None = Field(default=None, description="bounds at nominal ± this part of it")
    lower: float | None = Field(default=None, description="lower bound")
    upper: float | None = Field(default=None, description="upper bound")
    scale: Positive | None = Field(default=None, description="size of a change that matters, if nominal is 0")

    @model_validator(mode="after")
    def _one_kind_of_bounds(self) -> ParameterSection:
        if self.relative is not None and (self.lower is not None or self.upper is not None):
            raise InputError("relative and absolute bounds are both given", allowed="one kind of bounds")
        return self

    def apply(self, default: Parameter) -> dict[str, float]:
        """Fields of a parameter that change; default bounds keep their ratio to the nominal value."""
        nominal = default.nominal if self.nominal is None else self.nominal
        if self.relative is not None:
            lower, upper = nominal - self.relative * abs(nominal), nominal + self.relative * abs(nominal)
        else:
            ratio = nominal / default.nominal if default.nominal else 1.0
            lower, upper = sorted((default.lower * ratio, default.upper * ratio))
        change = {
            "nominal": nominal,
            "lower": lower if self.lower is None else self.lower,
            "upper": upper if self.upper is None else self.upper,
        }
        return change if self.scale is None else {**change, "scale": self.scale}


class DeviceSection(Section):
    """The model that is compared with the recording."""

    type: str = Field(description="synchronous_machine, dfig_plant or pv_plant")
    relative: Positive | None = Field(
        default=None, description="bounds of all candidates at nominal ± this part"
    )
    candidates: list[str] | None = Field(
        default=None, description="parameters that may be wrong; all if not given"
    )
    parameters: dict[str, ParameterSection] = Field(default={}, description="changes to single parameters")
    constants: dict[str, float] = Field(default={}, description="values of other constants")
    grid_resistance: Annotated[float, Field(ge=0)] = Field(
        default=0.0,
        description="of the grid as the terminal sees it, in pu of the device's base: how much of the recorded voltage "
        "the plant itself moved",
    )
    grid_reactance: Annotated[float, Field(ge=0)] = Field(default=0.0, description="the same, reactance")

    @property
    def grid_impedance(self) -> complex:
        """R + jX of the grid in pu."""
        return complex(self.grid_resistance, self.grid_reactance)

    def apply(self, space: ParameterSpace) -> ParameterSpace:
        """Candidates of this case, from those of the device.

        Raises
        ------
        InputError
            If a name is unknown or a range excludes its nominal value.
        """
        for name in (*self.parameters, *(self.candidates or ())):
            space.index(name)
        changes = {}
        for parameter in space:
            section = self.parameters.get(parameter.name, ParameterSection())
            bounds = (section.relative, section.lower, section.upper)
            if self.relative is not None and all(b is None for b in bounds):
                section = section.model_copy(update={"relative": self.relative})
            if section != ParameterSection():
                changes[parameter.name] = section.apply(parameter)
        out = space.replace(changes)
        return out if self.candidates is None else out.subset(self.candidates)


class SimulationSection(Section):
    """How the model is integrated."""

    step: Positive = Field(default=0.0025, description="longest integration step in s")
    dt: Positive | None = Field(
        default=None,
        description="step in s at which signals are compared; that of the recording if not given",
    )


def _each_once(methods: list[Any]) -> None:
    if len(set(methods)) < len(methods):
        raise InputError(f"the methods {methods} hold one twice", allowed="each method once")


class ScreeningSection(Section):
    """How the parameters that carry the error are found."""

    methods: list[Literal["cnn", "sensitivity", "random"]] = Field(
        default=["cnn", "sensitivity", "random"], min_length=1, description="rankers; the first one selects"
    )
    samples: Annotated[int, Field(ge=20)] = Field(default=600, description="cnn: simulations it learns from")
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
        _each_once(self.methods)
        return self


class CalibrationSection(Section):
    """How the selected parameters are fitted."""

    methods: list[Literal["map", "pso"]] = Field(
        default=["map", "pso"], min_length=1, description="calibrators; the report judges by the first one"
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
        _each_once(self.methods)
        if self.library < self.starts - 1:
            raise InputError(
                f"{self.starts} starts cannot be taken from a library of {self.library}",
                allowed="library >= starts - 1",
            )
        return self


class DiscoverySection(Section):
    """How causes that are no parameters are searched."""

    enabled: bool = Field(default=True, description="whether they are searched")
    effects: list[str] | None = Field(
        default=None, description="effects to try; all of the library if not given"
    )
    max_effects: Annotated[int, Field(ge=1, le=3)] = Field(
        default=2, description="largest number of effects that are named together"
    )
    fits: Count = Field(default=6, description="effects whose joint fit goes on to the end")
    draws: Annotated[int, Field(ge=8)] = Field(
        default=128, description="draws of an effect's parameters in each round of its signature"
    )
    significance: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.002, description="probability below which what is left counts as more than noise"
    )
    first_look: Annotated[int, Field(ge=0)] = Field(
        default=0,
        description="samples of a network that ranks parameters and effects before the search, 0 for none",
    )


class RunSection(Section):
    """How the computation is run."""

    random_state: Annotated[int, Field(ge=0)] = Field(default=0, description="seed of all random numbers")
    n_jobs: int = Field(default=1, description="processes; -1 for one on each core")
    out: str | None = Field(default=None, description="folder for results, relative to the case file")

    @model_validator(mode="after")
    def _some_job(self) -> RunSection:
        if self.n_jobs == 0:
            raise InputError("n_jobs is 0", allowed="a number of processes, or -1")
        return self
