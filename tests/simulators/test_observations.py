from dataclasses import replace

import numpy as np
import pytest

from errorscreen.exceptions import InputError
from errorscreen.simulators.observations import as_observations, check_names
from tests.toys import oscillator

SIMULATOR = oscillator()
OBSERVATION = SIMULATOR.record({"omega": 7.0}, 0.01, seed=0)


def test_one_or_several_recordings_of_any_kind_become_a_list():
    assert as_observations(SIMULATOR, OBSERVATION) == [OBSERVATION]
    raw = OBSERVATION.values
    for several in ([OBSERVATION, raw], (OBSERVATION, raw)):
        first, second = as_observations(SIMULATOR, several)
        assert first is OBSERVATION
        np.testing.assert_array_equal(second.values, raw)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"channels": ("P", "Q")}, r"recording 2 \(event\): the channels are P, Q. Allowed: .* x, v"),
        ({"values": np.zeros((2, 5))}, r"values have shape \(2, 5\). Allowed: \(2, 161\)"),
        ({"noise": np.array([0.0, 1.0])}, "noise of the channels"),
        ({"noise": np.array([1.0])}, "noise of the channels"),
        ({"noise": np.array([np.nan, 1.0])}, "noise of the channels"),
        ({"values": np.full((2, 161), np.nan)}, "no value was measured"),
    ],
)
def test_an_unusable_observation_is_named(change, message):
    with pytest.raises(InputError, match=message):
        as_observations(SIMULATOR, [OBSERVATION, replace(OBSERVATION, **change)])


def test_no_recording_and_no_simulator_are_named():
    with pytest.raises(InputError, match="list of recordings is empty"):
        as_observations(SIMULATOR, [])
    with pytest.raises(InputError, match="simulator is a str"):
        as_observations("plant", OBSERVATION)


def test_names_are_checked():
    space = SIMULATOR.parameters
    assert check_names(space, None) == space.names
    assert check_names(space, ["gain", "omega"]) == ("gain", "omega")
    for names, message in (
        (["omga"], "did you mean 'omega'"),
        (["gain", "gain"], "declared 2 times"),
        ([], "selection of parameters is empty"),
        ("gain", "names is the text 'gain'"),
    ):
        with pytest.raises(InputError, match=message):
            check_names(space, names)
