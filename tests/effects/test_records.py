"""Effects that a record of a standard model can stand for, in the user's file."""

import numpy as np
import pytest

from errorscreen.events import Playback
from errorscreen.models.dyr import DyrFile
from errorscreen.simulators import PlantSimulator

MACHINE = "101 'GENROU' 1  6.0 0.04 0.8 0.06 4.0 0.0 1.8 1.7 0.3 0.5 0.22 0.15 0.0 0.0 /  as built"
EXCITER = "101 'SEXS' 1  0.1 10.0 80.0 0.05 0.0 5.0 /"
STABILISER = "101 'IEEEST' 1  1 0  0.02 0.0004 0 0 0 0  0.15 0.03 0.15 0.03 10 10 10 0.1 -0.1 0 0 /"
COMPENSATOR = "101 'IEEEVC' 1  0.0 0.05 /"
#: effect, what the file holds beside the machine, values, model of the record, and how near both responses are in pu
CASES = {
    "exciter": ("", {"K": 80, "TA_TB": 0.2, "TB": 5, "TE": 0.05, "Emax": 4}, "SEXS", 1e-9),
    "stabiliser": (EXCITER, {"K": 15, "TW": 5, "T1_T2": 4, "T2": 0.05, "Vmax": 0.05}, "IEEEST", 1e-6),
    "governor": ("", {"K": 20, "db": 0, "T1": 0.2, "TCH": 0.3, "T2_T3": 0.3, "T3": 6}, "IEEEG1", 1e-6),
    "hydro_governor": (
        "",
        {"K": 2.5, "TR": 5, "R": 0.05, "TG": 0.3, "TW": 1.0, "db": 0},
        "HYGOV",
        4e-5,
    ),
    "gas_governor": (
        "",
        {"K": 12, "TI": 5, "R": 0.04, "TA": 0.5, "TB": 0.3, "TP": 1.0, "db": 0.0006},
        "GGOV1",
        1e-6,
    ),
}


def event(depth):
    time = np.arange(0.0, 8.0, 0.01)
    after = np.clip(time - 1.0, 0.0, None)
    voltage = 1.0 - depth * ((time > 1.0) & (time < 1.15)) - 0.02 * (1 - np.exp(-after))
    angle = -depth * (1 - np.exp(-2 * after)) + 0.3 * depth * np.sin(5 * after) * np.exp(-after)
    return Playback(time, "dip", 1.0, {"V": voltage, "angle": angle}, {"V": 1.0, "P": 0.7, "Q": 0.1})


def response(device, dip, effect=None, values=None):
    plant = PlantSimulator(device, dip)
    if effect is not None:
        plant = plant.extend(effect, **{name: {"nominal": float(value)} for name, value in values.items()})
    return plant.simulate(plant.parameters.nominal).require_ok().values[0]


@pytest.mark.parametrize("effect", CASES)
def test_the_record_answers_as_the_effect_does(effect):
    """The turbine of HYGOV is nonlinear, so the comparison with it is for a small event."""
    beside, values, model, near = CASES[effect]
    file = DyrFile("unit.dyr", "\n".join(filter(None, [MACHINE, beside])))
    dip = event(0.05 if effect == "hydro_governor" else 0.3)
    plant = PlantSimulator(file.unit(), dip)
    (added,) = [one for one in plant.effects if one.name == effect]
    name, constants = added.record({**values, "P": 0.7})
    assert name == model
    extended = response(file.unit(), dip, effect, values)
    whole = response(file.extended(None, None, [(name, constants)]).unit(), dip)
    assert np.abs(extended - response(file.unit(), dip)).max() > 20 * near
    assert np.abs(whole - extended).max() < near


@pytest.mark.parametrize("beside", [STABILISER, COMPENSATOR])
def test_an_exciter_that_is_missing_hears_the_stabiliser_and_compensator_of_the_file(beside):
    _, values, model, near = CASES["exciter"]
    file, dip = DyrFile("unit.dyr", f"{MACHINE}\n{beside}"), event(0.3)
    constants = {"TA_TB": 0.2, "TB": 5, "K": 80, "TE": 0.05, "EMIN": 0, "EMAX": 4}
    extended = response(file.unit(), dip, "exciter", values)
    whole = response(file.extended(None, None, [(model, constants)]).unit(), dip)
    alone = response(DyrFile("unit.dyr", MACHINE).unit(), dip, "exciter", values)
    assert np.abs(whole - extended).max() < near
    assert np.abs(alone - extended).max() > 1e-3


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_a_record_stands_behind_those_of_its_unit(newline):
    other = "202 'GENCLS' 1  3.0 0.0 /"
    file = DyrFile("unit.dyr", newline.join(["// plant", MACHINE, other, ""]))
    new = file.extended(101, 1, [("SEXS", {"TA_TB": 0.1, "TB": 8, "K": 90, "TE": 0.1, "EMIN": 0, "EMAX": 5})])
    lines = new.text.split(newline)
    assert lines[:2] == ["// plant", MACHINE]
    assert lines[2] == "101 'SEXS' 1  0.1 8.0 90.0 0.1 0.0 5.0 /"
    assert lines[3:] == [other, ""]
    assert new.check() == []
    assert new.unit(101, 1).name == "GENROU+SEXS"
