"""Records in pu of another base than that of the unit."""

import numpy as np
import pytest

from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.discovery import CauseFinder
from errorscreen.effects import mva_base
from errorscreen.events import Playback
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator

TIME = np.arange(0.0, 4.0, 0.02)
AFTER = np.clip(TIME - 1.0, 0.0, None)
SIGNALS = {
    "V": 1.0 - 0.2 * ((TIME > 1.0) & (TIME < 1.2)) - 0.03 * (1.0 - np.exp(-AFTER)),
    "angle": -0.2 * (1.0 - np.exp(-2.0 * AFTER)),
}
START = {"V": 1.0, "P": 0.72, "Q": 0.12}
DEVICE = unit([Record(PARTS["GENROU"], {})])


def plant(factor=1.0):
    """Machine that starts at its true power, or at one that is recorded with a factor."""
    start = {**START, "P": factor * START["P"], "Q": factor * START["Q"]}
    return PlantSimulator(DEVICE, Playback(TIME, "dip", 1.0, SIGNALS, start), step=0.005, n_threads=1)


def test_true_power_times_the_factor_is_recorded():
    """The start follows: it is that of the true power, whatever was recorded."""
    recorded = plant(5 / 6).extend("mva_base")
    found = recorded.simulate([*recorded.parameters.nominal[:-1], 5 / 6 - 1]).require_ok().values[0]
    assert np.abs(found - 5 / 6 * plant().baseline()).max() < 1e-12


@pytest.mark.parametrize(
    ("values", "title"),
    [
        ((-1 / 6, -0.18, -0.15), "Another MVA base: 83.3 instead of 100 MVA, or 5 of 6 units on line"),
        ((0.2, 0.19, 0.21), "Another MVA base: 120 instead of 100 MVA, or 6 units on line instead of 5"),
        ((-0.21, -0.22, -0.205), "Another MVA base: 79 instead of 100 MVA"),
        ((-0.5, np.nan, np.nan), "Another MVA base: 50 instead of 100 MVA"),
    ],
)
def test_the_title_tells_both_readings(values, title):
    assert mva_base(100.0).reading("", {"a": values}) == title


def test_the_stated_base_comes_from_the_recording():
    values = {"V": SIGNALS["V"], "angle": SIGNALS["angle"], "P": 0.7 + 0.0 * TIME, "Q": 0.1 + 0.0 * TIME}
    recording = Recording.from_arrays(
        TIME, values, base_mva=120.0, f_nominal=60.0, event_time=1.0, name="dip"
    )
    (effect,) = (e for e in PlantSimulator(DEVICE, recording).effects if e.name == "mva_base")
    assert "instead of 120 MVA" in effect.reading("", {"a": (0.1, 0.1, 0.1)})
    case_study = PlantSimulator("synchronous_machine", recording)
    assert "mva_base" not in {effect.name for effect in case_study.effects}


def test_one_factor_is_named_rather_than_two_scales():
    """Where half of the units were on line. A small factor is the same as larger reactances and a smaller inertia."""
    noise = np.full(2, 2e-3)
    y = plant().baseline() / 2
    y = y + noise[:, None] * np.random.default_rng(2).standard_normal(y.shape)
    stated = plant(1 / 2)
    observation = Observation(stated.event, y, noise, stated.channels, stated.units)
    names = ["mva_base", "scale_P", "scale_Q", "offset_P", "lag_Q"]
    finder = CauseFinder(
        stated, names, max_effects=2, n_fits=2, n_starts=1, library_size=64, random_state=0
    ).fit(observation)
    first = finder.causes_[0]
    assert finder.verdict_.kind == "measurement"
    assert first.name == "mva_base"
    _, low, high = first.values["mva_base.a"]
    assert low < -1 / 2 < high
    assert high < -0.3
    assert first.title.startswith("Another MVA base")
    assert "or 1 of 2 units on line" in finder.verdict_.text
