import pytest

from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.discovery import diagnose
from errorscreen.exceptions import InputError


def test_what_is_wrong_and_where_without_a_search_for_effects():
    hidden = draw_plant_scenario(3, 40.0, kind="outside", device="synchronous_machine")
    found = diagnose(hidden.simulator, list(hidden.recordings), random_state=0)
    assert found.verdict.kind == "unknown"
    assert found.places[0].place == hidden.place
    assert {fit.recording for fit in found.fits} == {o.event.name for o in hidden.recordings}
    assert max(stage.rms_over_noise for stage in found.stages) > 3
    assert found.remainder.significant
    assert found.calibrated.parameters.names == hidden.simulator.parameters.names


def test_where_parameters_suffice_nothing_is_left():
    hidden = draw_plant_scenario(1, 40.0, kind="nothing", device="pv_plant")
    lines: list[str] = []
    found = diagnose(hidden.simulator, list(hidden.recordings), random_state=0, report=lines.append)
    assert lines[0] == "fit without effects"
    assert found.verdict.kind == "parameters"
    assert found.places == ()
    assert found.remainder.p_value > 0.002


def test_what_cannot_be_used_is_refused():
    hidden = draw_plant_scenario(1, 40.0, kind="nothing", device="pv_plant")
    for wrong in ({"report": 1}, {"n_starts": "4"}, {"library_size": -5}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            diagnose(hidden.simulator, list(hidden.recordings), **wrong)
    with pytest.raises(InputError, match="an object of a subclass of Simulator"):
        diagnose("a model", [])
