"""An effect: a mechanism that a model lacks, as data that the engine switches on and off.

Every effect of the library is compiled into the models it fits, and does nothing while its strength is zero:
the calls are skipped where no simulation of a block uses them, and **at strength 0 an effect is an exact
identity**, bit for bit, also beside simulations that use it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from errorscreen.engine.stages import Equations
from errorscreen.parameters import Parameter

Values = dict[str, NDArray[np.float64]]


def nothing(values: Values, h: float) -> Values:
    """Start every state and memory of an effect at zero."""
    return {}


@dataclass(frozen=True)
class Effect:
    """A mechanism that acts on one quantity of a model.

    Parameters
    ----------
    name : str
        Short and unique in a model; prefix of its parameters, as in ``"exciter.K"``.
    title : str
        For reports.
    port : str
        The quantity it changes: a port of the device, or ``"channel." + name`` for a measured channel.
    equations : callable
        The first argument, ``value``, is the quantity at the port. The others are quantities of the device or the
        effect's own states, memories, parameters and derived constants. Returns the new value, then the derivatives of
        the states, or for a sampled effect the new memories.
    parameters : tuple of Parameter
        The first is the strength: 0 is allowed and is the identity.
    states : tuple of str
        Integrated together with the device.
    memories : tuple of str
        Carried from step to step by a sampled effect.
    derived : tuple of str
        Constants that `initialise` computes from parameters and step.
    sampled : bool
        Evaluated once per step instead of at every Runge-Kutta stage.
    initialise : callable
        ``initialise(values, h)`` returns start values of states and memories (zero where missing) and the derived
        constants; `values` holds all of the device at its equilibrium and the effect's parameters.
    description : str
        One paragraph for engineers.
    source : str
        Where the equations come from.
    confused_with : tuple of str
        What produces a similar error.
    """

    name: str
    title: str
    port: str
    equations: Equations
    parameters: tuple[Parameter, ...]
    states: tuple[str, ...] = ()
    memories: tuple[str, ...] = ()
    derived: tuple[str, ...] = ()
    sampled: bool = False
    initialise: Callable[[Values, float], Values] = nothing
    description: str = ""
    source: str = ""
    confused_with: tuple[str, ...] = ()

    @property
    def strength(self) -> Parameter:
        """The parameter that makes the effect an identity where it is zero."""
        return self.parameters[0]

    def local(self, name: str) -> str:
        """Name of one of the effect's own quantities in the model's name space."""
        return f"{self.name}.{name}"

    @property
    def own(self) -> tuple[str, ...]:
        """Names of all quantities that belong to the effect."""
        return (*(p.name for p in self.parameters), *self.derived, *self.states, *self.memories)
