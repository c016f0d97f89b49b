"""Equations as plain functions of named quantities, and the check that they fit together."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from errorscreen.exceptions import InputError, unknown_name

Equations = Callable[..., Any]


def stage(*writes: str) -> Callable[[Equations], Equations]:
    """Declare the quantities that a function of equations returns; its arguments name those that it reads.

    The function itself does not change: it works on floats and arrays, the engine compiles it, and the NumPy reference
    calls it. A derivative is called ``"d_"`` + state.

    Examples
    --------
    >>> @stage("P", "Q")
    ... def power(Vd, Vq, Id, Iq):
    ...     return Vd * Id + Vq * Iq, Vq * Id - Vd * Iq
    >>> reads_of(power), writes_of(power)
    (('Vd', 'Vq', 'Id', 'Iq'), ('P', 'Q'))
    """

    def decorate(function: Equations) -> Equations:
        function.writes = writes  # type: ignore[attr-defined]
        return function

    return decorate


def reads_of(function: Equations) -> tuple[str, ...]:
    """Names of the arguments of a function of equations."""
    return tuple(inspect.signature(function).parameters)


def writes_of(function: Equations) -> tuple[str, ...]:
    """Names declared with `stage`."""
    return function.writes  # type: ignore[attr-defined]


@dataclass(frozen=True)
class Call:
    """One use of a function in a model, with its quantities bound to names of that model.

    Parameters
    ----------
    function : callable
    reads, writes : tuple of str
        Names in the model's name space, in the order of the arguments and of the returned tuple.
    switch : str, default ""
        The call is made only where this quantity is nonzero in a simulation of the block; empty: always.
    recorded : bool, default False
        The call is made only where outputs are recorded, after all others, not at every Runge-Kutta stage.
    """

    function: Equations
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    switch: str = ""
    recorded: bool = False


@dataclass(frozen=True)
class Model:
    """Calls in the order of evaluation, and the quantities they work on.

    Parameters
    ----------
    name : str
    inputs : tuple of str
        Functions of time, the same for all simulations.
    states : tuple of str
        Integrated quantities.
    constants : tuple of str
        Constant values of each simulation: parameters, constants and set-points.
    calls : tuple of Call
    outputs : tuple of str
        Recorded quantities.
    gated : tuple of (str, tuple of str)
        Switch, and the states that are integrated only while it is on.
    tables : tuple of str
        Quantities that change between steps only, for example the state of a grid; common to all simulations, or
        different for each.

    Raises
    ------
    InputError
        If a call reads a quantity that nothing provides before it, or a derivative is missing.
    """

    name: str
    inputs: tuple[str, ...]
    states: tuple[str, ...]
    constants: tuple[str, ...]
    calls: tuple[Call, ...]
    outputs: tuple[str, ...]
    gated: tuple[tuple[str, tuple[str, ...]], ...] = ()
    tables: tuple[str, ...] = ()
    signals: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        available = dict.fromkeys((*self.inputs, *self.tables, *self.states, *self.constants))
        given = tuple(available)
        for call in self.calls:
            for name in call.reads:
                if name not in available:
                    raise unknown_name(
                        name,
                        available,
                        kind="quantity",
                        where=f"model {self.name!r}, read by {call.function.__name__}",
                        remedy="A quantity must be declared, or written by an earlier call",
                    )
            available.update(dict.fromkeys(call.writes))
        for name in self.states:
            if f"d_{name}" not in available:
                raise InputError(
                    f"nothing writes d_{name}, the derivative of a state", where=f"model {self.name!r}"
                )
        for name in self.outputs:
            if name not in available:
                raise unknown_name(name, available, kind="quantity", where=f"model {self.name!r}, outputs")
        derivatives = {f"d_{name}" for name in self.states}
        known = {*given, *derivatives}
        object.__setattr__(self, "signals", tuple(name for name in available if name not in known))

    @property
    def ungated(self) -> tuple[str, ...]:
        """States that are always integrated."""
        hidden = {name for _, names in self.gated for name in names}
        return tuple(name for name in self.states if name not in hidden)

    @property
    def switches(self) -> tuple[str, ...]:
        """Quantities that switch a call, in order of appearance."""
        return tuple(dict.fromkeys(call.switch for call in self.calls if call.switch))
