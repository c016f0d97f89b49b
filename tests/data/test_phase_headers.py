"""Columns that belong together by their headers, and one phase that is taken for all three."""

import warnings

import numpy as np
import pandas as pd
import pytest

from errorscreen.data import from_frame, read_csv
from errorscreen.data.phase_headers import phasors_of, sisters
from errorscreen.data.plausibility import Doubt
from errorscreen.data.table import Table

TIME = np.arange(300) / 50.0
BASES = {"base_mva": 1.0, "base_kv": 20.0, "f_nominal": 50.0}


def phase(dip, seed, level=11.5):
    """Magnitude that falls by a part from 2 s to 2.2 s, with noise."""
    fault = (TIME >= 2) & (TIME < 2.2)
    return level * (np.where(fault, 1 - dip, 1.0) + 1e-3 * np.random.default_rng(seed).normal(size=len(TIME)))


def doubts(columns, cells):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        recording = from_frame(pd.DataFrame({"t": TIME, **cells}), columns, time="t", **BASES)
    return [note for note in recording.assumptions if isinstance(note, Doubt)]


V = {"column": "VA_mag", "unit": "kV", "line_neutral": True}


def test_one_phase_that_dips_alone_is_doubted():
    cells = {"VA_mag": phase(0.5, 1), "VB_mag": phase(0.1, 2), "VC_mag": phase(0.3, 3)}
    (found,) = doubts({"V": V}, cells)
    assert found.startswith(
        "V is column 'VA_mag', one phase of three, and differs from 'VB_mag' by up to 40%"
    )
    assert "give phasors" in found


@pytest.mark.parametrize(
    ("cells", "why"),
    [
        ({"VB_mag": phase(0.5, 2), "VC_mag": phase(0.5, 3)}, "balanced"),
        ({"VB_mag": phase(0.5, 2, 11.8), "VC_mag": phase(0.5, 3, 11.2)}, "unbalanced by little all the time"),
        ({"VB_mag": phase(0.1, 2)}, "two columns are not three phases"),
        ({"VB": phase(0.1, 2), "VC": phase(0.1, 3)}, "other names"),
        ({"VB_mag": ["?!"] * 300, "VC_mag": np.zeros(300)}, "columns without readings"),
    ],
)
def test_nothing_else_is_doubted(cells, why):
    assert doubts({"V": V}, {"VA_mag": phase(0.5, 1), **cells}) == [], why


def test_a_single_odd_reading_is_no_difference():
    odd = phase(0.5, 2)
    odd[40] = 0.0
    assert doubts({"V": V}, {"VA_mag": phase(0.5, 1), "VB_mag": odd, "VC_mag": phase(0.5, 3)}) == []


def test_the_other_phases_of_a_file_are_looked_at(tmp_path):
    cells = {"time": TIME, "UL1": phase(0.5, 1), "UL2": phase(0.0, 2), "UL3": phase(0.0, 3)}
    path = tmp_path / "phases.csv"
    pd.DataFrame(cells).to_csv(path, index=False)
    with pytest.warns(UserWarning, match="one phase of three"):
        recording = read_csv(path, {"V": {**V, "column": "UL1"}}, **BASES)
    assert recording.names == ("V",)


@pytest.mark.parametrize(
    ("header", "others", "found"),
    [
        ("Ub [kV]", ["Ua [kV]", "Uc [kV]"], ["Ua [kV]", "Ub [kV]", "Uc [kV]"]),
        ("BUS7.V_L1", ["BUS7.V_L2", "BUS7.V_L3"], ["BUS7.V_L1", "BUS7.V_L2", "BUS7.V_L3"]),
        ("VB", ["VR", "VY"], ["VR", "VY", "VB"]),
        ("VBC", ["VAB", "VCA"], ["VAB", "VBC", "VCA"]),
        ("Voltage A", ["Voltage B", "Voltage C"], ["Voltage A", "Voltage B", "Voltage C"]),
        ("V1", ["V2", "V0"], []),
        ("Va", ["VB", "VC"], []),
        ("bar", ["bbr", "bcr"], []),
    ],
)
def test_sisters(header, others, found):
    assert sisters(header, [header, *others]) == found


def guessed(headers, units=(), **cells):
    table = Table({h: cells.get(h, np.ones(3)) for h in headers}, range(3), "file")
    return phasors_of(table, headers, dict(units))


def test_phasors_are_known_by_their_headers():
    headers = [
        f"{q}{p}_{part}"
        for q in "VI"
        for p in "ABC"
        for part in (("mag", "ang") if q == "V" else ("Ang", "Mag"))
    ]
    assert guessed(["time", *headers, "freq"]) == {
        "voltage": [[f"V{p}_mag", f"V{p}_ang"] for p in "ABC"],
        "current": [[f"I{p}_Mag", f"I{p}_Ang"] for p in "ABC"],
    }


def test_the_name_of_a_station_stands_in_front():
    """The first letter of the station says nothing, also where it looks like a channel."""
    for station in ("COLUMBIA_G4", "U1", "INDUS"):
        names = [f"{station}_{q}{p}_{part}" for p in "ABC" for q in "IV" for part in ("MAG", "ANG")]
        assert guessed(names) == {
            "voltage": [[f"{station}_V{p}_MAG", f"{station}_V{p}_ANG"] for p in "ABC"],
            "current": [[f"{station}_I{p}_MAG", f"{station}_I{p}_ANG"] for p in "ABC"],
        }


def test_other_spellings():
    polar = ["UL1", "UL2", "UL3", "UL1 Angle [deg]", "UL2 Angle [deg]", "UL3 Angle [deg]"]
    assert guessed(polar) == {"voltage": [[f"UL{k}", f"UL{k} Angle [deg]"] for k in (1, 2, 3)]}
    parts = [f"V{p} {part}" for p in ("ab", "bc", "ca") for part in ("real", "imag")]
    found = {"voltage": [[f"V{p} real", f"V{p} imag"] for p in ("ab", "bc", "ca")], "form": "rectangular"}
    assert guessed(parts) == {**found, "line_to_line": True}
    assert guessed(["V1_mag", "V1_ang", "I1_mag", "I1_ang"]) == {
        "voltage": [["V1_mag", "V1_ang"]],
        "current": [["I1_mag", "I1_ang"]],
    }
    texts = {name: ["1+2j", "1+2j", ""] for name in ("VA", "VB", "VC")}
    assert guessed([*texts], **texts) == {"voltage": ["VA", "VB", "VC"]}


@pytest.mark.parametrize(
    "headers", [["VA", "VB", "VC"], ["V", "angle", "P", "Q"], ["VA_mag", "VA_ang"], ["IA", "IB", "IC"]]
)
def test_what_is_no_phasor_is_not_offered(headers):
    assert guessed(headers) is None
