"""Which step the search for causes takes."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.cases import ieee39_events, load_ieee39
from errorscreen.data.observations import Observation
from errorscreen.discovery.search_step import search_simulator
from errorscreen.events import InputSignal
from errorscreen.exceptions import InputError
from errorscreen.parameters import Parameter
from errorscreen.simulators import CallableSimulator
from tests.plants import plant

RAMP = InputSignal([0.0, 1.0], "ramp", 0.0)


def observed(event):
    shape = (2, len(event.time))
    return Observation(event, np.zeros(shape), np.ones(2), ("U", "P"), ("pu", "pu"))


@pytest.fixture(scope="module")
def fault():
    return ieee39_events()["fault at bus 3"]


@pytest.mark.parametrize(
    ("own", "searched"), [(0.0025, 0.005), (0.004, 0.005), (0.001, 0.002), (0.005, 0.005), (0.01, 0.01)]
)
def test_a_grid_is_searched_with_twice_its_step_up_to_5_ms(fault, own, searched):
    simulator = load_ieee39(step=own)
    found = search_simulator(simulator, None, [observed(fault)])
    assert found.step == searched
    assert simulator.step == own


def test_a_grid_whose_fault_begins_between_two_long_steps_is_searched_with_its_own(fault):
    at = replace(fault, start=fault.start + 0.0025)
    assert search_simulator(load_ieee39(), None, [observed(fault), observed(at)]).step == 0.0025
    with pytest.raises(InputError, match=r"discovery\.step: the grid changes .* multiples of 0.005 s"):
        search_simulator(load_ieee39(), 0.005, [observed(at)])


def test_a_plant_is_searched_with_its_own_step_or_the_one_asked_for():
    simulator = plant("pv_plant")
    assert search_simulator(simulator, None, []) is simulator
    assert search_simulator(simulator, 0.001, []).step == 0.001


def test_a_step_of_a_simulator_without_one_is_refused():
    program = CallableSimulator(
        lambda theta, event: theta * event.time[None], [Parameter("gain", 1.0, 0.5, 2.0)], RAMP, outputs=["y"]
    )
    assert search_simulator(program, None, []) is program
    with pytest.raises(InputError, match=r"discovery\.step: the simulator has no step"):
        search_simulator(program, 0.001, [])
