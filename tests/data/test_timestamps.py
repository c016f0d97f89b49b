import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.data.table import Table
from errorscreen.data.timestamps import longest_increasing, order_samples, read_time
from errorscreen.exceptions import DataWarning, InputError


def _order(time, values, on_backward="error"):
    notes = []
    table = Table({"t": time}, range(2, len(time) + 2), "file a.csv")
    out = order_samples(np.array(time, float), {"P": np.array(values, float)}, table, "t", on_backward, notes)
    return out[0], out[1]["P"], notes


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


@pytest.mark.parametrize(
    ("unit", "number"), [("s", 90.0), ("ms", 9e4), ("us", 9e7), ("min", 1.5), ("h", 0.025)]
)
def test_units_of_time(unit, number):
    table = Table({"t": [0.0, number]}, [2, 3], "file a.csv")
    assert read_time(table, "t", unit, [], ".") == pytest.approx([0, 90.0])


def test_dates_count_from_the_first():
    table = Table({"t": ["2024-05-01T12:00:00Z", "2024-05-01T14:00:00.25+02:00"]}, [2, 3], "file a.csv")
    notes = []
    assert read_time(table, "t", "iso", notes, ".") == pytest.approx([0, 0.25])
    assert notes == ["Time 0 is 2024-05-01T12:00:00+00:00."]
