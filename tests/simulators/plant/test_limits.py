"""Limits that act in a recording are told, and only these."""

import numpy as np

from errorscreen.data.recordings import Recording
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator

TIME = np.arange(0.0, 4.0, 0.01)


def told(dip, *named, **changes):
    device = unit([Record(PARTS[name], changes.get(name, {})) for name in ("GENROU", "SEXS", "TGOV1")])
    rng = np.random.default_rng(0)
    V = np.where((TIME >= 1.0) & (TIME < 1.1), 1.0 - dip, 1.0)
    levels = {"V": V, "angle": 0 * TIME, "P": 0.7 + 0 * TIME, "Q": 0.15 + 0 * TIME}
    values = {name: one + rng.normal(0, 1e-4, len(TIME)) for name, one in levels.items()}
    recording = Recording.from_arrays(
        TIME, values, base_mva=100.0, f_nominal=60.0, event_time=1.0, noise=dict.fromkeys(values, 1e-4)
    )
    plant = PlantSimulator(device.with_candidates(named), recording, effects=())
    return [text for text in plant.observe(recording).assumptions if "limit" in text or "would act" in text]


def test_the_ceiling_that_a_dip_reaches_is_told_with_its_time():
    (text,) = [text for text in told(0.4, SEXS={"EMAX": 3.0}) if "SEXS.EMAX" in text]
    assert text.startswith("The limit SEXS.EMAX = 3 acts in the simulation of the model as it is")
    begin = float(text.split(" from ")[1].split()[0])
    assert 1.0 <= begin < 1.2


def test_a_limit_that_is_not_reached_or_is_a_candidate_is_not_told():
    assert not told(0.005, SEXS={"EMAX": 6.0, "EMIN": -6.0})
    assert not [text for text in told(0.4, "SEXS.EMAX", SEXS={"EMAX": 3.0}) if "SEXS.EMAX" in text]


def test_a_limit_near_the_signal_is_told_as_such():
    assert any("TGOV1.VMAX would act if moved by 20 %" in text for text in told(0.005, TGOV1={"VMAX": 0.75}))
