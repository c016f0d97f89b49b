"""Sections of a case file that say what is compared with a recording: a device, or a grid and what happened in it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from errorscreen.cases.ieee39 import PLANTS, load_ieee39
from errorscreen.cases.section import Positive, Section
from errorscreen.events import BusFault, GridEvent, LineTrip, LoadStep
from errorscreen.exceptions import InputError, unknown_name
from errorscreen.models import DEVICES
from errorscreen.parameters import Parameter, ParameterSpace
from errorscreen.simulators import PowerSystemSimulator

#: instants that are moved by less, in s, are those of rounded time stamps
_TOLD = 2e-5
#: what a channel of that name can be
_KINDS = {"V": "a bus", "P": "[sending, receiving] bus"}
NotNegative = Annotated[float, Field(ge=0)]
Pair = Annotated[list[int], Field(min_length=2, max_length=2)]


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


class CandidatesSection(Section):
    """Which parameters of a model may be wrong, and by how much."""

    relative: Positive | None = Field(
        default=None, description="bounds of all candidates at nominal ± this part"
    )
    candidates: Annotated[list[str], Field(min_length=1)] | None = Field(
        default=None, description="parameters that may be wrong; all if not given"
    )
    parameters: dict[str, ParameterSection] = Field(default={}, description="changes to single parameters")

    def apply(self, space: ParameterSpace) -> ParameterSpace:
        """Candidates of this case, from those of the model.

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


class DeviceSection(CandidatesSection):
    """A plant at whose terminal the recorded voltage is played back, and that is compared with the recording."""

    type: str = Field(description="synchronous_machine, dfig_plant or pv_plant")
    constants: dict[str, float] = Field(default={}, description="values of other constants")
    grid_resistance: NotNegative = Field(
        default=0.0,
        description="of the grid as the terminal sees it, in pu of the device's base: how much of the recorded voltage "
        "the plant itself moved",
    )
    grid_reactance: NotNegative = Field(default=0.0, description="the same, reactance")

    @property
    def grid_impedance(self) -> complex:
        """R + jX of the grid in pu."""
        return complex(self.grid_resistance, self.grid_reactance)

    def space(self) -> ParameterSpace:
        """Candidates of the device.

        Raises
        ------
        InputError
            If the device, a parameter or a constant is unknown.
        """
        if self.type not in DEVICES:
            raise unknown_name(self.type, DEVICES, kind="device", where="device.type")
        device = DEVICES[self.type]
        device.constant_values(self.constants, in_grid=self.grid_impedance != 0)
        return self.apply(device.candidates)


class GridSection(CandidatesSection):
    """A simulated grid that is compared with the recording, instead of a device."""

    case: Literal["ieee39"] = Field(description="ieee39, the 39-bus case study")
    channels: dict[str, int | Pair] = Field(
        default={"V": 2, "P": [25, 2]},
        min_length=1,
        description="recorded quantities by name: a bus for its voltage, or [sending, receiving] bus for the active "
        "power that arrives",
    )

    @model_validator(mode="after")
    def _kinds(self) -> GridSection:
        for name, where in self.channels.items():
            if name in _KINDS and isinstance(where, int) != (name == "V"):
                raise InputError(f"channel {name} is {where}", allowed=f"{name} = {_KINDS[name]}")
        return self

    def simulator(
        self, event: GridEvent, step: float, further: Sequence[GridEvent] = ()
    ) -> PowerSystemSimulator:
        """Simulator of the case with the candidates of this section."""
        channels = {
            name: where if isinstance(where, int) else (where[0], where[1])
            for name, where in self.channels.items()
        }
        return load_ieee39(
            parameters=self.space(), channels=channels, event=event, further=further, step=step
        )

    def space(self) -> ParameterSpace:
        """Candidates of the case."""
        return self.apply(ParameterSpace(p for _, device, *_ in PLANTS for p in DEVICES[device].candidates))


class Happening(Protocol):
    """What a recording says about an event beside its kind."""

    event_time: float | None
    load_level: float


class EventSection(Section):
    """What happened in a grid; the start is that of the recording's event."""

    TITLE: ClassVar[str]

    @abstractmethod
    def event(self, time: NDArray[np.float64], name: str, start: float, level: float) -> GridEvent:
        """Event on a time axis in seconds."""

    def on_steps(
        self, time: NDArray[np.float64], name: str, recording: Happening, step: float, where: str
    ) -> tuple[GridEvent, tuple[str, ...]]:
        """Event whose instants are those at which steps of the model begin, and what is to be told about that.

        The model's grid changes between two steps. An instant between two samples stays between them: moved onto the
        earlier one, that sample would count as one after the change.

        Parameters
        ----------
        time : ndarray of shape (L,)
            Uniform, in s.
        name : str
        recording : Happening
            With `event_time` and `load_level`.
        step : float
            Longest step in s.
        where : str
            For errors.

        Raises
        ------
        InputError
            If the event does not lie within the recording, or lasts for less than a step.
        """
        assert recording.event_time is not None  # `Case.check_events` sees to that
        grid = _Steps(time, step)
        start = grid.nearest(recording.event_time)
        moved = [("starts", recording.event_time, start)]
        section = self
        duration = getattr(self, "duration", None)
        if duration is not None:
            end = grid.nearest(recording.event_time + duration)
            if duration < grid.step - _TOLD or not start < end < time[-1]:
                raise InputError(
                    f"a duration of {duration:g} s",
                    where=where,
                    allowed=f"at least a step, {grid.step:g} s, and cleared before the end of the recording",
                )
            section = self.model_copy(update={"duration": end - start})
            moved.append(("is cleared", recording.event_time + duration, end))
        told = [
            f"What happened, as stated: {type(self).TITLE}, {self._stated()}, load level {recording.load_level:g}."
        ]
        told += [
            f"In the model it {what} at {at:.6g} s instead of {stated:.6g} s, where a step begins: a smaller "
            "simulation.step comes nearer."
            for what, stated, at in moved
            if abs(at - stated) > _TOLD
        ]
        return section.event(time, name, start, recording.load_level), tuple(told)

    def _stated(self) -> str:
        return ", ".join(f"{key} {value}" for key, value in self if value is not None)


class _Steps:
    """Instants at which steps of a model begin, on the time axis of a recording."""

    def __init__(self, time: NDArray[np.float64], step: float) -> None:
        self.first, self.dt = float(time[0]), float(time[1] - time[0])
        self.each = int(np.ceil(self.dt / step - 1e-9))
        self.step = self.dt / self.each

    def nearest(self, instant: float) -> float:
        """The nearest of them that has the same samples before and after it."""
        position = (instant - self.first) / self.dt
        sample = round(position)
        if abs(position - sample) * self.dt > _TOLD:
            before = int(np.floor(position)) * self.each
            here = min(max(round(position * self.each), before + 1), before + self.each)
        else:
            here = sample * self.each
        return self.first + here * self.step


class FaultSection(EventSection):
    """A three-phase short circuit at a bus that is cleared by itself."""

    TITLE: ClassVar[str] = "fault"

    bus: int = Field(description="where")
    duration: Positive = Field(description="seconds until it is cleared")
    resistance: NotNegative = Field(default=0.0, description="to ground, in pu of the grid's base")
    reactance: NotNegative = Field(default=0.0, description="the same, reactance")

    def event(self, time: NDArray[np.float64], name: str, start: float, level: float) -> GridEvent:
        """Event on a time axis in seconds."""
        impedance = complex(self.resistance, self.reactance)
        return BusFault(
            time, name, start, bus=self.bus, duration=self.duration, impedance=impedance, level=level
        )


class LineTripSection(EventSection):
    """A branch that is opened at both ends."""

    TITLE: ClassVar[str] = "line trip"

    ends: Pair = Field(description="its two buses")
    circuit: str | None = Field(default=None, description="which one, where there are several")

    def event(self, time: NDArray[np.float64], name: str, start: float, level: float) -> GridEvent:
        """Event on a time axis in seconds."""
        return LineTrip(
            time, name, start, ends=(self.ends[0], self.ends[1]), circuit=self.circuit, level=level
        )


class LoadStepSection(EventSection):
    """Loads that change at once."""

    TITLE: ClassVar[str] = "load step"

    factor: NotNegative = Field(description="on what the loads were before")
    buses: Annotated[list[int], Field(min_length=1)] | None = Field(
        default=None, description="where; all loads if not given"
    )

    @model_validator(mode="after")
    def _some_step(self) -> LoadStepSection:
        if self.factor == 1.0:
            raise InputError("a factor of 1 changes nothing", allowed="another factor")
        return self

    def event(self, time: NDArray[np.float64], name: str, start: float, level: float) -> GridEvent:
        """Event on a time axis in seconds."""
        buses = None if self.buses is None else tuple(self.buses)
        return LoadStep(time, name, start, factor=self.factor, buses=buses, level=level)


#: keys of a recording that say what happened in a grid
EVENTS = ("fault", "line_trip", "load_step")
