"""Declaration of a device: parameters, constants, states, equations and its exact equilibrium."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from errorscreen.effects.base import Effect
from errorscreen.engine.stages import Call, Equations
from errorscreen.exceptions import InputError, unknown_name
from errorscreen.parameters import Parameter, ParameterSpace

Values = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Constant:
    """Value of a device that is never calibrated.

    Parameters
    ----------
    name : str
    value : float
    unit, description : str
    """

    name: str
    value: float
    unit: str = ""
    description: str = ""


@dataclass(frozen=True)
class GridInterface:
    """Connection of a device to a grid.

    Parameters
    ----------
    kind : {"rotor", "norton", "current", "solved"}
        The device seen from the grid: electromotive forces Ed1, Eq1 behind Ra, Xd1, Xq1 in the rotor's frame of
        angle delta; the current Cr + jCi beside the reactance Xpp; the current Cr + jCi alone; or the current
        Ir + jIi, which it solves for itself. The last one can be driven behind an impedance, but not be part of a
        simulated grid.
    source : tuple of callable
        Stages before the solution of the grid; they write Cr and Ci, or Ir and Ii.
    terminal : tuple of callable
        Stages behind it, in place of the first stage of the device; they may read Vr, Vi, Ir, Ii and size.
    states : tuple of (str, str)
        Additional states, each with the quantity of the operating point that it starts at.
    constants : tuple of Constant
        Additional constants.
    names : mapping of str to str
        Names in the device of the quantities that `kind` lists, where they differ. Such a device can be driven behind
        an impedance, but not be part of a simulated grid.
    """

    kind: Literal["rotor", "norton", "current", "solved"]
    source: tuple[Equations | Call, ...]
    terminal: tuple[Equations | Call, ...]
    states: tuple[tuple[str, str], ...] = ()
    constants: tuple[Constant, ...] = ()
    names: Mapping[str, str] = field(default_factory=dict)


class Note(NamedTuple):
    """Sentence on what the model takes otherwise than its file says.

    Parameters
    ----------
    text : str
    constant : str
        Constant whose value the sentence is about, which is not told where the user states it; empty for none.
    """

    text: str
    constant: str = ""


class Remark(str):
    """Assumption about the model that the check of a case file tells, too."""

    __slots__ = ()


class SetPoint(NamedTuple):
    """Quantity of a device that a step of a set-point moves, see `errorscreen.models.set_points`.

    Parameters
    ----------
    name : str
        In the model.
    factor : str
        Constant that the size is multiplied by; empty for 1.
    computed : bool
        Whether equations write it; else it is a constant of the start.
    """

    name: str
    factor: str = ""
    computed: bool = False


@dataclass(frozen=True)
class Device:
    """A dynamic device at a terminal whose voltage, or power, is given.

    All quantities are in per unit of the device's own base unless a unit is stated; power is positive when
    generated. The terminal voltage enters as ``Vr``, ``Vi`` in a frame that rotates at the pre-event
    frequency.

    Parameters
    ----------
    name : str
        For example ``"synchronous_machine"``.
    title : str
        For reports.
    candidates : ParameterSpace
        The candidate parameters with typical values and ranges.
    constants : tuple of Constant
        All other values in the equations.
    further : ParameterSpace
        Constants that are candidates where the user names them, see `with_candidates`.
    limits : tuple of str
        Those of `further` that are limits.
    notes : tuple of Note
        What the model takes otherwise than its file says.
    states : tuple of str
    setpoints : tuple of str
        References that `initialise` computes, so that the device rests at the operating point.
    stages : tuple of callable or Call
        Functions of equations (`errorscreen.engine.stage`) in the order of evaluation; a `Call` binds its quantities to
        other names.
    initialise : callable
        ``initialise(values) -> (states, setpoints, feasible)``: equilibrium from a mapping that holds parameters,
        constants and the operating point ``V, P, Q, angle``, each of shape (n,).
    ports : mapping of str to str
        Quantities at which an effect may act, with their meaning.
    needs_angle : bool
        True if the response depends on how the angle of the terminal voltage moves.
    source : str
        Where the equations come from.
    grid : GridInterface, optional
        How the device is connected to a simulated grid; without it, it can only be played back.
    recordable : mapping of str to str
        Channels that are compared where they were recorded, beside P and Q, and their quantities.
    tags : tuple of str
        What effects may ask for beside the name, for example ``"without exciter"``.
    driven : mapping of str to tuple of str
        Recorded quantities that drive the device beside the terminal voltage, each with the models that it replaces.
    set_points : mapping of str to SetPoint
        Set-points that can step, see `errorscreen.models.set_points`.
    steps : mapping of str to bool
        Set-points whose steps are compiled in, and whether a size is to be found.
    effects : tuple of Effect
        Effects that it offers beside those of the library, for example its flags.
    words : mapping of str to str
        How titles of effects call the unit, ``"unit"``, and the model in each filled slot.
    imposed : tuple of (str, str)
        What drives it: the parts of the terminal voltage, or P and Q (`errorscreen.simulators.plant.imposed_power`).
    outputs : tuple of str
        Channels that are compared.
    """

    name: str
    title: str
    candidates: ParameterSpace
    constants: tuple[Constant, ...]
    states: tuple[str, ...]
    setpoints: tuple[str, ...]
    stages: tuple[Equations | Call, ...]
    initialise: Callable[[Values], tuple[Values, Values, NDArray[np.bool_]]]
    ports: Mapping[str, str]
    needs_angle: bool
    source: str
    grid: GridInterface | None = None
    recordable: Mapping[str, str] = field(default_factory=dict)
    tags: tuple[str, ...] = ()
    driven: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    set_points: Mapping[str, SetPoint] = field(default_factory=dict)
    steps: Mapping[str, bool] = field(default_factory=dict)
    effects: tuple[Effect, ...] = ()
    words: Mapping[str, str] = field(default_factory=dict)
    imposed: tuple[str, str] = ("Vr", "Vi")
    outputs: tuple[str, ...] = ("P", "Q")
    further: ParameterSpace = field(default_factory=lambda: ParameterSpace(()))
    limits: tuple[str, ...] = ()
    notes: tuple[Note, ...] = ()

    def with_candidates(self, names: Iterable[str]) -> Device:
        """Device with further candidates behind its own, for example the limits of an exciter.

        Parameters
        ----------
        names : iterable of str
            Of `further`, in any order; those that are candidates already stay as they are.

        Raises
        ------
        InputError
            If there is no such constant, or it is a flag, or zero where that means that the model lacks it.
        """
        wanted = {*names} - {*self.candidates.names}
        for name in sorted(wanted - {*self.further.names}):
            if name in (one.name for one in self.constants):
                raise InputError(
                    f"{name} is {self.constant_values()[name]:g} and cannot be a candidate",
                    where=f"device {self.name!r}",
                    allowed="numbers other than flags, buses, and zeros that mean that the model lacks something",
                    remedy="The search offers flags by itself. Put a value that is not 0 into the model file where "
                    "the model has what a zero stands for",
                )
            raise unknown_name(name, (*self.candidates.names, *self.further.names), kind="parameter")
        if not wanted:
            return self
        return replace(
            self,
            candidates=ParameterSpace([*self.candidates, *(p for p in self.further if p.name in wanted)]),
            further=ParameterSpace(p for p in self.further if p.name not in wanted),
            constants=tuple(one for one in self.constants if one.name not in wanted),
            limits=tuple(name for name in self.limits if name not in wanted),
        )

    @property
    def inputs(self) -> tuple[str, ...]:
        """Functions of time that all simulations share: what is imposed, recorded deviations, and steps."""
        steps = [
            f"{name}.{kind}"
            for name, sought in self.steps.items()
            for kind in ("known", "unknown")[: 1 + sought]
        ]
        return (*self.imposed, *(f"d{name}" for name in self.driven), *steps)

    @property
    def interface(self) -> GridInterface:
        """Connection to a grid; a device without it raises `InputError`."""
        if self.grid is None:
            raise InputError(f"the device {self.name!r} cannot be connected to a grid")
        return self.grid

    def constant_values(
        self, changes: Mapping[str, float] | None = None, in_grid: bool = False
    ) -> dict[str, float]:
        """Values of the constants, with the user's own in place of the defaults.

        Parameters
        ----------
        changes : mapping of str to float, optional
        in_grid : bool
            With the constants of the connection to a grid.

        Raises
        ------
        InputError
            If a name is not a constant of this device.
        """
        constants = (*self.constants, *(self.interface.constants if in_grid else ()))
        values = {c.name: c.value for c in constants}
        for name, value in (changes or {}).items():
            if name not in values:
                raise unknown_name(name, values, kind="constant", where=f"device {self.name!r}")
            values[name] = float(value)
        return values


def relative_parameters(device: str, rows: str, spread: float = 0.3) -> ParameterSpace:
    """Parameter table of a device, bounds at ± `spread`; `rows` has ``name | symbol | unit | nominal | domain |
    description`` a line.
    """
    parameters = []
    for row in rows.strip().splitlines():
        name, symbol, unit, nominal, domain, description = (cell.strip() for cell in row.split("|"))
        value = float(nominal)
        low, high = sorted((round(value * (1 - spread), 12), round(value * (1 + spread), 12)))
        parameters.append(Parameter(name, value, low, high, unit, device, symbol, description, domain=domain))
    return ParameterSpace(parameters)
