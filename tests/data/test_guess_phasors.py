"""Phasors that `errorscreen init` offers; what is right is known from tests.data.test_phasors."""

import numpy as np
import pandas as pd
import pytest

from errorscreen.cases import load_case
from errorscreen.workflow.init_case import init_case
from tests.data.test_phasors import (
    CURRENTS,
    TIME,
    VOLTAGES,
    P,
    Q,
    V,
    polar,
)

pytestmark = pytest.mark.filterwarnings("ignore::errorscreen.exceptions.DataWarning")


def initiated(folder, cells):
    path = folder / "pmu.csv"
    pd.DataFrame({"time": TIME, **cells}).to_csv(path, index=False, float_format="%.9f")
    written = init_case(path, out=folder / "pmu.toml")
    assert not written.missing
    case = load_case(written.case)
    return case, case.load_recording(), written


def check(case, recording, names="VPQ"):
    right = {"V": V * 20.0 / (case.recording.base_kv or 20.0), "P": P, "Q": Q}
    for name in names:
        scale = 100.0 / recording.base_mva if name in "PQ" else 1.0
        assert recording.channel(name).values == pytest.approx(scale * right[name], abs=1e-5), name


def test_three_phases_are_offered_as_phasors(tmp_path):
    cells = {**polar(VOLTAGES, scale=1e3), **polar(CURRENTS, scale=1e3)}
    case, recording, written = initiated(tmp_path, cells)
    check(case, recording)
    found = case.recording.phasors
    assert (found.voltage_unit, found.current_unit, found.angle_unit) == ("V", "A", "deg")
    assert case.recording.base_kv == 20.0
    assert not case.device.constant_frequency
    assert any(text.startswith("phasors") and "by its size" in text for text in written.check)


def test_currents_into_the_plant_are_seen(tmp_path):
    cells = {**polar(VOLTAGES), **polar({name: -one for name, one in CURRENTS.items()})}
    case, recording, _ = initiated(tmp_path, cells)
    assert case.recording.phasors.sign == "load"
    check(case, recording)


def test_phasors_in_pu_are_seen_by_their_size(tmp_path):
    """Of 20 kV and 100 MVA: 20/√3 kV and 2.887 kA are 1 pu."""
    cells = {**polar(VOLTAGES, scale=np.sqrt(3) / 20), **polar(CURRENTS, scale=np.sqrt(3) * 20 / 100)}
    case, recording, written = initiated(tmp_path, cells)
    found = case.recording.phasors
    assert (found.voltage_unit, found.current_unit) == ("pu", "pu")
    assert recording.channel("V").values == pytest.approx(V, abs=1e-5)
    assert recording.channel("P").values == pytest.approx(P, abs=1e-5)
    assert any(line.startswith("base_kv") for line in written.check)


def test_power_stands_beside_the_voltages(tmp_path):
    case, recording, _ = initiated(tmp_path, {**polar(VOLTAGES), "P [MW]": 100 * P, "Q [Mvar]": 100 * Q})
    check(case, recording)
    assert case.recording.columns["P"].column == "P [MW]"


def test_complex_texts(tmp_path):
    phases = {name: [str(z) for z in one.round(9)] for name, one in (VOLTAGES | CURRENTS).items()}
    case, recording, _ = initiated(tmp_path, phases)
    assert case.recording.phasors.voltage == [*VOLTAGES]
    check(case, recording)


def test_another_phase_order_is_left_open_with_its_reason(tmp_path):
    cells = polar(dict(zip(VOLTAGES, np.array([*VOLTAGES.values()])[[0, 2, 1]], strict=True)))
    path = tmp_path / "pmu.csv"
    pd.DataFrame({"time": TIME, **cells, "P [MW]": 100 * P}).to_csv(path, index=False)
    init_case(path, out=tmp_path / "pmu.toml")
    text = (tmp_path / "pmu.toml").read_text()
    assert "Phasors were not used" in text
    assert "Interchange two of the voltages" in text


def test_magnitudes_alone_are_no_phasors(tmp_path):
    cells = {"time": TIME, **{name: np.abs(one) for name, one in VOLTAGES.items()}, "P [MW]": 100 * P}
    pd.DataFrame(cells).to_csv(tmp_path / "pmu.csv", index=False)
    written = init_case(tmp_path / "pmu.csv", out=tmp_path / "pmu.toml")
    assert written.missing[0] == "V was not found: state recording.columns.V"
    assert "phasors =" not in written.case.read_text()
