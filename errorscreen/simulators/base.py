"""The contract that every simulator keeps; all above this floor knows a simulator only by it."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.data.observations import Observation
from errorscreen.effects.base import DURING, Effect
from errorscreen.events import Event
from errorscreen.exceptions import InputError, SimulationError, unknown_name
from errorscreen.parameters import ParameterSpace

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class Status(IntEnum):
    """How a simulation ended."""

    OK = 0
    DIVERGED = 1
    NO_EQUILIBRIUM = 2
    FAILED = 3


REMEDIES = {
    Status.OK: "",
    Status.DIVERGED: "the response left the plausible range or became NaN: reduce the step, narrow the parameter "
    "bounds, or check the units of the recording",
    Status.NO_EQUILIBRIUM: "no steady state exists for the recorded pre-event values: check the sign and base "
    "of P and Q, or the limits of the device; if only some samples fail, their parameters do not allow these values",
    Status.FAILED: "the program raised an error or returned values that are not finite, or open branches left an "
    "island: call it with these parameters by itself, and narrow the bounds where it does not work",
}


@dataclass(frozen=True)
class Responses:
    """Responses of a batch of simulations. A failure is data: it has a status and NaN.

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
        Reason of the first failure, where one is known.
    """

    values: NDArray[np.float64]
    status: NDArray[np.int64]
    time: NDArray[np.float64]
    channels: tuple[str, ...]
    detail: str = ""

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Rows that ended well, shape (n,), bool."""
        return self.status == Status.OK

    def __repr__(self) -> str:
        n, _, length = self.values.shape
        return f"Responses({n} rows, {int(self.ok.sum())} ok, {', '.join(self.channels):.100}, {length} instants)"

    def to_frame(self) -> pd.DataFrame:
        """Responses with a row for each simulation and instant, and a column for each channel."""
        import pandas as pd

        n, _, length = self.values.shape
        index = pd.MultiIndex.from_product([range(n), self.time], names=["row", "time"])
        values = self.values.transpose(0, 2, 1).reshape(n * length, -1)
        return pd.DataFrame(values, index=index, columns=list(self.channels))

    def plot(self) -> Figure:
        """Figure with a panel for each channel and a line for each row."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7.0, 1.0 + 1.5 * len(self.channels)), layout="constrained")
        panels = figure.subplots(len(self.channels), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name, rows in zip(panels, self.channels, self.values.swapaxes(0, 1), strict=True):
            axes.plot(self.time, rows.T, lw=1.0)
            axes.set_ylabel(name)
        panels[-1].set_xlabel("Time in s")
        return figure

    def summary(self) -> str:
        """Numbers of simulations and failures, with the remedy of each failure."""
        return f"{int(self.ok.sum())} of {len(self.status)} simulations ended well. {self.failures()}".strip()

    def failures(self) -> str:
        """Number of failed rows for each reason, with the remedy; empty if there are none."""
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
    """Abstract base: an immutable model that turns parameters and an event into responses.

    Attributes
    ----------
    parameters : ParameterSpace
        The m candidate parameters.
    channels : tuple of str
        Names of the R observed channels.
    units : tuple of str
        Their units.
    effects : tuple of Effect
        The library: effects that `extend` can add.
    extensions : tuple of Effect
        Added effects.
    event : Event
        Default event of `simulate`.
    usual_effects : int
        Number of effects that a search names together at most where nobody states it.
    """

    parameters: ParameterSpace
    channels: tuple[str, ...]
    units: tuple[str, ...]
    effects: tuple[Effect, ...] = ()
    extensions: tuple[Effect, ...] = ()
    event: Event
    usual_effects: int = 2

    @property
    def movable(self) -> tuple[str, ...]:
        """Names of the parameters that a fit moves: all but the strengths of added switches, see `Effect.switch`."""
        fixed = {effect.local(effect.strength.name) for effect in self.extensions if effect.switch}
        return tuple(name for name in self.parameters.names if name not in fixed)

    def _short(self, model: str) -> str:
        """Text for `repr`: the model, its effects and the number of its parameters, in less than 200 characters."""
        names = " + ".join([model, *(effect.name for effect in self.extensions)])
        names = names if len(names) < 140 else f"{names[:137]}..."
        return f"{type(self).__name__}({names}, {len(self.parameters)} parameters)"

    @abstractmethod
    def simulate(self, theta: ArrayLike, event: Event | None = None) -> Responses:
        """Simulate every row of `theta` (n, m); a failed row never raises.

        Parameters
        ----------
        theta : array-like of shape (n, m)
        event : Event, optional
            `self.event` where not given.

        Returns
        -------
        Responses
        """

    @property
    def threads(self) -> int:
        """Number of threads that may simulate at the same time."""
        return 1

    @abstractmethod
    def observe(self, recording: Any) -> Observation:
        """Bring a recording onto this simulator's channels, units and time grid; an `Observation` stays as it is."""

    def part(self, observation: Observation, samples: int) -> Observation:
        """Return the first `samples` instants (2 to L) of an observation, in a form that this simulator simulates."""
        return observation.first(samples)

    def extend(self, effect: Effect | str, **options: Any) -> Simulator:
        """Return this simulator with an effect of the library; its parameters follow, the strength first.

        Parameters
        ----------
        effect : Effect or str
            One of `effects`, or its name; also for one recording only, see `Effect.during`.
        **options : mapping
            Changes of a parameter's fields by its short name, for example ``K={"nominal": 50.0}``.

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
        """Effects that do not clash with added ones; with `asked`, a clash of each kind raises `InputError`."""
        effects = list(effects)
        new = [e for e in effects if not any(other.clashes_with(e) for other in self.extensions)]
        left = {e.original for e in new}
        had = [e.name for e in effects if e.original not in left]
        if asked and had:
            raise InputError(f"the effect {had[0]!r} has been added before", where=repr(self))
        return new

    def effects_named(self, names: Iterable[str] | None) -> list[Effect]:
        """Effects of the library by name, all but unknown signals for None; an unknown name raises `InputError`."""
        if isinstance(names, str):
            raise InputError(f"effects is the text {names!r}", allowed="a list of names of effects")
        library = {e.name: e for e in self.effects if e.kind != "latent"}
        chosen = list(library if names is None else names)
        for name in chosen:
            if name not in library:
                raise unknown_name(name, library, kind="effect", where=repr(self))
        return [library[name] for name in chosen]

    def acting(self, theta: ArrayLike, event: Event) -> NDArray[np.float64]:
        """Return `theta` (n, m) with the effects switched off that act in other recordings only."""
        theta = np.asarray(theta, dtype=float)
        off = [effect for effect in self.extensions if not effect.acts_in(event)]
        if off:
            theta = theta.copy()
        for effect in off:
            columns = [self.parameters.index(effect.local(p.name)) for p in effect.parameters]
            theta[:, columns] = [0.0, *(p.nominal for p in effect.parameters[1:])]
        return theta

    def _present(self, event: Event) -> tuple[Effect, ...]:
        """Effects that act in an event, under their original names."""
        acting = (e for e in self.extensions if e.acts_in(event))
        return tuple(replace(e, name=e.original) if e.recording else e for e in acting)

    def _named(self, theta: NDArray[np.float64], event: Event) -> dict[str, NDArray[np.float64]]:
        """Parameters (n,) by their original names, without those of effects that do not act."""
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
        """Return an observation with its uncertainty if `theta` are the true parameters.

        The noise of injected signals passes through the model, so its effect depends on the parameters. Without
        injected signals the observation is returned as it is.

        Parameters
        ----------
        observation : Observation
        theta : array-like of shape (m,)
        estimated : array-like of shape (m,), optional
            Parameters with which `Observation.noise` was estimated; the nominal ones where not given.
        """
        return observation

    def propagated_noise(self, observation: Observation, theta: ArrayLike) -> NDArray[np.float64]:
        """Energy of the propagated noise in squared deviations, for each of D draws of the injected signals' noise.

        Parameters
        ----------
        observation : Observation
        theta : array-like of shape (n, m)

        Returns
        -------
        ndarray of shape (D, n, R)
            0 without injected signals; NaN where a simulation fails or the noise changes the kind of response.
        """
        return np.zeros((1, len(np.atleast_2d(theta)), len(self.channels)))

    def fit_initial_state(self, observation: Observation) -> Observation:
        """Return an observation with its unknown initial states estimated from its beginning.

        Models are compared on recordings that were not fitted. Each model starts there from its own best initial state;
        nothing else is fitted. Without unknown initial states the observation is returned as it is.
        """
        return observation

    def trajectories(
        self, theta: ArrayLike, event: Event, device: str = ""
    ) -> dict[str, NDArray[np.float64]]:
        """States of the model by name, each (L,) on the time axis of an event; empty where they are not available.

        Parameters
        ----------
        theta : array-like of shape (m,)
        event : Event
        device : str
            Unit of a grid.
        """
        return {}

    def refined(self, factor: int) -> Simulator:
        """Return this simulator with its step divided by `factor`; itself where it has no step."""
        step = getattr(self, "step", None)
        return self if step is None else self.with_step(step / factor)

    def with_step_of(self, other: Simulator) -> Simulator:
        """Return this simulator with the step of another: a fair comparison needs equal steps."""
        step = getattr(other, "step", None)
        return self if step is None else self.with_step(step)

    def with_step(self, step: float) -> Simulator:
        """Return this simulator with another longest step in seconds; itself where it has none."""
        if getattr(self, "step", None) is None:
            return self
        changed = copy.copy(self)
        changed.step = step  # type: ignore[attr-defined]
        return changed

    def with_nominal(self, theta: ArrayLike) -> Simulator:
        """Return this simulator with other nominal values (m,), for example calibrated ones.

        Bounds and scales stay as they are. A value that is not finite or outside its bounds raises `InputError`.
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
        """Constants, step and options that responses depend on, for fingerprints of stored results."""
        return {}

    def baseline(self, event: Event | None = None) -> NDArray[np.float64]:
        """Nominal response y₀ = F(θ₀), shape (R, L); `SimulationError` if it fails."""
        responses = self.simulate(self.parameters.nominal, event)
        return responses.require_ok("the simulation at the nominal parameters").values[0]
