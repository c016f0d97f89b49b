"""Saturation that the search adds to a machine whose record has none."""

import numpy as np
import pytest

from errorscreen.events import Playback
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator


def plant(machine, S10, S12):
    time = np.arange(0.0, 3.0, 0.01)
    voltage = 1.0 - 0.3 * ((time > 1.0) & (time < 1.15))
    event = Playback(time, "dip", 1.0, {"V": voltage, "angle": 0.0 * time}, {"V": 1.05, "P": 0.7, "Q": 0.2})
    return PlantSimulator(
        unit([Record(PARTS[machine], {"S10": S10, "S12": S12})]), event, step=0.005, n_threads=1
    )


@pytest.mark.parametrize("machine", ["GENROU", "GENSAL", "GENTPJ1"])
def test_it_is_the_saturation_of_the_record_and_off_it_changes_nothing(machine):
    linear, record = plant(machine, 0.0, 0.0), plant(machine, 0.1, 0.4)
    extended = linear.extend("saturation")
    names = extended.parameters.names
    rows = np.tile(extended.parameters.nominal, (2, 1))
    rows[:, names.index("saturation.a")] = 0.0, 0.4
    rows[:, names.index("saturation.k")] = 0.25
    off, on = extended.simulate(rows).require_ok().values
    assert np.array_equal(off, linear.simulate(linear.parameters.nominal).values[0])
    assert np.array_equal(on, record.simulate(record.parameters.nominal).values[0])
    assert np.abs(on - off).max() > 1e-3
