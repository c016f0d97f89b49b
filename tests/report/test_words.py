"""Numbers in the report are short, and those that do not exist are a dash."""

from errorscreen.discovery.conclusions import probable
from errorscreen.report.html_report import format_change, format_number


def test_numbers_have_three_digits_and_no_exponent_where_that_stays_short():
    found = [format_number(value) for value in (1234.5, 999.6, 0.012345, 2.5e-7, float("nan"))]
    assert found == ["1230", "1000", "0.0123", "2.5e-07", "–"]


def test_a_change_has_its_sign():
    assert [format_change(*pair) for pair in ((0.2, 0.05), (0.1, 0.1), (0.0, 0.1))] == ["−75 %", "±0 %", "–"]


def test_a_probability_is_never_rounded_to_certainty():
    assert [probable(value) for value in (0.964, 0.998, 0.001)] == ["0.96", "> 0.99", "< 0.01"]
