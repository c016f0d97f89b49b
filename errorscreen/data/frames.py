"""Recordings from tables of named columns; every assumption and repair becomes a sentence of the recording."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.channels import ROLE_UNITS
from errorscreen.data.no_readings import (
    LARGEST,
    Quality,
    as_quality,
    check_marks,
    lost_frames,
    without_bad_rows,
    wrong_stamps,
)
from errorscreen.data.pandas_tables import INDEX, table_of_frame
from errorscreen.data.phase_headers import differing_phase
from errorscreen.data.phasors import Phasors, as_phases
from errorscreen.data.plausibility import doubt
from errorscreen.data.preparation import in_window
from errorscreen.data.recordings import Recording
from errorscreen.data.sequences import derived, own_column
from errorscreen.data.table import Table
from errorscreen.data.timestamps import (
    format_of_time,
    merge_duplicates,
    order_samples,
    read_time,
    seconds_of,
)
from errorscreen.data.units import Bases, Column, as_column, convert, unwrap
from errorscreen.data.waveforms import Waveforms
from errorscreen.exceptions import InputError, check_real

if TYPE_CHECKING:
    import pandas as pd

_Array = NDArray[np.float64]
Values = dict[str, _Array]
Specs = Mapping[str, Column | str | Mapping[str, Any]]
#: A channel must move by this part of its value; less is rounding, for example of numbers in single precision.
_LEAST_RANGE = 1e-6


def from_frame(
    frame: pd.DataFrame,
    columns: Specs | None,
    *,
    base_mva: float,
    f_nominal: float,
    time: str | Sequence[str] | None = None,
    name: str = "recording",
    **options: Any,
) -> Recording:
    """Build a recording from a pandas table.

    Parameters
    ----------
    frame : pandas.DataFrame
    columns : mapping of str to Column, str or mapping
        Source of each channel by its name: ``"V"``, ``"angle"``, ``"f"``, ``"P"``, ``"Q"`` or any other name; a
        `Column`, its fields as a mapping, or just the header. None where all of them follow from `waveforms` or
        `phasors`.
    base_mva : float
        Base that P and Q are converted to, in MVA: that of the device.
    f_nominal : float
        Nominal frequency in Hz.
    time : str or two of them, optional
        Header of the time stamps; the index of the table where not given. Two headers: whole seconds and fractions,
        with `time_base`, or date and time of day.
    name : str
        For messages and reports.
    **options
        Of `build_recording`: `base_kv`, `time_unit`, `event_time`, `waveforms`, `phasors` and others.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If something cannot be used; it says what was found, where, what is allowed, and what to do.

    Examples
    --------
    >>> import pandas as pd
    >>> t = np.arange(0, 4, 0.02)
    >>> frame = pd.DataFrame({"t": 1000 * t, "load": np.where(t < 1, -40.0, -30.0)})
    >>> rec = from_frame(frame, {"P": Column("load", unit="MW", sign="load")}, time="t", time_unit="ms",
    ...                  base_mva=50, f_nominal=50)
    >>> round(rec.initial(["P"])["P"], 6), rec.event_time
    (0.8, 1.0)
    """
    source = f"table {name!r}"
    header: str | Sequence[str] = INDEX if time is None else time
    table = table_of_frame(frame, source, with_index=time is None)
    return build_recording(
        table, columns, base_mva=base_mva, f_nominal=f_nominal, time=header, name=name, **options
    )


def build_recording(
    table: Table,
    columns: Specs | None,
    *,
    base_mva: float,
    f_nominal: float,
    base_kv: float | None = None,
    time: str | Sequence[str],
    time_unit: str = "s",
    t_start: float | str | None = None,
    t_end: float | str | None = None,
    time_format: str | None = None,
    time_base: float | None = None,
    missing: Iterable[str | float] = (),
    quality: Quality | Mapping[str, Any] | None = None,
    decimal: str = ".",
    on_backward: str = "error",
    on_duplicate: str = "mean",
    max_missing: float = 0.4,
    event_time: float | str | None = None,
    waveforms: Waveforms | Mapping[str, Any] | None = None,
    phasors: Phasors | Mapping[str, Any] | None = None,
    notes: Iterable[str] = (),
    **options: Any,
) -> Recording:
    """Read, order, convert and check the columns of a table.

    Parameters
    ----------
    table : Table
        Its columns are used up.
    columns, base_mva, f_nominal, time
        As in `from_frame`.
    base_kv : float, optional
        Base that V is converted to, in kV line to line.
    time_unit : {"s", "ms", "us", "ns", "ticks", "min", "h", "d", "iso"}
        Ticks have 100 ns. Time counts from the first stamp for dates as numbers (``"ns"``, ``"ticks"``, ``"d"``) and
        as texts (``"iso"``).
    t_start, t_end : float or str, optional
        First and last instant that is read, in seconds, or as a date where time stamps are dates.
    time_format : str, optional
        Of time stamps that are texts, with the codes of `datetime.strptime`.
    time_base : float, optional
        Fractions in one second, where they stand in a column of their own.
    missing : iterable of str or float
        Further texts or numbers that mark a gap.
    quality : Quality or mapping, optional
        Column with the status of each row, and the texts of good rows. Other rows are gaps.
    decimal : {".", ","}
    on_backward : {"error", "sort", "drop"}
        Treatment of time that runs backwards: refuse, sort, or drop as few samples as possible.
    on_duplicate : {"mean", "last", "keep-step"}
        Treatment of different readings at one instant, see `errorscreen.data.timestamps.merge_duplicates`.
    max_missing : float
        Largest part of a channel that may be missing.
    event_time : float or str, optional
        Start of the event, in seconds or as a date; detected where not given.
    waveforms : Waveforms or mapping, optional
        Sampled voltages and currents of three phases, from which V, angle, f, P and Q follow, whatever other columns of
        these names the file has. `columns` then holds only further channels, columns of the file that are to count
        instead of what follows, and the sign of what follows.
    phasors : Phasors or mapping, optional
        The same from rms phasors.
    notes : iterable of str
        Assumptions to begin with.
    **options
        `name`, `noise` and `held`, as in `Recording.from_arrays`.

    Raises
    ------
    InputError
        As `from_frame`.
    """
    source, notes = table.source, list(notes)
    for name, value in (("base_mva", base_mva), ("base_kv", base_kv), ("f_nominal", f_nominal)):
        if value is not None:
            check_real(value, name, low=0, above=True, where=source)
    check_real(max_missing, "max_missing", low=0, high=1, where=source)
    bases = Bases(base_mva, base_kv, f_nominal)
    phases = as_phases(waveforms, phasors, source)
    specs = _specs(columns or {}, phases, table, notes)
    follow = frozenset(map(derived, () if phases is None else phases.follow))
    form = format_of_time(time, time_unit, time_format, time_base, source)
    if not len(table.rows):
        raise InputError("there are no samples", where=source, allowed="at least two rows of numbers")
    stamps, first = read_time(table, form, notes, decimal)
    t_start, t_end, event_time = (
        seconds_of(value, name, form, first, source)
        for name, value in (("t_start", t_start), ("t_end", t_end), ("event_time", event_time))
    )
    headers = [h for spec in specs.values() for h in spec.headers if h not in follow]
    numbers = _numbers(table, headers, specs, phases, missing, decimal, as_quality(quality, source), notes)
    if phases is not None:
        stamps, found, rest = phases.derive(table, stamps, numbers, headers, f_nominal, notes, bases)
        numbers = {**rest, **{derived(name): values for name, values in found.items()}}
    if isinstance(table.columns, dict):
        table.columns.clear()  # a large file is held once
    stamps, numbers = order_samples(stamps, numbers, table, form.header, on_backward, notes)
    if "angle" in specs and specs["angle"].column is not None:  # before a mean could be taken across a jump
        header = specs["angle"].headers[0]
        numbers[header] = _unwrapped(numbers[header], specs["angle"], notes, source)
    notes += wrong_stamps(stamps, numbers, source) if on_duplicate == "mean" else []
    stamps, numbers = merge_duplicates(stamps, numbers, table, form.header, on_duplicate, notes)
    if len(stamps) < 2:
        raise InputError("there is one sample only", where=source, allowed="at least two samples")
    if (t_start, t_end) != (None, None):  # first of all: an event outside the window must not count
        keep = in_window(stamps, t_start, t_end, where=source)
        notes.append(f"{np.sum(~keep)} of {len(keep)} samples lie outside the window and were not read.")
        stamps, numbers = stamps[keep], {h: v[keep] for h, v in numbers.items()}
    values: Values = {}
    given: dict[str, float] = {}
    for role, spec in specs.items():
        where = f"{source}, channel {role!r}"
        if spec.value is not None:
            given[role] = float(convert(role, np.array([spec.value]), spec, bases, where)[0])
            unit = ROLE_UNITS.get(role) or spec.unit or ""
            notes.append(f"{role} was not measured; it was given as {given[role]:.4g} {unit}.")
        else:
            with np.errstate(over="ignore", invalid="ignore"):  # readings too large become gaps in `_checked`
                values |= _converted(role, [numbers.pop(h) for h in spec.headers], spec, bases, where)
        notes += _meaning(role, spec, bases, follows=spec.value is None and follow.issuperset(spec.headers))
    for role in values:
        stands = specs[role].column in follow if role in specs else False
        values[role] = _checked(role, values[role], max_missing, source, notes, may_stand=stands)
    _note_spacing(stamps, notes)
    own_units = {role: spec.unit for role, spec in specs.items() if spec.unit and role not in ROLE_UNITS}
    return Recording.from_arrays(
        stamps,
        values,
        base_mva=base_mva,
        base_kv=base_kv,
        f_nominal=f_nominal,
        units=own_units,
        given=given,
        event_time=event_time,
        assumptions=notes,
        copy=False,
        **options,
    )


def _numbers(
    table: Table,
    headers: list[str],
    specs: Mapping[str, Column],
    phases: Waveforms | Phasors | None,
    missing: Iterable[str | float],
    decimal: str,
    quality: Quality | None,
    notes: list[str],
) -> Values:
    """Numbers of columns of the file, and of the three phases; notes get doubts."""
    numbers = {h: table.numbers(h, missing=missing, decimal=decimal) for h in headers}
    if phases is not None:
        numbers |= phases.read(table, missing, decimal)
    numbers = without_bad_rows(numbers, table, quality, notes)
    notes += check_marks(numbers, table)
    if "V" in specs and specs["V"].column in headers:
        told = differing_phase(table, specs["V"].headers[0], numbers[specs["V"].headers[0]], missing, decimal)
        notes += [] if told is None else [doubt(told, table.source)]
    return numbers


def _specs(
    columns: Specs, phases: Waveforms | Phasors | None, table: Table, notes: list[str]
) -> dict[str, Column]:
    """Sources of channels: the phases, unless a column of the file is named for one."""
    source = table.source
    specs = {} if phases is None else phases.columns
    for role, given in columns.items():
        where = f"{source}, channel {role!r}"
        spec = as_column(role, given, where)
        if phases is not None and spec.column in phases.follow and spec.column not in table.columns:
            spec = own_column(spec, where)
        elif role in specs and spec.headers:
            told = ", ".join(map(repr, spec.headers))
            notes.append(
                f"{role} was read from {told}, which is named for it, instead of following from phases."
            )
        specs[role] = spec
    if not any(spec.headers for spec in specs.values()):
        raise InputError("no column is mapped to a channel", where=source, allowed="at least one")
    owner: dict[str, str] = {}
    for role, spec in specs.items():
        for header in spec.headers:
            if header in owner:
                problem = f"column {header!r} is mapped to {owner[header]!r} and to {role!r}"
                raise InputError(problem, where=source, allowed="one channel for each column")
            owner[header] = role
    if "angle" in specs and "V" in specs and specs["V"].real is not None:
        raise InputError(
            "the angle is given twice, as a channel and by the real and imaginary parts of V",
            where=source,
            allowed="one of them",
        )
    return specs


def _converted(role: str, columns: list[_Array], spec: Column, bases: Bases, where: str) -> Values:
    """Convert the column of a channel, or the two columns of a phasor."""
    if len(columns) == 1:
        return {role: convert(role, columns[0], spec, bases, where)}
    voltage = spec.scale * (columns[0] + 1j * columns[1])
    return {
        "V": convert("V", np.abs(voltage), replace(spec, scale=1.0), bases, where),
        "angle": np.where(np.isnan(voltage), np.nan, np.angle(voltage)),
    }


def _meaning(role: str, spec: Column, bases: Bases, *, follows: bool) -> list[str]:
    """Sentences on the assumed unit, base and sign of a channel, which may follow from three phases."""
    if role not in ROLE_UNITS:
        return []
    notes = []
    if spec.unit is None:
        notes.append(f"No unit of {role} was stated; {ROLE_UNITS[role]} was assumed.")
    if role in ("P", "Q") and (spec.unit or "pu") == "pu" and spec.base is None:
        notes.append(f"{role} in pu was taken to be on the base of {bases.mva:g} MVA.")
    if role == "V" and spec.unit in ("V", "kV") and not (spec.line_neutral or follows):
        notes.append("V was taken to be measured from line to line.")
    if spec.sign == "load":
        notes.append(f"{role} was recorded positive when consumed; its sign was turned.")
    if spec.per_phase:
        notes.append(f"{role} was recorded for one phase; the other two were taken to be equal.")
    return notes


def _checked(
    role: str, values: _Array, max_missing: float, source: str, notes: list[str], *, may_stand: bool
) -> _Array:
    """Take infinities as gaps, unwrap the angle, and refuse a channel that is empty, or constant unless it may be."""
    where = f"{source}, channel {role!r}"
    endless = np.abs(values) > LARGEST
    if endless.any():
        values = np.where(endless, np.nan, values)
        notes.append(f"{endless.sum()} infinite or absurdly large readings of {role} were taken as gaps.")
    lost = int(np.isnan(values).sum())
    if lost == len(values):
        raise InputError(
            "all readings are missing", where=where, remedy="Map another column, or leave it out"
        )
    if lost > max_missing * len(values):
        raise InputError(
            f"{lost} of {len(values)} readings ({lost / len(values):.0%}) are missing",
            where=where,
            allowed=f"at most {max_missing:.0%}",
            remedy="Leave the channel out, cut the file, or raise max_missing",
        )
    if lost:
        notes.append(f"{lost} of {len(values)} readings of {role} are missing.")
    if not may_stand and np.nanmax(values) - np.nanmin(values) <= _LEAST_RANGE * np.nanmax(np.abs(values)):
        raise InputError(
            f"every reading is {np.nanmean(values):.6g}: the channel never moves",
            where=where,
            remedy="Map another column, leave the channel out, or state it with value=",
        )
    return unwrap(values) if role == "angle" else values  # the angle of a phasor


def _unwrapped(angle: _Array, spec: Column, notes: list[str], where: str) -> _Array:
    """Angle as in the file, without jumps by full turns."""
    turn = abs((360.0 if spec.unit == "deg" else 2 * np.pi) / spec.scale)
    unwrapped, known = unwrap(angle, turn), np.isfinite(angle)
    jumps = np.abs(np.diff(angle[known]))
    if np.any(np.abs(unwrapped - angle)[known] > 0.1 * turn):
        notes.append("Jumps by full turns were removed from the angle.")
    if spec.unit != "deg" and np.any(np.abs(jumps - 360.0) < 10.0) and np.ptp(angle[known]) <= 361.0:
        notes.append(doubt("The angle jumps by 360, but its unit is rad: in degrees (unit = 'deg')?", where))
    return unwrapped


def _note_spacing(time: _Array, notes: list[str]) -> None:
    steps = np.diff(time)
    usual = float(np.median(steps))
    if lost := lost_frames(time):
        notes.append(lost)
    elif steps.max() > 1.1 * usual or steps.min() < 0.9 * usual:
        notes.append(
            f"Samples are {steps.min():.3g} to {steps.max():.3g} s apart (median {usual:.3g} s); between them "
            "signals were interpolated linearly."
        )
