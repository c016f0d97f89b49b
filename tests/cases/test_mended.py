"""Sections of recordings without their wrong keys."""

import pytest

from errorscreen.cases.mended import without_wrong_keys

GOOD = {
    "path": "r.csv",
    "base_mva": 100.0,
    "base_kv": 20.0,
    "f_nominal": 50.0,
    "columns": {"V": {"column": "U", "unit": "kV"}, "P": "P"},
}


@pytest.mark.parametrize(
    "wrong",
    [
        {"base_mva": -5},
        {"f_nominal": "fifty", "base_kv": 0},
        {"evnt_time": 3},
        {"xyzzy": 1},
        {"noise": 3, "held": "perhaps"},
        {"t_start": 3.0, "t_end": 1.0},
        {"load_level": -1.0, "fault": {"bus": "one"}},
    ],
)
def test_keys_apart_from_columns_are_left_out(wrong):
    section = without_wrong_keys({**GOOD, **wrong})
    assert (section.columns["V"].column, section.columns["V"].unit, section.columns["P"].column) == (
        "U",
        "kV",
        "P",
    )


@pytest.mark.parametrize(
    "wrong",
    [{"delimeter": ";"}, {"header_rows": 0}, {"time": 3}, {"decimal": ";"}, {"columns": {}}, {"path": 7}],
)
def test_a_key_that_decides_how_columns_are_read_is_not(wrong):
    """Columns that are not found without it would be told as wrong, though they are right."""
    assert without_wrong_keys({**GOOD, **wrong}) is None


def test_a_missing_base_is_stood_in_for_and_a_missing_path_is_not():
    assert without_wrong_keys({k: v for k, v in GOOD.items() if k != "base_mva"}).columns
    assert without_wrong_keys({k: v for k, v in GOOD.items() if k != "path"}) is None
    assert without_wrong_keys("no table") is None


def test_a_wrong_key_of_a_channel_is_left_out_and_the_channel_if_it_may_name_the_column():
    for key in ("sgn", "base"):
        columns = {**GOOD["columns"], "Q": {"column": "Q", key: "load"}}
        assert without_wrong_keys({**GOOD, "columns": columns}).columns["Q"].column == "Q"
    columns = {**GOOD["columns"], "Q": {"colum": "Q"}}
    assert list(without_wrong_keys({**GOOD, "columns": columns}).columns) == ["V", "P"]
