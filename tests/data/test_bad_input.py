"""Every kind of unusable recording, with the message that it must give."""

import contextlib
import re

import numpy as np
import pandas as pd
import pytest

from errorscreen.data import Column, from_frame, read_csv
from errorscreen.data.guess_file import guess_file
from errorscreen.exceptions import InputError

ROWS = [
    f"{0.05 * k:.2f},{1.0 - 0.1 * (k > 20):.3f},{40 - 10 * (k > 20) + 0.01 * (k % 3):.2f}" for k in range(60)
]
GOOD = "\n".join(["time,V,P", *ROWS])


def edited(line, text):
    """The good file with another line; lines count from 1 as in an editor."""
    lines = GOOD.splitlines()
    lines[line - 1] = text
    return "\n".join(lines)


def column_of(cell):
    """The good file with other readings of P."""
    return "\n".join(["time,V,P", *(",".join([*r.split(",")[:2], cell(k)]) for k, r in enumerate(ROWS))])


SWAPPED = "\n".join(["time,V,P", *ROWS[:30], ROWS[31], ROWS[30], *ROWS[32:]])

FILES = {
    "empty file": ("", {}, "is empty. Allowed: a header row and rows of numbers."),
    "header only": ("time,V,P\n", {}, "holds a header but no samples. Allowed: rows of numbers below it."),
    "one sample": ("time,V,P\n0,1,40\n", {}, "there is one sample only. Allowed: at least two samples."),
    "missing column": (
        GOOD,
        {"columns": {"P": "p"}},
        "unknown column 'p'. Allowed: time, V, P.",
    ),
    "misspelt column": (
        GOOD.replace("V,P", "Voltage,Power"),
        {"columns": {"V": "Volage"}},
        "unknown column 'Volage' (did you mean 'Voltage'?). Allowed: time, Voltage, Power.",
    ),
    "missing time column": (GOOD, {"time": "t"}, "unknown column 't'. Allowed: time, V, P."),
    "column twice": (
        GOOD.replace("time,V,P", "time,P,P"),
        {},
        "column 'P' occurs 2 times in the header. Allowed: a name of its own for each column.",
    ),
    "text in a number column": (
        edited(7, "0.25,1.0,forty"),
        {},
        "line 7, column 'P': 'forty' is not a number. Allowed: numbers with '.' before decimals",
    ),
    "another unit in the row of units": (
        edited(2, "s,pu,kW"),
        {},
        "column 'P': the unit of P is given as 'MW', but the file says 'kW'",
    ),
    "another unit of time in the row of units": (
        edited(2, "ms,pu,MW"),
        {"time_unit": "s"},
        "column 'time': the unit of time is given as 's', but the file says 'ms'",
    ),
    "a mark of a gap that is not stated": (
        edited(9, "0.35,-9999,-9999"),
        {},
        "line 9, column 'V': 1 readings are exactly -9999, far beyond the others",
    ),
    "no headers": (
        GOOD.split("\n", 1)[1],
        {},
        "has numbers in its first row where headers are expected",
    ),
    "status of no row is good": (
        GOOD,
        {"quality": {"column": "V", "good": ["ok"]}},
        "column 'V': no row has a good status; found were",
    ),
    "status without texts": (
        GOOD,
        {"quality": {"column": "V"}},
        "quality lacks its column, or texts of good rows",
    ),
    "a date where stamps are numbers": (
        GOOD,
        {"event_time": "2026-05-03"},
        "event_time is the text '2026-05-03'",
    ),
    "decimal comma": (
        GOOD.replace(",", ";").replace(".", ","),
        {},
        "line 2, column 'time': '0,00' is not a number, nor are '0,05', '0,10'",
    ),
    "decimal comma between commas": (
        GOOD.replace(".", ","),
        {},
        "line 2: the line has 6 fields, the header has 3. Complete or delete the line; numbers with a decimal "
        "comma need another delimiter, and decimal=','.",
    ),
    "comma for fields and decimals": (
        GOOD,
        {"decimal": ","},
        "the fields are separated by ',' and decimals by ','. Allowed: one character, and not the same unless",
    ),
    "truncated line": (
        GOOD + "\n3.00,0.9",
        {},
        "line 62: the line has 2 fields, the header has 3. Complete or delete the line.",
    ),
    "quotation mark that is not closed": (
        edited(3, '0.05,"1.0,40') + "\n" + 20000 * "3.00,0.9,30\n",
        {},
        "cannot be split into fields: field larger than field limit (131072). Look for a quotation mark",
    ),
    "line ends of an old Macintosh": (
        b"\r".join(GOOD.encode().splitlines()),
        {},
        r"the line 'time,V,P\r0.00,1.000,40.00\r0.05,1.000,40.' cannot be split into fields: new-line character",
    ),
    "all readings missing": (
        column_of(lambda k: "NaN"),
        {},
        "channel 'P': all readings are missing. Map another column, or leave it out.",
    ),
    "half of the readings missing": (
        column_of(lambda k: "" if k % 2 else f"{40 - k}"),
        {},
        "channel 'P': 30 of 60 readings (50%) are missing. Allowed: at most 40%. Leave the channel out",
    ),
    "channel that never moves": (
        column_of(lambda k: "40"),
        {},
        "channel 'P': every reading is 0.8: the channel never moves. Map another column",
    ),
    "channel that moves by rounding only": (
        column_of(lambda k: f"{40 + 8e-6 * (k % 2):.6f}"),
        {},
        "channel 'P': every reading is 0.8: the channel never moves. Map another column",
    ),
    "unsorted time": (
        SWAPPED,
        {},
        "line 33, column 'time': time runs backwards 1 times, first from 1.55 to 1.5 s. Allowed: increasing "
        "time stamps. Give on_backward='sort' for shuffled rows, or 'drop' for single wrong stamps.",
    ),
    "coarse time stamps": (
        "\n".join(["time,V,P", *(f"{k // 10},1,{k}" for k in range(60))]),
        {},
        "column 'time': 6 of 6 time stamps carry several different readings. Allowed: one reading for each",
    ),
    "missing time stamp": (
        edited(9, ",1.0,40"),
        {},
        "line 9, column 'time': 1 samples have no time stamp. Allowed: a number in every row.",
    ),
    "time stamp beyond any number": (
        edited(9, "1e400,1.0,40"),
        {},
        "line 9, column 'time': 1 time stamps lie beyond any date. Allowed: up to 1e+11 s from time 0. Check time_unit",
    ),
    "date as number": (
        edited(2, "2024-05-01 12:00,1.0,40"),
        {},
        "line 2, column 'time': '2024-05-01 12:00' is not a number. Allowed:",
    ),
    "number as date": (
        GOOD,
        {"time_unit": "iso"},
        "line 2, column 'time': '0.00' is no time stamp. Allowed: ISO 8601",
    ),
    "unknown time unit": (
        GOOD,
        {"time_unit": "sec"},
        "unknown time unit 'sec' (did you mean 's'?). Allowed: s, ms, us, ns, ticks, min, h, d, iso.",
    ),
    "event outside": (GOOD, {"event_time": 7.0}, "event_time is 7 s. Allowed: 0 to 2.95 s."),
    "no quiet part": (
        column_of(lambda k: f"{40 * np.cos(0.15 * k):.3f}"),
        {"columns": {"P": Column("P", unit="MW")}},
        "'P' moves from its first reading on. Allowed: at least 5 readings before the event.",
    ),
    "no event": (
        column_of(lambda k: f"{40 + 0.01 * (k % 3)}"),
        {"columns": {"P": Column("P", unit="MW")}},
        "no event was found: P never leaves its quiet band. Give event_time",
    ),
    "unknown unit": (
        GOOD,
        {"columns": {"V": Column("V", unit="kVolt")}},
        "channel 'V': unknown unit 'kVolt' (did you mean 'kV'?). Allowed: V, kV, pu.",
    ),
    "unknown sign": (
        GOOD,
        {"columns": {"P": Column("P", sign="loads")}},
        "channel 'P': unknown sign 'loads' (did you mean 'load'?). Allowed: generator, load.",
    ),
    "unknown field": (
        GOOD,
        {"columns": {"P": {"column": "P", "units": "MW"}}},
        "channel 'P': unknown field 'units' (did you mean 'unit'?). Allowed: column, unit, base,",
    ),
    "mistakable channel": (
        GOOD,
        {"columns": {"p": "P"}},
        "channel 'p': channel 'p' looks like 'P', which is written differently. Allowed: V, angle, f, P, Q",
    ),
    "sign where it means nothing": (
        GOOD,
        {"columns": {"V": Column("V", sign="load")}},
        "channel 'V': sign does not apply to 'V' in 'pu'. Allowed: P and Q.",
    ),
    "base where it means nothing": (
        GOOD,
        {"columns": {"P": Column("P", unit="MW", base=100.0)}},
        "channel 'P': base does not apply to 'P' in 'MW'. Allowed: V, P and Q in pu.",
    ),
    "half a phasor": (
        GOOD,
        {"columns": {"V": Column(real="V")}},
        "channel 'V': its source is not clear (V). Allowed: one of column; real and imag together; value.",
    ),
    "phasor of a power": (
        GOOD,
        {"columns": {"P": Column(real="V", imag="P")}},
        "channel 'P': real and imag were given for 'P'. Allowed: only for V.",
    ),
    "angle twice": (
        GOOD.replace("\n", ",0\n").replace("P,0", "P,a") + ",1",
        {"columns": {"V": Column(real="V", imag="P"), "angle": "a"}},
        "the angle is given twice, as a channel and by the real and imaginary parts of V. Allowed: one of them.",
    ),
    "column for two channels": (
        GOOD,
        {"columns": {"P": "P", "Q": "P"}},
        "column 'P' is mapped to 'P' and to 'Q'. Allowed: one channel for each column.",
    ),
    "no channel": (GOOD, {"columns": {}}, "no column is mapped to a channel. Allowed: at least one."),
    "volts without base": (
        GOOD,
        {"columns": {"V": Column("V", unit="kV")}, "base_kv": None},
        "channel 'V': V in 'kV' cannot be converted to pu. Give base_kv, the base voltage from line to line",
    ),
    "zero scale": (GOOD, {"columns": {"P": Column("P", scale=0.0)}}, "channel 'P': scale is 0. Allowed:"),
    "text as scale": (GOOD, {"columns": {"P": {"column": "P", "scale": "k"}}}, "channel 'P': scale is 'k'."),
    "negative base": (GOOD, {"base_mva": -50.0}, "base_mva is -50.0. Allowed: a number > 0."),
    "nominal frequency of zero": (GOOD, {"f_nominal": 0}, "f_nominal is 0. Allowed: a number > 0."),
    "threshold of gaps": (GOOD, {"max_missing": 1.5}, "max_missing is 1.5. Allowed: a number >= 0 and <= 1."),
    "unknown way with backward time": (
        GOOD,
        {"on_backward": "sorted"},
        "unknown value of on_backward 'sorted' (did you mean 'sort'?). Allowed: error, sort, drop.",
    ),
    "unknown way with held readings": (
        GOOD,
        {"held": "forget"},
        "unknown value of held 'forget'. Allowed: drop, keep.",
    ),
    "unknown encoding": (
        GOOD,
        {"encoding": "utf-99"},
        "encoding 'utf-99' is unknown. Allowed: utf-8, latin-1",
    ),
    "no decimal mark": (GOOD, {"decimal": ";"}, "decimal is ';'. Allowed: '.' or ','."),
    "negative lines to skip": (GOOD, {"skip_rows": -1}, "skip_rows is -1. Allowed: 0 or more."),
}


@pytest.mark.parametrize(("text", "changes", "message"), FILES.values(), ids=FILES.keys())
def test_unusable_files_are_explained(tmp_path, text, changes, message):
    path = tmp_path / "rec.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    options = {
        "columns": {"V": "V", "P": Column("P", unit="MW")},
        "base_mva": 50.0,
        "base_kv": 20.0,
        "f_nominal": 50.0,
        **changes,
    }
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        read_csv(path, **options)
    assert "rec" in caught.value.where


def test_the_good_file_is_good(tmp_path):
    path = tmp_path / "rec.csv"
    path.write_text(GOOD)
    rec = read_csv(path, {"V": "V", "P": Column("P", unit="MW")}, base_mva=50, base_kv=20, f_nominal=50)
    assert rec.event_time == pytest.approx(1.05)
    path.write_text(SWAPPED)
    swapped = read_csv(
        path, {"V": "V", "P": Column("P", unit="MW")}, base_mva=50, f_nominal=50, on_backward="sort"
    )
    np.testing.assert_array_equal(swapped.channel("P").values, rec.channel("P").values)


def test_files_that_cannot_be_read(tmp_path):
    bases = {"base_mva": 50, "f_nominal": 50}
    (tmp_path / "rec.csv").write_bytes(b"time,P\n0,\xff\n")
    with pytest.raises(InputError, match=r"recs.csv: does not exist.*Did you mean rec.csv\?"):
        read_csv(tmp_path / "recs.csv", {"P": "P"}, **bases)
    with pytest.raises(InputError, match=r"does not exist.*Check the path"):
        read_csv(tmp_path / "no" / "folder.csv", {"P": "P"}, **bases)
    with pytest.raises(InputError, match=r"is a folder\. Allowed: a file of readings"):
        read_csv(tmp_path, {"P": "P"}, **bases)
    with pytest.raises(InputError, match=r"byte 9 is not utf-8-sig text\. Give encoding='latin-1'"):
        read_csv(tmp_path / "rec.csv", {"P": "P"}, **bases)


@pytest.mark.parametrize("text", ["(" * 40000, "1" + " " * 40000 + "x", "+1" * 20000])
@pytest.mark.parametrize("place", ["header", "reading", "time stamp"])
def test_long_texts_take_no_longer_than_their_length(tmp_path, text, place):
    """Patterns would be tried on them in all ways, for minutes."""
    lines = GOOD.splitlines()
    cells = {"header": f"time,{text},P", "reading": f"0.00,{text},40", "time stamp": f"{text},1.0,40"}
    lines[place != "header"] = cells[place]
    path = tmp_path / "rec.csv"
    path.write_text("\n".join(lines))
    for unit in ("s", "iso"):
        with pytest.raises(InputError):
            read_csv(path, {"V": "V"}, base_mva=50, f_nominal=50, time_unit=unit)
    with contextlib.suppress(InputError):
        guess_file(path)


def test_tables_name_their_rows():
    frame = pd.DataFrame({"P": ["1", "x"]}, index=[0.0, 1.0])
    with pytest.raises(InputError, match=r"table 'recording', row 1, column 'P': 'x' is not a number"):
        from_frame(frame, {"P": "P"}, base_mva=1, f_nominal=50)
    with pytest.raises(InputError, match="there are no samples"):
        from_frame(frame.iloc[:0], {"P": "P"}, base_mva=1, f_nominal=50)
    with pytest.raises(InputError, match=r"numbers were found instead of dates.*time_unit='s'"):
        from_frame(frame, {"P": "P"}, base_mva=1, f_nominal=50, time_unit="iso")
