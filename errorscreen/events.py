"""What happened: the inputs a simulator is driven with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.display import Displayed, listed, span
from errorscreen.exceptions import InputError, check_real


@dataclass(frozen=True)
class Event(Displayed):
    """A disturbance, on the time grid on which it is observed.

    Parameters
    ----------
    time : ndarray of shape (L,)
        Uniform, increasing, in seconds: where responses are wanted.
    name : str
        For tables and plots.
    start : float
        Time at which the disturbance begins, in seconds, on the same axis as `time`; everything before it
        is the quiet part.
    """

    time: NDArray[np.float64]
    name: str = "event"
    start: float = 0.0

    def __post_init__(self) -> None:
        time = np.asarray(self.time, dtype=float)
        if time.ndim != 1 or len(time) < 2:
            raise InputError(f"the time axis has shape {time.shape}", allowed="at least two instants")
        with np.errstate(invalid="ignore"):  # what is not finite does not pass
            mean = (time[-1] - time[0]) / (len(time) - 1)
            uniform = mean > 0 and np.abs(np.diff(time) - mean).max() <= 1e-9 + 1e-6 * mean
        if not (uniform and np.isfinite(mean)):
            raise InputError(
                "the time axis of an event is not uniform and increasing",
                remedy="Resample the recording first (Recording.resample)",
            )
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


def _check_signals(signals: Mapping[str, NDArray[np.float64]], time: NDArray[np.float64]) -> None:
    for name, values in signals.items():
        if np.shape(values) != time.shape or not np.all(np.isfinite(values)):
            raise InputError(
                f"signal {name!r} has shape {np.shape(values)} or holds values that are not finite",
                allowed=f"{len(time)} finite values",
            )


def _cut(signals: Mapping[str, NDArray[np.float64]], samples: int) -> dict[str, NDArray[np.float64]]:
    return {name: np.asarray(values)[:samples] for name, values in signals.items()}


@dataclass(frozen=True)
class Playback(Event):
    """Measured signals that are injected at the terminal of a device.

    Parameters
    ----------
    signals : mapping of str to ndarray of shape (L,)
        ``"V"`` magnitude in pu and, where recorded, ``"angle"`` in rad; ``"P"`` and ``"Q"`` in pu where the voltage
        behind an impedance is wanted.
    initial : mapping of str to float
        Pre-event values that the equilibrium is computed from: ``"V"``, ``"P"``, ``"Q"`` in pu.
    noise : mapping of str to float
        Standard deviation of the noise of what was measured of the signals, by name; ``"f"`` where the angle is the
        integral of a frequency. Empty for signals without noise.
    age : float
        Seconds that readings may be older than their time stamps, because a meter holds them.
    """

    signals: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    age: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_signals(self.signals, self.time)

    def first(self, samples: int) -> Self:
        """Return the event on the first instants of its time axis only, see `Event.first`."""
        return replace(self, time=self.time[:samples], signals=_cut(self.signals, samples))


@dataclass(frozen=True)
class InputSignal(Event):
    """Measured inputs of a model, and the state that it starts from.

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

    signals: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_signals(self.signals, self.time)

    def first(self, samples: int) -> Self:
        """Return the event on the first instants of its time axis only, see `Event.first`."""
        return replace(self, time=self.time[:samples], signals=_cut(self.signals, samples))


@dataclass(frozen=True)
class GridEvent(Event):
    """A disturbance of a simulated grid; by itself nothing happens.

    Parameters
    ----------
    level : float
        Load level before the disturbance: all loads and the active power of all generators are multiplied by it.
    """

    level: float = field(default=1.0, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_real(self.level, "the load level", low=0, above=True, where=self.name)

    def changes(self, network: Any) -> tuple[tuple[float, Any], ...]:
        """Instants in seconds and the grid from each of them on, from the grid before.

        Parameters
        ----------
        network : errorscreen.power.network.Network
        """
        return ()


@dataclass(frozen=True)
class BusFault(GridEvent):
    """A symmetrical short circuit at a bus that is cleared by itself.

    Parameters
    ----------
    bus : int
    duration : float
        Seconds until it is cleared.
    impedance : complex
        To ground, in pu of the grid's base; 0 is a bolted fault.
    opened : tuple of (int, int, float, str or None)
        Branches that clearing opens: their buses, the share of the admittance that is taken out of service, and the
        circuit where there are several.

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
        """Grid with the fault, and without it again."""
        after = network
        for bus, other, share, circuit in self.opened:
            after = after.with_branch_share(bus, other, 1 - share, circuit)
        return (
            (self.start, network.with_fault(self.bus, self.impedance)),
            (self.start + self.duration, after),
        )


@dataclass(frozen=True)
class LineTrip(GridEvent):
    """A branch that is opened at both ends.

    Parameters
    ----------
    ends : (int, int)
        Its buses.
    circuit : str, optional
        Which one, where there are several.

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
    """Loads that change at once; they are impedances, so the power at the voltage before is meant.

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
        """Grid with the other loads."""
        return ((self.start, network.with_load_scaled(self.factor, self.buses)),)
