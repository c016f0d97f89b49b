"""Curves of the report: what is left of a long record, and how it is packed."""

import base64
import json

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.report.charts import MOST, Chart, Curve, Panel, kept

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS, st.integers(1, 4), st.integers(3, 3000), st.integers(20, 400))
def test_thinning_keeps_the_extremes_of_every_curve_and_both_ends(seed, count, length, most):
    curves = [*np.random.default_rng(seed).standard_normal((count, length)).cumsum(axis=1)]
    places = kept(curves, most)
    assert len(places) <= max(most, 2 + 2 * count)
    assert (np.diff(places) > 0).all()
    assert places[0] == 0
    assert places[-1] == length - 1
    for values in curves:
        assert values[places].max() == values.max()
        assert values[places].min() == values.min()


def test_short_records_and_gaps_stay_as_they_are():
    values = np.array([1.0, np.nan, 3.0])
    assert kept([values], 10).tolist() == [0, 1, 2]
    gappy = np.where(np.arange(1000) % 3, 1.0, np.nan)
    assert 0 < len(kept([gappy, np.full(1000, np.nan)], 50)) <= 50


def test_packed_numbers_are_the_curves():
    time = np.linspace(0.0, 60.0, 60_001)
    values = np.sin(time)
    values[31_415] = 7.0
    chart = Chart(time, 1.0, (Panel("P in pu", (Curve("measured", "measured", values),)),))
    assert chart.thinned
    panel = json.loads(chart.packed())["panels"][0]
    found_time = np.frombuffer(base64.b64decode(panel["time"]), "<f8")
    found = np.frombuffer(base64.b64decode(panel["curves"][0]["values"]), "<f4")
    assert len(found) <= MOST
    assert found.max() == 7.0
    assert found_time[found.argmax()] == time[31_415]
    assert np.allclose(found, values[np.searchsorted(time, found_time)], atol=1e-6)


def test_no_name_can_end_the_script_that_holds_it():
    chart = Chart(np.arange(2.0), 0.0, (Panel("</script><b>", (Curve("<!--", "input", np.arange(2.0)),)),))
    assert "<" not in chart.packed()
    assert json.loads(chart.packed())["panels"][0]["label"] == "</script><b>"
