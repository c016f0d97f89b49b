"""Dates with and without offsets, changed clocks, names of zones, weeks."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.data.dates import no_date, one_date, parse_dates
from errorscreen.data.table import Table
from errorscreen.data.timestamps import format_of_time, order_samples, read_time, seconds_of
from errorscreen.exceptions import InputError


def read(texts, unit="iso", pattern=None, time="t"):
    form, notes = format_of_time(time, unit, pattern, None, "file a.csv"), []
    columns = texts if isinstance(texts, dict) else {"t": texts}
    table = Table(columns, range(2, 2 + len(next(iter(columns.values())))), "file a.csv")
    seconds, first = read_time(table, form, notes, ".")
    return seconds, first, form, notes


def ordered(seconds, on_backward="error"):
    table = Table({"t": seconds}, range(2, 2 + len(seconds)), "file a.csv")
    return order_samples(seconds, {"P": np.arange(float(len(seconds)))}, table, "t", on_backward, [])


@pytest.mark.parametrize("end", ["+01:00", " +01:00", "+0100", "+01"])
def test_an_offset_is_read(end):
    seconds, first, form, _ = read([f"2026-05-03T10:00:00{end}", f"2026-05-03T10:00:00.5{end}"])
    assert seconds.tolist() == [0.0, 0.5]
    assert first == pd.Timestamp("2026-05-03T09:00:00Z")
    assert seconds_of("2026-05-03T09:00:00.2Z", "event_time", form, first, "file") == pytest.approx(0.2)
    with pytest.raises(InputError, match="event_time is .*the time stamps have an offset.*10:00:00.01:00"):
        seconds_of("2026-05-03T10:00:00.2", "event_time", form, first, "file")


def test_an_instant_with_an_offset_does_not_fit_stamps_without():
    _, first, form, _ = read(["2026-05-03T10:00:00", "2026-05-03T10:00:01"])
    assert first.tzinfo is None
    with pytest.raises(InputError, match="the time stamps have no offset from UTC"):
        seconds_of("2026-05-03T10:00:00.2Z", "event_time", form, first, "file")


def clock(start, count, minutes, offsets=True):
    """Local stamps of Berlin, which the standard library computes."""
    stamps = pd.date_range(start, periods=count, freq=f"{minutes}min", tz="UTC").tz_convert("Europe/Berlin")
    return [one.isoformat() if offsets else one.tz_localize(None).isoformat() for one in stamps]


def test_with_offsets_changed_clocks_do_no_harm():
    texts = clock("2026-10-24T23:00Z", 40, 5)
    assert {text[-6:] for text in texts} == {"+02:00", "+01:00"}
    seconds, *_ = read(texts)
    assert seconds.tolist() == (300.0 * np.arange(40)).tolist()
    date, offset = zip(*((text[:-6], text[-6:]) for text in texts), strict=True)
    seconds, *_ = read({"date": list(date), "offset": list(offset)}, time=("date", "offset"))
    assert seconds.tolist() == (300.0 * np.arange(40)).tolist()


def test_clocks_that_are_put_back_are_named():
    seconds, *_ = read(clock("2026-10-24T23:00Z", 40, 5, offsets=False))
    for on_backward in ("error", "sort"):
        with pytest.raises(
            InputError, match="line 26.*back by one hour.*clocks are put back.*in UTC or with offsets"
        ):
            ordered(seconds, on_backward)
    assert (np.diff(ordered(seconds, "drop")[0]) >= 0).all()
    with pytest.raises(InputError, match="time runs backwards 1 times"):
        ordered(np.r_[seconds[:10], seconds[:10]])


def test_clocks_that_are_put_forward_are_told():
    *_, notes = read(clock("2026-03-29T00:00Z", 40, 5, offsets=False))
    assert "After 2026-03-29T01:55:00 the stamps jump ahead by one hour" in notes[-1]
    *_, notes = read(clock("2026-03-29T00:00Z", 40, 5))
    assert len(notes) == 1


def test_stamps_with_and_without_offsets_are_refused():
    with pytest.raises(InputError, match="line 3.*'2026-05-03T10:00:01' has no offset from UTC, but other"):
        read(["2026-05-03T10:00:00Z", "2026-05-03T10:00:01"])


@pytest.mark.parametrize("zone", ["EST", "CET", "CST", "Europe/Berlin"])
def test_names_of_zones_are_refused(zone):
    with pytest.raises(InputError, match=f"names the zone '{zone}'.*Write the offset"):
        read([f"2026-05-03 10:00:00 {zone}"] * 2)
    with pytest.raises(InputError, match="time_format is .*with %Z.*-0500"):
        read([f"2026-05-03 10:00:00 {zone}"] * 2, "s", "%Y-%m-%d %H:%M:%S %Z")
    seconds, *_ = read(["2026-05-03 10:00:00 -0500"] * 2, "s", "%Y-%m-%d %H:%M:%S %z")
    assert seconds.tolist() == [0.0, 0.0]


def test_weeks_and_words_are_refused():
    with pytest.raises(InputError, match="'2026-W18-7T10:00:00' counts weeks.*month and day"):
        read(["2026-W18-7T10:00:00"] * 2)
    for pattern in ("%G-W%V-%u", "%Y-%W", "%c", "%Q", "no code"):
        with pytest.raises(InputError, match="time_format is"):
            read(["2026"] * 2, "s", pattern)
    for text in ("now", "today", "yesterday", ""):
        with pytest.raises(InputError, match="is no time stamp"):
            read([text] * 2)


def test_typed_columns_need_no_unit():
    stamps = pd.Series(pd.date_range("2026-05-03 10:00", periods=3, freq="500ms"))
    for column in (stamps, stamps.to_numpy(), stamps.dt.tz_localize("Europe/Berlin")):
        assert read(column, "s")[0].tolist() == [0.0, 0.5, 1.0]
    assert read(stamps - stamps[0], "s")[0].tolist() == [0.0, 0.5, 1.0]
    with pytest.raises(InputError, match="time_unit is 'ms', but the column holds durations"):
        read(stamps - stamps[0], "ms")


@given(
    st.lists(
        st.text(max_size=30) | st.datetimes().map(str) | st.from_regex(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d.{0,8}")
    )
)
def test_any_text_is_a_date_or_told(texts):
    for pattern in (None, "%Y-%m-%d %H:%M:%S%z", "%d.%m.%y %I:%M:%S.%f %p"):
        found = parse_dates(pd.Series(texts, dtype="string"), pattern)
        assert len(found) == len(texts)
        for text in texts:
            if one_date(text, pattern) is None:
                assert isinstance(no_date(text, pattern, "cell"), InputError)
