"""RAW files of PSS/E: what is read of each revision, and what is refused with which message."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import errorscreen as es
from errorscreen.exceptions import InputError
from errorscreen.models.raw import RawFile
from tests.models.raw_texts import RATES, raw_text

SHARED = Path(__file__).parents[3] / "shared" / "data" / "psse_three_bus" / "inputs"
REVISIONS = (33, 34, 35)


def read(text):
    return RawFile("case.raw", text)


@pytest.mark.parametrize("revision", REVISIONS)
def test_each_revision_gives_the_same_network(revision):
    file = read(raw_text(revision))
    assert (file.revision, file.base_mva, file.frequency) == (revision, 100.0, 60.0)
    assert [(bus.number, bus.name, bus.kind) for bus in file.buses.values()] == [
        (1, "UNIT, EAST", 2), (2, "STATION", 1), (3, "POINT", 1), (4, "GRID", 3),
    ]  # fmt: skip
    unit = file.generators[0]
    assert (unit.base_mva, unit.source, unit.power, unit.in_service) == (
        200.0,
        0.003 + 0.25j,
        150 + 20j,
        True,
    )
    line, grid, transformer = file.branches
    assert (line.impedance, line.shunts) == (0.005 + 0.04j, (0.001 + 0.032j, 0.03j))
    assert grid.impedance == 0.01 + 0.1j
    # by hand: 0.003 + j0.13 pu of 220 MVA, first winding at bus 2
    assert transformer.impedance == pytest.approx((0.003 + 0.13j) * 100 / 220)
    assert transformer.ratios == pytest.approx((1.05 * np.exp(1j * np.pi / 6), 1.01))
    assert transformer.shunts == (0.0005 - 0.004j, 0)
    load, fixed, *switched = *file.loads, *file.shunts
    # 6 + j2 MVA at 1.02 pu, 1 + j0.5 MVA of constant current, 2 MW and 1 Mvar inductive of constant admittance
    assert load.admittance == pytest.approx((6 - 2j) / 1.02**2 + (1 - 0.5j) / 1.02 + 2 - 1j)
    assert (fixed.admittance, switched[0].admittance) == (10j, -5j)
    table = file.table()
    assert table.loc[table.kind == "transformer", "ratio"].item() == pytest.approx(1.05 / 1.01)
    assert f"revision {revision}, 100 MVA, 60 Hz; bus 4" in file.summary()


def transformer(revision=33, codes="1,1,1", mag="0,0", z="0.003,0.13,220.0", windings=("1.0,0.0", "1.0,0.0")):
    first, second = windings
    record = f" 2,1,0,'T1',{codes},{mag},2,'',1\n {z}\n {first}\n {second}"
    return next(
        one for one in read(raw_text(revision, TRANSFORMER=record)).branches if one.kind == "transformer"
    )


def test_codes_of_a_transformer():
    assert transformer(codes="2,1,1", windings=("144.9,0", "20.4,0")).ratios == pytest.approx((1.05, 1.02))
    assert transformer(codes="3,1,1", windings=("1.05,144.9", "1.0,0")).ratios == pytest.approx(
        (1.05**2, 1.0)
    )
    assert transformer(codes="2,1,1", windings=(",", ",")).ratios == pytest.approx((1.0, 1.0))
    assert transformer().impedance == 0.003 + 0.13j
    # load loss of 660 kW, 0.13 pu of 220 MVA: r = 0.66 / 220
    found = transformer(codes="1,3,1", z="660000.0,0.13,220.0").impedance
    assert found == pytest.approx((0.003 + 1j * np.sqrt(0.13**2 - 0.003**2)) * 100 / 220)
    # no-load loss of 110 kW, 0.2 % exciting current at 1.1 of the base voltage
    found = transformer(codes="1,1,2", mag="110000.0,0.002", windings=("1.0,151.8", "1.0,0")).shunts[0]
    g, y = 0.11 / 100 / 1.1**2, 0.002 * 220 / 100 / 1.1**2
    assert found == pytest.approx(g - 1j * np.sqrt(y**2 - g**2))


def test_free_form_defaults_and_an_early_end():
    text = raw_text().split(" 0 / END OF TRANSFORMER")[0] + "Q\n all that follows counts as little as this\n"
    file = read(text.replace(" 3,4,'1 ',0.01,0.1,0.1", ' 3 4, "1" 0.01  0.1/ blanks and other quotes'))
    assert file.branches[1].impedance == 0.01 + 0.1j
    assert file.branches[1].in_service
    assert (file.buses[2].voltage.real, file.buses[4].name) == (
        pytest.approx(1.01 * np.cos(np.radians(5))),
        "GRID",
    )
    assert file.shunts[-1].kind == "shunt"


def test_a_bus_by_number_name_and_extended_name():
    file = read(raw_text())
    assert [file.bus(name).number for name in (3, "3", "point", "POINT   138.000")] == [3, 3, 3, 3]
    with pytest.raises(InputError, match=r"bus 'NOWHERE' is not in case\.raw.*3 'POINT'"):
        file.bus("NOWHERE")
    twice = read(raw_text(BUS="1,'A',20,2\n2,'A',138\n3,'B',138\n4,'C',138,3"))
    with pytest.raises(InputError, match="belongs to 2 buses"):
        twice.bus("A")


def test_switches_and_devices_that_are_only_looked_up():
    switch = f" 2,3,'S1',0.0002,{RATES},0,1,1,2,'BREAKER'"
    file = read(
        raw_text(
            34,
            SYSTEM_SWITCHING_DEVICE=switch,
            **{"TWO-TERMINAL_DC": " 'HVDC',1,1,1\n 3,1,1\n 4,1,1", "FACTS_DEVICE": " 'STATCOM',2,0,1"},
            INDUCTION_MACHINE=" 2,'M1',1",
        )
    )
    assert [(one.kind, one.in_service, one.impedance) for one in file.branches if one.kind == "switch"] == [
        ("switch", False, 0.0002j)
    ]
    assert [(one.kind, one.buses) for one in file.others] == [
        ("dc line", (3, 4)), ("FACTS device", (2,)), ("induction machine", (2,)),
    ]  # fmt: skip


def test_a_transformer_of_three_windings_takes_five_lines():
    record = " 2,3,1,'T3',1,1,1,0,0,2,'TERTIARY',3\n 0,0.1,100,0,0.1,100,0,0.1,100\n 1,0\n 1,0\n 1,0"
    two = " 2,1,0,'T1'\n 0,0.1\n 1\n 1"
    file = read(raw_text(TRANSFORMER=f"{record}\n{two}"))
    assert [(one.name, one.buses) for one in file.others] == [
        ("TERTIARY", (2, 3))
    ]  # the third one is out of service
    assert file.branches[-1].circuit == "T1"


BAD = {
    "no RAW": ("101 'GENROU' 1 6.0 /", ":1, case identification: the file begins with '101 GENROU"),
    "empty": ("", "the file begins with ''"),
    "revision 32": (raw_text().replace("33", "32", 1), "the revision is 32. Allowed: 33, 34, 35"),
    "base": (raw_text().replace("100.00, 33", "-1, 33"), "SBASE is -1 MVA"),
    "revision of another file": (
        raw_text(34).replace(" 34,", " 33,", 1), ":5, bus data: I is 'GENERAL'. Allowed: a number",
    ),
    "sections of another revision": (
        raw_text(34).replace(" 34,", " 33,", 1).replace("GENERAL, THRSHZ=0.0001, PQBRAK=0.7\n", "").replace(
            'RATING, 1, "RATE1 ", "RATING SET 1"\n0 / END OF SYSTEM-WIDE DATA, BEGIN BUS DATA\n', ""
        ).replace(f",'LINE / NORTH',{RATES}", ",1,2,3"),
        "the branch data are followed by system switching device data. Allowed: transformer data",
    ),
    "too many fields": (raw_text(FIXED_SHUNT="2,'1',1,0,10,7"), "the record has 6 fields. Allowed: at most 5: I, ID"),
    "too few fields": (raw_text(BRANCH="2,3,'1',0.01"), "the field X is empty"),
    "text for a number": (raw_text(BRANCH="2,3,'1',0.01,O.1"), ", branch data: X is 'O.1'"),
    "number between": (raw_text(BUS="1.5,'A',20"), "I is 1.5. Allowed: a whole number"),
    "bus number": (raw_text(BUS="-3,'A',20"), "the bus number is -3. Allowed: 1 to 999999"),
    "type of bus": (raw_text(BUS="1,'A',20,7"), "IDE is 7. Allowed: 1, 2, 3, 4"),
    "voltage": (raw_text(BUS="1,'A',20,1,1,1,1,0.0"), "VM is 0. Allowed: 0.01 to 10"),
    "base voltage": (raw_text(BUS="1,'A',-20"), "BASKV is -20"),
    "bus twice": (raw_text(BUS="1,'A',20\n1,'B',20"), ":5, bus data: bus 1 is given twice, first in line 4"),
    "unknown bus": (raw_text(LOAD="9,'1',1,1,1,5,1"), "load data: I is bus 9, which is not in the bus data"),
    "unknown end": (raw_text(BRANCH="2,7,'1',0.01,0.1"), "J is bus 7, which is not in the bus data"),
    "branch twice": (
        raw_text(BRANCH="2,3,'1',0.01,0.1\n3,2,'1',0.01,0.1"), "line '1' at bus 3 and 2 is given twice, first in line",
    ),
    "generator twice": (
        raw_text(GENERATOR="1,'1',9,,,,,,100\n1,'1',9,,,,,,100"), "generator '1' at bus 1 is given twice",
    ),
    "no reactance": (raw_text(BRANCH="2,3,'1',0.01,0.0"), "X is 0 (R is 0.01). Allowed: X of at least 1e-09 pu"),
    "both ends": (raw_text(BRANCH="2,2,'1',0.01,0.1"), "both ends are bus 2"),
    "status": (raw_text(GENERATOR="1,'1',9,,,,,,100,,,,,,2"), "STAT is 2. Allowed: 0, 1"),
    "base of a generator": (raw_text(GENERATOR="1,'1',9,,,,,,0"), "MBASE is 0. Allowed: 0.0001 to 1e+06"),
    "code of a transformer": (raw_text(TRANSFORMER="2,1,0,'1',1,4\n0,0.1\n1\n1"), "CZ is 4. Allowed: 1, 2, 3"),
    "ratio": (raw_text(TRANSFORMER="2,1,0,'1'\n0,0.1\n0.0\n1"), "WINDV is 0, which is 0 of the base voltage"),
    "base of a transformer": (
        raw_text(TRANSFORMER="2,1,0,'1',1,2\n0,0.1,0\n1\n1"), "transformer impedance data: SBASE1-2 is 0",
    ),
    "losses": (raw_text(TRANSFORMER="2,1,0,'1',1,3\n9e9,0.1,100\n1\n1"), "X1-2 is 0.1 pu, less than the part 90 pu"),
    "no base voltage": (
        raw_text(BUS="1,'A'\n2,'B',138\n3,'C',138\n4,'D',138", TRANSFORMER="2,1,0,'1',2\n0,0.1\n138\n20"),
        "WINDV is in kV, but its bus has no BASKV",
    ),
    "quote": (raw_text(BUS="1,'A,20"), "the quote ' in column 3 has no partner"),
    "truncated": (raw_text()[:400], "the file ends inside the fixed shunt data"),
    "truncated transformer": (
        raw_text().split(" 1.05,0.0,30.0")[0], "the file ends inside the transformer data",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_files_are_refused_with_file_line_and_remedy(name):
    text, words = BAD[name]
    with pytest.raises(InputError) as error:
        read(text)
    assert str(error.value).startswith("case.raw:")
    assert words in str(error.value)
    assert error.value.allowed


def test_paths_that_are_no_raw_file(tmp_path):
    with pytest.raises(InputError, match="Give the path of the RAW file"):
        es.read_raw(tmp_path)
    (tmp_path / "case.sav").write_bytes(b"\x00\x01\x02")
    with pytest.raises(InputError, match="Save the power flow data of the case as a RAW file"):
        es.read_raw(tmp_path / "case.sav")
    with pytest.raises(InputError, match="the path is of type int"):
        es.read_raw(3)
    (tmp_path / "case.raw").write_text(raw_text(35), encoding="utf-8")
    assert es.read_raw(tmp_path / "case.raw").revision == 35


PIECES = st.sampled_from(
    [
        "",
        ",",
        "'",
        '"',
        "/",
        "0",
        "Q",
        "\n",
        "@!",
        "-1",
        "1e999",
        "1e-300",
        "nan",
        "x",
        ",,,,",
        "3",
        "0 / END",
    ]
)


@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from(REVISIONS), st.lists(st.tuples(st.floats(0, 1), st.integers(0, 40), PIECES), max_size=4)
)
def test_a_changed_text_gives_a_network_or_a_message(revision, changes):
    text = raw_text(revision)
    for place, length, piece in changes:
        start = int(place * len(text))
        text = text[:start] + piece + text[start + length :]
    with contextlib.suppress(InputError):
        read(text).table()


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet="0123456789,.'\"/ Q\n-eE@!ABC\x00é", max_size=200))
def test_any_text_gives_a_network_or_a_message(text):
    with contextlib.suppress(InputError):
        read("0,100,33\n\n\n" + text)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the files of PSS/E are not here")
def test_files_of_psse():
    for path in sorted(SHARED.glob("*/ThreeBusMulti*.raw")):
        file = es.read_raw(path)
        assert (file.revision, [*file.buses], file.frequency) == (33, [101, 102, 103], 60.0)
        assert [(one.buses, one.impedance) for one in file.branches] == [
            (ends, 0.01 + 0.12j) for ends in ((101, 102), (101, 103), (102, 103))
        ]
    with pytest.raises(InputError, match="the revision is 32"):
        es.read_raw(SHARED / "RENA" / "ThreeBusRenewable.raw")
