"""DYR files: order of the records, reading, messages, changes in place."""

import csv
import os
import re
import shutil
import subprocess
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import errorscreen as es
from errorscreen.exceptions import DataWarning, InputError
from errorscreen.models.dyr import DyrFile, read_dyr
from errorscreen.models.dyr_text import LARGEST, difference, written
from errorscreen.models.standard import PARTS

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
ORDERS = SHARED / "psse_records" / "psse_records.csv"

GENROU = "101 'GENROU' 1  6.0 0.04 0.8 0.06\n    4.0 0.0 1.8 1.7 0.3\n    0.5 0.22 0.15 0.1 0.4 /\n"
SEXS = "101 'SEXS' 1  0.1 10.0 100.0 0.05 0.0 5.0 /\n"
TGOV1 = "101 'TGOV1' 1  0.05 0.3 1.0 0.0 2.0 7.0 0.0 /\n"
UNIT = f"// a unit\n{GENROU}{SEXS}{TGOV1}"
OTHER = GENROU.replace("101", "202")


def file(text):
    return DyrFile("unit.dyr", text)


def numbers(found):
    """Values of all records by model."""
    return {one.model: [value.value for value in one.values] for one in found.records}


# --- order of the constants -------------------------------------------------------------------------------------------


def orders():
    found = defaultdict(list)
    if ORDERS.exists():
        with ORDERS.open(encoding="utf-8") as handle:
            for row in csv.DictReader(handle):
                found[row["model"]].append((row["name"], row["kind"]))
    return found


@pytest.mark.parametrize("name", list(PARTS))
def test_constants_are_in_the_order_of_the_record(name):
    known = orders()
    if name not in known:
        pytest.skip(f"no order of {name} in {ORDERS}")
    fields = PARTS[name].fields
    assert [one.symbol for one in fields] == [symbol for symbol, _ in known[name]]
    assert all(one.integer for one, (_, kind) in zip(fields, known[name], strict=True) if kind == "ICON")


def test_names_of_records_are_unique():
    names = [name for part in PARTS.values() for name in (part.name, *part.aliases)]
    assert len(set(names)) == len(names)


@pytest.mark.skipif(not SHARED.exists(), reason=f"{SHARED} is not there")
def test_files_of_others_are_read():
    paths = sorted(SHARED.rglob("*.dyr"))
    assert len(paths) >= 20
    for path in paths:
        found = read_dyr(path)
        assert all("unknown model" in problem for problem in found.check())
        for bus, id in found.units:
            if all(one.part for one in found.records if (one.bus, one.id) == (bus, id)):
                assert found.unit(bus, id).candidates
        assert DyrFile(path, found.text).table().equals(found.table())


# --- reading ----------------------------------------------------------------------------------------------------------


def test_a_unit_in_three_lines(tmp_path):
    path = tmp_path / "unit.dyr"
    path.write_text(UNIT)
    device = es.read_dyr(path).unit()
    assert device.name == "GENROU+SEXS+TGOV1"
    assert device.candidates["TGOV1.R"].nominal == 0.05
    assert es.read_dyr(str(path)).unit(101, 1).name == device.name


@pytest.mark.parametrize(
    "text",
    [
        "101 'SEXS' 1 0.1 10 100. .05 0 5 /",
        "101,'SEXS',1,0.1,10.0,100.0,0.05,0.0,5.0/",
        "101, 'sexs' , '1 ' , 0.1 , 10.0\n, 100.0, 0.05, 0.0, 5.0, / 50 'GENROU' was here",
        '101 "Sexs" "1" 1.0E-1 1.0d1 1D+2 +5e-2 -0.0 0.5E01 / and more',
        "101 SEXS 1 0.1 10 100 0.05\n// between 'the lines /\n/* so is this\n@ and this\n0 5\n/\n",
        "  101\n'SEXS'\n1\n0.1\n\n10\n100\n0.05\n0\n5\n/",
        "101 'SEXS' 1 0.1 10 100 0.05 0 5 /\r\n\x1a",
        "\r\r101 ' SEXS ' 1\t0.1 10\t100 0.05 0 5 /\r",
        "/ a line that begins with a slash\n101'SEXS'1 0.1 10 100 0.05 0 5/",
        "101 'USRMDL' 1 'SEXS' 4 0 0 6 2 0 0.1 10 100 0.05 0 5 /",
        "101 'USRMDL'\n 1 'SEXS' 4 0 0 6 2 0\n 0.1 10 100 0.05 0 5 /",
    ],
)
def test_spellings_of_a_record(text):
    [record] = file(text).records
    assert (record.bus, record.id, record.part.name) == (101, "1", "SEXS")
    assert [one.value for one in record.values] == [0.1, 10, 100, 0.05, 0, 5]
    assert not list(record.problems(record.values))


def test_places_of_values():
    found = file("\n\n  101 'SEXS' 1  0.1,10.0\n\t100.0 0.05 0 5 /").records[0]
    assert found.line == 3
    assert [(one.token.line, one.token.column) for one in found.values][:3] == [(3, 17), (3, 21), (4, 2)]
    text = found._text
    assert [text[one.token.start : one.token.end] for one in found.values[:2]] == ["0.1", "10.0"]


def test_identifiers_are_text_and_texts_in_records_stay():
    found = file(UNIT.replace("' 1  ", "' 'g1' "))
    assert found.units == [(101, "G1")]
    assert found.unit(id="g1").name == "GENROU+SEXS+TGOV1"
    repca = file("103 'REPCA1' 1 0 0 0 '0 ' " + "0 " * 30 + "/").records[0]
    if repca.part:
        assert repca.values[3].value == 0.0
        assert repca.values[3].token.text == "0 "


def test_a_bus_may_have_an_extended_name():
    found = file(UNIT.replace("101", "'Hydro 1   13.8'"))
    assert found.units == [("HYDRO 1 13.8", "1")]
    assert found.unit("Hydro 1 13.8").name == "GENROU+SEXS+TGOV1"


@pytest.mark.parametrize(("encoding", "mark"), [("utf-8", ""), ("latin-1", ""), ("utf-8", "\ufeff")])
def test_encodings_survive(tmp_path, encoding, mark):
    path = tmp_path / "unit.dyr"
    data = f"{mark}// Überlandwerk\r\n{UNIT}".encode(encoding)
    path.write_bytes(data)
    found = read_dyr(path)
    assert found.write(tmp_path / "copy.dyr").read_bytes() == data
    changed = found.write(tmp_path / "new.dyr", values={"SEXS.K": 120.0}).read_bytes()
    assert changed == data.replace(b"100.0", b"120.0")


def test_a_voltage_source_is_no_unit():
    if "GENCLS" not in PARTS:
        pytest.skip("GENCLS is not there yet")
    found = file(f"1 'GENCLS' 1 0.0 0.0 /\n{UNIT}")
    assert found.units == [(101, "1")]
    assert found.unit().name == "GENROU+SEXS+TGOV1"
    assert found.check() == []
    with pytest.raises(InputError, match="H is 0"):
        found.unit(1)


def test_records_of_other_units_do_not_hinder():
    bad = SEXS.replace("101", "202").replace("10.0", "-1")
    found = file(UNIT + OTHER + bad + "303 'NEWGOV' 1 1 2 3 /\n303 'GENROU' 1 1 /\n")
    assert found.unit(101).name == "GENROU+SEXS+TGOV1"
    problems = found.check()
    assert len(problems) == 3
    for words, problem in zip(["TB is -1", "'NEWGOV'", "has 1 values"], problems, strict=True):
        assert words in problem
    assert re.match(r"unit.dyr:10, column 19, SEXS of unit 202 '1'", problems[0])
    with pytest.raises(InputError, match="TB is -1"):
        found.unit(202)


def test_an_unknown_model_can_be_left_out():
    found = file(UNIT + "101 'OEL99X' 1 1.0 'text' 3 /\n")
    with pytest.raises(InputError, match=r"unit.dyr:7, .*'OEL99X'.*leave_out=\['OEL99X'\]"):
        found.unit()
    assert found.unit(leave_out=["oel99x"]).name == "GENROU+SEXS+TGOV1"
    with pytest.raises(InputError, match="unknown model 'OEL'.*OEL99X"):
        found.unit(leave_out=["OEL"])


def test_a_record_without_bus_may_belong_to_any_unit():
    found = file(UNIT + OTHER + "1O1 'SCRX' 1 0.1 1.0 100.0 0.005 -10.0 10.0 0 0.0 /\n")
    with pytest.warns(DataWarning, match="1 records may belong to any unit.*'1O1'"):
        assert found.unit(101).name == "GENROU+SEXS+TGOV1"
    with pytest.raises(InputError, match="'1O1'"):
        file(UNIT + "1O1 'SCRX' 1 /\n").unit()


def test_table_summary_and_repr():
    found = file(UNIT + OTHER + "202 'NEWGOV' 1 1 x 3 /\n")
    table = found.table()
    assert list(table.columns) == ["bus", "id", "model", "slot", "name", "value", "unit", "meaning", "line"]
    row = table[(table.model == "TGOV1") & (table.name == "R")].iloc[0]
    assert (row.bus, row.id, row.slot, row.value, row.unit, row.line) == (101, "1", "governor", 0.05, "pu", 6)
    assert table.value.isna().sum() == 1
    assert "202 '1': GENROU, NEWGOV (unknown)" in found.summary()
    assert repr(found) == "DyrFile(file: unit.dyr, records: 5, units: 2, records of unknown models: 1)"
    many = file("".join(GENROU.replace("101", str(bus)) for bus in range(1, 31)))
    assert many.summary().endswith("and 10 more")


def test_a_large_file_is_read_lazily():
    found = file("".join(GENROU.replace("101", str(bus)) for bus in range(1, 3001)))
    assert len(found.units) == 3000
    assert found.unit(2999).name == "GENROU"
    assert found.check() == []
    assert found.diff(2999, 1, {"GENROU.H": 5}).count("\n") == 11


# --- wrong files ------------------------------------------------------------------------------------------------------

#: text, and the words of the message for its unit 101
BAD = {
    "too few": (
        GENROU.replace(" 0.4 /", " /"),
        ["unit.dyr:1,", "has 13 values", "the 14 values of GENROU: T'do", "missing: S(1.2)"],
    ),
    "too many": (
        SEXS.replace(" /", " 9.5 /") + GENROU,
        ["unit.dyr:1,", "has 7 values", "6 values of SEXS", "behind EMAX: 9.5"],
    ),
    "unknown model": (
        GENROU + SEXS.replace("SEXS", "SEXX"),
        ["unit.dyr:4,", "unknown model 'SEXX' (did you mean 'SEXS'", "leave it out"],
    ),
    "user model": (
        GENROU + "101 'USRMDL' 1 'SEXSU' 4 0 0 1 1 0 1.0 /",
        ["unit.dyr:4,", "'SEXSU' (did you mean 'SEXS'"],
    ),
    "library counts": (
        "101 'USRMDL' 1 'SEXS' 4 0 0 5 1 0 0.1 10 100 .05 0 5 /\n" + GENROU,
        ["NI '0', NC '5'", "NI + NC = 6"],
    ),
    "duplicate record": (
        GENROU + SEXS + SEXS,
        ["unit.dyr:4,", "unit.dyr:5,", "SEXS and SEXS", "slot exciter", "Remove one"],
    ),
    "two machines": (
        GENROU + GENROU.replace("ROU", "ROE"),
        ["unit.dyr:1,", "unit.dyr:4,", "GENROE and GENROU", "one machine"],
    ),
    "exciter without machine": (
        SEXS,
        ["unit.dyr:1,", "the unit has SEXS, but no machine", "Allowed: a machine", "Check bus number"],
    ),
    "negative time constant": (
        GENROU + SEXS.replace("10.0", "-10.0"),
        ["unit.dyr:4, column 19", "TB is -10", ">= 0 (lag time constant"],
    ),
    "zero time constant": (
        GENROU.replace("6.0", "0.0"),
        ["unit.dyr:1, column 17", "T'do is 0", "> 0 (d-axis transient"],
    ),
    "TC without TB": (
        GENROU + "101 'TGOV1' 1 0.05 0.3 1 0 2 0 0 /",
        ["unit.dyr:4,", "T2 is 2 and T3 is 0", "T2 other than 0 only with T3"],
    ),
    "limits swapped": (
        GENROU + SEXS.replace("0.0 5.0", "5.0 0.0"),
        ["unit.dyr:4,", "EMIN is 5 and EMAX is 0", "EMIN < EMAX"],
    ),
    "leakage": (
        GENROU.replace("0.15", "0.25"),
        ["unit.dyr:1,", "Xl is 0.25", "Xl < X''d", "Xl: leakage reactance"],
    ),
    "no inertia": (GENROU.replace(" 4.0 ", " 0.0 "), ["unit.dyr:2, column 5", "H is 0", "> 0 (inertia"]),
    "negative inertia": (GENROU.replace(" 4.0 ", " -4.0 "), ["unit.dyr:2, column 5", "H is -4"]),
    "empty field": (
        GENROU.replace("0.5 0.22", "0.5,,0.22"),
        ["unit.dyr:3, column 9", "value 11, X''d, is empty", "not public"],
    ),
    "text": (
        GENROU.replace("0.22", "abc"),
        ["unit.dyr:3, column 9", "X''d is 'abc'", "a finite number (subtransient"],
    ),
    "quoted number": (GENROU.replace("0.22", "'0.22'"), ["X''d is '0.22' in quotes", "a finite number"]),
    "NaN": (GENROU.replace("0.22", "NaN"), ["unit.dyr:3, column 9", "X''d is 'NaN'", "a finite number"]),
    "infinite": (GENROU.replace("0.22", "-Infinity"), ["X''d is '-Infinity'", "a finite number"]),
    "too large": (GENROU.replace("0.22", "1E999"), ["X''d is '1E999'", "a finite number"]),
    "decimal comma": (GENROU.replace("0.22", "0,22"), ["has 15 values", "the 14 values of GENROU"]),
    "repetition": (GENROU.replace("0.22", "2*0.22"), ["X''d is '2*0.22'", "Write each value"]),
    "no end": (
        GENROU.rstrip("/\n"),
        ["unit.dyr:1,", "no '/' ends the record", "Put ' /' behind", "no line is missing"],
    ),
    "cut off": (GENROU[:50], ["unit.dyr:1,", "no '/' ends the record"]),
    "no end before the next": (GENROU.replace("/", "") + SEXS, ["unit.dyr:1,", "no '/' ends the record"]),
    "quote": (
        GENROU + SEXS.replace("'SEXS'", "'SEXS"),
        ["unit.dyr:4, column 5, bus 101", "the quote ' has no partner", "two quotes on one line"],
    ),
    "quote behind": (GENROU.replace("0.22", '"0.22'), ["unit.dyr:3, column 9", 'the quote " has no partner']),
    "no bus": (
        UNIT + "'SCRX' 1 0.1 1.0 100.0 0.005 -10.0 10.0 0 0.0 /",
        ["unit.dyr:7: the record begins with 'SCRX'", "the number of a bus: 101", "Comments begin with //"],
    ),
    "headline": (
        "My units of 2019\n" + UNIT,
        ["unit.dyr:1: the record begins with 'My'", "Comments begin with //"],
    ),
    "fractional bus": (
        SEXS.replace("101", "101.5") + GENROU,
        ["unit.dyr:1: the bus is 101.5", "a whole number"],
    ),
    "negative bus": (SEXS.replace("101", "-101") + GENROU, ["unit.dyr:1: the bus is -101", "without sign"]),
    "huge bus": (SEXS.replace("101", "1" * 30) + GENROU, ["the bus is 111", "at most nine digits"]),
    "no model": (
        GENROU + "101 /",
        ["unit.dyr:4, bus 101: the record has no model", "101 'GENROU' 1 values /"],
    ),
    "model is a number": (GENROU + "101 5 1 0.1 /", ["unit.dyr:4, bus 101: the model is 5"]),
    "no identifier": (GENROU + "101 'SEXS' /", ["the record has no identifier"]),
    "identifier forgotten": (
        SEXS + GENROU.replace("' 1 ", "' "),
        ["unit.dyr:2: the identifier of GENROU at bus 101 is '6.0'", "one or two characters"],
    ),
    "library form cut": (
        GENROU + "101 'USRMDL' 1 'SEXS' 4 0 /",
        ["header of the library form is incomplete", "NI NC NS NV"],
    ),
    "second on the line": (
        GENROU + SEXS.rstrip() + TGOV1,
        ["unit.dyr:4: another record follows on the line", "a line of its own"],
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_wrong_unit_is_refused_with_its_place_and_a_remedy(kind):
    text, words = BAD[kind]
    with pytest.raises(InputError) as caught:
        file(text).unit()
    for word in words:
        assert word in str(caught.value)
    assert any(words[-1] in problem for problem in file(text).check())


#: flags and whole numbers: model, position of the constant, text, words
CODES = [
    ("ESST1A", 0, "1.5", ["is '1.5'", "a whole number"]),
    ("ESST1A", 0, "7", ["is 7", "Allowed: 0, 1, 2, 3"]),
    ("IEEEST", 0, "x", ["is 'x'", "a whole number"]),
]


@pytest.mark.parametrize(("model", "position", "text", "words"), CODES)
def test_a_wrong_code_is_refused(model, position, text, words):
    if model not in PARTS:
        pytest.skip(f"{model} is not there yet")
    values = [f"{one.typical:g}" for one in PARTS[model].fields]
    values[position] = text
    found = file(f"{GENROU}101 '{model}' 1 {' '.join(values)} /\n")
    with pytest.raises(InputError) as caught:
        found.unit()
    for word in (f"unit.dyr:4, column 16, {model}", *words):
        assert word in str(caught.value)


def test_a_governor_of_another_kind_of_unit():
    if "REGCA1" not in PARTS:
        pytest.skip("REGCA1 is not there yet")
    values = " ".join(f"{one.typical:g}" for one in PARTS["REGCA1"].fields)
    with pytest.raises(InputError, match="REGCA1 is for another kind of unit than GENROU"):
        file(f"{GENROU}101 'REGCA1' 1 {values} /").unit()


DYD = 'models\ngenrou 101 "BUS 1" 13.8 "1 " : #9 mva=100.0 6.0 0.04 0.8 /\n0.06 4.0\n'
RAW = """0,   100.00, 33, 0, 0, 60.00     / PSS(R)E 33 RAW


   101,'BUS 1', 138.0000,3,   1,   1,   1,1.05000,   0.0000
   102,'BUS 2', 138.0000,2,   1,   1,   1,1.02000,  -0.9440
 0 /End of Bus data, Begin Load data
"""
#: bytes of a file, and the words of the message
FILES = {
    "nothing": (b"", ["is empty", "101 'GENROU' 1 values /"]),
    "blanks": (b" \n\n ", ["is empty"]),
    "comments": (b"// nothing\n@ here\n/ at all\n", ["holds comments but no record"]),
    "DYD": (DYD.encode(), ["is a DYD file of PSLF", "DYD is not read yet"]),
    "DYD line": (DYD.encode()[7:], ["is a DYD file of PSLF"]),
    "RAW": (RAW.encode(), ["is a RAW file", "Give the DYR file"]),
    "RAW 35": (b"@!IC,SBASE,REV\n" + RAW.replace("33,", "35,").encode(), ["is a RAW file"]),
    "binary": (b"\x89PNG\r\n\x1a\n\x00\x00", ["is no text", "0x00", "plain text"]),
    "UTF-16": ("101".encode("utf-16"), ["UTF-16", "Save it as UTF-8"]),
    "JSON": (b'{"network": [1, 2]}', ["the record begins with '{", "the number of a bus"]),
    "prose": (b"Dear all,\nhere is the model.\n", ["the record begins with 'Dear'"]),
}


@pytest.mark.parametrize("kind", FILES)
def test_another_file_is_refused(tmp_path, kind):
    data, words = FILES[kind]
    path = tmp_path / "plant.dyr"
    path.write_bytes(data)
    with pytest.raises(InputError) as caught:
        read_dyr(path)
    for word in (str(path), *words):
        assert word in str(caught.value)


def test_a_path_that_is_no_file(tmp_path):
    with pytest.raises(InputError, match="does not exist.*Check the path"):
        read_dyr(tmp_path / "missing.dyr")
    with pytest.raises(InputError, match="is a folder.*Allowed: a DYR file"):
        read_dyr(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        read_dyr("a\0b")
    with pytest.raises(InputError, match="of type int"):
        read_dyr(3)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="a device or a pipe"):
        read_dyr(tmp_path / "pipe")


def test_a_file_beyond_all_sizes_is_refused_at_once(tmp_path):
    path = tmp_path / "huge.dyr"
    with path.open("wb") as handle:
        handle.truncate(LARGEST + 1)
    with pytest.raises(InputError, match=r"has 200 MiB.*at most 200 MiB.*cut it"):
        read_dyr(path)


@pytest.mark.parametrize(
    ("bus", "id", "words"),
    [
        (None, None, ["2 units are meant", "bus 101 id '1', bus 202 id '1'", "Give bus and id"]),
        (999, None, ["bus 999 has no record", "bus 101, bus 202"]),
        ("north", None, ["bus 'NORTH' has no record"]),
        (101, 2, ["no unit has the id '2'", "bus 101 id '1'"]),
    ],
)
def test_a_unit_that_is_not_there(bus, id, words):
    with pytest.raises(InputError) as caught:
        file(UNIT + OTHER).unit(bus, id)
    for word in ("file unit.dyr", *words):
        assert word in str(caught.value)


@given(st.binary(max_size=300))
def test_any_bytes_are_refused_or_read(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "any.dyr"
    path.write_bytes(data)
    refused_or_used(lambda: read_dyr(path))


PIECES = st.sampled_from(
    ["101", "'GENROU'", "SEXS", "1", "0.5", "-2", "1E3", "/", "//", ",", ",,", "\n", "\r", "'", '"', "@", "USRMDL",
     "'0 '", "*", "nan", "9" * 400, "é", "'REPCA1'", "\x1a", "\x0c"]
)  # fmt: skip


@given(st.lists(st.one_of(PIECES, st.text(max_size=5)), max_size=40))
def test_any_text_is_refused_or_read(pieces):
    refused_or_used(lambda: file(" ".join(pieces)))


def refused_or_used(make):
    """Whatever is in a file, a person gets an answer: objects, or an `InputError`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        try:
            found = make()
            assert found.table() is not None
            assert found.summary()
            assert all(isinstance(problem, str) for problem in found.check())
            for bus, id in found.units:
                assert found.diff(bus, id, {}) == ""
                found.unit(bus, id)
        except InputError:
            pass


# --- changes ----------------------------------------------------------------------------------------------------------


def test_only_the_numbers_change():
    found = file(UNIT)
    text = found.changed(101, 1, {"GENROU.Tpdo": 7.25, "TGOV1.R": 1 / 30, "SEXS.K": 99})
    assert text.splitlines() == [
        "// a unit",
        "101 'GENROU' 1  7.25 0.04 0.8 0.06",
        *UNIT.splitlines()[2:4],
        "101 'SEXS' 1  0.1 10.0 99.0  0.05 0.0 5.0 /",
        "101 'TGOV1' 1  0.0333333 0.3 1.0 0.0 2.0 7.0 0.0 /",
    ]
    assert found.changed(101, 1, {"GENROU.T'do": 7.25}) == UNIT.replace("6.0", "7.25")
    assert found.changed(None, None, {}) == UNIT


def test_columns_stay_where_they_fit():
    wide = "101 'SEXS' 1  0.10000      10.000   100.00 0.05  0.0 5.0/\n"
    new = {"SEXS.TA_TB": 0.123456, "SEXS.TB": 9, "SEXS.EMAX": 4.125}
    text = file(GENROU + wide).changed(101, 1, new)
    assert "1  0.123456     9.0      100.00 0.05" in text
    assert text.index("100.00") == (GENROU + wide).index("100.00")
    assert text.endswith("4.125/\n")


def test_a_difference_shows_the_changed_lines():
    found = file(UNIT + OTHER)
    assert found.diff(101, 1, {"TGOV1.R": 0.04}) == (
        "--- unit.dyr\n+++ unit.dyr (changed)\n@@ -3,7 +3,7 @@\n"
        "     4.0 0.0 1.8 1.7 0.3\n     0.5 0.22 0.15 0.1 0.4 /\n 101 'SEXS' 1  0.1 10.0 100.0 0.05 0.0 5.0 /\n"
        "-101 'TGOV1' 1  0.05 0.3 1.0 0.0 2.0 7.0 0.0 /\n+101 'TGOV1' 1  0.04 0.3 1.0 0.0 2.0 7.0 0.0 /\n"
        " 202 'GENROU' 1  6.0 0.04 0.8 0.06\n     4.0 0.0 1.8 1.7 0.3\n     0.5 0.22 0.15 0.1 0.4 /\n"
    )
    assert "\\ No newline at end of file" in file(UNIT.rstrip()).diff(101, 1, {"TGOV1.R": 0.04})


def test_a_change_can_mend_a_record():
    broken = file(UNIT.replace("0.22", "abc"))
    assert file(broken.changed(101, 1, {"GENROU.Xpp": 0.22})).check() == []


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"GENROU.HH": 4.0}, ["unit 101 '1'", "unknown constant 'GENROU.HH'", "GENROU.H"]),
        ({"GENROE.H": 4.0}, ["unknown constant 'GENROE.H'"]),
        ({"GENROU.H": float("nan")}, ["GENROU.H", "nan", "a number"]),
        ({"GENROU.H": "4"}, ["GENROU.H", "'4'"]),
        ({"GENROU.H": -4.0}, ["unit.dyr:3, column 5", "H is -4", "> 0"]),
        ({"GENROU.T'do": 6.5, "GENROU.Tpdo": 7.0}, ["GENROU.Tpdo", "two new values"]),
        ({"SEXS.EMIN": 6.0}, ["unit.dyr:5", "EMIN is 6 and EMAX is 5"]),
    ],
)
def test_a_change_that_cannot_be(values, words):
    with pytest.raises(InputError) as caught:
        file(UNIT).changed(101, 1, values)
    for word in words:
        assert word in str(caught.value)


def test_a_change_of_a_doubled_record_is_refused():
    with pytest.raises(InputError, match="SEXS and SEXS are both in the slot exciter"):
        file(UNIT + SEXS).changed(101, 1, {"SEXS.K": 90.0})


def test_the_file_itself_is_written_only_when_asked(tmp_path):
    path = tmp_path / "unit.dyr"
    path.write_text(UNIT)
    found = read_dyr(path)
    os.symlink(path, tmp_path / "link.dyr")
    for same in (path, tmp_path / "link.dyr"):
        with pytest.raises(InputError, match="the file that was read.*overwrite=True"):
            found.write(same, 101, 1, {"TGOV1.R": 0.04})
    assert path.read_text() == UNIT
    found.write(path, 101, 1, {"TGOV1.R": 0.04}, overwrite=True)
    assert read_dyr(path).unit().candidates["TGOV1.R"].nominal == 0.04
    with pytest.raises(InputError, match="cannot be written"):
        found.write(tmp_path / "no folder" / "unit.dyr")


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_written_number_reads_as_the_same(value):
    text = written(value)
    assert abs(float(text) - value) <= 1e-6 * abs(value)
    assert not set(text) - set("0123456789.E+-")


BLANKS = st.sampled_from([" ", "   ", "\t", ", ", " ,", "\n  ", "\r\n", " \n// 'comment /\n "])


@st.composite
def files(draw):
    """Text of a file with one unit, its models, and the values that it holds."""
    names = draw(
        st.lists(
            st.sampled_from(sorted(PARTS)), min_size=1, max_size=4, unique_by=lambda one: PARTS[one].slot
        )
    )
    text, held = draw(st.sampled_from(["", "// head\n", "\n\n", "/ 101 'GENROU' 1\n"])), {}
    for name in names:
        pool = draw(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=4))
        values = []
        for k, one in enumerate(PARTS[name].fields):
            number = pool[k % len(pool)] + k
            values.append(0.0 if one.unit == "id" else float(round(number)) if one.integer else number)
        blank = draw(BLANKS)
        spelling = draw(st.sampled_from(["{}", "'{}'", '"{}  "'])).format(
            name if draw(st.booleans()) else name.lower()
        )
        fields = [draw(st.sampled_from(["7", "'7 '", '" 7"'])), *(repr(value) for value in values)]
        text += (
            f"31 {spelling}{blank}{blank.join(fields)} /{draw(st.sampled_from(['', ' note', ' /* it is']))}\n"
        )
        held[name] = values
    return text, held


@given(files(), st.data())
def test_a_file_is_read_written_and_read_as_the_same(made, data):
    text, held = made
    found = file(text)
    assert found.units == [(31, "7")] or not found.units
    assert numbers(found) == held
    name = data.draw(st.sampled_from(sorted(held)))
    typical = {f"{name}.{one.name}": one.typical for one in PARTS[name].fields if one.unit != "id"}
    changed = found.changed(31, 7, typical)
    again = numbers(file(changed))
    expected = [one.typical if one.unit != "id" else 0.0 for one in PARTS[name].fields]
    assert np.allclose(again.pop(name), expected, rtol=1e-6, atol=0)
    assert again == {other: values for other, values in held.items() if other != name}
    assert (
        re.sub(r"[-+.\dE]+", "#", changed.upper()).split() == re.sub(r"[-+.\dE]+", "#", text.upper()).split()
    )


def test_of_two_records_in_a_slot_the_one_that_is_not_left_out_can_be_changed():
    text = (
        "101 'GENROU' 1  6.0 0.04 0.8 0.06 4.0 0.0 1.8 1.7 0.3 0.5 0.22 0.15 0.1 0.4 /\n"
        "101 'SEXS' 1 0.1 10.0 100.0 0.1 0.0 5.0 /\n101 'SCRX' 1 0.1 10.0 100.0 0.1 0.0 5.0 0 0.0 /\n"
    )
    file = DyrFile("unit.dyr", text)
    assert file.unit(leave_out=["SCRX"]).name == "GENROU+SEXS"
    assert file.changed(101, 1, {"SEXS.K": 150.0}) == text.replace("100.0", "150.0", 1)


@pytest.mark.skipif(shutil.which("patch") is None, reason="patch is not installed")
@given(st.data())
def test_a_difference_is_one_that_patch_applies(tmp_path_factory, data):
    """Whatever lines change, appear or vanish."""
    lines = data.draw(st.lists(st.sampled_from(["a", "b", "c", "d", "e"]), min_size=1, max_size=30))
    new = list(lines)
    for _ in range(data.draw(st.integers(0, 4))):
        at = data.draw(st.integers(0, len(new)))
        new[at : at + data.draw(st.integers(0, 1))] = [data.draw(st.sampled_from(["x", "y", "a"]))]
    old_text, new_text = ("".join(f"{line}\n" for line in one) for one in (lines, new))
    found = difference(old_text, new_text, ("old", "new"))
    folder = tmp_path_factory.mktemp("patch")
    (folder / "old").write_text(old_text)
    if found:
        subprocess.run(
            ["patch", "--quiet", "--fuzz=0", str(folder / "old")], input=found, text=True, check=True
        )
    assert (folder / "old").read_text() == new_text


# --- names and comments -----------------------------------------------------------------------------------------------


def refused(text):
    with pytest.raises(InputError) as found:
        file(text).unit()
    return str(found.value)


def test_an_unknown_model_is_answered_with_each_name_once():
    allowed = refused(UNIT.replace("'SEXS'", "'SEXSU'")).split("Allowed: ")[1].split(". ")[0].split(", ")
    assert len(allowed) == len({*allowed})
    assert {"GENTPJ", "GENTPJ1", "REXS", "REXSYS", "REGCAU1", "REGCA1"} <= {*allowed}


def test_an_unknown_library_model_is_answered_with_those_of_its_kind():
    text = f"{GENROU}101 'USRMDL' 1 'MYAVR' {{}} 0 0 2 0 0 1.0 2.0 /\n"
    exciters = refused(text.format(4))
    assert "ESST1A" in exciters
    assert "MNLEX2" not in exciters
    assert "GENROU" not in exciters.split("Allowed")[1]
    assert "MNLEX2" in refused(text.format(9))
    assert "GENROU" in refused(text.format(77)).split("Allowed")[1]


def test_a_repetition_is_not_a_wrong_count():
    assert "Write each value of a repetition out" in refused(UNIT.replace("0.0 5.0 /", "2*5.0 /"))
    assert "repetition" not in refused(UNIT.replace("0.0 5.0 /", "5.0 /"))


@pytest.mark.parametrize("comment", ["/* of this\nunit */\n", f"/* {SEXS}{TGOV1} */\n"])
def test_a_comment_over_several_lines_is_told(comment):
    problem = "unit.dyr:1: a comment /* goes on over several lines"
    assert problem in refused(comment + UNIT)
    assert any(problem in one for one in file(comment + UNIT).check())
    assert file("/* one line */\n/* another\n" + UNIT).check() == []


@pytest.mark.parametrize(
    ("model", "changes", "words"),
    [
        ("EXAC1", {"TF": 0.0}, "KF other than 0 only with TF"),
        ("ESAC1A", {"TF": 0.0}, "KF other than 0 only with TF"),
        ("EXAC2", {"TF": 0.0}, "KF other than 0 only with TF"),
        ("REXSYS", {"TF": 0.0}, "KF other than 0 only with TF"),
        ("EXPIC1", {"KF": 0.1, "TF1": 0.0}, "KF other than 0 only with TF1 or TF2"),
        ("EXPIC1", {"TA2": 0.0, "TA3": 0.1}, "TA3 other than 0 only with TA2 or TA4"),
        ("GGOV1", {"KDGOV": 1.0, "TDGOV": 0.0}, "KDGOV other than 0 only with TDGOV"),
    ],
)
def test_a_derivative_needs_its_lag(model, changes, words):
    part = PARTS[model]
    with pytest.raises(InputError, match=words):
        part.check({**part.typical, **changes}, model)
