"""Units, order and duplicates of time stamps."""

from __future__ import annotations

import warnings
from bisect import bisect_right

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from errorscreen.data.table import Table
from errorscreen.exceptions import DataWarning, InputError, unknown_name

#: Seconds in one unit.
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0}
TIME_UNITS = (*_SECONDS, "iso")
ON_BACKWARD = ("error", "sort", "drop")
#: Largest part of stamps with several different readings; more mean that the stamps are too coarse.
_DUPLICATES = 0.1
#: Seconds, 3000 years. Later stamps have another unit, and too few digits for fractions of a second.
_LATEST = 1e11
_ISO = "ISO 8601, for example 2024-05-01T12:00:00.25Z"

_Array = NDArray[np.float64]
Values = dict[str, _Array]


def read_time(table: Table, header: str, unit: str, notes: list[str], decimal: str) -> _Array:
    """Read time stamps in seconds; ISO 8601 stamps count from the first one."""
    if unit not in TIME_UNITS:
        raise unknown_name(unit, TIME_UNITS, kind="time unit", where=table.source)
    if unit == "iso":
        return _read_iso(table, header, notes)
    remedy = "Give time_unit='iso' for dates, or correct the cell"
    time = table.numbers(header, decimal=decimal, remedy=remedy) * _SECONDS[unit]
    far = np.flatnonzero(np.abs(time) > _LATEST)
    if len(far):
        raise InputError(
            f"{len(far)} time stamps lie beyond any date",
            where=table.place(int(far[0]), header),
            allowed=f"up to {_LATEST:g} s from time 0",
            remedy=f"Check time_unit, which is {unit!r}, or correct the cell",
        )
    lost = np.flatnonzero(np.isnan(time))
    if len(lost):
        raise InputError(
            f"{len(lost)} samples have no time stamp",
            where=table.place(int(lost[0]), header),
            allowed="a number in every row",
            remedy="Delete these rows or complete their stamps",
        )
    return time


def _read_iso(table: Table, header: str, notes: list[str]) -> _Array:
    cells = pd.Series(list(table.column(header)))
    if pd.api.types.is_numeric_dtype(cells):
        problem, remedy = "numbers were found instead of dates", "Give time_unit='s' or 'ms' for numbers"
        raise InputError(problem, where=table.place(0, header), allowed=_ISO, remedy=remedy)
    stamps = pd.to_datetime(cells, format="ISO8601", utc=True, errors="coerce")
    wrong = np.flatnonzero(stamps.isna())
    if len(wrong):
        problem = f"{cells[int(wrong[0])]!r} is no time stamp"
        raise InputError(problem, where=table.place(int(wrong[0]), header), allowed=_ISO)
    first = stamps.min()
    notes.append(f"Time 0 is {first.isoformat()}.")
    return np.asarray((stamps - first).dt.total_seconds(), dtype=np.float64)


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
    return _merge_duplicates(time, values, table, header, notes)


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


def _merge_duplicates(
    time: _Array, values: Values, table: Table, header: str, notes: list[str]
) -> tuple[_Array, Values]:
    unique, count = np.unique(time, return_counts=True)
    if len(unique) == len(time):
        return time, values
    group = np.repeat(np.arange(len(unique)), count)
    frame = pd.DataFrame(values).groupby(group)
    differing = int((frame.nunique() > 1).any(axis=1).sum())
    if differing > _DUPLICATES * len(unique):
        raise InputError(
            f"{differing} of {len(unique)} time stamps carry several different readings",
            where=f"{table.source}, column {header!r}",
            allowed="one reading for each time stamp",
            remedy="Export the time stamps with all their decimal places",
        )
    same = int((count > 1).sum()) - differing
    if same:
        notes.append(f"{same} time stamps occurred several times with equal readings; one of each was kept.")
    if differing:
        notes.append(
            f"{differing} time stamps occurred several times with different readings; their mean was taken."
        )
        warnings.warn(f"{table.source}: {notes[-1]}", DataWarning, stacklevel=2)
    mean, first_known, kinds = frame.mean(), frame.first(), frame.nunique()
    merged = {n: np.where(kinds[n] > 1, mean[n], first_known[n]) for n in values}
    return unique, merged
