"""Sections of a case file that say what is compared with a recording: a device, or a grid and what happened in it."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from errorscreen.cases.ieee39 import PLANTS, load_ieee39
from errorscreen.cases.section import Positive, Section
from errorscreen.events import BusFault, GridEvent, LineTrip, LoadStep
from errorscreen.exceptions import InputError, unknown_name
from errorscreen.parameters import Parameter, ParameterSpace
from errorscreen.power import DEVICES
from errorscreen.simulators import PowerSystemSimulator

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
    candidates: list[str] | None = Field(
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

    def simulator(self, event: GridEvent, step: float) -> PowerSystemSimulator:
        """Simulator of the case with the candidates of this section."""
        channels = {
            name: where if isinstance(where, int) else (where[0], where[1])
            for name, where in self.channels.items()
        }
        return load_ieee39(parameters=self.space(), channels=channels, event=event, step=step)

    def space(self) -> ParameterSpace:
        """Candidates of the case."""
        return self.apply(ParameterSpace(p for _, device, *_ in PLANTS for p in DEVICES[device].candidates))


class EventSection(Section):
    """What happened in a grid; the start is that of the recording's event."""

    @abstractmethod
    def event(self, time: NDArray[np.float64], name: str, start: float, level: float) -> GridEvent:
        """Event on a time axis in seconds."""


class FaultSection(EventSection):
    """A three-phase short circuit at a bus that is cleared by itself."""

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

    ends: Pair = Field(description="its two buses")
    circuit: str | None = Field(default=None, description="which one, where there are several")

    def event(self, time: NDArray[np.float64], name: str, start: float, level: float) -> GridEvent:
        """Event on a time axis in seconds."""
        return LineTrip(
            time, name, start, ends=(self.ends[0], self.ends[1]), circuit=self.circuit, level=level
        )


class LoadStepSection(EventSection):
    """Loads that change at once."""

    factor: NotNegative = Field(description="on what the loads were before")
    buses: list[int] | None = Field(default=None, description="where; all loads if not given")

    def event(self, time: NDArray[np.float64], name: str, start: float, level: float) -> GridEvent:
        """Event on a time axis in seconds."""
        buses = None if self.buses is None else tuple(self.buses)
        return LoadStep(time, name, start, factor=self.factor, buses=buses, level=level)


#: keys of a recording that say what happened in a grid
EVENTS = ("fault", "line_trip", "load_step")
