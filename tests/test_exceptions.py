import pickle

import pytest

from errorscreen.exceptions import InputError, MissingExtraError, SimulationError


@pytest.mark.parametrize(
    "error",
    [
        InputError("unit 'kVolt' is unknown", where="column 'V1'", allowed="V, kV, pu", remedy="Convert it"),
        InputError("the file is empty"),
        MissingExtraError("torch", extra="cnn"),
        SimulationError("no simulation ended well"),
    ],
)
def test_errors_pass_from_one_process_to_another(error):
    twin = pickle.loads(pickle.dumps(error))
    assert type(twin) is type(error)
    assert str(twin) == str(error)
    assert twin.args == error.args
    assert vars(twin) == vars(error)
