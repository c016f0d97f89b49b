"""Texts of dates: ISO 8601 or a stated format, with or without an offset from UTC."""

from __future__ import annotations

import re
from datetime import datetime

import pandas as pd

from errorscreen.exceptions import InputError

ISO = "ISO 8601, for example 2024-05-01T12:00:00.25Z"
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
        "%b %d %Y",
        "%d %b %Y",
    )
    for time in ("%H:%M:%S.%f", "%H:%M:%S:%f", "%H:%M:%S,%f", "%H:%M:%S", "%I:%M:%S.%f %p", "%I:%M:%S %p")
)
_TIMES_OF_DAY = ("%H:%M:%S.%f", "%H:%M:%S:%f", "%H:%M:%S")
#: codes of `datetime.strptime` that a format may hold: no weeks, nor what depends on the language of the system
_CODES = frozenset("YymdjbBaAHIMSfpz%")
_OFFSET = r":\d\d(?:[.,]\d+)?\s*(?:Z|[+-]\d\d(?::?\d\d)?)$"
#: a zone in words behind a time of day
_ZONE = re.compile(r"\d\s*([A-Za-z]{2,5}|[A-Za-z]+/[A-Za-z_/]+)$")
#: letters of a date; patterns would be tried on a longer text for ever
_LONGEST = 200
_WEEK = re.compile(r"\d{4}-?W\d\d")


def check_pattern(pattern: str, source: str) -> None:
    """Refuse a format with codes that a date may not be read by."""
    codes = re.findall(r"%(.?)", pattern)
    wrong = [f"%{code}" for code in codes if code not in _CODES]
    if not codes or wrong:
        remedy = "Give time_format = '%Y-%m-%d %H:%M:%S.%f' with the parts in their order"
        if "%Z" in wrong:
            remedy = "Names of zones say no offset for sure; write it as -0500, and read it by %z"
        raise InputError(
            f"time_format is {pattern!r}" + (f", with {', '.join(wrong)}" if wrong else ", without a code"),
            where=source,
            allowed=", ".join(f"%{code}" for code in sorted(_CODES, key=str.casefold)),
            remedy=remedy,
        )


def parse_dates(texts: pd.Series, pattern: str | None) -> pd.Series:
    """Dates from texts.

    Parameters
    ----------
    texts : Series of str, or of dates
    pattern : str or None
        As `datetime.strptime` takes it; else the texts are of ISO 8601, also with a decimal comma and ``UTC``.

    Returns
    -------
    Series
        NaT where wrong. With the offset from UTC where all texts state the same one, in UTC where they differ, and
        without a zone where none is stated. A text without an offset among others with one is wrong.
    """
    if pd.api.types.is_datetime64_any_dtype(texts):
        return texts if texts.dt.tz is None else texts.dt.tz_convert("UTC")
    plain = texts.astype("string")
    plain = plain.where(plain.str.len() <= _LONGEST)
    if pattern is None:
        plain = plain.str.replace(r"\s*(UTC|GMT)$", "Z", regex=True)
        plain = plain.str.replace(r"(:\d\d),(\d)", r"\1.\2", regex=True)
        plain = plain.where(plain.str.match(r"\d", na=False))  # "now" would be one
    form = "ISO8601" if pattern is None else pattern
    try:
        return pd.to_datetime(plain, format=form, errors="coerce")
    except ValueError:  # offsets differ
        stamps = pd.to_datetime(plain, format=form, utc=True, errors="coerce")
        return stamps if pattern is not None else stamps.where(plain.str.contains(_OFFSET, na=False))


def one_date(text: str, pattern: str | None) -> pd.Timestamp | None:
    """A date with the offset that it states; None for a text that is none."""
    found = parse_dates(pd.Series([text.strip()], dtype="string"), pattern)[0]
    return None if pd.isna(found) else found


def no_date(text: str, pattern: str | None, where: str) -> InputError:
    """Error for a text that is no date among others."""
    text = text[:_LONGEST]
    allowed = ISO if pattern is None else f"the format {pattern!r}"
    if one_date(text, pattern) is not None:
        return InputError(
            f"{text!r} has no offset from UTC, but other time stamps have one",
            where=where,
            allowed="all time stamps with an offset, or none",
            remedy="Complete it, for example by +01:00",
        )
    if zone := _ZONE.search(text):
        return InputError(
            f"{text!r} names the zone {zone[1]!r}, which is no sure offset from UTC",
            where=where,
            allowed=allowed,
            remedy="Write the offset, for example -05:00, in place of the name, or export the stamps in UTC",
        )
    if _WEEK.match(text):
        return InputError(
            f"{text!r} counts weeks",
            where=where,
            allowed=allowed,
            remedy="Export the stamps with month and day",
        )
    fitting = ", ".join(map(repr, fitting_formats(text)))
    remedy = f"Give time_format, of these the right one: {fitting}" if fitting else None
    return InputError(f"{text!r} is no time stamp", where=where, allowed=allowed, remedy=remedy)


def fitting_formats(text: str) -> list[str]:
    """Usual formats, with the codes of `datetime.strptime`, that a time stamp may be written in."""
    return [one for one in (*_FORMATS, *_TIMES_OF_DAY) if _fits(text, one)]


def _fits(text: str, pattern: str) -> bool:
    try:
        datetime.strptime(text, pattern)
    except ValueError:
        return False
    return True
