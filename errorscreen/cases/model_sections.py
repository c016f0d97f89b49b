"""Sections of a case file for the model: a device, or a grid and its events."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, PrivateAttr, model_validator

from errorscreen.cases.ieee39 import PLANTS, load_ieee39
from errorscreen.cases.section import NameIn, NotNegative, Positive, Section, each_once, setting
from errorscreen.events import BusFault, GridEvent, LineTrip, LoadStep, SetPointStep
from errorscreen.exceptions import InputError
from errorscreen.models import DEVICES, Device
from errorscreen.models.dyr import DyrFile, read_dyr
from errorscreen.models.set_points import size_name, with_steps
from errorscreen.parameters import Parameter, ParameterSpace
from errorscreen.simulators import PowerSystemSimulator

#: a shift of an instant by less, in s, comes from rounded time stamps
_TOLD = 2e-5
#: place of a channel by its name
_KINDS = {"V": "a bus", "P": "[sending, receiving] bus"}
Pair = Annotated[list[int], Field(min_length=2, max_length=2)]


class ParameterSection(Section):
    """Changes to one candidate parameter."""

    nominal: float | None = setting(None, "value before calibration; typical value if not given")
    relative: Positive | None = setting(None, "bounds at nominal ± this part of it")
    lower: float | None = setting(None, "lower bound")
    upper: float | None = setting(None, "upper bound")
    scale: Positive | None = setting(None, "size of a change that matters, if nominal is 0")

    @model_validator(mode="after")
    def _one_kind_of_bounds(self) -> ParameterSection:
        if self.relative is not None and (self.lower is not None or self.upper is not None):
            raise InputError("relative and absolute bounds are both given", allowed="one kind of bounds")
        return self

    def apply(self, default: Parameter) -> dict[str, float]:
        """Fields of a parameter that change; default bounds keep their ratio to the nominal value."""
        nominal = default.nominal if self.nominal is None else self.nominal
        if self.relative is not None and not (nominal == 0 and default.lower <= 0 <= default.upper):
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
    """Parameters of a model that may be wrong, and their ranges."""

    relative: Positive | None = setting(None, "bounds of all candidates at nominal ± this part")
    candidates: Annotated[list[str], Field(min_length=1)] | None = setting(
        None, "parameters that may be wrong; all if not given"
    )
    parameters: dict[str, ParameterSection] = setting({}, "changes to single parameters")

    def apply(self, space: ParameterSpace) -> ParameterSpace:
        """Candidates of this case, from those of the model; `InputError` if a name or a range is wrong."""
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
    """A plant that is compared with the recording while the recorded voltage, or power, is imposed on its terminal."""

    type: Annotated[str, NameIn(DEVICES)] | None = setting(None, "kind of the plant, where there is no dyr")
    dyr: str | None = setting(None, "model file of PSS/E with the records of the unit, instead of type")
    bus: int | str | None = setting(None, "bus of the unit in dyr; needed where the file holds several units")
    id: str | int | None = setting(
        None, "identifier of the unit in dyr; needed where the bus has several units"
    )
    leave_out: list[str] = setting([], "models of dyr that shall not count, for example of a protection")
    inputs: Annotated[list[Literal["Efd", "Pm"]], AfterValidator(each_once)] = setting(
        [],
        "recorded channels that drive the unit of dyr: Efd instead of its exciter, stabiliser, compensator and "
        "limiters, Pm instead of its governor",
    )
    constants: dict[str, float] = setting({}, "values of other constants")
    imposed: Literal["voltage", "power"] = setting(
        "voltage",
        "recorded quantity that drives the unit: the voltage, while P and Q are compared, or P and Q, while V and f "
        "are compared, as for load rejections and open-circuit tests of machines in dyr",
    )
    grid_resistance: NotNegative = setting(
        0.0,
        "of the grid seen from the terminal, in pu of the device's base: how much the plant itself moves the "
        "voltage",
    )
    grid_reactance: NotNegative = setting(0.0, "the same, reactance")
    constant_frequency: bool = setting(
        False,
        "for recordings without angle and f: the frequency of the terminal keeps its value before the event",
    )
    angle_reactance: NotNegative = setting(
        0.0,
        "for recordings without angle and f: reactance in pu of the device's base to a source of constant angle, "
        "against which V, P and Q give the angle",
    )
    _file: DyrFile | None = PrivateAttr(default=None)

    @property
    def grid_impedance(self) -> complex:
        """R + jX of the grid in pu."""
        return complex(self.grid_resistance, self.grid_reactance)

    @model_validator(mode="after")
    def _one_model(self) -> DeviceSection:
        if (self.type is None) == (self.dyr is None):
            found = "neither type nor dyr is" if self.type is None else "type and dyr are both"
            raise InputError(f"{found} given", allowed="one of the two: the kind of a plant, or a model file")
        if self.dyr is None and not (self.bus is None and self.id is None):
            raise InputError("bus or id is given without dyr", allowed="only with a model file")
        if self.dyr is None and self.inputs:
            raise InputError("inputs are given without dyr", allowed="only with a model file")
        if self.dyr is None and self.imposed == "power":
            raise InputError(
                'imposed is "power" without dyr', allowed="only with a model file that holds a machine"
            )
        return self

    def file(self, folder: Path) -> DyrFile | None:
        """Model file, relative to a folder and read once; None for a kind of plant."""
        if self.dyr is not None and self._file is None:
            self._file = read_dyr(folder / self.dyr)
        return self._file

    def model(self, folder: Path, steps: Sequence[SetPointStep] = ()) -> Device:
        """Device of this section with the steps of its recordings and the candidates that it names.

        Its files are relative to a folder. `InputError` if a parameter or a constant is unknown.
        """
        file = self.file(folder)
        if file is None:
            assert self.type is not None
            device = DEVICES[self.type]
        else:
            device = file.unit(self.bus, self.id, leave_out=self.leave_out, inputs=self.inputs)
        device.constant_values(self.constants, in_grid=self.grid_impedance != 0)
        return with_steps(device, steps).with_candidates((*self.parameters, *(self.candidates or ())))

    @property
    def typical(self) -> str:
        """Sentence on the parameters for which no value of this unit is stated; empty where there are none."""
        if self.type is None:
            return ""
        stated = {name for name, one in self.parameters.items() if one.nominal is not None}
        names = [name for name in DEVICES[self.type].candidates.names if name not in stated]
        if not names:
            return ""
        return (
            f"The model begins with typical values of {', '.join(names)}, not with those of this unit: their error is "
            "part of the result. State them in [device.parameters], or give the model file of the unit as dyr."
        )

    def space(self, folder: Path, steps: Sequence[SetPointStep] = ()) -> ParameterSpace:
        """Candidates of the device; `InputError` if a parameter or a constant is unknown, or a size cannot be found."""
        device = self.model(folder, steps)
        space = self.apply(device.candidates)
        for quantity, sought in device.steps.items():
            if sought and size_name(quantity) not in space:
                raise InputError(
                    f"the size of the step of {quantity} is not given, and {size_name(quantity)!r} is no candidate",
                    where="device.candidates",
                    allowed="a size, or a candidate that finds it",
                    remedy=f"State size in [[recording.step]], or add {size_name(quantity)!r} to candidates",
                )
        return space


class GridSection(CandidatesSection):
    """A simulated grid that is compared with the recording, instead of a device."""

    case: Literal["ieee39"] = setting(..., "ieee39, the 39-bus case study")
    channels: dict[str, int | Pair] = setting(
        {"V": 2, "P": [25, 2]},
        "recorded quantities by name: a bus for its voltage, or [sending, receiving] bus for the active power"
        " that arrives",
        min_length=1,
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
            parameters=self.space(Path()), channels=channels, event=event, further=further, step=step
        )

    def space(self, folder: Path) -> ParameterSpace:
        """Candidates of the case."""
        return self.apply(ParameterSpace(p for _, device, *_ in PLANTS for p in DEVICES[device].candidates))


class EventSection(Section):
    """An event in a grid; it starts at the recording's `event_time`."""

    TITLE: ClassVar[str]

    @abstractmethod
    def event(self, time: NDArray[np.float64], name: str, start: float, level: float) -> GridEvent:
        """Event on a time axis in seconds."""

    def on_steps(
        self, time: NDArray[np.float64], name: str, recording: Any, step: float, where: str
    ) -> tuple[GridEvent, tuple[str, ...]]:
        """Event whose instants are beginnings of integration steps of at most `step` s, and notes for the report.
        An instant between two samples stays between them: on the earlier one, it would turn that sample into one after
        the change. Raises `InputError` (with the place `where`) if the event is not inside the recording or shorter
        than a step.
        """
        first, dt = float(time[0]), float(time[1] - time[0])
        per_sample = int(np.ceil(dt / step - 1e-9))
        step = dt / per_sample

        def nearest(instant: float) -> float:
            position = (instant - first) / dt
            sample = round(position)
            number = sample * per_sample
            if abs(position - sample) * dt > _TOLD:
                before = int(np.floor(position)) * per_sample
                number = min(max(round(position * per_sample), before + 1), before + per_sample)
            return first + number * step

        start = nearest(recording.event_time)
        moved = [("starts", recording.event_time, start)]
        section = self
        duration = getattr(self, "duration", None)
        if duration is not None:
            end = nearest(recording.event_time + duration)
            if duration < step - _TOLD or not start < end < time[-1]:
                raise InputError(
                    f"a duration of {duration:g} s",
                    where=where,
                    allowed=f"at least a step, {step:g} s, and cleared before the end of the recording",
                )
            section = self.model_copy(update={"duration": end - start})
            moved.append(("is cleared", recording.event_time + duration, end))
        stated = ", ".join(f"{key} {value}" for key, value in self if value is not None)
        notes = [f"Event as stated: {self.TITLE}, {stated}, load level {recording.load_level:g}."]
        notes += [
            f"In the model it {what} at {at:.6g} s instead of {instant:.6g} s, where a step begins: a smaller "
            "simulation.step comes nearer."
            for what, instant, at in moved
            if abs(at - instant) > _TOLD
        ]
        return section.event(time, name, start, recording.load_level), tuple(notes)


class FaultSection(EventSection):
    """A three-phase short circuit at a bus that is cleared by itself."""

    TITLE: ClassVar[str] = "fault"

    bus: int = setting(..., "where")
    duration: Positive = setting(..., "seconds until it is cleared")
    resistance: NotNegative = setting(0.0, "to ground, in pu of the grid's base")
    reactance: NotNegative = setting(0.0, "the same, reactance")

    def event(self, time: NDArray[np.float64], name: str, start: float, level: float) -> GridEvent:
        """Event on a time axis in seconds."""
        impedance = complex(self.resistance, self.reactance)
        return BusFault(
            time, name, start, bus=self.bus, duration=self.duration, impedance=impedance, level=level
        )


class LineTripSection(EventSection):
    """A branch that is opened at both ends."""

    TITLE: ClassVar[str] = "line trip"

    ends: Pair = setting(..., "its two buses")
    circuit: str | None = setting(None, "which one, where there are several")

    def event(self, time: NDArray[np.float64], name: str, start: float, level: float) -> GridEvent:
        """Event on a time axis in seconds."""
        return LineTrip(
            time, name, start, ends=(self.ends[0], self.ends[1]), circuit=self.circuit, level=level
        )


class LoadStepSection(EventSection):
    """Loads that change at once."""

    TITLE: ClassVar[str] = "load step"

    factor: NotNegative = setting(..., "on the loads before the event")
    buses: Annotated[list[int], Field(min_length=1)] | None = setting(
        None, "buses whose loads change; all if not given"
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


class StepSection(Section):
    """A step of a set-point of the unit, as in a step test; several stand in [[recording.step]] one after the other."""

    quantity: Literal["Vref", "Pref", "Qref", "Qext", "Fref"] = setting(
        ...,
        "set-point: voltage, active power, reactive power of a plant controller, that of a converter without one, or "
        "frequency",
    )
    time: float = setting(..., "its instant in s")
    size: float | None = setting(
        None, "in pu of the unit's base; a candidate parameter, quantity.step, if not given"
    )

    @property
    def step(self) -> SetPointStep:
        """The same for a recording."""
        return SetPointStep(self.quantity, self.time, self.size)


#: keys of a recording for its event in a grid
EVENTS = ("fault", "line_trip", "load_step")
