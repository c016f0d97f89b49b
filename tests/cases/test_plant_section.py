"""The section [plant] of a case file: numbers, or a RAW file with the point of measurement."""

import numpy as np
import pandas as pd
import pytest

import errorscreen as es
from errorscreen.exceptions import InputError
from errorscreen.models.raw import read_raw
from errorscreen.models.standard import PARTS
from errorscreen.simulators.plant.from_raw import plant_in
from errorscreen.workflow.study import Study
from tests.models.raw_texts import NETWORK, raw_text

DYR = "1 'GENCLS' {id} 4.0 0.0 /\n"
CASE = """
[recording]
path = "r.csv"
base_mva = {base_mva}
f_nominal = {f_nominal}
event_time = 0.5
columns = {{ V = {{ column = "V" }}, angle = {{ column = "angle" }}, P = {{ column = "P" }}, Q = {{ column = "Q" }} }}
[device]
{device}
[plant]
{plant}
"""
FILE = 'dyr = "unit.dyr"'
RAW = 'raw = "case.raw"\nmeasured = "POINT"'


def written(folder, text=None, dyr=None, *, base_mva=200.0, f_nominal=60.0, device=FILE, plant=RAW):
    (folder / "case.raw").write_text(text or raw_text(), encoding="utf-8")
    (folder / "unit.dyr").write_text(dyr or DYR.format(id=1), encoding="utf-8")
    time = np.arange(0, 1.5, 0.01)
    V = np.where((time > 0.5) & (time < 0.6), 0.8, 1.0) + 1e-4 * np.sin(700 * time)
    P = 0.7 + 1e-4 * np.cos(900 * time)
    pd.DataFrame({"time": time, "V": V, "angle": 0.1 * V, "P": P, "Q": P - 0.6}).to_csv(
        folder / "r.csv", index=False
    )
    path = folder / "case.toml"
    path.write_text(
        CASE.format(base_mva=base_mva, f_nominal=f_nominal, device=device, plant=plant), encoding="utf-8"
    )
    return path


def test_a_study_stands_at_the_recorded_bus_of_the_network(tmp_path):
    study = Study.from_case(es.load_case(written(tmp_path)))
    expected = plant_in(read_raw(tmp_path / "case.raw"), 1, "1", 3)
    assert study.simulator.connection == expected.connection
    assert (study.simulator.constants["Xsource"], study.simulator.constants["Ra"]) == (0.25, 0.003)
    for note in expected.notes:
        assert note in study.observation.assumptions
    stated = f"{FILE}\nconstants = {{ Xsource = 0.3 }}"
    study = Study.from_case(es.load_case(written(tmp_path, device=stated)))
    assert study.simulator.constants["Xsource"] == 0.3
    assert "Xsource is 0.3 pu as the case file states" in study.observation.assumptions[-1]


def test_a_plant_controller_is_told_to_measure_at_the_terminal(tmp_path):
    records = [f"1 '{name}' 1 {' '.join(f'{v:g}' for v in PARTS[name].typical.values())} /\n" for name in
               ("REGCA1", "REECB1", "REPCA1")]  # fmt: skip
    study = Study.from_case(es.load_case(written(tmp_path, dyr="".join(records))))
    assert study.observation.assumptions[-1].startswith("The plant controller measures at the terminal")


def test_equal_units_of_both_files_count_as_one(tmp_path):
    one = NETWORK["GENERATOR"][33].splitlines()[0]
    text = raw_text(GENERATOR=f"{one}\n{one.replace(chr(39) + '1 ', chr(39) + '2 ')}")
    device = f"{FILE}\nbus = 1\nid = 2"
    both = DYR.format(id=1) + DYR.format(id=2)
    case = es.load_case(written(tmp_path, text, both, base_mva=400.0, device=device))
    assert case.network().units == ("2", "1")
    other = DYR.format(id=1) + DYR.format(id=2).replace("4.0", "5.0")
    with pytest.raises(
        InputError, match=r"units '2' and '1' at bus 1 are equal in case\.raw, but not in unit\.dyr"
    ):
        es.load_case(written(tmp_path, text, other, base_mva=400.0, device=device))
    with pytest.raises(InputError, match="base_mva is 200, but the sum of MBASE of 2 equal units is 400 MVA"):
        es.load_case(written(tmp_path, text, both, device=device))


def test_the_rating_of_a_turbine_is_on_the_base_of_one_unit(tmp_path):
    one = NETWORK["GENERATOR"][33].splitlines()[0]
    text = raw_text(GENERATOR=f"{one}\n{one.replace(chr(39) + '1 ', chr(39) + '2 ')}")
    values = {**PARTS["GGOV1"].typical, "TRATE": 180.0}
    both = "".join(
        DYR.format(id=id) + f"1 'GGOV1' {id} {' '.join(f'{v:g}' for v in values.values())} /\n"
        for id in (1, 2)
    )
    device = f"{FILE}\nbus = 1\nid = 1"
    case = es.load_case(written(tmp_path, text, both, base_mva=400.0, device=device))
    assert Study.from_case(case).simulator.constants["MBASE"] == 200.0
    stated = f"{device}\nconstants = {{ MBASE = 250 }}"
    case = es.load_case(written(tmp_path, text, both, base_mva=400.0, device=stated))
    assert Study.from_case(case).simulator.constants["MBASE"] == 250.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"base_mva": 100.0}, "base_mva is 100, but the MBASE of the unit is 200 MVA"),
        ({"f_nominal": 50.0}, "f_nominal is 50 Hz, but BASFRQ is 60 Hz"),
        ({"plant": 'raw = "case.raw"'}, "raw is given without measured"),
        ({"plant": "measured = 3"}, "measured is given without raw"),
        ({"plant": RAW + "\nreactance = 0.1"}, "raw and reactance are both given"),
        ({"plant": RAW.replace("POINT", "NOWHERE")}, "bus 'NOWHERE' is not in"),
        ({"plant": RAW.replace("case.raw", "other.raw")}, "other.raw: does not exist"),
        ({"device": 'type = "pv_plant"'}, "raw is given, but the unit has no model file"),
        ({"dyr": DYR.format(id=7)}, "bus 1 has no generator '7'"),
    ],
)
def test_what_does_not_fit_is_refused_when_the_case_is_read(tmp_path, options, words):
    with pytest.raises(InputError, match=words):
        es.load_case(written(tmp_path, **options))


def test_numbers_may_hold_a_conductance(tmp_path):
    case = es.load_case(written(tmp_path, plant="reactance = 0.1\nconductance = 0.01"))
    assert (case.plant.connection.reactance, case.plant.connection.conductance) == (0.1, 0.01)
    assert case.network() is None
