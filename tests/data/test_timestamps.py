import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.data.table import Table
from errorscreen.data.timestamps import (
    format_of_time,
    longest_increasing,
    merge_duplicates,
    order_samples,
    read_time,
    seconds_of,
)
from errorscreen.exceptions import DataWarning, InputError


def _order(time, values, on_backward="error", on_duplicate="mean"):
    notes = []
    table = Table({"t": time}, range(2, len(time) + 2), "file a.csv")
    out = order_samples(np.array(time, float), {"P": np.array(values, float)}, table, "t", on_backward, notes)
    out = merge_duplicates(*out, table, "t", on_duplicate, notes)
    return out[0], out[1]["P"], notes


def _read(columns, time="t", unit="s", pattern=None, base=None):
    columns = columns if isinstance(columns, dict) else {"t": columns}
    rows = range(2, 2 + len(next(iter(columns.values()))))
    form, notes = format_of_time(time, unit, pattern, base, "file a.csv"), []
    seconds, first = read_time(Table(columns, rows, "file a.csv"), form, notes, ".")
    return seconds, notes, form, first


@given(st.permutations(list(range(30))))
def test_sorting_undoes_any_shuffle(order):
    _, values, notes = _order([0.1 * i for i in order], order, "sort")
    np.testing.assert_array_equal(values, np.arange(30))
    assert bool(notes) == (order != list(range(30)))


@given(st.lists(st.integers(0, 20), min_size=1, max_size=12))
def test_dropping_keeps_the_longest_part_that_increases(stamps):
    kept = longest_increasing(np.array(stamps, float))
    assert np.all(np.diff(np.array(stamps)[kept]) >= 0)
    assert np.all(np.diff(kept) > 0)
    best = [1] * len(stamps)  # the textbook's quadratic way
    for i, stamp in enumerate(stamps):
        best[i] = 1 + max((best[j] for j in range(i) if stamps[j] <= stamp), default=0)
    assert len(kept) == max(best)


def test_a_single_wrong_stamp_is_dropped():
    time, values, notes = _order([0, 1, 99, 2, 3], [0, 1, 2, 3, 4], "drop")
    np.testing.assert_array_equal(time, [0, 1, 2, 3])
    np.testing.assert_array_equal(values, [0, 1, 3, 4])
    assert notes == ["Time ran backwards 1 times; 1 samples were dropped."]


def test_backward_time_is_refused_with_its_line():
    with pytest.raises(
        InputError, match=r"file a.csv, line 5, column 't': time runs backwards 1 times, first"
    ):
        _order([0, 1, 2, 1.5, 3], [0] * 5)


def test_equal_duplicates_are_dropped_and_others_averaged():
    time = np.arange(30.0)
    values = np.sin(time)
    doubled = np.r_[time[:10], 9.0, time[10:]]
    same, kept, notes = _order(doubled, np.r_[values[:10], values[9], values[10:]])
    np.testing.assert_array_equal(same, time)
    np.testing.assert_array_equal(kept, values)
    assert notes == ["1 time stamps occurred several times with equal readings; one of each was kept."]
    with pytest.warns(DataWarning, match="different readings; their mean was taken"):
        _, kept, notes = _order(doubled, np.r_[values[:10], values[9] + 1.0, values[10:]])
    assert kept[9] == pytest.approx(values[9] + 0.5)
    assert "mean" in notes[0]


def test_a_gap_is_filled_from_its_duplicate():
    _, values, _ = _order([0, 1, 1, 2], [5, np.nan, 6, 7])
    np.testing.assert_array_equal(values, [5, 6, 7])


def test_stamps_without_decimals_are_refused():
    with pytest.raises(InputError, match=r"10 of 10 time stamps carry several .* all their decimal places"):
        _order(np.repeat(np.arange(10), 6), np.arange(60))


@pytest.mark.parametrize("on_duplicate", ["last", "keep-step"])
def test_rows_of_a_step_at_one_instant(on_duplicate):
    """A simulation writes the last state before a step, iterations, and the first one after it."""
    time, values, notes = _order([0, 1, 2, 2, 2, 3], [5, 5, 5, 6, 9, 9], on_duplicate=on_duplicate)
    if on_duplicate == "last":
        assert (time.tolist(), values.tolist()) == ([0, 1, 2, 3], [5, 5, 9, 9])
    else:
        assert values.tolist() == [5, 5, 5, 9, 9]
        assert 0 < time[3] - time[2] < 1e-5
    assert notes[0].startswith("1 time stamps occurred several times with different readings")


@pytest.mark.parametrize(
    ("unit", "number"),
    [("s", 90.0), ("ms", 9e4), ("us", 9e7), ("min", 1.5), ("h", 0.025), ("ns", 9e10), ("ticks", 9e8)],
)
def test_units_of_time(unit, number):
    assert _read([0.0, number], unit=unit)[0] == pytest.approx([0, 90.0])


@pytest.mark.parametrize(
    ("unit", "first", "second", "apart"),
    [
        ("d", 45415.5, 45415.500001, 0.0864),
        ("ns", 1.7778024e18, 1.7778024e18 + 2e7, 0.02),
        ("ticks", 6.39e17, 6.39e17 + 2e5, 0.02),
    ],
)
def test_serial_dates_count_from_the_first(unit, first, second, apart):
    seconds, notes, _, _ = _read([first, second], unit=unit)
    resolved = np.spacing(first) * {"d": 86400, "ns": 1e-9, "ticks": 1e-7}[unit]  # of a double of this size
    assert seconds == pytest.approx([0, apart], abs=resolved)
    assert notes == [f"Time 0 is t = {first:.12g} {unit}."]


def test_dates_count_from_the_first():
    seconds, notes, _, _ = _read(["2024-05-01T12:00:00Z", "2024-05-01T14:00:00.25+02:00"], unit="iso")
    assert seconds == pytest.approx([0, 0.25])
    assert notes == ["Time 0 is 2024-05-01T12:00:00+00:00."]


@pytest.mark.parametrize(
    ("texts", "pattern"),
    [
        (["2026-05-03 10:00:00.000 UTC", "2026-05-03 10:00:00.020 UTC"], None),
        (["2026-05-03 10:00:00,000", "2026-05-03 10:00:00,020"], None),
        (["05/03/2026 10:00:00.000", "05/03/2026 10:00:00.020"], "%m/%d/%Y %H:%M:%S.%f"),
        (["03-May-2026 10:00:00.000", "03-May-2026 10:00:00.020"], "%d-%b-%Y %H:%M:%S.%f"),
        (["2026-05-03 10:00:00:000", "2026-05-03 10:00:00:020"], "%Y-%m-%d %H:%M:%S:%f"),
        (["23:59:59.990", "00:00:00.010"], "%H:%M:%S.%f"),
    ],
)
def test_texts_of_historians(texts, pattern):
    unit = "iso" if pattern is None else "s"
    assert _read(texts, unit=unit, pattern=pattern)[0] == pytest.approx([0, 0.02], abs=1e-9)


def test_an_unknown_text_is_refused_with_the_formats_that_fit():
    with pytest.raises(InputError, match=r"line 2, column 't'.*'%d/%m/%Y %H:%M:%S', '%m/%d/%Y %H:%M:%S'"):
        _read(["05/03/2026 10:00:00", "05/03/2026 10:00:01"], unit="iso")


def test_time_in_two_columns():
    soc = {"SOC": ["1777802400", "1777802401"], "FRACSEC": ["980000", "0"]}
    assert _read(soc, ("SOC", "FRACSEC"), base=1e6)[0] == pytest.approx([0, 0.02])
    date = {"Date": ["2026-05-03", "2026-05-04"], "Time": ["23:59:59.990", "00:00:00.010"]}
    assert _read(date, ("Date", "Time"))[0] == pytest.approx([0, 0.02])
    with pytest.raises(InputError, match="time_base is 50.*whole seconds, and fractions"):
        _read([0.0, 1.0], base=50)


def test_instants_may_be_dates_where_stamps_are():
    _, _, form, first = _read(["2026-05-03T10:00:00Z", "2026-05-03T10:00:01Z"], unit="iso")
    assert seconds_of("2026-05-03 10:00:00.8", "event_time", form, first, "file") == pytest.approx(0.8)
    assert seconds_of(0.8, "event_time", form, first, "file") == 0.8
    with pytest.raises(InputError, match="event_time is 'soon', which is no time stamp"):
        seconds_of("soon", "event_time", form, first, "file")
    _, _, form, first = _read([0.0, 1.0])
    with pytest.raises(InputError, match="event_time is the text '2026-05-03'.*where time stamps are dates"):
        seconds_of("2026-05-03", "event_time", form, first, "file")
