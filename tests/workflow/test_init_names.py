"""Names, levels and covers as programs and utilities write them, in the case files that `init_case` guesses."""

import re

import numpy as np
import pytest

from tests.data.readers import test_comtrade
from tests.workflow.test_init_case import TIME, VALUES, check, initiated, write

pytestmark = pytest.mark.filterwarnings("ignore::errorscreen.exceptions.DataWarning")


def test_a_workbook_with_a_cover_and_remarks(tmp_path):
    """A cover with words, a title above the table, a column of remarks that is mostly empty, and the field voltage."""
    openpyxl = pytest.importorskip("openpyxl")
    V, _, P, Q = VALUES.values()
    book = openpyxl.Workbook()
    for row in (("Customer", "Sunny Peaker"), ("Unit", "GT-3"), ("Rated kV", 20)):
        book.active.append(row)
    sheet = book.create_sheet("Data")
    sheet.append(["GT-3 line fault"])
    sheet.append([])
    sheet.append(["Time", "Field Volts", "Gen Voltage", "MW", "MVAR", "Remarks"])
    sheet.append(["sec", "V", "kV", "MW", "MVAr"])
    for k, row in enumerate(zip(TIME, 90 * V, 20 * V, P, Q, strict=True)):
        sheet.append([*map(float, row), *["fault"] * (k == 50)])
    path = tmp_path / "unit.xlsx"
    book.save(path)
    written, case, recording, _ = initiated(path)
    assert not written.missing
    check(recording)
    assert (case.recording.sheet, case.recording.skip_rows) == ("Data", 2)
    assert {name: one.column for name, one in case.recording.columns.items()} == {
        **{"V": "Gen Voltage", "P": "MW", "Q": "MVAR"}
    }


def test_a_title_that_is_filled_up_with_delimiters_is_above_the_table(tmp_path):
    V, _, P, Q = VALUES.values()
    path = write(tmp_path, ["time", "V", "P", "Q"], [V, P, Q], delimiter=";", above=["Line fault;;;", ";;;"])
    written, _, recording, _ = initiated(path)
    assert not written.missing
    check(recording)


@pytest.mark.parametrize("stated", [True, False])
def test_phases_r_y_b_and_the_ratio_of_the_transformers(tmp_path, stated):
    """Phases as they are named in India, also in the names alone; 15.75 kV as the transformers say, not 16 kV."""
    values = {
        name[0] + "RYB"["ABC".index(name[1])]: x * (15.9 / 20 if name[0] == "V" else 20 / 15.9)
        for name, x in test_comtrade.waves(test_comtrade.TIME).items()
    }
    ratio = ((15750, 110), (10000, 5))
    path = test_comtrade.write(tmp_path, values, test_comtrade.TIME, ratio=ratio)
    if not stated:
        lines = path.read_text().splitlines()
        path.write_text("\n".join(re.sub(r"^(\d+,[VI][RYB]),[RYB],", r"\1,,", line) for line in lines))
    written, case, recording, text = initiated(path)
    assert not written.missing
    assert (case.recording.waveforms.voltage, case.recording.base_kv) == (["VR", "VY", "VB"], 15.75)
    assert "rated primary voltage" in text
    assert recording.initial(["V"])["V"] == pytest.approx(15.9 / 15.75, abs=1e-3)
    assert recording.initial(["P"])["P"] * recording.base_mva == pytest.approx(80.0, rel=1e-3)


def test_a_voltage_between_two_usual_levels_is_asked(tmp_path):
    V, _, P, Q = VALUES.values()
    path = write(tmp_path, ["time", "U [kV]", "P [MW]", "Q [Mvar]"], [21.4 * V, P, Q])
    assert (
        "CHECK: V is 21.4 kV before the event: the nearest usual level, but 22 kV is usual"
        in initiated(path)[3]
    )


def test_line_to_neutral_is_taken_from_the_header_and_asked_without(tmp_path):
    V, _, P, Q = VALUES.values()
    LN = 6.478 * V  # 11.22 kV from line to line, and near 6.6 kV
    for name, base, neutral in (("V_LN_kV", 11.0, True), ("V_kV", 6.6, False)):
        path = write(tmp_path, ["time", name, "P_MW", "Q_Mvar"], [LN, P, Q], name=f"{name}.csv")
        _, case, _, text = initiated(path)
        assert (case.recording.base_kv, case.recording.columns["V"].line_neutral) == (base, neutral)
        assert ("or 11 kV, if V is from line to neutral" in text) != neutral
        assert "base_kv = " in text.split("# CHECK: V")[0]


def test_an_angle_that_may_be_the_rotors_is_asked(tmp_path):
    V, A, P, Q = VALUES.values()
    headers = ["time", "Vrms", "delta_deg", "Pe", "Qe"]
    written, case, recording, _ = initiated(write(tmp_path, headers, [V, np.rad2deg(A), 1e6 * P, 1e6 * Q]))
    assert not written.missing
    check(recording)
    assert case.recording.columns["P"].unit == "W"
    assert any("not that of the rotor" in one for one in written.check)


def test_tags_in_german(tmp_path):
    rows = ["Messstelle;Zeitstempel;Wert;Status"]
    for name, sign, x in (("U_KLEMME", 20, "V"), ("P_WIRK", -1, "P"), ("Q_BLIND", -1, "Q")):
        for k, t in enumerate(TIME):
            value = f"{sign * VALUES[x][k]:.6f}".replace(".", ",")
            status = "SCHLECHT" if k == 150 else "GUT"
            rows.append(f"KW1.GEN.{name};03.05.2026 10:00:{t:06.3f};{value};{status}")
    path = tmp_path / "Archiv.csv"
    path.write_text("\n".join(rows))
    written, case, recording, _ = initiated(path)
    assert not written.missing
    check(recording)
    assert case.recording.long.tag == "Messstelle"
    assert [case.recording.columns[name].sign for name in "PQ"] == ["load", "load"]


def test_names_of_channels_in_pslf(tmp_path):
    """Types of channels as PSLF names them: of the bus in pu, degrees and Hz, of the machine in MW and Mvar."""
    V, A, P, Q = VALUES.values()
    f = 60.0 + np.gradient(A, TIME) / (2 * np.pi)
    path = write(tmp_path, ["Time", "vbus", "abus", "fbus", "pg", "qg"], [V, np.rad2deg(A), f, P, Q])
    written, case, recording, _ = initiated(path)
    assert not written.missing
    check(recording)
    columns = {name: (one.column, one.unit) for name, one in case.recording.columns.items()}
    assert columns == {
        **{"V": ("vbus", "pu"), "angle": ("abus", "deg"), "f": ("fbus", "Hz")},
        **{"P": ("pg", "MW"), "Q": ("qg", "Mvar")},
    }
