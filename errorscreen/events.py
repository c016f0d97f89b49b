"""Events: the inputs of a simulator and the time axis of its responses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.display import Displayed, listed, span
from errorscreen.exceptions import InputError, check_real

#: apparent power in pu below which a unit counts as unloaded
IDLE = 0.05


@dataclass(frozen=True)
class Event(Displayed):
    """A disturbance, on the time grid of its observation.

    Parameters
    ----------
    time : ndarray of shape (L,)
        Instants of the responses in seconds; uniform, increasing.
    name : str
        For tables and plots.
    start : float
        Start of the disturbance in seconds on the same axis; everything before it is the quiet part.
    """

    time: NDArray[np.float64]
    name: str = "event"
    start: float = 0.0

    def __post_init__(self) -> None:
        time = np.asarray(self.time, dtype=float)
        if time.ndim != 1 or len(time) < 2:
            raise InputError(f"the time axis has shape {time.shape}", allowed="at least two instants")
        with np.errstate(invalid="ignore"):  # values that are not finite do not pass
            mean = (time[-1] - time[0]) / (len(time) - 1)
            uniform = mean > 0 and np.abs(np.diff(time) - mean).max() <= 1e-9 + 1e-6 * mean
        if not (uniform and np.isfinite(mean)):
            problem = "the time axis of an event is not uniform and increasing"
            raise InputError(problem, remedy="Resample the recording first (Recording.resample)")
        object.__setattr__(self, "time", time)

    def _facts(self) -> dict[str, Any]:
        facts = {"name": self.name, "time": span(self.time), "start": f"{self.start:g} s"}
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name in facts:
                continue
            if isinstance(value, Mapping):
                facts |= {item.name: listed(value)} if value else {}
            elif isinstance(value, np.ndarray):
                facts[item.name] = f"array of shape {value.shape}"
            elif value != item.default:
                facts[item.name] = value
        return facts

    @property
    def dt(self) -> float:
        """Step of the time axis in seconds."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    def first(self, samples: int) -> Self:
        """Return the event on the first instants of its time axis only.

        Kinds of events that hold more arrays along the time axis cut these too.

        Parameters
        ----------
        samples : int
            From 2 to L.
        """
        return replace(self, time=self.time[:samples])


@dataclass(frozen=True)
class _Driven(Event):
    """An event that drives a simulator with signals over its time axis."""

    signals: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, values in self.signals.items():
            if np.shape(values) != self.time.shape or not np.all(np.isfinite(values)):
                problem = f"signal {name!r} has shape {np.shape(values)} or holds values that are not finite"
                raise InputError(problem, allowed=f"{len(self.time)} finite values")

    def first(self, samples: int) -> Self:
        """Return the event on the first instants of its time axis only, see `Event.first`."""
        signals = {name: np.asarray(values)[:samples] for name, values in self.signals.items()}
        return replace(self, time=self.time[:samples], signals=signals)


@dataclass(frozen=True)
class SetPointStep:
    """A step of a set-point at a known instant.

    Parameters
    ----------
    quantity : str
        ``"Vref"``, ``"Pref"``, ``"Qref"``, ``"Qext"`` or ``"Fref"``.
    time : float
        Instant in seconds on the time axis of the recording.
    size : float, optional
        In pu; a candidate parameter where not given.

    Examples
    --------
    >>> SetPointStep("Vref", 1.0, 0.02).size
    0.02
    """

    quantity: str
    time: float
    size: float | None = None

    def __post_init__(self) -> None:
        where = f"step of {self.quantity}"
        check_real(self.time, "the instant", where=where)
        if self.size is not None and check_real(self.size, "the size", where=where) == 0:
            raise InputError(
                "the size is 0", where=where, allowed="another number, or none if it is to be found"
            )


@dataclass(frozen=True)
class Playback(_Driven):
    """Measured signals that are injected at the terminal of a device.

    Parameters
    ----------
    signals : mapping of str to ndarray of shape (L,)
        ``"V"`` magnitude in pu and, where recorded, ``"angle"`` in rad; ``"P"`` and ``"Q"`` in pu where the voltage
        behind an impedance is wanted, or without V where power is imposed; ``"Efd"``, ``"Pm"`` in pu where they drive
        the device.
    initial : mapping of str to float
        Pre-event values that give the equilibrium: ``"V"``, ``"P"``, ``"Q"`` in pu; and those of ``"Efd"``, ``"Pm"``;
        ``"f"`` in Hz where power is imposed, nominal where not given.
    noise : mapping of str to float
        Standard deviation of the measurement noise of each signal; ``"f"`` where the angle is the integral of a
        frequency. Empty for signals without noise.
    age : float
        Seconds that readings may be older than their time stamps, because a meter holds them.
    steps : tuple of SetPointStep
        Steps of set-points of the device.
    fine : Playback, optional
        The same at every reading, where the signals are averages over several of them.
    """

    noise: Mapping[str, float] = field(default_factory=dict)
    age: float = 0.0
    steps: tuple[SetPointStep, ...] = ()
    fine: Playback | None = None

    def first(self, samples: int) -> Self:
        """Return the event on the first instants of its time axis only, see `Event.first`."""
        part = super().first(samples)
        if self.fine is None:
            return part
        until = int(np.searchsorted(self.fine.time, part.time[-1], side="right"))
        return replace(part, fine=self.fine.first(until))

    @property
    def by_power(self) -> bool:
        """Whether P and Q are imposed instead of the voltage."""
        return "V" not in self.signals

    @property
    def kind(self) -> str:
        """Word for reports: load rejection, open-circuit test, step test, or else disturbance.

        Where power is imposed, the apparent power tells: it falls below 0.05 pu, or is below from the beginning on.

        Examples
        --------
        >>> time = np.arange(0, 2, 0.1)
        >>> power = {"P": np.where(time < 1, 0.8, 0.0), "Q": 0 * time}
        >>> Playback(time, "breaker", 1.0, power, {"V": 1.0, "P": 0.8, "Q": 0.0}).kind
        'load rejection'
        """
        if self.by_power:
            late = self.time >= 0.5 * (self.start + self.time[-1])
            after = np.median(np.hypot(self.signals["P"][late], self.signals["Q"][late]))
            if after < IDLE:
                before = np.hypot(self.initial["P"], self.initial["Q"])
                return "load rejection" if before >= IDLE else "open-circuit test"
        return "step test" if self.steps else "disturbance"


@dataclass(frozen=True)
class InputSignal(_Driven):
    """Measured inputs of a model, and its initial state.

    Parameters
    ----------
    signals : mapping of str to ndarray of shape (L,)
        Inputs by name, in their units; empty for a model without inputs.
    initial : mapping of str to float
        States at the first instant that the simulator does not know by itself.

    Examples
    --------
    >>> time = np.arange(0, 1, 0.01)
    >>> InputSignal(time, "step", 0.5, {"u": 1.0 * (time >= 0.5)}).start
    0.5
    """


@dataclass(frozen=True)
class GridEvent(Event):
    """A disturbance of a simulated grid; this base class changes nothing.

    Parameters
    ----------
    level : float
        Factor on all loads and the active power of all generators before the disturbance.
    """

    level: float = field(default=1.0, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_real(self.level, "the load level", low=0, above=True, where=self.name)

    def changes(self, network: Any) -> tuple[tuple[float, Any], ...]:
        """Instants in seconds, and the grid from each of them on.

        Parameters
        ----------
        network : errorscreen.power.network.Network
            The grid before the event.
        """
        return ()


@dataclass(frozen=True)
class BusFault(GridEvent):
    """A symmetrical short circuit at a bus, which is cleared later.

    Parameters
    ----------
    bus : int
    duration : float
        Seconds until it is cleared.
    impedance : complex
        To ground, in pu of the grid's base; 0 is a bolted fault.
    opened : tuple of (int, int, float, str or None)
        Branches that open when the fault is cleared: their buses, the share of the admittance that goes out of
        service, and the circuit where there are several.

    Examples
    --------
    >>> fault = BusFault(np.arange(0, 5, 0.01), "fault at bus 3", 1.0, bus=3, duration=0.1)
    >>> fault.start, fault.impedance
    (1.0, 0.0)
    """

    bus: int = field(kw_only=True)
    duration: float = field(default=0.1, kw_only=True)
    impedance: complex = field(default=0.0, kw_only=True)
    opened: tuple[tuple[int, int, float, str | None], ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_real(self.duration, "the duration", low=0, above=True, where=self.name)
        for _, _, share, _ in self.opened:
            check_real(share, "the opened share", low=0, high=1, where=self.name)

    def changes(self, network: Any) -> tuple[tuple[float, Any], ...]:
        """Grid with the fault, and after it."""
        after = network
        for bus, other, share, circuit in self.opened:
            after = after.with_branch_share(bus, other, 1 - share, circuit)
        during = network.with_fault(self.bus, self.impedance)
        return (self.start, during), (self.start + self.duration, after)


@dataclass(frozen=True)
class LineTrip(GridEvent):
    """The opening of a branch at both ends.

    Parameters
    ----------
    ends : (int, int)
        Its buses.
    circuit : str, optional
        Name of the circuit where there are several.

    Examples
    --------
    >>> LineTrip(np.arange(0, 5, 0.01), "line 3-4 out", 1.0, ends=(3, 4)).ends
    (3, 4)
    """

    ends: tuple[int, int] = field(kw_only=True)
    circuit: str | None = field(default=None, kw_only=True)

    def changes(self, network: Any) -> tuple[tuple[float, Any], ...]:
        """Grid without the branch."""
        return ((self.start, network.with_line_out(*self.ends, self.circuit)),)


@dataclass(frozen=True)
class LoadStep(GridEvent):
    """A step of loads, which are impedances, so the factor is that of their power at the voltage before.

    Parameters
    ----------
    factor : float
    buses : tuple of int, optional
        All loads where not given.

    Examples
    --------
    >>> LoadStep(np.arange(0, 5, 0.01), "load at bus 4 + 20 %", 1.0, factor=1.2, buses=(4,)).factor
    1.2
    """

    factor: float = field(kw_only=True)
    buses: tuple[int, ...] | None = field(default=None, kw_only=True)

    def changes(self, network: Any) -> tuple[tuple[float, Any], ...]:
        """Grid with the changed loads."""
        return ((self.start, network.with_load_scaled(self.factor, self.buses)),)
