"""Measured channels: names, units, time base, gaps, noise and what was assumed about them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.display import Displayed, aligned, listed, span
from errorscreen.data import preparation, resampling, signals
from errorscreen.data.panels import Curves, channel_table, plot_curves, with_unit
from errorscreen.exceptions import InputError, unknown_name

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

#: Units of the channels whose meaning is fixed by their name.
ROLE_UNITS = {"V": "pu", "angle": "rad", "f": "Hz", "P": "pu", "Q": "pu"}


@dataclass(frozen=True, eq=False)
class Channel(Displayed):
    """One measured channel.

    Parameters
    ----------
    name : str
        ``"V"`` (magnitude, pu), ``"angle"`` (rad, unwrapped, in a frame that turns at the nominal frequency),
        ``"f"`` (Hz), ``"P"``, ``"Q"`` (pu on the recording's base, generation positive), or any other name.
    values : ndarray of shape (L,)
        NaN where nothing was measured.
    unit : str
    noise : float
        Standard deviation of the measurement noise, in `unit`; positive.
    age : float
        Seconds that a reading may be older than its time stamp, because the meter holds it.
    """

    name: str
    values: NDArray[np.float64]
    unit: str
    noise: float
    age: float = 0.0

    def _facts(self) -> dict[str, Any]:
        readings = f"{np.isfinite(self.values).sum()} of {len(self.values)}"
        return {"name": self.name, "unit": self.unit, "readings": readings, "noise": f"{self.noise:.3g}"}


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
        Pre-event values that are stated and not measured, for example ``{"P": 0.54}``.
    assumptions : tuple of str
        Sentences on what was assumed or repaired, for the report.

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

    def __post_init__(self) -> None:
        where = f"recording {self.name!r}"
        _check_axes(self.time, {name: c.values for name, c in self.channels.items()}, where)
        positive = {"base_mva": self.base_mva, "f_nominal": self.f_nominal}
        if self.base_kv is not None:
            positive["base_kv"] = self.base_kv
        for what, value in {
            **positive,
            **{f"the noise of {k}": c.noise for k, c in self.channels.items()},
        }.items():
            if not (np.isfinite(value) and value > 0):
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
        held: str = "drop",
        assumptions: Iterable[str] = (),
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
            Detected from V, P and Q by `errorscreen.data.signals.detect_event` where not given.
        noise : mapping of str to float, optional
            Known standard deviations; the others are estimated from the quiet part.
        held : {"drop", "keep"}
            What to do with stale repeats of a meter that updates less often than it is read: leave only new
            readings, or keep the staircase.
        assumptions : iterable of str
            Sentences to begin with.

        Raises
        ------
        InputError
            As `Recording`, and if there is no quiet part or no event to be found, the channels move before the
            stated event as they do in one, or the recording ends with the event.

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
        where = f"recording {name!r}"
        t = np.array(time, dtype=float)
        arrays = {key: np.array(v, dtype=float) for key, v in values.items()}
        _check_axes(t, arrays, where)
        if held not in ("drop", "keep"):
            raise unknown_name(str(held), ("drop", "keep"), kind="value of held", where=where)
        preparation.check_extras(arrays, noise or {}, given or {}, where)
        notes = list(assumptions)
        start = preparation.find_event(t, arrays, event_time, notes, where)
        ages = preparation.treat_held(t, arrays, held, notes)
        quiet = preparation.quiet_part(t, start, where)
        preparation.check_response(t, start, where)
        if event_time is not None:
            preparation.check_rest(t, arrays, quiet, notes, where)
        channels = {}
        for key, v in arrays.items():
            unit = ROLE_UNITS.get(key) or (units or {}).get(key, "")
            sigma = preparation.channel_noise(key, t, v, quiet, noise or {}, unit, notes, where)
            channels[key] = Channel(key, v, unit, sigma, ages.get(key, 0.0))
        recording = cls(name, t, channels, base_mva, f_nominal, start, quiet, base_kv, dict(given or {}))
        if "V" in channels or "V" in recording.given:
            notes += preparation.warn_implausible(recording.initial(["V"])["V"], where)
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
        """Build a recording of any system: nothing is assumed about bases, a quiet part or what happened.

        Parameters
        ----------
        time : array-like of shape (L,)
            Seconds.
        values : mapping of str to array-like of shape (L,)
            Inputs and outputs by name, NaN for gaps.
        name : str
        units : mapping of str to str, optional
        noise : mapping of str to float, optional
            Known standard deviations. The others are estimated: from what lies before `event_time` where that is given,
            else from third differences, which is too much for a signal that changes fast from sample to sample.
        event_time : float, optional
            Before it everything is at rest. Where not given there is no such part.

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
        where = f"recording {name!r}"
        t = np.array(time, dtype=float)
        arrays = {key: np.array(v, dtype=float) for key, v in values.items()}
        _check_axes(t, arrays, where)
        preparation.check_extras(arrays, noise or {}, {}, where)
        start = float(t[0]) if event_time is None else float(event_time)
        if not t[0] <= start < t[-1]:
            raise InputError(
                f"the event is at {start:g} s", where=where, allowed=f"from {t[0]:g} s to before {t[-1]:g} s"
            )
        quiet, notes, channels = (float(t[0]), start), [], {}
        for key, v in arrays.items():
            sigma = (noise or {}).get(key)
            if sigma is None:
                sigma, note = preparation.noise_of_signal(key, t, v, start)
                notes.append(note)
            channels[key] = Channel(key, v, (units or {}).get(key, ""), float(sigma))
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
        part = (self.time >= self.quiet[0]) & (self.time <= self.quiet[1])
        means = {}
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
        """Cut to the samples from `start` to `stop` seconds, both included; event and noise stay as they are.

        To leave an earlier event out, give `t_start` to the function that reads the recording: the event and the
        noise are then taken from what is left.

        Raises
        ------
        InputError
            If too little is left before or after the event.
        """
        where = f"recording {self.name!r}"
        keep = preparation.in_window(self.time, start, stop, where)
        time = self.time[keep]
        quiet = (max(self.quiet[0], float(time[0])), self.quiet[1])
        left = int(np.sum((time >= quiet[0]) & (time <= quiet[1])))
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
        """Bring all channels onto one grid; a time shift is applied before, so that it need not fit the grid.

        Parameters
        ----------
        dt : float, optional
            Step in seconds of a uniform grid over all samples; their median distance where not given.
        time : array-like of shape (K,), optional
            The grid itself, instead of `dt`.
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
        channels = {
            name: self._resampled(channel, grid, shift.get(name, 0.0), max_gap, notes)
            for name, channel in self.channels.items()
        }
        quiet = (self.quiet[0] + late, self.quiet[1] + early)  # quiet for shifted and other channels alike
        return replace(
            self, time=grid, channels=channels, quiet=quiet, assumptions=(*self.assumptions, *notes)
        )

    def _resampled(
        self,
        channel: Channel,
        grid: NDArray[np.float64],
        shift: float,
        max_gap: float | None,
        notes: list[str],
    ) -> Channel:
        source = self.time + shift
        values = resampling.interpolate(source, channel.values, grid, max_gap=max_gap)
        noise, step = channel.noise, float(np.median(np.diff(grid)))
        if resampling.low_pass_needed(step, resampling.spacing(source, channel.values)):
            notes.append(f"{channel.name} was low-pass filtered before it was sampled every {step:g} s.")
            quiet = (grid >= self.quiet[0]) & (grid <= self.quiet[1])
            if np.isfinite(values[quiet]).sum() >= signals.MIN_QUIET:  # the filter took part of the noise
                noise = min(noise, signals.estimate_noise(grid, values, self.quiet))
        return replace(channel, values=values, noise=noise)

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
        >>> rec = Recording.from_arrays(
        ...     t, {"P": np.where(t < 1, 0.8, 0.6)}, base_mva=50, f_nominal=50, name="trip"
        ... )
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
        facts = self._facts()
        facts.pop("channels")
        table = channel_table((c.name, c.unit, c.values, c.noise) for c in self.channels.values())
        notes = [f"- {sentence}" for sentence in self.assumptions]
        return "\n".join([f"Recording {facts.pop('name')}", aligned(facts.items()), "", table, "", *notes])

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
        bases = [
            f"{self.base_mva:g} MVA",
            f"{self.base_kv:g} kV" if self.base_kv else "",
            f"{self.f_nominal:g} Hz",
        ]
        facts = {
            "name": self.name,
            "channels": listed(self.names),
            "time": span(self.time),
            "event": f"{self.event_time:g} s",
            "quiet": f"{self.quiet[0]:g} to {self.quiet[1]:g} s",
            "base": ", ".join(filter(None, bases)),
        }
        return facts | ({"given": listed(self.given)} if self.given else {})


def _check_axes(time: NDArray[np.float64], values: Mapping[str, NDArray[np.float64]], where: str) -> None:
    if time.ndim != 1 or len(time) < 2:
        raise InputError(f"the time axis has shape {time.shape}", where=where, allowed="two samples or more")
    if not (np.isfinite(time).all() and (np.diff(time) > 0).all()):
        raise InputError("the time axis is not finite and strictly increasing", where=where)
    if not values:
        raise InputError("there is no channel", where=where, allowed="at least one, for example 'P'")
    for name, array in values.items():
        if array.shape != time.shape:
            raise InputError(
                f"channel {name!r} has shape {array.shape}", where=where, allowed=f"{time.shape}"
            )
