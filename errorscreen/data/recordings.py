"""Recordings: measured channels over time, with bases, event, noise and assumptions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.display import Displayed, listed, span
from errorscreen.data import preparation, resampling, signals
from errorscreen.data.channels import ROLE_UNITS, Channel, channel_arrays, check_axes, summary_of
from errorscreen.data.panels import Curves, plot_curves, with_unit
from errorscreen.data.plausibility import warn_implausible
from errorscreen.events import SetPointStep
from errorscreen.exceptions import InputError, unknown_name

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Recording(Displayed):
    """A recorded disturbance of one plant, built by `from_arrays`, `errorscreen.data.read_csv` or `from_frame`.

    Parameters
    ----------
    name : str
    time : ndarray of shape (L,)
        Seconds, strictly increasing, not necessarily uniform.
    channels : mapping of str to Channel
    base_mva : float
        Base of P and Q.
    f_nominal : float
        Nominal frequency in Hz.
    event_time : float
        First instant of the disturbance in seconds.
    quiet : (float, float)
        First and last instant of the quiet part before the event, in seconds.
    base_kv : float, optional
        Base of V, line to line.
    given : mapping of str to float
        Pre-event values that were not measured, for example ``{"P": 0.54}``.
    assumptions : tuple of str
        Sentences on assumptions and repairs, for the report.
    steps : tuple of SetPointStep
        Steps of set-points of the plant; give them with ``dataclasses.replace``.
    stated : bool
        Whether the quiet part holds a stated level instead of readings.

    Raises
    ------
    InputError
        If shapes disagree, time does not increase strictly, a base or a noise is not positive, or there is no
        channel.
    """

    name: str
    time: NDArray[np.float64]
    channels: Mapping[str, Channel]
    base_mva: float
    f_nominal: float
    event_time: float
    quiet: tuple[float, float]
    base_kv: float | None = None
    given: Mapping[str, float] = field(default_factory=dict)
    assumptions: tuple[str, ...] = ()
    steps: tuple[SetPointStep, ...] = ()
    stated: bool = False

    def __post_init__(self) -> None:
        where = f"recording {self.name!r}"
        check_axes(self.time, {name: c.values for name, c in self.channels.items()}, where)
        positive = {"base_mva": self.base_mva, "f_nominal": self.f_nominal, "base_kv": self.base_kv}
        positive |= {f"the noise of {name}": c.noise for name, c in self.channels.items()}
        for what, value in positive.items():
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InputError(f"{what} is {value}", where=where, allowed="a positive number")

    @classmethod
    def from_arrays(
        cls,
        time: ArrayLike,
        values: Mapping[str, ArrayLike],
        *,
        base_mva: float,
        f_nominal: float,
        base_kv: float | None = None,
        name: str = "recording",
        units: Mapping[str, str] | None = None,
        event_time: float | None = None,
        noise: Mapping[str, float] | None = None,
        given: Mapping[str, float] | None = None,
        level: Mapping[str, float] | None = None,
        held: str = "drop",
        assumptions: Iterable[str] = (),
        copy: bool = True,
    ) -> Recording:
        """Build a recording from arrays that already have the units of `Channel`.

        Parameters
        ----------
        time : array-like of shape (L,)
            Seconds.
        values : mapping of str to array-like of shape (L,)
            Channels by name, NaN for gaps.
        base_mva, f_nominal, base_kv, name, given
            As in `Recording`.
        units : mapping of str to str, optional
            Units of channels other than V, angle, f, P and Q.
        event_time : float, optional
            Detected from V, P and Q by `errorscreen.data.moves.detect_event` where not given.
        noise : mapping of str to float, optional
            Known standard deviations; the others are estimated from the quiet part.
        level : mapping of str to float, optional
            Values before the event of V, P and Q, as far as they are channels, and perhaps of f, for a recording that
            begins in its event.
        held : {"drop", "keep"}
            Treatment of a meter that updates less often than it is read: leave only new readings, or keep the
            repeated ones.
        assumptions : iterable of str
            Sentences to begin with.
        copy : bool
            False where the arrays belong to nobody else, and are large.

        Raises
        ------
        InputError
            As `Recording`, and if no event or no quiet part is found, an earlier event precedes the stated one, or
            the recording ends with the event.

        Warns
        -----
        DataWarning
            If pre-event values are implausible, or a channel moves a little before the stated event.

        Examples
        --------
        >>> t = np.arange(300) / 60
        >>> rng = np.random.default_rng(0)
        >>> p = 0.8 - 0.2 * (t > 1.0) * np.exp(-(t - 1.0)) + rng.normal(0, 0.001, 300)
        >>> rec = Recording.from_arrays(t, {"P": p}, base_mva=100.0, f_nominal=60.0, name="trip")
        >>> round(rec.event_time, 3), round(rec.initial(["P"])["P"], 3), round(rec.channel("P").noise, 3)
        (1.017, 0.8, 0.001)
        """
        where, notes = f"recording {name!r}", list(assumptions)
        noise, given, units = noise or {}, dict(given or {}), units or {}
        t, arrays = channel_arrays(time, values, noise, given, where, copy=copy)
        if held not in ("drop", "keep"):
            raise unknown_name(str(held), ("drop", "keep"), kind="value of held", where=where)
        start = preparation.find_event(t, arrays, event_time, notes, where, stated=bool(level))
        ages = preparation.treat_held(t, arrays, held, notes)
        preparation.check_response(t, start, where)
        quiet = None if level else preparation.quiet_part(t, start, where)
        if quiet:
            preparation.check_rest(t, arrays, start, quiet, notes, where, stated=event_time is not None)
        named = {key: ROLE_UNITS.get(key) or units.get(key, "") for key in arrays}
        known = (quiet, noise, named, notes, where)
        sigma = {key: preparation.channel_noise(key, t, v, *known) for key, v in arrays.items()}
        if quiet is None:
            t, arrays, quiet = preparation.preceded(t, arrays, level or {}, f_nominal, notes, where)
        fixed = arrays if level else noise  # without a quiet part, it cannot be estimated again
        channels = {
            k: Channel(k, v, named[k], sigma[k], ages.get(k, 0), k in fixed) for k, v in arrays.items()
        }
        bases = (base_mva, f_nominal, start, quiet, base_kv)
        recording = cls(name, t, channels, *bases, given, stated=bool(level))
        initial = recording.initial(name for name in ("V", "f") if name in channels or name in given)
        notes += warn_implausible(t, arrays, initial, quiet, f_nominal, where)
        return replace(recording, assumptions=tuple(notes))

    @classmethod
    def from_signals(
        cls,
        time: ArrayLike,
        values: Mapping[str, ArrayLike],
        *,
        name: str = "recording",
        units: Mapping[str, str] | None = None,
        noise: Mapping[str, float] | None = None,
        event_time: float | None = None,
    ) -> Recording:
        """Build a recording of any system, without bases and with no need of a quiet part or an event.

        Parameters
        ----------
        time : array-like of shape (L,)
            Seconds.
        values : mapping of str to array-like of shape (L,)
            Inputs and outputs by name, NaN for gaps.
        name : str
        units : mapping of str to str, optional
        noise : mapping of str to float, optional
            Known standard deviations. The others are estimated from the part before `event_time`, or else from
            differences between readings, which overestimate the noise of a fast signal.
        event_time : float, optional
            Everything is at rest before it. Where not given there is no such part.

        Raises
        ------
        InputError
            As `Recording`, and if the event lies outside of the record.

        Examples
        --------
        >>> t = np.arange(0, 2, 0.01)
        >>> rec = Recording.from_signals(t, {"x": np.sin(t)}, units={"x": "m"}, noise={"x": 0.01})
        >>> rec.channel("x").unit, rec.event_time
        ('m', 0.0)
        """
        where, noise = f"recording {name!r}", noise or {}
        t, arrays = channel_arrays(time, values, noise, {}, where)
        start = float(t[0]) if event_time is None else float(event_time)
        if not t[0] <= start < t[-1]:
            allowed = f"from {t[0]:g} s to before {t[-1]:g} s"
            raise InputError(f"the event is at {start:g} s", where=where, allowed=allowed)
        notes, channels = [], {}
        for key, v in arrays.items():
            sigma = noise.get(key)
            if sigma is None:
                sigma, note = preparation.noise_of_signal(key, t, v, start)
                notes.append(note)
            channels[key] = Channel(key, v, (units or {}).get(key, ""), float(sigma), fixed=key in noise)
        quiet = (float(t[0]), start)
        return cls(name, t, channels, 1.0, 50.0, start, quiet, assumptions=tuple(notes))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the measured channels."""
        return tuple(self.channels)

    def channel(self, name: str) -> Channel:
        """Return a channel; an unknown name raises `InputError` with the nearest matches."""
        if name not in self.channels:
            raise unknown_name(name, self.names, kind="channel", where=f"recording {self.name!r}")
        return self.channels[name]

    def initial(self, names: Iterable[str]) -> dict[str, float]:
        """Mean over the quiet part of each named channel, or its given value, in the channel's unit.

        Raises
        ------
        InputError
            If a channel is neither measured before the event nor given.
        """
        part, means = signals.within(self.time, self.quiet), {}
        for name in names:
            if name in self.given and name not in self.channels:
                means[name] = float(self.given[name])
                continue
            quiet = self.channel(name).values[part]
            if not np.isfinite(quiet).any():
                raise InputError(
                    f"channel {name!r} has no reading before the event at {self.event_time:g} s",
                    where=f"recording {self.name!r}",
                    remedy="Start the window earlier, or give the pre-event value",
                )
            means[name] = float(np.nanmean(quiet))
        return means

    def window(self, start: float | None = None, stop: float | None = None) -> Recording:
        """Cut to the samples from `start` to `stop` seconds, both included; event and noise stay the same.

        To leave out an earlier event, give `t_start` to the function that reads the recording. It then takes event
        and noise from the remaining samples.

        Raises
        ------
        InputError
            If too little is left before or after the event.
        """
        where = f"recording {self.name!r}"
        keep = preparation.in_window(self.time, start, stop, where)
        time = self.time[keep]
        quiet = (max(self.quiet[0], float(time[0])), self.quiet[1])
        left = int(np.sum(signals.within(time, self.quiet)))
        if left < signals.MIN_QUIET:
            raise InputError(
                f"the window leaves {left} quiet samples before the event at {self.event_time:g} s",
                where=where,
                allowed=f"at least {signals.MIN_QUIET}",
                remedy="Start the window earlier",
            )
        preparation.check_response(time, self.event_time, where)
        channels = {k: replace(c, values=c.values[keep]) for k, c in self.channels.items()}
        return replace(self, time=time, channels=channels, quiet=quiet)

    def resample(
        self,
        dt: float | None = None,
        *,
        time: ArrayLike | None = None,
        shift: Mapping[str, float] | None = None,
        max_gap: float | None = None,
    ) -> Recording:
        """Bring all channels onto one time grid; time shifts come first, so they need not fit the grid.

        Parameters
        ----------
        dt : float, optional
            Step in seconds of a uniform grid over all samples; their median distance where not given.
        time : array-like of shape (K,), optional
            Instants of the grid in seconds, instead of `dt`.
        shift : mapping of str to float, optional
            Seconds added to the time stamps of a channel, negative for one that is late.
        max_gap : float, optional
            Longest gap that is interpolated, see `errorscreen.data.resampling.interpolate`.

        Raises
        ------
        InputError
            If both `dt` and `time` are given, the grid is empty, or a channel is unknown.
        """
        if dt is not None and time is not None:
            raise InputError("both dt and time are given", where="resample", allowed="one of them")
        shift = {self.channel(name).name: float(s) for name, s in (shift or {}).items()}
        late, early = max([0.0, *shift.values()]), min([0.0, *shift.values()])
        if time is None:
            step = float(np.median(np.diff(self.time))) if dt is None else dt
            grid = resampling.uniform_grid(self.time[0] + late, self.time[-1] + early, step)
        else:
            grid = np.array(time, dtype=float)
        notes = [f"The time stamps of {k} were shifted by {s:g} s." for k, s in shift.items() if s]
        channels = {}
        for name, channel in self.channels.items():
            source = self.time + shift.get(name, 0.0)
            channels[name] = preparation.resampled(channel, source, grid, self.quiet, max_gap, notes)
        quiet = (self.quiet[0] + late, self.quiet[1] + early)  # quiet for shifted and other channels alike
        notes = [*self.assumptions, *notes]
        return replace(self, time=grid, channels=channels, quiet=quiet, assumptions=tuple(notes))

    def to_frame(self) -> pd.DataFrame:
        """Table of all channels, indexed by time in seconds."""
        import pandas as pd

        return pd.DataFrame(
            {name: c.values for name, c in self.channels.items()}, index=pd.Index(self.time, name="time")
        )

    def summary(self) -> str:
        """Say what was recorded and what was assumed about it.

        Examples
        --------
        >>> t = np.arange(0, 4, 0.02)
        >>> values = {"P": np.where(t < 1, 0.8, 0.6)}
        >>> rec = Recording.from_arrays(t, values, base_mva=50, f_nominal=50, name="trip")
        >>> print(rec.summary())
        Recording trip
        time   200 samples from 0 to 3.98 s
        event  1 s
        quiet  0 to 0.92 s
        base   50 MVA, 50 Hz
        <BLANKLINE>
        channel  unit  lowest  highest  noise    readings
        P        pu    0.6     0.8      0.05774  200
        <BLANKLINE>
        - The event was taken to begin at 1 s, where the first of P leaves its quiet band.
        - P scatters less before the event than it can resolve, so its noise was set to its resolution, 0.058 pu.
        """
        channels = ((c.name, c.unit, c.values, c.noise) for c in self.channels.values())
        return summary_of(f"Recording {self.name}", self._facts(), channels, self.assumptions)

    def plot(self, *, window: tuple[float, float] | None = None) -> Figure:
        """Draw all channels, one panel each, with the event marked.

        Parameters
        ----------
        window : (float, float), optional
            First and last instant in seconds; all where not given.
        """
        labels = [with_unit(channel.name, channel.unit) for channel in self.channels.values()]
        measured = np.array([channel.values for channel in self.channels.values()])
        return plot_curves(labels, [Curves(self.time, measured, self.event_time)], window)

    def _facts(self) -> dict[str, Any]:
        kv = f"{self.base_kv:g} kV, " if self.base_kv else ""
        facts = {
            "name": self.name,
            "channels": listed(self.names),
            "time": span(self.time),
            "event": f"{self.event_time:g} s",
            "quiet": f"{self.quiet[0]:g} to {self.quiet[1]:g} s",
            "base": f"{self.base_mva:g} MVA, {kv}{self.f_nominal:g} Hz",
        }
        return facts | ({"given": listed(self.given)} if self.given else {})
