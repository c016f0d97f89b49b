import pytest

from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.discovery import diagnose
from errorscreen.exceptions import InputError


def test_an_unknown_cause_is_located_without_trying_effects():
    hidden = draw_plant_scenario(3, 40.0, kind="outside", device="synchronous_machine")
    found = diagnose(hidden.simulator, list(hidden.recordings), random_state=0, max_effects=0)
    assert found.verdict.kind == "unknown"
    assert found.input_locations[0].place == hidden.place
    assert {fit.recording for fit in found.model("nominal").channels} == {
        o.event.name for o in hidden.recordings
    }
    assert max(stage.rms_over_noise for stage in found.model("nominal").stages) > 3
    assert found.cells
    assert found.calibrated.parameters.names == hidden.simulator.parameters.names


def test_parameters_that_suffice_leave_nothing_on_held_out_recordings_either():
    hidden = draw_plant_scenario(1, 40.0, kind="nothing", device="pv_plant")
    found = diagnose(
        hidden.simulator, list(hidden.recordings), list(hidden.held_out), random_state=0, max_effects=0
    )
    assert (found.verdict.kind, found.confirmed.kind) == ("parameters", "parameters")
    assert found.input_locations == ()
    assert found.cells == ()
    assert len(found.observations) == len(hidden.recordings) + len(hidden.held_out)
    assert "parameters only" in found.summary()
    assert found.to_frame().index[0] == "parameters"
    assert len(found.plot(1).axes) == 2
    assert len(repr(found)) < 200


def test_arguments_that_cannot_be_used_are_refused():
    hidden = draw_plant_scenario(1, 40.0, kind="nothing", device="pv_plant")
    for wrong in ({"n_starts": "4"}, {"library_size": -5}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            diagnose(hidden.simulator, list(hidden.recordings), **wrong)
    with pytest.raises(InputError, match="an object of a subclass of Simulator"):
        diagnose("a model", [])
