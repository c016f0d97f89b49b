r"""Phasors of the positive sequence from sampled voltages and currents of three phases.

A signal :math:`x(t)` is brought into the frame of the nominal frequency and averaged by a window w around t:

.. math:: X(t) = \sqrt2 \int w(\tau - t)\, x(\tau)\, e^{-j 2\pi f_n \tau}\,\mathrm d\tau                 \qquad (1)

The windows, of one nominal period T:

- ``"cycle"``: constant over T, the Fourier coefficient of one period;
- ``"P"``: a triangle over 2T, the filter of class P of IEEE Std C37.118.1-2011, annex C;
- ``"M"``: a sinc with Hamming window over 8T, cut-off at 0.14/T, after class M of the same annex.

The positive sequence and the powers follow by the equations of `errorscreen.data.sequences`.

At the frequency f the window passes the part :math:`G(f - f_n)` of (1), its Fourier transform; V and I are divided by
it. The integral is that of a cubic spline, so that neither rate nor distance of the samples matters.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from errorscreen.data.resampling import check_holes
from errorscreen.data.sequences import (
    Phasor,
    check_voltages,
    doubt_currents,
    factor,
    magnitudes,
    own_columns,
    power,
    pu_factors,
    sequences,
    spec_of,
)
from errorscreen.data.table import Table
from errorscreen.data.units import Bases, Column, unwrap
from errorscreen.exceptions import InputError, unknown_name

_Array = NDArray[np.float64]
METHODS = ("cycle", "P", "M")
#: least number of samples in a nominal period
_LEAST_SAMPLES = 6
#: a step longer than this part of a nominal period is a hole: fewer samples tell no wave
_HOLE = 0.25
#: half length of the window of class M in periods, and its cut-off in multiples of 1/T
_M_HALF, _M_CUTOFF = 4.0, 0.14
#: Hz; more is a jump of the angle, not a frequency
_MOST_OFF = 5.0


@dataclass(frozen=True)
class Waveforms:
    """Sampled voltages and currents of three phases.

    Parameters
    ----------
    voltage : tuple of three str
        Headers, in the order of the phases.
    current : tuple of three str, optional
        Headers; without them there are no P and Q.
    sign : {"generator", "load"}
        Currents are positive out of the plant, or into it.
    line_to_line : bool
        The voltages are those between a and b, b and c, c and a.
    method : {"cycle", "P", "M"}
        Window, see the equations of this module.
    rate : float, optional
        Phasors in one second; two in each nominal period where not given.
    voltage_unit, current_unit : {"V", "kV", "pu"}, {"A", "kA", "pu"}, optional
        Those of the file where not given. 1 pu is the peak value of the nominal voltage, or of the nominal current.
    """

    voltage: tuple[str, ...]
    current: tuple[str, ...] = ()
    sign: str = "generator"
    line_to_line: bool = False
    method: str = "cycle"
    rate: float | None = None
    voltage_unit: str | None = None
    current_unit: str | None = None

    @property
    def headers(self) -> tuple[str, ...]:
        """Headers of the columns that are read."""
        return (*self.voltage, *self.current)

    @property
    def columns(self) -> dict[str, Column]:
        """Sources of the channels that follow."""
        return own_columns(("V", "angle", "f", *("PQ" if self.current else "")))

    @property
    def follow(self) -> tuple[str, ...]:
        """Names of all columns that follow."""
        return (*self.columns, "V2", "V0")

    def read(
        self, table: Table, missing: Iterable[str | float] = (), decimal: str = "."
    ) -> dict[str, _Array]:
        """Numbers of the columns."""
        return {h: table.numbers(h, missing=missing, decimal=decimal) for h in self.headers}

    def derive(
        self,
        table: Table,
        time: _Array,
        numbers: Mapping[str, _Array],
        further: Iterable[str],
        f_nominal: float,
        notes: list[str],
        bases: Bases | None = None,
    ) -> tuple[_Array, dict[str, _Array], dict[str, _Array]]:
        """Time, columns that follow by their names, and the means of further columns; see `phasors`.

        `bases` are needed for numbers in pu.
        """
        if (np.diff(time) <= 0).any():
            raise InputError(
                "time does not increase with each sample",
                where=table.source,
                allowed="stamps with all their decimals",
            )
        return phasors(replace(table, columns=numbers), time, self, further, f_nominal, notes, bases)


def as_waveforms(found: Waveforms | Mapping[str, Any], source: str) -> Waveforms:
    """Check a description of waveforms, given as a mapping of fields or as `Waveforms`."""
    where = f"{source}, waveforms"
    found = spec_of(Waveforms, found, where)
    found = replace(found, voltage=tuple(found.voltage), current=tuple(found.current))
    for name, headers in (("voltage", found.voltage), ("current", found.current)):
        if len(headers) != 3 and (headers or name == "voltage"):
            raise InputError(
                f"{name} has {len(headers)} columns", where=where, allowed="three, one for each phase"
            )
    if len({*found.headers}) < len(found.headers):
        raise InputError("a column is named twice", where=where, allowed="a column for each phase")
    for key, allowed in (("method", METHODS), ("sign", ("generator", "load"))):
        if getattr(found, key) not in allowed:
            raise unknown_name(str(getattr(found, key)), allowed, kind=key, where=where)
    if found.rate is not None and not found.rate > 0:
        raise InputError(
            f"rate is {found.rate}", where=where, allowed="a positive number of phasors in a second"
        )
    return found


def trios(channels: Sequence[tuple[str, str, str]], source: str) -> Waveforms:
    """The only three voltages and three currents among channels (name, phase, unit).

    Raises
    ------
    InputError
        If there are no three voltages, or more than three.
    """
    names: dict[str, dict[str, str]] = {}
    for kind, units in (("voltage", ("V", "kV")), ("current", ("A", "kA"))):
        of_kind = [(name, phase) for name, phase, unit in channels if unit in units]
        names[kind] = {phase: name for name, phase in of_kind}
        phases = [phase for _, phase in of_kind]
        for wanted in (
            ("A", "B", "C"),
            ("AB", "BC", "CA"),
            ("L1", "L2", "L3"),
            ("R", "S", "T"),
            ("R", "Y", "B"),
        ):
            if sorted(p for p in phases if p in wanted) == sorted(wanted):
                names[kind] = {phase: names[kind][phase] for phase in wanted}
                break
        else:
            names[kind] = {}
    if len(names["voltage"]) != 3:
        listed = ", ".join(f"{name!r} (phase {phase or 'none'}, {unit})" for name, phase, unit in channels)
        raise InputError(
            f"three voltages of the phases A, B and C are not beyond doubt; the channels are {listed}",
            where=source,
            allowed="columns of rms values, or waveforms",
            remedy='Give waveforms = { voltage = ["VA", "VB", "VC"], current = ["IA", "IB", "IC"] }, with voltage_unit '
            "and current_unit where the record does not state V, kV, A or kA; or columns",
        )
    return Waveforms(
        tuple(names["voltage"].values()),
        tuple(names["current"].values()),
        line_to_line="AB" in names["voltage"],
    )


def phasors(
    table: Table,
    time: _Array,
    spec: Waveforms,
    further: Iterable[str],
    f_nominal: float,
    notes: list[str],
    bases: Bases | None = None,
) -> tuple[_Array, dict[str, _Array], dict[str, _Array]]:
    """Time in s; V in kV from line to line, angle in rad, f in Hz, P in MW and Q in Mvar, all of the positive sequence.

    Parameters
    ----------
    table : Table
        Numbers of the waveforms and of further columns.
    time : ndarray of shape (L,)
        Seconds.
    spec : Waveforms
    further : iterable of str
        Headers of further columns, which are averaged over a nominal period.
    f_nominal : float
        Hz.
    notes : list of str
        Gets sentences on assumptions.
    bases : Bases, optional
        For numbers in pu.

    Raises
    ------
    InputError
        If the samples are too few, or the phases are in another order than stated.
    """
    period, where = 1.0 / f_nominal, f"{table.source}, waveforms"
    step = float(np.median(np.diff(time)))
    if period / step < _LEAST_SAMPLES:
        raise InputError(
            f"there are {period / step:.2g} samples in a period of {f_nominal:g} Hz",
            where=table.source,
            allowed=f"at least {_LEAST_SAMPLES}",
            remedy="Of a record of rms values give columns instead of waveforms; of rms phasors give phasors",
        )
    half = {"cycle": 0.5, "P": 1.0, "M": _M_HALF}[spec.method] * period
    rate = 2.0 * f_nominal if spec.rate is None else spec.rate
    check_holes(time, 1.0 / rate, where)
    at = np.arange(time[0] + half, time[-1] - half + 1e-9, 1.0 / rate)
    if len(at) < 2:
        raise InputError(
            f"the record of {time[-1] - time[0]:.3g} s is too short",
            where=table.source,
            allowed=f"{2 * half:g} s",
        )
    pu = None
    if bases is not None:
        pu = {quantity: np.sqrt(2) * rms for quantity, rms in pu_factors(bases, spec.line_to_line).items()}
    scale = factor(table.units, spec.voltage, spec.voltage_unit, "voltage", where, pu)
    voltages = [scale * _phasor(table, header, time, at, spec.method, f_nominal) for header in spec.voltage]
    check_voltages(voltages, spec.voltage, table.source)
    one, two, zero = sequences(voltages, spec.line_to_line)
    angle = unwrap(np.angle(one))
    f = f_nominal + np.gradient(angle, at) / (2 * np.pi)
    passed = _passed(np.clip(f - f_nominal, -_MOST_OFF, _MOST_OFF), spec.method, period)
    one = _divided(one, passed)
    found = {"angle": angle, "f": f, **magnitudes(one, two, zero)}
    if spec.current:
        scale = factor(table.units, spec.current, spec.current_unit, "current", where, pu)
        currents = [
            scale * _phasor(table, header, time, at, spec.method, f_nominal) for header in spec.current
        ]
        doubt_currents(currents, spec.current, notes, table.source)
        flowing = _divided(sequences(currents)[0], passed)
        found |= power(one, flowing if spec.sign == "generator" else -flowing)
    rest = {header: _windowed(table.numbers(header), time, at, "cycle", period).real for header in further}
    notes.append(
        f"V, angle, f, P and Q are of the positive sequence of {', '.join(spec.headers)}, by windows "
        f"of {2 * half:.3g} s around each instant (method {spec.method!r}): within half of that, values before and "
        "after a jump are mixed."
    )
    return at, found, rest


def _phasor(table: Table, header: str, time: _Array, at: _Array, method: str, f_nominal: float) -> Phasor:
    """Phasor (1) of a column at some instants; NaN where its window holds a gap."""
    turning = np.exp(-2j * np.pi * f_nominal * time)
    return _windowed(np.sqrt(2) * table.numbers(header) * turning, time, at, method, 1.0 / f_nominal)


def _windowed(values: NDArray[Any], time: _Array, at: _Array, method: str, period: float) -> Phasor:
    """Averages by a window around some instants."""
    known = np.isfinite(values)
    if known.sum() < 4:
        return np.full(len(at), np.nan, dtype=complex)
    spline = CubicSpline(time[known], values[known])
    if method == "cycle":
        once = spline.antiderivative()
        found, half = (once(at + period / 2) - once(at - period / 2)) / period, period / 2
    elif method == "P":
        twice = spline.antiderivative(2)
        found, half = (twice(at + period) - 2 * twice(at) + twice(at - period)) / period**2, period
    else:
        half = _M_HALF * period
        shifts = np.linspace(-half, half, 321)
        weights = _m_weights(shifts / period)
        found = sum(w * spline(at + s) for w, s in zip(weights, shifts, strict=True))
    hole = np.diff(time) > _HOLE * period
    begins = np.sort(np.concatenate([time[~known], time[:-1][hole]]))
    ends = np.sort(np.concatenate([time[~known], time[1:][hole]]))
    inside = np.searchsorted(begins, at + half, side="right") > np.searchsorted(ends, at - half)
    return np.where(inside, np.nan, found)


def _m_weights(shifts: _Array) -> _Array:
    """Weights of class M at distances in periods; their sum is 1."""
    weights = np.sinc(2 * _M_CUTOFF * shifts) * (0.54 + 0.46 * np.cos(np.pi * shifts / _M_HALF))
    return np.asarray(weights / weights.sum())


def _passed(deviation: _Array, method: str, period: float) -> _Array:
    """Part of a phasor that turns by a deviation in Hz from the nominal frequency which the window passes."""
    if method == "M":
        shifts = np.linspace(-_M_HALF, _M_HALF, 321)
        return np.asarray(np.cos(2 * np.pi * period * np.outer(deviation, shifts)) @ _m_weights(shifts))
    gain = np.sinc(deviation * period)
    return np.asarray(gain if method == "cycle" else gain**2)


def _divided(phasor: Phasor, passed: _Array) -> Phasor:
    """Quotient; a gap stays one."""
    with np.errstate(invalid="ignore"):
        return phasor / passed
