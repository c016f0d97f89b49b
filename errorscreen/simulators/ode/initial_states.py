"""Initial states of a user's model: known, measured, or fitted for each recording by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.observations import Observation
from errorscreen.events import InputSignal
from errorscreen.exceptions import InputError, check_real, unknown_name
from errorscreen.parameters import Parameter

#: standard deviations by which a measured initial state may be off
_AROUND = 3.0
#: instants of the grid within which the first reading of a state must lie
_FIRST = 8
#: scale over range: a prior of 0.3 of the scale is then nearly flat over the range
_SCALE = 2.0

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class InitialStates:
    """Knowledge of the initial state of each recording, from the argument ``initial`` of `ODESimulator`.

    `columns` has the columns of theta by recording and state.
    """

    states: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]
    given: Mapping[str, float | str | Parameter]
    columns: Mapping[tuple[str, str], int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, value in self.given.items():
            if name not in self.states:
                raise unknown_name(name, self.states, kind="state", where="initial")
            if isinstance(value, str):
                if value != "measured":
                    raise InputError(
                        f"the initial state {name!r} is {value!r}",
                        allowed="a number, 'measured', or a Parameter",
                    )
                if name not in self.outputs:
                    raise InputError(f"the state {name!r} is no output, so its initial value is not measured")
            elif not isinstance(value, Parameter):
                check_real(value, f"the initial state {name!r}")

    @property
    def free(self) -> tuple[str, ...]:
        """Unknown states."""
        return tuple(name for name, value in self.given.items() if isinstance(value, str | Parameter))

    @property
    def guesses(self) -> dict[str, str | float]:
        """First guess of each free state: a number, or the output whose first reading it is."""
        given = ((name, self.given[name]) for name in self.free)
        return {name: value.nominal if isinstance(value, Parameter) else name for name, value in given}

    def fitted_to(
        self, seen: Sequence[Observation | InputSignal], first: int
    ) -> tuple[InitialStates, list[Parameter]]:
        """Return this with a set of parameters for each recording, from column `first` of theta on."""
        columns: dict[tuple[str, str], int] = {}
        parameters: list[Parameter] = []
        names: set[str] = set()
        for item in seen:
            event = item.event if isinstance(item, Observation) else item
            if event.name in names:
                raise InputError(f"two recordings are called {event.name!r}", allowed="unique names")
            names.add(event.name)
            for state in self.free:
                columns[event.name, state] = first + len(parameters)
                low, high = self.bounds(state, item)
                value = self.given[state]
                middle = value.nominal if isinstance(value, Parameter) else 0.5 * (low + high)
                parameter = Parameter(
                    f"{state}(0) of {event.name}", middle, low, high, self.units[state], event.name,
                    f"{state}(0)", "initial state", scale=_SCALE * (high - low),
                )  # fmt: skip
                parameters.append(parameter)
        return replace(self, columns=columns), parameters

    def knows(self, event: InputSignal) -> bool:
        """Whether the initial state of an event is among the parameters."""
        return any(name == event.name for name, _ in self.columns)

    def check(self, event: InputSignal) -> None:
        """Raise `InputError` if an initial state of an event is unknown."""
        for name in self.free:
            if (event.name, name) not in self.columns and name not in event.initial:
                raise InputError(
                    f"the initial state {name!r} is unknown",
                    where=f"event {event.name!r}",
                    remedy="Give it as InputSignal(initial={...}), or observe the recording with this simulator",
                )

    def bounds(self, name: str, item: Observation | InputSignal) -> tuple[float, float]:
        """Bounds of a free state of a recording; a measured one without a first reading raises `InputError`."""
        value = self.given[name]
        if isinstance(value, Parameter):
            return value.lower, value.upper
        event = item.event if isinstance(item, Observation) else item
        where = f"recording {event.name!r}"
        row = item.values[self.outputs.index(name)] if isinstance(item, Observation) else np.zeros(0)
        if not np.isfinite(row[:_FIRST]).any():
            raise InputError(
                f"the initial state {name!r} is measured, but there is no reading of it at the beginning",
                where=where,
                remedy="Give it as a Parameter, with its bounds, or as a number",
            )
        assert isinstance(item, Observation)
        middle = float(row[np.isfinite(row)][0])
        half = _AROUND * float(item.noise[self.outputs.index(name)])
        return middle - half, middle + half

    def values(self, theta: _Array, event: InputSignal) -> _Array:
        """Initial states (n, nx) for parameters (n, m)."""
        x0 = np.zeros((len(theta), len(self.states)))
        for j, name in enumerate(self.states):
            value = self.given.get(name, 0.0)
            column = self.columns.get((event.name, name))
            if column is not None:
                x0[:, j] = theta[:, column]
            else:
                x0[:, j] = event.initial[name] if isinstance(value, str | Parameter) else value
        return x0
