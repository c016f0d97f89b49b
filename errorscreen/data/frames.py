"""From named columns to a `Recording`, with every assumption and repair written down."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.channels import ROLE_UNITS
from errorscreen.data.preparation import in_window
from errorscreen.data.recordings import Recording
from errorscreen.data.table import Table
from errorscreen.data.timestamps import order_samples, read_time
from errorscreen.data.units import Bases, Column, as_column, convert, unwrap
from errorscreen.exceptions import InputError, check_real

if TYPE_CHECKING:
    import pandas as pd

Values = dict[str, NDArray[np.float64]]
#: Readings beyond this are marks of a gap, or end in numbers too large to calculate with.
_LARGEST = 1e12
#: Part of its value that a channel must move by; less is rounding, of numbers in single precision for example.
_LEAST_RANGE = 1e-6
Window = tuple[float | None, float | None]
Specs = Mapping[str, Column | str | Mapping[str, Any]]


def from_frame(
    frame: pd.DataFrame,
    columns: Specs,
    *,
    base_mva: float,
    f_nominal: float,
    base_kv: float | None = None,
    time: str | None = None,
    time_unit: str = "s",
    name: str = "recording",
    event_time: float | None = None,
    t_start: float | None = None,
    t_end: float | None = None,
    noise: Mapping[str, float] | None = None,
    held: str = "drop",
    missing: Iterable[str] = (),
    on_backward: str = "error",
    max_missing: float = 0.4,
) -> Recording:
    """Build a recording from a pandas table.

    Parameters
    ----------
    frame : pandas.DataFrame
    columns : mapping of str to Column, str or mapping
        Source of each channel by its name: ``"V"``, ``"angle"``, ``"f"``, ``"P"``, ``"Q"`` or any other name; a
        `Column`, its fields as a mapping, or just the header.
    base_mva : float
        Base that P and Q are converted to, in MVA: that of the device.
    f_nominal : float
        Nominal frequency in Hz.
    base_kv : float, optional
        Base that V is converted to, in kV line to line.
    time : str, optional
        Header of the time stamps; the index of the table where not given.
    time_unit : {"s", "ms", "us", "min", "h", "iso"}
    name : str
        For messages and reports.
    event_time, noise, held
        As in `Recording.from_arrays`.
    t_start, t_end : float, optional
        First and last instant in seconds that is read; samples outside are as if they were not in the table.
    missing : iterable of str
        Further texts that mark a gap.
    on_backward : {"error", "sort", "drop"}
        What to do where time runs backwards: refuse, sort, or drop as few samples as possible.
    max_missing : float
        Largest part of a channel that may be missing.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If something cannot be used; it says what, where, what is allowed, and what to do.

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
    if not frame.columns.is_unique:
        twice = frame.columns[frame.columns.duplicated()][0]
        raise InputError(f"column {twice!r} occurs more than once", where=source, allowed="unique names")
    header = "(index)" if time is None else time
    cells = {str(column): frame[column].to_numpy() for column in frame.columns}
    if time is None:
        cells[header] = frame.index.to_numpy()
    table = Table(cells, range(len(frame)), source, "row")
    return build_recording(
        table, columns, header, time_unit, Bases(base_mva, base_kv, f_nominal), missing=missing,
        on_backward=on_backward, max_missing=max_missing, window=(t_start, t_end), name=name, event_time=event_time,
        noise=noise, held=held,
    )  # fmt: skip


def build_recording(
    table: Table,
    columns: Specs,
    time: str,
    time_unit: str,
    bases: Bases,
    *,
    missing: Iterable[str] = (),
    decimal: str = ".",
    on_backward: str = "error",
    max_missing: float = 0.4,
    window: Window = (None, None),
    **options: Any,
) -> Recording:
    """Read, order, convert and check the columns of a table; `options` go to `Recording.from_arrays`."""
    _check_bases(bases, max_missing, table.source)
    specs = _specs(columns, table.source)
    if not len(table.rows):
        raise InputError("there are no samples", where=table.source, allowed="at least two rows of numbers")
    notes: list[str] = []
    stamps = read_time(table, time, time_unit, notes, decimal)
    headers = dict.fromkeys(h for spec in specs.values() for h in spec.headers)
    numbers = {h: table.numbers(h, missing=missing, decimal=decimal) for h in headers}
    stamps, numbers = order_samples(stamps, numbers, table, time, on_backward, notes)
    if len(stamps) < 2:
        raise InputError("there is one sample only", where=table.source, allowed="at least two samples")
    # before anything is concluded from the samples: an event outside the window must not count
    stamps, numbers = _cut(stamps, numbers, window, table.source, notes)
    values: Values = {}
    given: dict[str, float] = {}
    for role, spec in specs.items():
        where = f"{table.source}, channel {role!r}"
        if spec.value is not None:
            given[role] = float(convert(role, np.array([spec.value]), spec, bases, where)[0])
            notes.append(f"{role} was not measured; it was given as {given[role]:.4g} {_unit(role, spec)}.")
        else:
            with np.errstate(over="ignore", invalid="ignore"):  # readings too large become gaps in `_checked`
                values |= _converted(role, [numbers[h] for h in spec.headers], spec, bases, where)
        notes += _meaning(role, spec, bases)
    for role in values:
        values[role] = _checked(role, values[role], max_missing, table.source, notes)
    _note_spacing(stamps, notes)
    return Recording.from_arrays(
        stamps,
        values,
        base_mva=bases.mva,
        base_kv=bases.kv,
        f_nominal=bases.hz,
        units={role: spec.unit for role, spec in specs.items() if spec.unit and role not in ROLE_UNITS},
        given=given,
        assumptions=notes,
        **options,
    )


def _cut(
    time: NDArray[np.float64], values: Values, window: Window, source: str, notes: list[str]
) -> tuple[NDArray[np.float64], Values]:
    """Samples within the window."""
    if window == (None, None):
        return time, values
    keep = in_window(time, *window, where=source)
    notes.append(f"{np.sum(~keep)} of {len(keep)} samples lie outside the window and were not read.")
    return time[keep], {name: v[keep] for name, v in values.items()}


def _check_bases(bases: Bases, max_missing: float, source: str) -> None:
    for name, value in (("base_mva", bases.mva), ("base_kv", bases.kv), ("f_nominal", bases.hz)):
        if value is not None:
            check_real(value, name, low=0, above=True, where=source)
    check_real(max_missing, "max_missing", low=0, high=1, where=source)


def _specs(columns: Specs, source: str) -> dict[str, Column]:
    specs = {role: as_column(role, c, f"{source}, channel {role!r}") for role, c in columns.items()}
    if not any(spec.headers for spec in specs.values()):
        raise InputError("no column is mapped to a channel", where=source, allowed="at least one")
    owner: dict[str, str] = {}
    for role, spec in specs.items():
        for header in spec.headers:
            if header in owner:
                raise InputError(
                    f"column {header!r} is mapped to {owner[header]!r} and to {role!r}",
                    where=source,
                    allowed="one channel for each column",
                )
            owner[header] = role
    if "angle" in specs and "V" in specs and specs["V"].real is not None:
        raise InputError(
            "the angle is given twice, as a channel and by the real and imaginary parts of V",
            where=source,
            allowed="one of them",
        )
    return specs


def _converted(
    role: str, columns: list[NDArray[np.float64]], spec: Column, bases: Bases, where: str
) -> Values:
    """Channels that come from the column of a role, or from the two of a phasor."""
    if len(columns) == 1:
        return {role: convert(role, columns[0], spec, bases, where)}
    voltage = spec.scale * (columns[0] + 1j * columns[1])
    return {
        "V": convert("V", np.abs(voltage), replace(spec, scale=1.0), bases, where),
        "angle": np.where(np.isnan(voltage), np.nan, np.angle(voltage)),
    }


def _unit(role: str, spec: Column) -> str:
    return ROLE_UNITS.get(role) or spec.unit or ""


def _meaning(role: str, spec: Column, bases: Bases) -> list[str]:
    """What was taken for granted about the numbers of a channel."""
    if role not in ROLE_UNITS:
        return []
    notes = []
    if spec.unit is None:
        notes.append(f"No unit of {role} was stated; {ROLE_UNITS[role]} was assumed.")
    if role in ("P", "Q") and (spec.unit or "pu") == "pu" and spec.base is None:
        notes.append(f"{role} in pu was taken to be on the base of {bases.mva:g} MVA.")
    if role == "V" and spec.unit in ("V", "kV") and not spec.line_neutral:
        notes.append("V was taken to be measured from line to line.")
    if spec.sign == "load":
        notes.append(f"{role} was recorded positive when consumed; its sign was turned.")
    if spec.per_phase:
        notes.append(f"{role} was recorded for one phase; the other two were taken to be equal.")
    return notes


def _checked(
    role: str, values: NDArray[np.float64], max_missing: float, source: str, notes: list[str]
) -> NDArray[np.float64]:
    """Channel without infinities, with its angle unwrapped, refused if it says nothing."""
    where = f"{source}, channel {role!r}"
    endless = np.abs(values) > _LARGEST
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
    if np.nanmax(values) - np.nanmin(values) <= _LEAST_RANGE * np.nanmax(np.abs(values)):
        raise InputError(
            f"every reading is {np.nanmean(values):.6g}: the channel never moves",
            where=where,
            remedy="Map another column, leave the channel out, or state it with value=",
        )
    if role == "angle":
        unwrapped = unwrap(values)
        if np.nanmax(np.abs(unwrapped - values)) > 1:
            notes.append("Jumps by full turns were removed from the angle.")
        return unwrapped
    return values


def _note_spacing(time: NDArray[np.float64], notes: list[str]) -> None:
    steps = np.diff(time)
    usual = float(np.median(steps))
    if steps.max() > 1.1 * usual or steps.min() < 0.9 * usual:
        notes.append(
            f"Samples are {steps.min():.3g} to {steps.max():.3g} s apart (median {usual:.3g} s); between them "
            "signals were interpolated linearly."
        )
