"""Units, formats, order and duplicates of time stamps."""

from __future__ import annotations

import warnings
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from errorscreen.data.dates import ISO, check_pattern, no_date, one_date, parse_dates
from errorscreen.data.table import Table
from errorscreen.exceptions import DataWarning, InputError, unknown_name

#: Seconds in one unit. Ticks are those of .NET, 100 ns.
SECONDS = {
    **{"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "ticks": 1e-7, "min": 60.0, "h": 3600.0, "d": 86400.0}
}
#: s between samples as recorders and simulation programs usually have it
USUAL_STEP = (5e-5, 1.0)
#: Units of dates as numbers: time counts from the first stamp.
_OF_DATES = ("d", "ns", "ticks")
TIME_UNITS = (*SECONDS, "iso")
ON_BACKWARD = ("error", "sort", "drop")
ON_DUPLICATE = ("mean", "last", "keep-step")
#: Largest part of stamps with several different readings; more mean that the stamps are too coarse.
_DUPLICATES = 0.1
#: Distance of the two readings of a step at one instant, in median distances between samples.
_STEP = 1e-6
#: Seconds, 3000 years. Later stamps have another unit, and too few digits for fractions of a second.
_LATEST = 1e11
_DAY = 86400.0
#: s that clocks are put back by in autumn
_CLOCK = 3600.0

_Array = NDArray[np.float64]
Values = dict[str, _Array]


@dataclass(frozen=True)
class TimeFormat:
    """Where time stamps stand and how they are written.

    Parameters
    ----------
    headers : tuple of str
        One header; or two: whole seconds and fractions, or date and time of day.
    unit : str
        One of `TIME_UNITS`.
    pattern : str, optional
        Of texts, with the codes of `datetime.strptime`, for example ``"%d-%b-%Y %H:%M:%S.%f"``. A pattern without a
        date is a time of day.
    base : float, optional
        Of two columns of numbers: fractions in one second, as TIME_BASE of IEEE C37.118.
    """

    headers: tuple[str, ...]
    unit: str = "s"
    pattern: str | None = None
    base: float | None = None

    @property
    def header(self) -> str:
        """Header for messages."""
        return self.headers[0]

    @property
    def of_texts(self) -> bool:
        """Whether stamps are texts: dates, or times of day."""
        return (
            self.unit == "iso" or self.pattern is not None or (len(self.headers) == 2 and self.base is None)
        )

    @property
    def of_day(self) -> bool:
        """Whether stamps are times of day, without a date."""
        return self.pattern is not None and not any(code in self.pattern for code in ("%d", "%j", "%Y", "%y"))


def format_of_time(
    time: str | Sequence[str], unit: str, pattern: str | None, base: float | None, source: str
) -> TimeFormat:
    """Check how time stamps are said to be written; `InputError` for what does not fit together."""
    headers = (time,) if isinstance(time, str) else tuple(time)
    if unit not in TIME_UNITS:
        raise unknown_name(unit, TIME_UNITS, kind="time unit", where=source)
    if len(headers) not in (1, 2):
        raise InputError(f"time has {len(headers)} columns", where=source, allowed="one or two")
    if base is not None and (len(headers) == 1 or not base > 0 or pattern is not None):
        raise InputError(
            f"time_base is {base:g}",
            where=source,
            allowed="a positive number, for two columns of numbers: whole seconds, and fractions",
            remedy='Give time = ["SOC", "FRACSEC"] with it, or leave it out',
        )
    if pattern is not None:
        check_pattern(pattern, source)
    return TimeFormat(headers, unit, pattern, base)


def read_time(
    table: Table, form: TimeFormat, notes: list[str], decimal: str
) -> tuple[_Array, pd.Timestamp | None]:
    """Time stamps in seconds, and the date of time 0 where they are dates; these count from the first one."""
    kind = _kind(table, form)
    if (kind == "M" and form.unit not in ("s", "iso")) or (kind == "m" and form.unit != "s"):
        raise InputError(
            f"time_unit is {form.unit!r}, but the column holds {'dates' if kind == 'M' else 'durations'}",
            where=f"{table.source}, column {form.header!r}",
            allowed="no time_unit",
            remedy="Leave it out",
        )
    if form.of_texts or kind == "M":
        return _read_texts(table, form, notes)
    if kind == "m":
        seconds = _series(table.column(form.header)).dt.total_seconds().to_numpy(dtype=np.float64)
        table = replace(table, columns={form.header: seconds})
    remedy = "Give time_unit='iso' or time_format for dates, or correct the cell"
    numbers = [table.numbers(header, decimal=decimal, remedy=remedy) for header in form.headers]
    for header, values in zip(form.headers, numbers, strict=True):
        lost = np.flatnonzero(np.isnan(values))
        if len(lost):
            raise InputError(
                f"{len(lost)} samples have no time stamp",
                where=table.place(int(lost[0]), header),
                allowed="a number in every row",
                remedy="Delete these rows or complete their stamps",
            )
    if form.base is not None:
        whole, parts = numbers
        notes.append(f"Time 0 is {form.header} = {whole[0]:.0f} and {parts[0]:g}/{form.base:g} s.")
        return (whole - whole[0]) + (parts - parts[0]) / form.base, None
    stamps = numbers[0]
    if form.unit in _OF_DATES:
        notes.append(f"Time 0 is {form.header} = {stamps[0]:.12g} {form.unit}.")
        stamps = stamps - stamps[0]
    time = stamps * SECONDS[form.unit]
    far = np.flatnonzero(np.abs(time) > _LATEST)
    if len(far):
        raise InputError(
            f"{len(far)} time stamps lie beyond any date",
            where=table.place(int(far[0]), form.header),
            allowed=f"up to {_LATEST:g} s from time 0",
            remedy=f"Check time_unit, which is {form.unit!r}, or correct the cell",
        )
    return time, None


def _read_texts(table: Table, form: TimeFormat, notes: list[str]) -> tuple[_Array, pd.Timestamp]:
    columns = [_series(table.column(header)) for header in form.headers]
    for header, cells in zip(form.headers, columns, strict=True):
        if pd.api.types.is_numeric_dtype(cells):
            problem, remedy = "numbers were found instead of dates", "Give time_unit='s' or 'ms' for numbers"
            raise InputError(problem, where=table.place(0, header), allowed=ISO, remedy=remedy)
    texts = columns[0]
    if not pd.api.types.is_datetime64_any_dtype(texts):
        texts = texts.astype("string").fillna("").str.strip()
    if len(columns) == 2:
        texts = texts.astype("string") + " " + columns[1].astype("string").fillna("").str.strip()
    stamps = parse_dates(texts, form.pattern)
    wrong = np.flatnonzero(stamps.isna())
    if len(wrong):
        row = int(wrong[0])
        raise no_date(str(texts[row]), form.pattern, table.place(row, form.header))
    start = 0 if form.of_day else int(stamps.to_numpy().argmin())
    first = stamps[start]
    seconds = (stamps - first).dt.total_seconds().to_numpy(dtype=np.float64)
    if not pd.api.types.is_datetime64_any_dtype(texts):  # where offsets differ, that of the first one
        first = one_date(str(texts[start]), form.pattern) or first
    if form.of_day:  # a jump back by more than half a day is midnight
        seconds = seconds + _DAY * np.cumsum(np.diff(seconds, prepend=seconds[0]) < -0.5 * _DAY)
    notes.append(f"Time 0 is {texts[0] if form.of_day else first.isoformat()}.")
    if first.tzinfo is None and len(seconds) > 2 and np.diff(seconds).min() >= 0:
        steps = np.diff(seconds)
        ahead = np.flatnonzero(np.abs(steps - np.median(steps) - _CLOCK) < 1.5 * np.median(steps))
        if len(ahead) == 1:
            notes.append(
                f"After {texts[ahead[0]]} the stamps jump ahead by one hour, and they state no offset from UTC: if "
                "clocks were changed there, the gap is none."
            )
    return seconds, first


def _series(cells: Any) -> pd.Series:
    """Cells as they are where they have a type, else texts or what else they hold."""
    return pd.Series(cells if isinstance(cells, pd.Series | np.ndarray) else list(cells))


def _kind(table: Table, form: TimeFormat) -> str:
    """``"M"`` of a column whose type is that of dates, ``"m"`` of durations."""
    dtype = getattr(table.columns.get(form.header), "dtype", None) if len(form.headers) == 1 else None
    return str(getattr(dtype, "kind", ""))


def units_of_step(step: float) -> list[str]:
    """Units in which a distance between samples would be usual.

    Examples
    --------
    >>> units_of_step(20.0)
    ['ms']
    """
    return [unit for unit, seconds in SECONDS.items() if USUAL_STEP[0] <= seconds * step <= USUAL_STEP[1]]


def seconds_of(
    value: float | str | None, name: str, form: TimeFormat, first: pd.Timestamp | None, source: str
) -> float | None:
    """An instant in seconds, given so or as a date where time stamps are dates."""
    if value is None or not isinstance(value, str):
        return value
    if first is None:
        raise InputError(
            f"{name} is the text {value!r}",
            where=source,
            allowed="seconds, or a date where time stamps are dates",
            remedy="Give seconds",
        )
    found = one_date(value, form.pattern)
    if found is None:
        raise InputError(
            f"{name} is {value!r}, which is no time stamp",
            where=source,
            allowed=f"seconds, or {ISO if form.pattern is None else f'the format {form.pattern!r}'}",
        )
    if found.tzinfo is None and first.tzinfo is not None and not first.utcoffset():
        found = found.tz_localize("UTC")
    if (found.tzinfo is None) != (first.tzinfo is None):
        have = "no" if first.tzinfo is None else "an"
        raise InputError(
            f"{name} is {value!r}, and the time stamps have {have} offset from UTC",
            where=source,
            allowed="an instant written as the time stamps are, or seconds",
            remedy=f"Write it as {first.isoformat()}",
        )
    seconds = float((found - first).total_seconds())
    return seconds + _DAY if form.of_day and seconds < 0 else seconds


def order_samples(
    time: _Array, values: Values, table: Table, header: str, on_backward: str, notes: list[str]
) -> tuple[_Array, Values]:
    """Bring samples into strictly increasing time, and write a note on each repair.

    Where time runs backwards, `on_backward` is ``"error"``, ``"sort"`` by time, or ``"drop"`` as few samples as
    possible.
    """
    if on_backward not in ON_BACKWARD:
        raise unknown_name(str(on_backward), ON_BACKWARD, kind="value of on_backward", where=table.source)
    back = np.flatnonzero(np.diff(time) < 0) + 1
    if len(back):
        if on_backward != "drop" and _put_back(time, back):
            raise InputError(
                f"time runs back by one hour, from {time[back[0] - 1]:.9g} to {time[back[0]]:.9g} s, as where clocks "
                "are put back",
                where=table.place(int(back[0]), header),
                allowed="increasing time stamps",
                remedy="Export the time stamps in UTC or with offsets such as +01:00, or cut the file there",
            )
        if on_backward == "error":
            raise InputError(
                f"time runs backwards {len(back)} times, first from {time[back[0] - 1]:.9g} to "
                f"{time[back[0]]:.9g} s",
                where=table.place(int(back[0]), header),
                allowed="increasing time stamps",
                remedy="Give on_backward='sort' for shuffled rows, or 'drop' for single wrong stamps",
            )
        keep = np.argsort(time, kind="stable") if on_backward == "sort" else longest_increasing(time)
        dropped = f"{len(time) - len(keep)} samples were dropped"
        repair = "the samples were sorted by time" if on_backward == "sort" else dropped
        notes.append(f"Time ran backwards {len(back)} times; {repair}.")
        time, values = time[keep], {name: v[keep] for name, v in values.items()}
    return time, values


def _put_back(time: _Array, back: NDArray[np.int64]) -> bool:
    """Whether the only jump back is by one hour, less the usual step: sorted, two hours would be mixed."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    return len(back) == 1 and abs(steps[back[0] - 1] - usual + _CLOCK) < 1.5 * usual


def longest_increasing(time: _Array) -> NDArray[np.int64]:
    """Indices of the longest selection of `time` that never decreases."""
    tails: list[float] = []  # last value of the best part of each length (patience sorting)
    where: list[int] = []
    previous = np.full(len(time), -1)
    for i, value in enumerate(time.tolist()):
        length = bisect_right(tails, value)
        previous[i] = where[length - 1] if length else -1
        tails[length:] = [value] if length == len(tails) else [value, *tails[length + 1 :]]
        where[length:] = [i] if length == len(where) else [i, *where[length + 1 :]]
    index, path = where[-1], []
    while index >= 0:
        path.append(index)
        index = int(previous[index])
    return np.array(path[::-1], dtype=np.int64)


def merge_duplicates(
    time: _Array, values: Values, table: Table, header: str, on_duplicate: str, notes: list[str]
) -> tuple[_Array, Values]:
    """Leave one reading at each instant of sorted samples, with a note.

    Of different readings at one instant, `on_duplicate` takes the ``"mean"``, or the ``"last"``; ``"keep-step"`` keeps
    the first and the last, as two samples a millionth of the usual distance apart.
    """
    if on_duplicate not in ON_DUPLICATE:
        raise unknown_name(str(on_duplicate), ON_DUPLICATE, kind="value of on_duplicate", where=table.source)
    unique, count = np.unique(time, return_counts=True)
    if len(unique) == len(time):
        return time, values
    grouped = pd.DataFrame(values).groupby(np.repeat(np.arange(len(unique)), count))
    first, last, kinds = grouped.first(), grouped.last(), grouped.nunique()
    different = (kinds > 1).any(axis=1).to_numpy()
    differing = int(different.sum())
    same = int((count > 1).sum()) - differing
    if same:
        notes.append(f"{same} time stamps occurred several times with equal readings; one of each was kept.")
    if not differing:
        return unique, {name: first[name].to_numpy() for name in values}
    told = f"{differing} time stamps occurred several times with different readings"
    if on_duplicate == "last":
        notes.append(f"{told}; the last was taken.")
        return unique, {name: last[name].to_numpy() for name in values}
    if on_duplicate == "keep-step":
        notes.append(f"{told}; the first and the last were kept, as a step.")
        apart = _STEP * float(np.median(np.diff(unique)))
        time = np.concatenate([unique, unique[different] + apart])
        order = np.argsort(time, kind="stable")
        both = {name: np.concatenate([first[name], last[name][different]])[order] for name in values}
        return time[order], both
    if differing > _DUPLICATES * len(unique):
        raise InputError(
            f"{differing} of {len(unique)} time stamps carry several different readings",
            where=f"{table.source}, column {header!r}",
            allowed="one reading for each time stamp",
            remedy="Export the time stamps with all their decimal places. If a simulation wrote several rows at an "
            "instant, give on_duplicate='last', or 'keep-step'",
        )
    notes.append(f"{told}; their mean was taken.")
    warnings.warn(f"{table.source}: {notes[-1]}", DataWarning, stacklevel=2)
    mean = grouped.mean()
    return unique, {n: np.where(kinds[n] > 1, mean[n], first[n]) for n in values}
