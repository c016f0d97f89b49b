"""Tables of pandas with any types of columns, index and headers."""

import numpy as np
import pandas as pd
import pytest

import errorscreen as es
from errorscreen.data import Column, from_frame
from errorscreen.exceptions import InputError
from tests.data.readers.shared_rows import BASES, COLUMNS, TIME, P, V, check

STAMPS = pd.Timestamp("2026-05-03 10:00") + pd.to_timedelta(TIME, unit="s")
FRAME = pd.DataFrame({"V": V, "P": P})


@pytest.mark.parametrize(
    "index",
    [
        STAMPS,
        STAMPS.tz_localize("Europe/Berlin"),
        STAMPS.as_unit("ns"),
        STAMPS - STAMPS[0],
        pd.CategoricalIndex(STAMPS),
        pd.Index(TIME),
    ],
    ids=str,
)
def test_an_index_of_instants(index):
    check(from_frame(FRAME.set_index(index), COLUMNS, **BASES))
    check(from_frame(FRAME.assign(t=index), COLUMNS, time="t", **BASES))


def test_an_index_of_dates_needs_no_unit_in_read():
    table = FRAME.set_index(STAMPS).rename(columns={"V": "V [kV]", "P": "P [MW]"})
    check(es.read(table, **BASES))


@pytest.mark.parametrize("kind", ["Float64", "Float32", "category", "object", "string", "double[pyarrow]"])
def test_types_of_numbers(kind):
    if "pyarrow" in kind:
        pytest.importorskip("pyarrow")
    table = FRAME.astype(kind).set_index(TIME)
    table.iloc[50, 0] = table.iloc[49, 0] if kind == "category" else None
    rec = from_frame(table, COLUMNS, **BASES)
    check(rec)
    assert np.isnan(rec.channel("V").values[50]) == (kind != "category")


def test_arrow_dates():
    pytest.importorskip("pyarrow")
    for kind in ("timestamp[us][pyarrow]", "timestamp[ns, tz=UTC][pyarrow]"):
        index = STAMPS.tz_localize("UTC") if "tz" in kind else STAMPS
        check(from_frame(FRAME.assign(t=pd.Series(index).astype(kind)), COLUMNS, time="t", **BASES))


def test_headers_of_several_levels_are_joined():
    table = FRAME.set_axis(pd.MultiIndex.from_tuples([("Plant B", "V"), ("Plant B", "P")]), axis=1)
    columns = {"V": Column("Plant B|V", unit="kV"), "P": Column("Plant B|P", unit="MW")}
    check(from_frame(table.set_index(TIME), columns, **BASES))
    check(es.read(table.set_index(TIME), columns, **BASES))


def test_what_is_not_clear_is_refused():
    with pytest.raises(InputError, match="column '1' occurs more than once"):
        from_frame(pd.DataFrame({1: V, "1": P}, index=TIME), {"V": "1"}, **BASES)
    table = FRAME.set_index([pd.Index(TIME, name="t"), pd.Index(TIME, name="run")])
    with pytest.raises(InputError, match="the index has the levels 't', 'run'.*reset_index"):
        from_frame(table, COLUMNS, **BASES)
