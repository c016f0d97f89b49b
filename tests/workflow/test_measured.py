"""Causes in measured recordings: what is known about them has to be found."""

from pathlib import Path

import numpy as np
import pytest

from errorscreen.cases import load_case
from errorscreen.discovery import CauseFinder
from errorscreen.discovery.conclusions import ALIKE
from errorscreen.workflow import Study
from errorscreen.workflow.advice import advice

EXAMPLES = Path(__file__).parents[2] / "examples"


def study_of(name, step=None):
    """Study of an example, with its step of the integration or a longer one, which its models bear."""
    case = load_case(EXAMPLES / f"{name}.toml")
    if step is not None:
        case = case.model_copy(update={"simulation": case.simulation.model_copy(update={"step": step})})
    for section in (case.recording, *case.held_out):
        if not (case.folder / section.path).exists():
            pytest.skip(f"the recording {section.path} is not on this machine")
    return Study.from_case(case)


#: the cause, and what is easily confused with it; benchmarks/measured_systems.py searches whole libraries
REACTIVE = ["volt_var", "lag_reactive", "priority", "scale_Q"]


@pytest.mark.slow
def test_the_droop_of_an_inverter_in_volt_var_mode_is_named_and_both_steps_tell_its_curve():
    study = study_of("volt_var", step=0.01)
    finder = CauseFinder(study.simulator, REACTIVE, max_effects=1, random_state=study.run.random_state)
    finder.fit(list(study.observations))
    assert finder.verdict_.kind == "effect"
    assert finder.causes_[0].name == "volt_var"
    assert not finder.causes_[0].exact
    assert finder.best_.at_rest
    parameters = finder.causes_[0].values
    found = {name.removeprefix("volt_var."): value for name, (value, _, _) in parameters.items()}
    # what can be read off the records: at 331 V the reactive power is 1787 var of 3 kVA, whatever the droop
    assert found["Qm"] == pytest.approx(0.596, abs=0.003)
    # at 363.06 V, 16.15 V above the voltage before, it is 1368 var lower, by the droop beyond both edges of the band
    assert 3000.0 * found["K"] * (16.15 / 350.57 - 2.0 * found["db"]) == pytest.approx(1368.0, rel=0.03)
    # about 800 var/s
    assert 0.2 < found["R"] < 0.33
    low, high = parameters["volt_var.K"][1:]
    assert low < high < 1.5 * low


@pytest.mark.slow
def test_the_droop_is_named_by_one_step_too_which_leaves_the_dead_band_open():
    """Of the step up it removes more or less, as chance has it: `confirm` tells that; it is no check of the search."""
    study = study_of("volt_var", step=0.01)
    finder = CauseFinder(study.simulator, REACTIVE, max_effects=1, random_state=study.run.random_state)
    finder.fit(study.observation)
    assert finder.causes_[0].name == "volt_var"
    assert not finder.causes_[0].exact
    parameters = finder.causes_[0].values
    assert 0.2 < parameters["volt_var.R"][0] < 0.33
    # both steps tell 0.0155, and the centre of the band, to a tenth of their size
    _, low, high = parameters["volt_var.db"]
    assert low < 0.0155 < high
    assert high - low > 0.01
    _, low, high = parameters["volt_var.Vc"]
    assert high - low > 0.015


@pytest.mark.slow
def test_the_trip_of_an_inverter_and_its_return_are_named():
    study = study_of("ride_through")
    names = ["trip", "cessation"]
    finder = CauseFinder(study.simulator, names, max_effects=1, random_state=0).fit(study.observation)
    assert finder.causes_[0].name == "trip"
    parameters = finder.causes_[0].values
    found = {name: value for name, (value, _, _) in parameters.items()}
    # 20 s under a threshold between the voltages that were tried, 120 s away, and back
    assert found["trip.Tth"] == pytest.approx(20, abs=0.5)
    assert found["trip.Tc"] == pytest.approx(121.5, abs=2.5)
    # back to what flowed before after some 13 s
    assert 12 < found["trip.Tramp"] < 15
    # 321.3 V tripped it, 326.1 V did not: this is what the recording tells, and the setting of 325 V is among it
    value, low, high = (350.57 * v for v in parameters["trip.Vth"])
    assert low == pytest.approx(321.3, abs=0.4)
    assert high == pytest.approx(326.1, abs=0.4)
    assert 321.3 < value < 326.2
    # 326 V for 14 s and for 50 s, and 321 V for 10 s: nothing may happen then
    event, extended = study.observation.event, finder.extended_simulator_
    steady = event.time < 130.0
    assert np.all(power_of(extended, event)[steady] > 0.8)
    assert power_of(extended, event)[np.searchsorted(event.time, 160.0)] < 0.01
    # which is no matter of course: each of them trips a plant whose threshold is higher, or whose timer is shorter
    for changed in ({"trip.Vth": 330.0 / 350.57}, {"trip.Tth": 9.0}):
        theta = extended.parameters.nominal
        theta[[extended.parameters.index(name) for name in changed]] = list(changed.values())
        assert power_of(extended.with_nominal(theta), event)[steady].min() < 0.01


def power_of(simulator, event):
    return simulator.baseline(event)[simulator.channels.index("P")]


@pytest.mark.slow
def test_what_a_grid_fault_tells_of_a_hydro_unit_is_where_to_measure():
    """Nobody knows the cause: whoever names one is wrong."""
    study = study_of("grid_fault")
    finder = CauseFinder(study.simulator, random_state=study.run.random_state).fit(study.observation)
    assert finder.verdict_.kind == "unknown"
    assert finder.best_.at_rest
    first = finder.input_locations_[0]
    assert (first.device, first.place) == ("synchronous_machine", "Efd")
    assert first.explained > 0.5
    assert "record the field voltage" in " ".join(advice(finder.diagnosis_, study))
    alike = [p.name for p in finder.input_locations_ if p.probability >= ALIKE * first.probability]
    assert [list(group.names) for group in finder.groups_] == ([alike] if len(alike) > 1 else [])
