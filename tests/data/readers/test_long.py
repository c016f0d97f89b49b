"""Text files with one reading in each row."""

import numpy as np
import pytest
from hypothesis import given

from errorscreen.cases import load_case
from errorscreen.data import read_recording
from errorscreen.exceptions import InputError
from tests.data.readers.shared_rows import BASES, COLUMNS, TIME, P, V, bounded, check, damages, survives

LONG = {"tag": "tag", "value": "value"}
ROWS = [
    f"{tag},{t:.2f},{x:.9g},ok" for tag, xs in (("V", V), ("P", P)) for t, x in zip(TIME, xs, strict=True)
]
HEAD = "tag,time,value,state"


def write(folder, rows):
    path = folder / "a.csv"
    path.write_text("\n".join([HEAD, *rows, "switch,0.50,open,ok"]))
    return path


def read(path, **options):
    return read_recording(path, COLUMNS, long=LONG, **options, **BASES)


def test_tags_become_columns_in_any_order_of_rows(tmp_path):
    check(read(write(tmp_path, ROWS)))
    check(read(write(tmp_path, sorted(ROWS, key=lambda row: float(row.split(",")[1])))))


def test_gaps_status_and_several_readings(tmp_path):
    rows = [row for k, row in enumerate(ROWS) if k not in (110, 111)]
    rows[5] = rows[5].replace(",ok", ",bad").replace("20", "900", 1)
    rec = read(write(tmp_path, rows), quality={"column": "state", "good": ["ok"]})
    check(rec)
    assert np.isnan(rec.channel("P").values).sum() == 2
    assert np.isnan(rec.channel("V").values).sum() == 1
    rec = read(write(tmp_path, [*ROWS[:41], "V,0.80,18.0,ok", *ROWS[41:]]), on_duplicate="last")
    assert rec.channel("V").values[40] == pytest.approx(0.9)


def test_what_does_not_fit_is_refused(tmp_path):
    with pytest.raises(InputError, match="tag 'V', line 4, column 'time': time runs backwards"):
        read(write(tmp_path, [ROWS[1], ROWS[2], ROWS[0], *ROWS[3:]]))
    check(read(write(tmp_path, [ROWS[1], ROWS[2], ROWS[0], *ROWS[3:]]), on_backward="sort"))
    with pytest.raises(InputError, match="unknown tag 'P'"):
        read(write(tmp_path, ROWS[:100]))
    with pytest.raises(InputError, match="unknown field 'tags'"):
        read_recording(write(tmp_path, ROWS), COLUMNS, long={"tags": "x"}, **BASES)


def test_a_case_file(tmp_path):
    write(tmp_path, ROWS)
    (tmp_path / "case.toml").write_text(
        '[recording]\npath = "a.csv"\nbase_mva = 100\nbase_kv = 20\nf_nominal = 50\n'
        'long = { tag = "tag", value = "value" }\n'
        'columns = { V = { column = "V", unit = "kV" }, P = { column = "P", unit = "MW" } }\n'
        '[device]\ntype = "synchronous_machine"\n'
    )
    check(load_case(tmp_path / "case.toml").load_recording())


@bounded
@given(damages)
def test_damage(tmp_path_factory, damage):
    path = write(tmp_path_factory.mktemp("long"), ROWS)
    survives(path, path.read_bytes(), damage, format="csv", long=LONG)
