"""Cells of a table that hold no reading: rows with a bad status, and numbers that stand for a gap."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from errorscreen.data.plausibility import doubt
from errorscreen.data.signals import noise_floor
from errorscreen.data.table import Table
from errorscreen.exceptions import InputError, unknown_name

_Array = NDArray[np.float64]
#: larger readings are gaps, or end in numbers too large to calculate with
LARGEST = 1e12
#: a number far beyond the others lies so many times their whole range from them
_FAR = 10.0
#: relative distance of steps from a whole number of usual ones in a regular grid, and how many may be longer
_EVEN, _FEW = 0.1, 0.1
#: Rows at one instant differ by more than noise where by so many times the usual distance of neighbours.
_APART = 6.0
#: gaps of the grid that are told one by one
_TOLD = 5


@dataclass(frozen=True)
class Quality:
    """Column that says which rows hold readings.

    Parameters
    ----------
    column : str
        Header.
    good : tuple of str
        Its texts in rows with readings, for example ``("0000",)`` of a status word. Numbers are compared as numbers.
    """

    column: str
    good: tuple[str, ...]


def as_quality(found: Quality | Mapping[str, Any] | None, source: str) -> Quality | None:
    """Check a description of the status, given as a mapping of fields or a `Quality`."""
    if found is None or isinstance(found, Quality):
        return found
    for key in found:
        if key not in ("column", "good"):
            raise unknown_name(key, ("column", "good"), kind="field", where=f"{source}, quality")
    good = found.get("good", ())
    good = (good,) if isinstance(good, str | int | float) else tuple(good)
    if not found.get("column") or not good:
        raise InputError(
            "quality lacks its column, or texts of good rows",
            where=source,
            allowed='for example {column = "STAT", good = ["0000"]}',
        )
    return Quality(str(found["column"]), tuple(map(str, good)))


def without_bad_rows(
    values: Mapping[str, _Array], table: Table, quality: Quality | None, notes: list[str]
) -> dict[str, _Array]:
    """The columns with gaps in rows whose status is bad."""
    if quality is None:
        return dict(values)
    cells = pd.Series(list(table.column(quality.column)))
    bad = ~_matches(cells, quality.good)
    if bad.all():
        found = ", ".join(map(repr, dict.fromkeys(cells.astype("string").head(1000).tolist())))
        raise InputError(
            f"no row has a good status; found were {found[:200]}",
            where=f"{table.source}, column {quality.column!r}",
            allowed=f"rows with {', '.join(map(repr, quality.good))}",
            remedy="Correct good",
        )
    notes.append(
        f"{int(bad.sum())} of {len(bad)} rows have a bad status in {quality.column!r}; they count as gaps."
    )
    return {header: np.where(bad, np.nan, column) for header, column in values.items()}


def _matches(cells: pd.Series, texts: Iterable[str]) -> NDArray[np.bool_]:
    """Which cells are one of some texts, in any case, or equal to one as a number."""
    plain = cells.astype("string").fillna("").str.strip().str.lower()
    numbers = pd.to_numeric(plain, errors="coerce")
    found = plain.isin({text.strip().lower() for text in texts})
    wanted = pd.to_numeric(pd.Series([*texts], dtype="string").str.strip(), errors="coerce").dropna()
    return (found | numbers.isin(wanted)).to_numpy(dtype=bool)


def check_marks(values: Mapping[str, _Array], table: Table) -> list[str]:
    """Refuse numbers that mark a gap, such as -9999: they agree exactly, and lie far beyond the others.

    Returns
    -------
    list of str
        Doubts about other numbers that do so.

    Raises
    ------
    InputError
        With the number, so that it can be added to `missing`.
    """
    doubts: list[str] = []
    for header, column in values.items():
        known = column[np.abs(column) <= LARGEST]
        if not len(known):
            continue
        for end in (float(known.min()), float(known.max())):
            others = known[known != end]
            if len(others) < 0.5 * len(known) or not (_marks_gap(end) or len(known) - len(others) > 1):
                continue
            middle, size = float(np.median(others)), float(np.max(others) - np.min(others))
            if abs(end - middle) <= _FAR * max(size, abs(middle)):
                continue
            rows = np.flatnonzero(column == end)
            problem = (
                f"{len(rows)} readings are exactly {end:.9g}, far beyond the others, {others.min():.6g} to "
                f"{others.max():.6g}: a mark of a gap?"
            )
            where, remedy = table.place(int(rows[0]), header), f"Give missing = ['{end:.9g}']"
            if not _marks_gap(end):
                if abs(middle) < size or not size:  # a signal about zero may well stand still far from it
                    continue
                doubts.append(doubt(f"{problem} {remedy}.", where))
                continue
            raise InputError(
                problem,
                where=where,
                allowed="readings, or marks of gaps that are stated",
                remedy=f"{remedy}, or correct the cells",
            )
    return doubts


def _marks_gap(value: float) -> bool:
    """Whether a number looks like a mark: all nines, or a limit of an integer. What is beyond 1e12 is a gap anyway."""
    size = abs(value)
    digits = f"{size:.9g}".replace(".", "").strip("0")
    return (size >= 99 and set(digits) == {"9"}) or size in (2.0**15, 2.0**15 - 1, 2.0**31, 2.0**31 - 1)


def lost_frames(time: _Array) -> str | None:
    """Sentence on the samples that a regular grid lacks; None for a grid that lacks none, or is none.

    Examples
    --------
    >>> lost_frames(np.array([0.0, 0.02, 0.04, 0.10, 0.12, 0.14, 0.16, 0.18, 0.20, 0.22, 0.24, 0.26]))
    '2 samples are missing in a grid of 0.02 s, in 1 place: 2 after 0.04 s.'
    """
    steps = np.diff(time)
    usual = float(np.median(steps))
    counted = np.round(steps / usual)
    longer = np.flatnonzero(counted > 1)
    if not len(longer) or len(longer) > _FEW * len(steps) or (np.abs(steps / usual - counted) > _EVEN).any():
        return None
    lost = counted[longer] - 1
    places = [f"{n:.0f} after {time[k]:g} s" for n, k in zip(lost[:_TOLD], longer[:_TOLD], strict=True)]
    more = f" and {len(longer) - _TOLD} more" if len(longer) > _TOLD else ""
    return (
        f"{lost.sum():.0f} samples are missing in a grid of {usual:.3g} s, in {len(longer)} "
        f"place{'s' * (len(longer) > 1)}: {', '.join(places)}{more}."
    )


def wrong_stamps(time: _Array, values: Mapping[str, _Array], where: str) -> list[str]:
    """Doubts about rows at one instant beside a missing sample: one of them belongs to the next instant, or the last.

    Parameters
    ----------
    time : ndarray of shape (L,)
        Seconds, never decreasing.
    values : mapping of str to ndarray of shape (L,)
        Columns by header. Rows must differ by more than their noise.
    where : str
        For the warnings.
    """
    if not (np.diff(time) == 0).any():
        return []
    unique, first, count = np.unique(time, return_index=True, return_counts=True)
    if len(unique) == 1 or lost_frames(unique) is None:
        return []
    longer = np.diff(unique) > 1.5 * float(np.median(np.diff(unique)))
    beside = np.concatenate([[False], longer]) | np.concatenate([longer, [False]])
    found = []
    for k in np.flatnonzero((count > 1) & beside):
        rows = slice(int(first[k]), int(first[k] + count[k]))
        apart = [header for header, column in values.items() if np.ptp(column[rows]) > _usual(column)]
        if apart:
            found.append(f"{count[k]} rows at {unique[k]:.9g} s differ in {', '.join(map(repr, apart))}")
    if not found:
        return []
    more = f", and at {len(found) - _TOLD} more instants" if len(found) > _TOLD else ""
    text = (
        f"{'; '.join(found[:_TOLD])}{more}, and a sample beside them is missing: a wrong time stamp? Correct "
        "the stamp, or state on_duplicate = 'last' if the last row counts."
    )
    return [doubt(text, where)]


def _usual(column: _Array) -> float:
    """Largest distance that rows at one instant may have by noise."""
    steps = np.abs(np.diff(column[np.isfinite(column)]))
    usual = float(np.median(steps)) if len(steps) else 0.0
    return _APART * max(usual, noise_floor(column))
