"""Exports of PSS/E: channels are known by their names, with the units that PSS/E writes them in."""

import numpy as np
import pytest

from errorscreen import read
from errorscreen.exceptions import InputError
from errorscreen.workflow.init_case import init_case
from tests.workflow.test_init_case import TIME, UNIT, VALUES, initiated, write

pytestmark = pytest.mark.filterwarnings("ignore::errorscreen.exceptions.DataWarning")
#: of two machines at two buses, in the order of PSS/E: machines first
BUSES = {7: "GAS 7 13.800", 12: "HYDRO12 13.800"}
MACHINES = {7: "1", 12: "H2"}


def columns():
    """Headers and numbers: bus 12 has the voltage, power and frequency of `VALUES`, bus 7 has others."""
    V, theta, P, Q = VALUES.values()
    f = np.gradient(theta, TIME) / (2 * np.pi * 60.0)
    found = {}
    for bus, factor in ((7, 0.5), (12, 1.0)):
        of_machine = {
            "ANGL": np.full_like(TIME, 40.0),
            "POWR": factor * P / 100,
            "VARS": factor * Q / 100,
            "SPD": f,
        }
        found |= {f"{what} {bus}[{BUSES[bus]}]{MACHINES[bus]}": x for what, x in of_machine.items()}
    for bus, factor in ((7, 1.05), (12, 1.0)):
        of_bus = {"VOLT": factor * V, "ANGL": np.rad2deg(theta), "FREQ": f}
        found |= {f"{what} {bus} [{BUSES[bus]}]": x for what, x in of_bus.items()}
    return found


def exported(folder, leave_out=(), above=True):
    """Export with a row that counts the channels, and two rows at the instant of the fault."""
    found = {name: x for name, x in columns().items() if name.split()[0] not in leave_out}
    numbers = [np.concatenate([x[:51], x[50:]]) for x in found.values()]
    time = [f"{t:.2f}" for t in np.concatenate([TIME[:51], TIME[50:]])]
    count = [", ".join(["time", *map(str, range(1, len(found) + 1))])] * above
    return write(folder, ["Time(s)", *found], numbers, delimiter=", ", above=count, time=time)


def test_the_machine_of_the_model_file_is_found_with_its_bus(tmp_path):
    (tmp_path / "units.dyr").write_text(UNIT.format(bus=12, id="'H2'") + UNIT.format(bus=99, id=1))
    written, case, recording, text = initiated(exported(tmp_path), dyr=tmp_path / "units.dyr")
    assert not written.missing
    first = recording.initial(["V", "angle", "f", "P", "Q"])
    assert first["V"] == pytest.approx(1.0, abs=1e-3)
    assert first["angle"] == pytest.approx(np.deg2rad(20.0), abs=1e-6)
    assert first["f"] == pytest.approx(case.recording.f_nominal, abs=1e-6)
    assert first["P"] * recording.base_mva == pytest.approx(80.0, rel=1e-3)
    assert first["Q"] * recording.base_mva == pytest.approx(10.0, rel=1e-3)
    assert (case.device.bus, case.device.id) == (12, "H2")
    assert case.recording.columns["P"].column == "POWR 12[HYDRO12 13.800]H2"
    assert "system base, which is 100 MVA unless the RAW file says otherwise" in text
    assert case.recording.skip_rows == 0


def test_without_a_model_file_the_first_machine_is_taken_and_the_others_are_told(tmp_path):
    written, case, recording, _ = initiated(exported(tmp_path))
    assert case.recording.columns["V"].column == "VOLT 7 [GAS 7 13.800]"
    assert recording.initial(["V"])["V"] == pytest.approx(1.05, abs=1e-3)
    assert any("also holds the machines H2 at bus 12" in line for line in written.check)


def test_what_was_not_written_is_left_open(tmp_path):
    """Without channels of the bus there is no voltage, and the angle of a rotor is not that of the voltage."""
    path = exported(tmp_path, ("VOLT", "FREQ"))
    path.write_text(path.read_text().replace("ANGL 7 [", "ANGX 7 ["))
    written = init_case(path, out=path.with_suffix(".toml"))
    assert any(line.startswith("V was not found") for line in written.missing)
    assert "angle =" not in written.case.read_text()


def test_a_row_that_counts_the_columns_is_no_header(tmp_path):
    columns = {
        "V": {"column": "VOLT 12 [HYDRO12 13.800]"},
        "P": {"column": "POWR 12[HYDRO12 13.800]H2", "unit": "pu", "base": 100.0},
        "Q": {"column": "VARS 12[HYDRO12 13.800]H2", "unit": "pu", "base": 100.0},
        "f": {"column": "FREQ 12 [HYDRO12 13.800]", "unit": "pu deviation"},
    }
    options = {"time": "Time(s)", "base_mva": 50.0, "f_nominal": 60.0, "on_duplicate": "last"}
    with_count, without = (
        read(exported(tmp_path / name, above=name == "a"), columns, **options) for name in folders(tmp_path)
    )
    assert with_count.channel("P").values[0] == pytest.approx(80.0 / 50.0, rel=1e-3)
    assert with_count.channel("f").values[-1] == pytest.approx(60.0 + 0.3 / (2 * np.pi), rel=1e-6)
    for name in columns:
        np.testing.assert_array_equal(with_count.channel(name).values, without.channel(name).values)


def folders(parent):
    for name in ("a", "b"):
        (parent / name).mkdir()
        yield name


def test_numbers_as_names_above_numbers_stay_names(tmp_path):
    path = tmp_path / "numbered.csv"
    path.write_text("time,1,2\n" + "".join(f"{k / 50},{1.0 + k / 1e3},{5.0 + k}\n" for k in range(20)))
    recording = read(
        path, {"A": {"column": "1"}, "B": {"column": "2"}}, base_mva=1.0, f_nominal=50.0, event_time=0.2
    )
    assert recording.channel("B").values[3] == 8.0


def test_a_unit_of_the_frequency_that_is_not_known_is_refused(tmp_path):
    with pytest.raises(InputError, match="pu deviation"):
        read(
            exported(tmp_path),
            {"f": {"column": "FREQ 7 [GAS 7 13.800]", "unit": "pu dev"}},
            base_mva=1.0,
            f_nominal=60.0,
        )
