"""What a unit takes otherwise than its file says."""

import numpy as np
import pytest

import errorscreen as es
from errorscreen.data.recordings import Recording
from errorscreen.models.dyr import DyrFile
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit

TIME = np.arange(0.0, 2.0, 0.02)
CASES = {
    "remote bus of a plant controller": (
        [("REGCA1", {}), ("REECB1", {}), ("REPCA1", {"REMBUS": 205})], "REPCA1 names the bus 205 (REMBUS)",
    ),
    "branch of a plant controller": (
        [("REGCA1", {}), ("REECB1", {}), ("REPCA1", {"FromBus": 205, "ToBus": 206})], "a branch from the bus 205",
    ),
    "remote bus of a stabiliser": (
        [("GENROU", {}), ("SEXS", {}), ("IEEEST", {"IB": 205, "IC": 5})], "IEEEST names the bus 205 (IB)",
    ),
    "second remote bus": (
        [("GENROU", {}), ("SEXS", {}), ("PSS2A", {"IB2": 205})], "PSS2A names the bus 205 (IB2)",
    ),
    "electrical control": ([("REGCA1", {}), ("REECB1", {"REMBUS": 205})], "REECB1 names the bus 205 (REMBUS)"),
    "second machine": (
        [("GENROU", {}), ("IEEEG1", {"JBUS": 102, "K2": 0.3})], "The shares K2 = 0.3 of IEEEG1 drive another machine",
    ),
    "source reactance": ([("GENCLS", {})], "The source reactance of GENCLS is taken as 0.2 pu"),
    "no field winding": ([("GENCLS", {}), ("SEXS", {})], "SEXS cannot act on it"),
}  # fmt: skip


def notes(named, bus=101):
    device = unit([Record(PARTS[name], values) for name, values in named], bus=bus)
    return " ".join(note.text for note in device.notes)


@pytest.mark.parametrize("case", CASES)
def test_an_approximation_is_told(case):
    assert CASES[case][1] in notes(CASES[case][0])


def test_nothing_is_told_of_what_the_model_has():
    assert not notes([("GENROU", {}), ("SEXS", {}), ("IEEEST", {"IB": 101}), ("IEEEG1", {})])
    assert not notes([("GENROU", {}), ("SEXS", {}), ("PSS2A", {"IC2": 0, "IB2": 205})])
    assert not notes(
        [("REGCA1", {}), ("REECB1", {}), ("REPCA1", {"REMBUS": 101, "FromBus": 101, "ToBus": 7})]
    )


def test_the_file_and_the_observation_tell_it():
    text = "101 'GENCLS' 1  4.0 0.0 /\n101 'SEXS' 1  0.1 10.0 100.0 0.1 0.0 5.0 /\n"
    file = DyrFile("unit.dyr", text)
    assert "0.2 pu" in file.summary()
    assert "SEXS cannot act" in file.summary()
    rng = np.random.default_rng(0)
    levels = {"V": 1.0, "angle": 0.0, "P": 0.7, "Q": 0.1, "exciter current": 2.0}
    values = {name: level + rng.normal(0, 1e-4, len(TIME)) for name, level in levels.items()}
    recording = Recording.from_arrays(TIME, values, base_mva=100.0, f_nominal=50.0, event_time=1.0)

    def told(**constants):
        plant = es.Plant(file.unit(), recording, constants=constants)
        return " ".join(plant.without_uncertainty(recording).assumptions)

    assert "0.2 pu" in told()
    assert "0.2 pu" not in told(Xsource=0.3)
    assert "exciter current is not compared: the model GENCLS+SEXS has P, Q, Efd, If, Pm, speed." in told()
