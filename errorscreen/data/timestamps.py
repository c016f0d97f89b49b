"""Units, formats, order and duplicates of time stamps."""

from __future__ import annotations

import warnings
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
import pandas as pd
from numpy.typing import NDArray

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
_ISO = "ISO 8601, for example 2024-05-01T12:00:00.25Z"
#: Usual formats of dates, which are proposed and never guessed: day and month may be in either order.
_FORMATS = tuple(
    f"{date} {time}"
    for date in (
        "%Y-%m-%d",
        "%Y/%m/%d",
        "%d.%m.%Y",
        "%d/%m/%Y",
        "%m/%d/%Y",
        "%d-%b-%Y",
        "%d-%m-%Y",
        "%m-%d-%Y",
    )
    for time in ("%H:%M:%S.%f", "%H:%M:%S:%f", "%H:%M:%S,%f", "%H:%M:%S", "%I:%M:%S.%f %p", "%I:%M:%S %p")
)
_TIMES_OF_DAY = ("%H:%M:%S.%f", "%H:%M:%S:%f", "%H:%M:%S")

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
    return TimeFormat(headers, unit, pattern, base)


def read_time(
    table: Table, form: TimeFormat, notes: list[str], decimal: str
) -> tuple[_Array, pd.Timestamp | None]:
    """Time stamps in seconds, and the date of time 0 where they are dates; these count from the first one."""
    if form.of_texts:
        return _read_texts(table, form, notes)
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
    columns = [pd.Series(list(table.column(header))) for header in form.headers]
    for header, cells in zip(form.headers, columns, strict=True):
        if pd.api.types.is_numeric_dtype(cells):
            problem, remedy = "numbers were found instead of dates", "Give time_unit='s' or 'ms' for numbers"
            raise InputError(problem, where=table.place(0, header), allowed=_ISO, remedy=remedy)
    texts = columns[0]
    if not pd.api.types.is_datetime64_any_dtype(texts):
        texts = texts.astype("string").fillna("").str.strip()
    if len(columns) == 2:
        texts = texts.astype("string") + " " + columns[1].astype("string").fillna("").str.strip()
    stamps = parse_dates(texts, form.pattern)
    wrong = np.flatnonzero(stamps.isna())
    if len(wrong):
        row = int(wrong[0])
        found = str(texts[row])
        fitting = ", ".join(map(repr, fitting_formats(found)))
        raise InputError(
            f"{found!r} is no time stamp",
            where=table.place(row, form.header),
            allowed=_ISO if form.pattern is None else f"the format {form.pattern!r}",
            remedy=f"Give time_format, of these the right one: {fitting}" if fitting else None,
        )
    first = stamps[0] if form.of_day else stamps.min()
    seconds = (stamps - first).dt.total_seconds().to_numpy(dtype=np.float64)
    if form.of_day:  # a jump back by more than half a day is midnight
        seconds = seconds + _DAY * np.cumsum(np.diff(seconds, prepend=seconds[0]) < -0.5 * _DAY)
    notes.append(f"Time 0 is {texts[0] if form.of_day else first.isoformat()}.")
    return seconds, first


def fitting_formats(text: str) -> list[str]:
    """Usual formats, with the codes of `datetime.strptime`, that a time stamp may be written in."""
    return [one for one in (*_FORMATS, *_TIMES_OF_DAY) if _fits(text, one)]


def units_of_step(step: float) -> list[str]:
    """Units in which a distance between samples would be usual.

    Examples
    --------
    >>> units_of_step(20.0)
    ['ms']
    """
    return [unit for unit, seconds in SECONDS.items() if USUAL_STEP[0] <= seconds * step <= USUAL_STEP[1]]


def parse_dates(texts: pd.Series, pattern: str | None) -> pd.Series:
    """Dates from texts by a pattern or as ISO 8601 allows, also with a decimal comma and ``UTC``; NaT where wrong."""
    if pattern is not None:
        return pd.to_datetime(texts, format=pattern, utc=True, errors="coerce")
    if pd.api.types.is_datetime64_any_dtype(texts):
        return pd.to_datetime(texts, utc=True)
    plain = texts.astype("string").str.replace(r"\s*(UTC|GMT)$", "Z", regex=True)
    plain = plain.str.replace(r"(:\d\d),(\d)", r"\1.\2", regex=True)
    return pd.to_datetime(plain, format="ISO8601", utc=True, errors="coerce")


def _fits(text: str, pattern: str) -> bool:
    try:
        datetime.strptime(text, pattern)
    except ValueError:
        return False
    return True


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
    found = parse_dates(pd.Series([value.strip()]), form.pattern)[0]
    if pd.isna(found):
        raise InputError(
            f"{name} is {value!r}, which is no time stamp",
            where=source,
            allowed=f"seconds, or {_ISO if form.pattern is None else f'the format {form.pattern!r}'}",
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
