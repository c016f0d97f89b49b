"""An effect: a mechanism that a model lacks, as data that the engine switches on and off.

Every effect of the library is compiled into the models of its devices. **At strength 0 it is an exact identity**, bit
for bit, also beside simulations that use it; its calls are skipped where no simulation of a block uses it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.engine.stages import Equations
from errorscreen.exceptions import unknown_name
from errorscreen.parameters import Parameter

Values = dict[str, NDArray[np.float64]]

#: an effect belongs to the plant, changes its constants, belongs to the measurement, to the event in the grid, or is an
#: unknown signal
KINDS = ("mechanism", "constants", "measurement", "event", "latent")
#: prefix of a port that is a measured channel, and the port of all channels
CHANNEL, ALL_CHANNELS = "channel.", "channels"
#: between the name of an effect and the name of the only recording in which it acts
DURING = "@"
#: scale of a parameter in multiples of its range: a prior of 0.3 times that is nearly flat
_SCALE = 2.0


def nothing(values: Values, h: float) -> Values:
    """Start every state of an effect at zero."""
    return {}


def strength(
    name: str, typical: float, upper: float, unit: str, of: str, symbol: str, description: str,
    lower: float = 0.0, scale: float | None = None,
) -> Parameter:  # fmt: skip
    """First parameter of an effect, which is the identity at 0; see `value` for the others."""
    return value(name, typical, lower, upper, unit, of, symbol, description, scale)


def value(
    name: str, typical: float, lower: float, upper: float, unit: str, of: str, symbol: str, description: str,
    scale: float | None = None,
) -> Parameter:  # fmt: skip
    """Parameter of an effect, with a prior of 0.3 times `scale`, which is wide where only the range is known."""
    scale = _SCALE * (upper - lower) if scale is None else scale
    return Parameter(name, typical, lower, upper, unit, of, symbol, description, scale=scale)


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
        The quantity it changes: a port of the device, ``"channel." + name`` for a measured channel, ``"channels"``
        for all of them, or a constant of the device, without the name of the part that has it.
    equations : callable
        The first argument, ``value``, is the quantity at the port. The others are quantities of the device, or the
        effect's own states, parameters and derived constants. Returns the new value, then those of the ports
        `beside`, then the derivatives of the states. Of a measurement: ``equations(values, h, *parameters)`` returns
        the measured record (n, L) from the true one ``values`` (n, L), with the step `h` in seconds and parameters
        (n,). Of an event: ``equations(event, *parameters)`` returns the event as it was. Of constants:
        ``equations(*parameters)`` returns the values of `port` and `beside`.
    parameters : tuple of Parameter
        The first is the strength: 0 is allowed and is the identity.
    states : tuple of str
        Integrated together with the device.
    derived : tuple of str
        Constants that `initialise` computes from parameters and step.
    initialise : callable
        ``initialise(values, h)`` returns start values of states (zero where missing) and the derived constants;
        `values` holds all of the device at its equilibrium, the effect's parameters, and ``"t_event"`` and
        ``"t_stop"``, the seconds from the beginning of the record to the event and to its end.
    recorded : callable, optional
        Of a measurement: ``recorded(value, *parameters)`` returns the true value before the event from the recorded
        one.
    kind : {"mechanism", "constants", "measurement", "event", "latent"}
        Effects on constants act before the start, so the equilibrium follows.
    devices : tuple of str
        Names of the devices whose models it is compiled into, or tags that a device may have.
    device : str
        Unit of a grid that it belongs to; empty in a plant, and for a measurement.
    description : str
        One paragraph for engineers.
    formula : str
        Its equations in one line, for reports.
    source : str
        Where the equations come from.
    confused_with : tuple of str
        Causes of a similar error.
    beside : tuple of str
        Further ports that it changes; the same equations of the device write them.
    minima : int
        Rough number of local minima of a fit; a search draws that many times more values. Oscillations and timers have
        many.
    smallest : mapping of str to float
        Smallest magnitude of a parameter that matters; a search draws in the logarithm from there.
    event_specific : bool
        Belongs to one recording and not to the plant: an error of the event's record, or a forced oscillation.
    recording : str
        Name of the only event in which it acts; empty for all.
    usual : float, optional
        Value of the strength that is likely by itself, such as a = 1 of a part that does not act at all.
    switch : bool
        On or off and nothing between: the strength is nominal where the effect is added, and no fit moves it.
    told : str
        Title of the effect in a unit of standard models, with ``{unit}`` and the names of its slots, ``{exciter}``, in
        place of their models; the title where empty.
    reading : callable, optional
        ``reading(title, values)`` returns the title for fitted values: value, lower and upper end of each parameter by
        its short name.
    record : callable, optional
        ``record(values)`` returns the standard model with the same equations, as its name and its constants, from the
        parameters of the effect and ``"P"``, the power before the event.
    """

    name: str
    title: str
    port: str
    equations: Equations
    parameters: tuple[Parameter, ...]
    states: tuple[str, ...] = ()
    derived: tuple[str, ...] = ()
    initialise: Callable[[Values, float], Values] = nothing
    recorded: Callable[..., NDArray[np.float64]] | None = None
    kind: str = "mechanism"
    devices: tuple[str, ...] = ()
    device: str = ""
    description: str = ""
    formula: str = ""
    source: str = ""
    confused_with: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()
    minima: int = 1
    smallest: Mapping[str, float] = field(default_factory=dict, hash=False)
    event_specific: bool = False
    recording: str = ""
    usual: float | None = None
    switch: bool = False
    told: str = ""
    reading: Callable[[str, Mapping[str, tuple[float, float, float]]], str] | None = None
    record: Callable[[Mapping[str, float]], tuple[str, dict[str, float]]] | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise unknown_name(self.kind, KINDS, kind="kind of effect", where=f"effect {self.name!r}")

    @property
    def strength(self) -> Parameter:
        """The parameter that makes the effect an identity where it is zero."""
        return self.parameters[0]

    @property
    def fitted(self) -> tuple[Parameter, ...]:
        """Parameters that a fit moves: all but the strength of a switch."""
        return self.parameters[1:] if self.switch else self.parameters

    @property
    def channels(self) -> tuple[str, ...]:
        """Measured channels that it acts on; none for all channels, and inside the model."""
        ports = (self.port, *self.beside)
        return tuple(port.removeprefix(CHANNEL) for port in ports if port.startswith(CHANNEL))

    def distorts(self, channel: str) -> bool:
        """Whether it is a fault of the measurement of a channel."""
        return self.kind == "measurement" and (self.port == ALL_CHANNELS or channel in self.channels)

    @property
    def place(self) -> str:
        """Where it acts, for reports."""
        port = " and ".join((self.port, *self.beside)) if self.channels else self.port
        return port if not self.device else f"{self.device}: {port}"

    def at(self, device: str) -> Effect:
        """The same effect at one unit of a grid.

        Examples
        --------
        >>> from errorscreen.effects import GOVERNOR
        >>> GOVERNOR.at("synchronous_machine").name
        'synchronous_machine.governor'
        """
        return replace(self, name=f"{device}.{self.name}", device=device)

    def in_words(self, words: Mapping[str, str]) -> Effect:
        """The same effect with its title in the words of a unit, see `errorscreen.models.device.Device.words`.

        Examples
        --------
        >>> from errorscreen.effects import GOVERNOR_ACTING
        >>> GOVERNOR_ACTING.in_words({"governor": "TGOV1", "unit": "unit 1"}).title
        'The governor TGOV1 of unit 1 did not act'
        """
        return replace(self, title=self.told.format_map(words)) if self.told and words else self

    def during(self, recording: str, *, rename: bool = True) -> Effect:
        """The same effect, in the event of one recording only.

        Parameters
        ----------
        recording : str
            Name of the event.
        rename : bool
            Whether its name holds the recording; otherwise a model can have it for one recording only.

        Examples
        --------
        >>> from errorscreen.effects import FAULT_DURATION
        >>> FAULT_DURATION.during("fault at 3").name
        'fault_duration@fault at 3'
        """
        if not rename:
            return replace(self, recording=recording)
        # names of effects are joined by " + "
        name = f"{self.original}{DURING}{recording.replace(' + ', ' & ')}"
        return replace(self, name=name, title=f"{self.title}, in {recording}", recording=recording)

    def acts_in(self, event: Any) -> bool:
        """Whether it acts in an event."""
        return self.recording in ("", event.name)

    def clashes_with(self, other: Effect) -> bool:
        """Whether a model cannot have both: the same effect in the same event. Errors of an event's record add up."""
        if self.name == other.name:
            return True
        apart = self.recording and other.recording and self.recording != other.recording
        return self.original == other.original and self.kind != "event" and not apart

    @property
    def original(self) -> str:
        """Name in the model, without the recording."""
        return self.name.partition(DURING)[0]

    def local(self, name: str) -> str:
        """Name of one of the effect's own quantities in the model's name space."""
        return f"{self.name}.{name}"

    @property
    def own(self) -> tuple[str, ...]:
        """Names of all quantities that belong to the effect."""
        return (*(p.name for p in self.parameters), *self.derived, *self.states)
