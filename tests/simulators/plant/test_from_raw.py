"""Connection of a unit to the recorded point from the network of a RAW file, against chains of two-ports."""

from pathlib import Path

import numpy as np
import pytest

from errorscreen.exceptions import InputError
from errorscreen.models.raw import RawFile
from errorscreen.simulators.plant.connection import Connection
from errorscreen.simulators.plant.from_raw import plant_in
from tests.models.raw_texts import NETWORK, raw_text

SHARED = Path(__file__).parents[4] / "shared" / "data" / "psse_three_bus" / "inputs" / "GENROU"


def plant(text, bus=1, id="1", measured=3):
    return plant_in(RawFile("case.raw", text), bus, id, measured)


def series(z):
    return np.array([[1, z], [0, 1]])


def shunt(y):
    return np.array([[1, 0], [y, 1]])


def ratio(t):
    """Ideal transformer: t times the voltage on the side that comes first."""
    return np.array([[t, 0], [0, 1 / np.conj(t)]])


def terminal_of(chain, V, power):
    """Voltage and power at the terminal, from those at the recorded point, by the product of the two-ports."""
    product = np.eye(2)
    for one in chain:
        product = product @ one
    voltage, current = product @ np.array([V, np.conj(power / V)])
    return abs(voltage), voltage * np.conj(current)


def assert_same(connection, chain, base=2.0):
    """`base` is that of the unit over that of the network."""
    for V, power in ((1.0, 0.7 + 0.1j), (0.6, 0.2 + 0.9j), (1.1, 1.0 - 0.3j)):
        found = connection.terminal({"V": np.array(V), "P": np.array(power.real), "Q": np.array(power.imag)})
        voltage, expected = terminal_of(chain, V, power * base)
        assert found["V"] == pytest.approx(voltage, abs=1e-12)
        assert found["P"] + 1j * found["Q"] == pytest.approx(expected / base, abs=1e-12)


LOAD = ((6 - 2j) / 1.02**2 + (1 - 0.5j) / 1.02 + 2 - 1j) / 100
STEP_UP = [
    shunt(LOAD),
    ratio(1.01),
    series((0.003 + 0.13j) * 100 / 220),
    ratio(1 / (1.05 * np.exp(1j * np.pi / 6))),
    shunt(0.0005 - 0.004j + 0.1j - 0.05j),
]
LINE = [shunt(0.001 + 0.032j), series(0.005 + 0.04j), shunt(0.03j)]


@pytest.mark.parametrize("revision", [33, 34, 35])
def test_transformer_line_shunts_and_load_between(revision):
    found = plant(raw_text(revision))
    assert_same(found.connection, STEP_UP + LINE)
    assert (found.base_mva, found.base_kv, found.frequency, found.units) == (200.0, 138.0, 60.0, ("1",))
    assert found.constants == {"Ra": 0.003, "Xsource": 0.25}
    told = " ".join(found.notes)
    for words in ("transformer 'STEP-UP' between the buses 2 and 1", "on 100 MVA, ratio 1.0396", "load 'A' at bus 1",
                  "on 200 MVA"):  # fmt: skip
        assert words in told
    assert found.table().element[0] == "transformer 'STEP-UP' between the buses 2 and 1"


def test_the_recorded_bus_decides_where_the_network_ends():
    found = plant(raw_text(), measured="STATION")
    assert_same(found.connection, [*STEP_UP[:-1], shunt(0.0005 - 0.004j)])
    assert plant(raw_text(), measured=1).connection == Connection()


def test_the_step_up_transformer_of_the_generators_record():
    unit = " 1,'1',150,20,80,-80,1.02,0,200.0,0.0,0.3,0.004,0.12,1.04,1"
    found = plant(raw_text(GENERATOR=unit), measured=1)
    connection = found.connection
    assert (connection.impedance, connection.tap) == (pytest.approx(0.004 + 0.12j), pytest.approx(1.04))
    chain = [series((0.004 + 0.12j) / 2), ratio(1 / 1.04)]
    assert_same(connection, chain)
    assert_same(plant(raw_text(GENERATOR=unit)).connection, chain + STEP_UP + LINE)
    assert "The step-up transformer of the generator's record, 0.004 + j0.12 pu on 200 MVA" in found.notes[1]


def test_a_base_loaded_unit_is_told():
    whole = NETWORK["GENERATOR"][35]
    told = plant(raw_text(35, GENERATOR=whole.replace("180.0,0.0,0,1,1.0", "180.0,0.0,2,1,1.0"))).notes
    assert any(
        "BASLOD of unit '1' at bus 1 is 2" in note and "governor does not act" in note for note in told
    )
    assert not any("BASLOD" in note for note in plant(raw_text(35)).notes)
    with pytest.raises(InputError, match=r"BASLOD is 3.*0, 1, 2"):
        plant(raw_text(35, GENERATOR=whole.replace("180.0,0.0,0,1,1.0", "180.0,0.0,3,1,1.0")))


def test_equal_units_count_as_one():
    units = "\n".join(f" 1,'{id}',75,10,40,-40,1.02,0,100.0,0.003,0.25,0.002,0.1,1.0,{on}" for id, on in
                      (("1", 1), ("2", 1), ("3", 0)))  # fmt: skip
    found = plant(raw_text(GENERATOR=units), id="2")
    assert (found.base_mva, found.units) == (200.0, ("2", "1"))
    assert_same(found.connection, [series((0.002 + 0.1j) / 2), *STEP_UP, *LINE])
    assert "The 2 equal units '2', '1' at bus 1 count as one of 200 MVA." in found.notes
    with pytest.raises(InputError, match="'2' and '1' at bus 1 differ in PG, QG, MBASE"):
        plant(raw_text(GENERATOR=units.replace("75,10", "60,10", 1)), id="2")


def test_parallel_branches_and_side_branches_are_exact():
    parallel = NETWORK["BRANCH"][33] + "\n 2,3,'2 ',0.01,0.08,0.02"
    found = plant(raw_text(BRANCH=parallel))
    one, two = 0.005 + 0.04j, 0.01 + 0.08j
    line = [shunt(0.001 + 0.042j), series(1 / (1 / one + 1 / two)), shunt(0.04j)]
    assert_same(found.connection, STEP_UP + line)
    side = NETWORK["BRANCH"][33] + "\n 2,5,'1',0.02,0.2"
    load = NETWORK["LOAD"] + "\n 5,'1',1,1,1,0,0,0,0,3.0,-1.5"
    found = plant(raw_text(BUS=NETWORK["BUS"] + "\n 5,'SERVICE',20", BRANCH=side, LOAD=load))
    hanging = shunt(1 / (0.02 + 0.2j + 1 / (0.03 - 0.015j)))
    assert_same(found.connection, [*STEP_UP, hanging, *LINE])


def test_what_leaves_the_path_open_is_refused_with_what_to_do():
    for text, words in (
        (raw_text(BRANCH=NETWORK["BRANCH"][33] + "\n 2,4,'1',0.01,0.1"),
         "generator '1' at bus 4 is reached from bus 1 without passing the recorded bus, by the buses 1, 2, 4"),
        (raw_text(BRANCH=" 3,4,'1 ',0.01,0.1"), "no branch in service leads from bus 1 to bus 3"),
        (raw_text(GENERATOR=" 4,'1',9,,,,,,100"), "bus 1 has no generator '1'"),
        (raw_text(GENERATOR=" 1,'1',9,,,,,,100,,,,,,0"), "generator '1' at bus 1 is out of service"),
        (raw_text(FACTS_DEVICE=" 'SVC',2,0"), "the FACTS device 'SVC' lies in the unit's network"),
        (raw_text(TRANSFORMER=" 2,1,4,'1',1,1,1,0,0,2,'T3W'\n 0,.1,100,0,.1,100,0,.1,100\n 1\n 1\n 1\n"),
         "the transformer of three windings 'T3W' lies in the unit's network"),
        (raw_text(TRANSFORMER=NETWORK["TRANSFORMER"][33].replace("33,0,0.0", "33,4,0.0")
                  + "\n 2,1,0,'T2'\n 0,.1\n 1\n 1"),
         "transformer with a table of impedance correction 'STEP-UP' lies"),
        (raw_text(BRANCH=" 2,3,'1',0.0,4.0\n 3,4,'1',0.01,0.1"), "pu on 200 MVA. Allowed: R and X of at least 0"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words) as error:
            plant(text)
        assert error.value.remedy or error.value.allowed


def test_a_recording_must_fit_the_file():
    found = plant(raw_text())
    found.check(200.0, 138.0, 60.0, "recording")
    for given, words in (
        ((100.0, None, 60.0), "base_mva is 100, but the MBASE of the unit is 200 MVA"),
        ((200.0, 345.0, 60.0), "base_kv is 345, but BASKV of the recorded bus is 138 kV"),
        ((200.0, None, 50.0), "f_nominal is 50 Hz, but BASFRQ is 60 Hz"),
    ):
        with pytest.raises(InputError, match=words):
            found.check(*given, "recording")
    values, notes = found.constants_with({"Xsource": 0.3, "shortest": 0.002})
    assert values == {"Ra": 0.003, "Xsource": 0.3, "shortest": 0.002}
    assert notes == ["Xsource is 0.3 pu as the case file states, not 0.25 pu as the RAW file says."]


@pytest.mark.skipif(not SHARED.is_dir(), reason="the files of PSS/E are not here")
def test_the_three_buses_of_psse():
    text = (SHARED / "ThreeBusMulti.raw").read_text(encoding="utf-8")
    assert plant(text, 102, "1", 102).constants == {"Ra": 0.0, "Xsource": 0.25}
    with pytest.raises(InputError, match="generator '1' at bus 101 is reached from bus 102.*buses 102, 101"):
        plant(text, 102, "1", 103)
    # the line to the infinite bus out of service, as after the event of these runs
    tripped = text.replace("0.00000,1,1,   0.00,   1,1.0000", "0.00000,0,1,   0.00,   1,1.0000", 1)
    connection = plant(tripped, 102, "1", 103).connection
    assert (connection.impedance, connection.tap) == (pytest.approx(0.01 + 0.12j), pytest.approx(1.0))


@pytest.mark.skipif(not SHARED.is_dir(), reason="the files of PSS/E are not here")
def test_a_line_as_psse_ran_it():
    # P and Q were recorded at both ends of the line from the infinite bus, whose voltage is 1.05 pu, to the load
    text = (SHARED / "ThreeBusMulti.raw").read_text(encoding="utf-8")
    for line in ("   101,   102,", "   102,   103,"):
        text = text.replace(next(one for one in text.splitlines() if one.startswith(line)) + "\n", "")
    connection = plant(text, 101, "1", 103).connection
    table = np.genfromtxt(SHARED.parents[1] / "genrou_sexs.csv", delimiter=",", names=True)
    near = (table["P101_103_MW"] + 1j * table["Q101_103_Mvar"]) / 100
    far = -(table["P103_101_MW"] + 1j * table["Q103_101_Mvar"]) / 100
    # the infinite bus is the terminal behind the source reactance of 1e-5 pu
    V = np.abs(1.05 - (0.01 + 0.12j) * np.conj(near / 1.05))
    found = connection.terminal({"V": V, "P": far.real, "Q": far.imag})
    assert np.abs(found["V"] - 1.05).max() < 2e-4
    assert np.abs(found["P"] + 1j * found["Q"] - near).max() < 2e-4


def test_branches_that_cancel_are_refused():
    cancel = " 2,3,'1',0.0,0.1\n 2,3,'2',0.0,-0.1\n 3,4,'1',0.01,0.1"
    alone = " 2,1,0,'1'\n 0,0.1\n 1\n 1"
    for branches, transformer in ((cancel, alone), (cancel.replace("2,3", "1,3"), "")):
        with pytest.raises(InputError, match="R and X of at least 0"):
            plant(
                raw_text(BRANCH=branches, TRANSFORMER=transformer, FIXED_SHUNT="", SWITCHED_SHUNT="", LOAD="")
            )
