r"""Phasors of the positive sequence from sampled voltages and currents of three phases.

A signal :math:`x(t)` is brought into the frame of the nominal frequency and averaged by a window w around t:

.. math:: X(t) = \sqrt2 \int w(\tau - t)\, x(\tau)\, e^{-j 2\pi f_n \tau}\,\mathrm d\tau                 \qquad (1)

The windows, of one nominal period T:

- ``"cycle"``: constant over T, the Fourier coefficient of one period;
- ``"P"``: a triangle over 2T, the filter of class P of IEEE Std C37.118.1-2011, annex C;
- ``"M"``: a sinc with Hamming window over 8T, cut-off at 0.14/T, after class M of the same annex.

The positive sequence, with :math:`a = e^{j 2\pi/3}`, of phases or of the voltages between them:

.. math::

    V_1 &= \tfrac13 (V_a + a V_b + a^2 V_c) = \tfrac{1}{3\sqrt3} e^{-j\pi/6} (V_{ab} + a V_{bc} + a^2 V_{ca})   & (2)\\
    P + jQ &= 3\, V_1 I_1^*                                                                              & (3)

At the frequency f the window passes the part :math:`G(f - f_n)` of (1), its Fourier transform; V and I are divided by
it. The integral is that of a cubic spline, so that neither rate nor distance of the samples matters.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from errorscreen.data.frames import Specs, build_recording
from errorscreen.data.plausibility import doubt
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.data.units import KA, KV, Column, unwrap
from errorscreen.exceptions import InputError, unknown_name

_Array = NDArray[np.float64]
_Phasor = NDArray[np.complex128]
METHODS = ("cycle", "P", "M")
#: least number of samples in a nominal period
_LEAST_SAMPLES = 6
#: half length of the window of class M in periods, and its cut-off in multiples of 1/T
_M_HALF, _M_CUTOFF = 4.0, 0.14
_TURN = np.exp(2j * np.pi / 3)
#: channels that follow from waveforms, with their units
_OWN = {"V": "kV", "angle": "rad", "f": "Hz", "P": "MW", "Q": "Mvar"}
#: Hz; more is a jump of the angle, not a frequency
_MOST_OFF = 5.0
#: a negative sequence of this part of the positive one before an event is no usual unbalance
_UNBALANCED = 0.5


@dataclass(frozen=True)
class Waveforms:
    """Sampled voltages and currents of three phases.

    Parameters
    ----------
    voltage : tuple of three str
        Headers, in the order of the phases.
    current : tuple of three str, optional
        Headers, positive out of the plant; without them there are no P and Q.
    line_to_line : bool
        The voltages are those between a and b, b and c, c and a.
    method : {"cycle", "P", "M"}
        Window, see the equations of this module.
    rate : float, optional
        Phasors in one second; two in each nominal period where not given.
    voltage_unit, current_unit : {"V", "kV"}, {"A", "kA"}, optional
        Those of the file where not given.
    """

    voltage: tuple[str, ...]
    current: tuple[str, ...] = ()
    line_to_line: bool = False
    method: str = "cycle"
    rate: float | None = None
    voltage_unit: str | None = None
    current_unit: str | None = None


def as_waveforms(found: Waveforms | Mapping[str, Any], source: str) -> Waveforms:
    """Check a description of waveforms, given as a mapping of fields or as `Waveforms`."""
    where = f"{source}, waveforms"
    if not isinstance(found, Waveforms):
        known = Waveforms.__dataclass_fields__
        for key in found:
            if key not in known:
                raise unknown_name(key, known, kind="field", where=where)
        given: dict[str, Any] = {k: tuple(v) if k in ("voltage", "current") else v for k, v in found.items()}
        found = Waveforms(**given)
    for name, headers in (("voltage", found.voltage), ("current", found.current)):
        if len(headers) != 3 and (headers or name == "voltage"):
            raise InputError(
                f"{name} has {len(headers)} columns", where=where, allowed="three, one for each phase"
            )
    if len({*found.voltage, *found.current}) < len(found.voltage) + len(found.current):
        raise InputError("a column is named twice", where=where, allowed="a column for each phase")
    if found.method not in METHODS:
        raise unknown_name(found.method, METHODS, kind="method", where=where)
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
        for wanted in (("A", "B", "C"), ("AB", "BC", "CA"), ("L1", "L2", "L3"), ("R", "S", "T")):
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
            remedy='Give waveforms = { voltage = ["VA", "VB", "VC"], current = ["IA", "IB", "IC"] }, or columns',
        )
    return Waveforms(
        tuple(names["voltage"].values()), tuple(names["current"].values()), "AB" in names["voltage"]
    )


def phasors(
    table: Table,
    time: _Array,
    spec: Waveforms,
    f_nominal: float,
    notes: list[str],
    *,
    further: Specs | None = None,
) -> Table:
    """Table of V in kV from line to line, angle in rad, f in Hz, P in MW and Q in Mvar, all of the positive sequence.

    Parameters
    ----------
    table : Table
        With the waveforms.
    time : ndarray of shape (L,)
        Seconds.
    spec : Waveforms
    f_nominal : float
        Hz.
    notes : list of str
        Gets what was assumed.
    further : mapping, optional
        Further channels, which are averaged over a nominal period.

    Raises
    ------
    InputError
        If the samples are too few, or the phases are in another order than stated.
    """
    period = 1.0 / f_nominal
    step = float(np.median(np.diff(time)))
    if period / step < _LEAST_SAMPLES:
        raise InputError(
            f"there are {period / step:.2g} samples in a period of {f_nominal:g} Hz",
            where=table.source,
            allowed=f"at least {_LEAST_SAMPLES}",
            remedy="Of a record of rms values give columns instead of waveforms",
        )
    half = {"cycle": 0.5, "P": 1.0, "M": _M_HALF}[spec.method] * period
    rate = 2.0 * f_nominal if spec.rate is None else spec.rate
    at = np.arange(time[0] + half, time[-1] - half + 1e-9, 1.0 / rate)
    if len(at) < 2:
        raise InputError(
            f"the record of {time[-1] - time[0]:.3g} s is too short",
            where=table.source,
            allowed=f"{2 * half:g} s",
        )
    voltages = [_phasor(table, header, time, at, spec.method, f_nominal) for header in spec.voltage]
    scale = _factor(table, spec.voltage, spec.voltage_unit, KV)
    one, two, zero = (scale * part for part in _sequences(voltages))
    if spec.line_to_line:
        one, two = (
            part * np.exp(-1j * turn) / np.sqrt(3) for part, turn in ((one, np.pi / 6), (two, -np.pi / 6))
        )
    start = slice(0, max(2, len(at) // 20))
    if np.nanmedian(np.abs(two[start])) > _UNBALANCED * np.nanmedian(np.abs(one[start])):
        raise InputError(
            f"the negative sequence of the voltage is {np.nanmedian(np.abs(two[start])):.3g} kV, the positive one "
            f"{np.nanmedian(np.abs(one[start])):.3g} kV",
            where=table.source,
            allowed="phases in the order of the positive sequence",
            remedy=f"Interchange two of the voltages: {[spec.voltage[0], *spec.voltage[:0:-1]]}",
        )
    angle = unwrap(np.angle(one))
    f = f_nominal + np.gradient(angle, at) / (2 * np.pi)
    passed = _passed(np.clip(f - f_nominal, -_MOST_OFF, _MOST_OFF), spec.method, period)
    one = _divided(one, passed)
    cells: dict[str, Any] = {
        "time": at,
        "V": np.sqrt(3) * np.abs(one),
        "angle": angle,
        "f": f,
        "V2": np.sqrt(3) * np.abs(two),
        "V0": np.sqrt(3) * np.abs(zero),
    }
    if spec.current:
        currents = [_phasor(table, header, time, at, spec.method, f_nominal) for header in spec.current]
        scale = _factor(table, spec.current, spec.current_unit, KA)
        of_one, of_two, _ = (scale * part for part in _sequences(currents))
        if np.nanmedian(np.abs(of_two[start])) > np.nanmedian(np.abs(of_one[start])):
            notes.append(
                doubt(
                    "The currents have a larger negative than positive sequence: two phases interchanged, or one "
                    "current transformer reversed?",
                    table.source,
                )
            )
        power = 3.0 * one * np.conj(_divided(of_one, passed))
        cells |= {"P": power.real, "Q": power.imag}
    known = {*cells}
    for header in {h for column in (further or {}).values() for h in _headers(column)} - known:
        cells[header] = _windowed(table.numbers(header), time, at, "cycle", period).real
    notes.append(
        f"V, angle, f, P and Q are of the positive sequence of {', '.join((*spec.voltage, *spec.current))}, by windows "
        f"of {2 * half:.3g} s around each instant (method {spec.method!r}): within half of that, values before and "
        "after a jump are mixed."
    )
    return Table(cells, range(1, len(at) + 1), table.source, "phasor")


def recording_of_waveforms(
    table: Table,
    time: _Array,
    waveforms: Waveforms | Mapping[str, Any],
    columns: Specs | None,
    *,
    f_nominal: float,
    notes: Iterable[str] = (),
    **options: Any,
) -> Recording:
    """Recording of the positive sequence, see `phasors`; the options are those of `build_recording`."""
    spec, told = as_waveforms(waveforms, table.source), list(notes)
    found = phasors(table, time, spec, f_nominal, told, further=columns)
    own = {name: Column(name, unit=unit) for name, unit in _OWN.items() if name in found.columns}
    return build_recording(
        found, {**own, **(columns or {})}, time="time", f_nominal=f_nominal, notes=told, **options
    )


def _headers(column: Any) -> tuple[str, ...]:
    if isinstance(column, str):
        return (column,)
    found = column if isinstance(column, Mapping) else column.__dict__
    return tuple(found[key] for key in ("column", "real", "imag") if found.get(key))


def _factor(table: Table, headers: Sequence[str], given: str | None, factors: Mapping[str, float]) -> float:
    """Factor to kV or kA."""
    units = {given} if given else {table.units.get(header, "") for header in headers}
    unit = units.pop() if len(units) == 1 else ""
    if unit not in factors:
        raise InputError(
            f"the unit of {', '.join(headers)} is {unit or 'not stated'!r}",
            where=f"{table.source}, waveforms",
            allowed=f"{' or '.join(factors)}, the same for all",
            remedy=f"Give {'voltage_unit' if 'V' in factors else 'current_unit'}",
        )
    return factors[unit]


def _sequences(phases: Sequence[_Phasor]) -> tuple[_Phasor, _Phasor, _Phasor]:
    """Positive, negative and zero sequence of three phasors, (2)."""
    a, b, c = phases
    return (a + _TURN * b + _TURN**2 * c) / 3, (a + _TURN**2 * b + _TURN * c) / 3, (a + b + c) / 3


def _phasor(table: Table, header: str, time: _Array, at: _Array, method: str, f_nominal: float) -> _Phasor:
    """Phasor (1) of a column at some instants; NaN where its window holds a gap."""
    turning = np.exp(-2j * np.pi * f_nominal * time)
    return _windowed(np.sqrt(2) * table.numbers(header) * turning, time, at, method, 1.0 / f_nominal)


def _windowed(values: NDArray[Any], time: _Array, at: _Array, method: str, period: float) -> _Phasor:
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
    gaps = time[~known]
    inside = np.searchsorted(gaps, at + half, side="right") > np.searchsorted(gaps, at - half)
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


def _divided(phasor: _Phasor, passed: _Array) -> _Phasor:
    """Quotient; a gap stays one."""
    with np.errstate(invalid="ignore"):
        return phasor / passed
