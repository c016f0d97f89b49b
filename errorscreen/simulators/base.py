"""The contract that every simulator keeps; all above this floor knows a simulator only by it."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.data.observations import Observation
from errorscreen.effects.base import DURING, Effect
from errorscreen.events import Event
from errorscreen.exceptions import InputError, SimulationError, unknown_name
from errorscreen.parameters import ParameterSpace


class Status(IntEnum):
    """How one simulation of a batch ended."""

    OK = 0
    DIVERGED = 1
    NO_EQUILIBRIUM = 2
    FAILED = 3


REMEDIES = {
    Status.OK: "",
    Status.DIVERGED: "the response left the plausible range or became NaN: reduce the step, narrow the parameter "
    "bounds, or check the units of the recording",
    Status.NO_EQUILIBRIUM: "no steady state exists for the recorded pre-event values: check the sign and base "
    "of P and Q, or the limits of the device",
    Status.FAILED: "the program raised an error, or returned values that are not finite, or branches that were opened "
    "left an island: call it with these parameters by itself, and narrow the bounds where it does not work",
}


@dataclass(frozen=True)
class Responses:
    """Responses of a batch of simulations; failures are data.

    Parameters
    ----------
    values : ndarray of shape (n, R, L)
        NaN in every row whose status is not ``Status.OK``.
    status : ndarray of shape (n,), int
        `Status` of each row.
    time : ndarray of shape (L,)
        Seconds.
    channels : tuple of str
        Names of the R channels.
    detail : str
        What is known about the first failure beside its status.
    """

    values: NDArray[np.float64]
    status: NDArray[np.int64]
    time: NDArray[np.float64]
    channels: tuple[str, ...]
    detail: str = ""

    @property
    def ok(self) -> NDArray[np.bool_]:
        """True for rows that ended well, shape (n,)."""
        return self.status == Status.OK

    def failures(self) -> str:
        """Count failed rows with their remedy; empty if there are none."""
        parts = []
        for status in Status:
            count = int(np.sum(self.status == status))
            if count and status != Status.OK:
                parts.append(f"{count} of {len(self.status)} simulations {status.name}: {REMEDIES[status]}")
        return "; ".join([*parts, f"the first: {self.detail}"] if parts and self.detail else parts)

    def require_ok(self, what: str = "simulation") -> Responses:
        """Return self, or raise `SimulationError` with the remedy if any row failed."""
        if not self.ok.all():
            raise SimulationError(f"{what} failed: {self.failures()}.")
        return self


class Simulator(ABC):
    """An immutable model that turns parameters and an event into responses.

    Attributes
    ----------
    parameters : ParameterSpace
        The m candidate parameters; everything else keeps its value.
    channels : tuple of str
        Names of the R observed channels.
    units : tuple of str
        Their units.
    effects : tuple of Effect
        Effects that could be added with `extend`.
    extensions : tuple of Effect
        Those that have been added.
    event : Event
        The event that `simulate` uses where none is given.
    """

    parameters: ParameterSpace
    channels: tuple[str, ...]
    units: tuple[str, ...]
    effects: tuple[Effect, ...] = ()
    extensions: tuple[Effect, ...] = ()
    event: Event

    @abstractmethod
    def simulate(self, theta: ArrayLike, event: Event | None = None) -> Responses:
        """Simulate every row of `theta` (n, m); a failed row has a status and NaN, and never raises."""

    @property
    def threads(self) -> int:
        """How many threads may simulate at the same time; 1 where it is not known that several may."""
        return 1

    @abstractmethod
    def observe(self, recording: Any) -> Observation:
        """Bring a recording onto this simulator's channels, units and time grid."""

    def part(self, observation: Observation, samples: int) -> Observation:
        """Return what was observed at the first instants only, in a form that this simulator can be compared with.

        Parameters
        ----------
        observation : Observation
        samples : int
            From 2 to L.
        """
        return observation.first(samples)

    def extend(self, effect: Effect | str, **options: Any) -> Simulator:
        """Add an effect of the library; its parameters join `parameters`, the strength first.

        Parameters
        ----------
        effect : Effect or str
            One of `effects`, or its name; also for one recording only, see `Effect.during`.
        **options : mapping
            Changes of a parameter's fields by its short name, for example ``K={"nominal": 50.0}``.

        Returns
        -------
        Simulator

        Raises
        ------
        InputError
            If the effect is unknown or has been added before.
        """
        wanted = effect if isinstance(effect, str) else str(getattr(effect, "name", effect))
        if not self.effects:
            raise InputError(f"{type(self).__name__} has no ports, so {wanted!r} cannot be added")
        library = {e.name: e for e in self.effects}
        name, _, recording = (wanted, "", "") if wanted in library else wanted.partition(DURING)
        recording = getattr(effect, "recording", recording)
        if name not in library:
            raise unknown_name(wanted, library, kind="effect", where=repr(self))
        added = library[name]
        if recording:
            added = added.during(recording, rename=wanted != name)
        self.addable([added], asked=True)
        space = ParameterSpace(added.parameters).replace(options)
        extended = copy.copy(self)
        extended.parameters = self.parameters.extend(replace(p, name=added.local(p.name)) for p in space)
        extended.extensions = (*self.extensions, added)
        return extended

    def addable(self, effects: Iterable[Effect], *, asked: bool) -> list[Effect]:
        """Effects that can be added beside those that have been.

        Parameters
        ----------
        effects : iterable of Effect
        asked : bool
            Whether each was asked for, so that it must not be left out.

        Raises
        ------
        InputError
            If one that was asked for has been added before, for each recording.
        """
        effects = list(effects)
        new = [e for e in effects if not any(other.clashes_with(e) for other in self.extensions)]
        left = {e.original for e in new}
        had = [e.name for e in effects if e.original not in left]
        if asked and had:
            raise InputError(f"the effect {had[0]!r} has been added before", where=repr(self))
        return new

    def effects_named(self, names: Iterable[str] | None) -> list[Effect]:
        """Effects of the library by name; all but unknown signals where no names are given.

        Parameters
        ----------
        names : iterable of str or None

        Raises
        ------
        InputError
            If a name is not that of an effect.
        """
        if isinstance(names, str):
            raise InputError(f"effects is the text {names!r}", allowed="a list of names of effects")
        library = {e.name: e for e in self.effects if e.kind != "latent"}
        chosen = list(library if names is None else names)
        for name in chosen:
            if name not in library:
                raise unknown_name(name, library, kind="effect", where=repr(self))
        return [library[name] for name in chosen]

    def acting(self, theta: ArrayLike, event: Event) -> NDArray[np.float64]:
        """Return parameter vectors (n, m) with all effects off that act in other recordings only.

        Rows that become equal have the same response to the event.

        Parameters
        ----------
        theta : array-like of shape (n, m)
        event : Event
        """
        theta = np.asarray(theta, dtype=float)
        off = [effect for effect in self.extensions if not effect.acts_in(event)]
        if off:
            theta = theta.copy()
        for effect in off:
            columns = [self.parameters.index(effect.local(p.name)) for p in effect.parameters]
            theta[:, columns] = [0.0, *(p.nominal for p in effect.parameters[1:])]
        return theta

    def _present(self, event: Event) -> tuple[Effect, ...]:
        """Effects that act in an event, by the names that the model knows them by."""
        acting = (e for e in self.extensions if e.acts_in(event))
        return tuple(replace(e, name=e.original) if e.recording else e for e in acting)

    def _named(self, theta: NDArray[np.float64], event: Event) -> dict[str, NDArray[np.float64]]:
        """Parameters (n,) by the names that the model knows them by, without those of effects that do not act."""
        values = dict(zip(self.parameters.names, theta.T, strict=True))
        for effect in self.extensions:
            if effect.recording:
                own = {p.name: values.pop(effect.local(p.name)) for p in effect.parameters}
                if effect.acts_in(event):
                    values |= {f"{effect.original}.{name}": column for name, column in own.items()}
        return values

    def with_uncertainty(
        self, observation: Observation, theta: ArrayLike, estimated: ArrayLike | None = None
    ) -> Observation:
        """Return an observation with the uncertainty that it has if `theta` are the true parameters.

        What the noise of injected signals makes depends on the model; without injected signals nothing changes.

        Parameters
        ----------
        observation : Observation
        theta : array-like of shape (m,)
        estimated : array-like of shape (m,), optional
            Parameters with which `Observation.noise` was estimated; the nominal ones where not given.
        """
        return observation

    def propagated_noise(self, observation: Observation, theta: ArrayLike) -> NDArray[np.float64]:
        """Energy of what each of D draws of the noise of injected signals makes, in squared deviations.

        Parameters
        ----------
        observation : Observation
        theta : array-like of shape (n, m)

        Returns
        -------
        ndarray of shape (D, n, R)
            0 without injected signals, NaN where it cannot be simulated or another response comes out.
        """
        return np.zeros((1, len(np.atleast_2d(theta)), len(self.channels)))

    def fit_initial_state(self, observation: Observation) -> Observation:
        """Return a recording with what belongs to it alone estimated from its beginning, as an unknown initial state.

        Models are compared on recordings that were not fitted; each gets the start that suits it best, and nothing else
        is adapted. Without anything of that kind the observation is returned as it is.

        Parameters
        ----------
        observation : Observation
        """
        return observation

    def trajectories(
        self, theta: ArrayLike, event: Event, device: str = ""
    ) -> dict[str, NDArray[np.float64]]:
        """States inside a model on the time axis of an event (L,), by name; empty where they cannot be seen.

        Parameters
        ----------
        theta : array-like of shape (m,)
        event : Event
        device : str
            Unit of a grid.
        """
        return {}

    def refined(self, factor: int) -> Simulator:
        """Return this simulator with a step so many times smaller; itself where it has no step.

        Parameters
        ----------
        factor : int
        """
        step = getattr(self, "step", None)
        return self if step is None else self.with_step(step / factor)

    def with_step_of(self, other: Simulator) -> Simulator:
        """Return this simulator with the step of another, see `refined`; itself where it has no step.

        Two models are compared fairly only if both are integrated alike.

        Parameters
        ----------
        other : Simulator
        """
        step = getattr(other, "step", None)
        return self if step is None else self.with_step(step)

    def with_step(self, step: float) -> Simulator:
        """Return this simulator with another longest step in seconds; itself where it has no step."""
        if getattr(self, "step", None) is None:
            return self
        changed = copy.copy(self)
        changed.step = step  # type: ignore[attr-defined]
        return changed

    def with_nominal(self, theta: ArrayLike) -> Simulator:
        """Return this simulator with other nominal values, for example calibrated ones.

        Bounds, and the scales that deviations are measured against, stay as they are.

        Parameters
        ----------
        theta : array-like of shape (m,)

        Raises
        ------
        InputError
            If there is not one finite value inside the bounds for each parameter.
        """
        values = self.parameters.validate(theta)[0]
        changes = {
            p.name: {"nominal": value, "scale": p.scale}
            for p, value in zip(self.parameters, values, strict=True)
        }
        changed = copy.copy(self)
        changed.parameters = self.parameters.replace(changes)
        return changed

    def settings(self) -> dict[str, Any]:
        """Everything that responses depend on beside parameters and event, for fingerprints of stored results.

        Override it in a simulator that has constants, steps or options of its own.
        """
        return {}

    def baseline(self, event: Event | None = None) -> NDArray[np.float64]:
        """Response at the nominal parameters, y₀ = F(θ₀), shape (R, L)."""
        responses = self.simulate(self.parameters.nominal, event)
        return responses.require_ok("the simulation at the nominal parameters").values[0]
