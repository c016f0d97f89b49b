import numpy as np
import pytest

from errorscreen.calibration import PSOCalibrator
from errorscreen.exceptions import InputError, SimulationError
from tests.toys import TIME, Pulse, oscillator

SIMULATOR = oscillator()
TRUTH = {"omega": 8.0, "zeta": 0.06, "gain": 1.4}
RECORDINGS = [
    SIMULATOR.record(TRUTH, 0.01, seed=0),
    SIMULATOR.record(TRUTH, 0.01, seed=1, event=Pulse(TIME, start=0.5, duration=0.2)),
]


def test_it_recovers_what_was_hidden():
    fitted = PSOCalibrator(SIMULATOR, list(TRUTH), random_state=0).fit(RECORDINGS)
    for name, value in TRUTH.items():
        assert fitted.values_[name] == pytest.approx(value, rel=0.03)
    assert fitted.objective_ == pytest.approx(-fitted.score(RECORDINGS), rel=1e-12)


def test_each_iteration_is_one_call_for_each_event():
    simulator = oscillator()
    fitted = PSOCalibrator(simulator, n_particles=7, n_iterations=9, random_state=0).fit(RECORDINGS)
    assert simulator.calls == 2 * 9
    assert fitted.n_simulations_ == simulator.rows == 2 * 9 * 7
    np.testing.assert_array_equal(fitted.history_["simulations"], 14 * np.arange(1, 10))
    assert np.all(np.diff(fitted.history_["objective"]) <= 0)
    assert fitted.history_["objective"][-1] == fitted.objective_


def test_patience_ends_what_no_longer_improves():
    long, short = (
        PSOCalibrator(SIMULATOR, random_state=0, n_iterations=400, patience=patience).fit(RECORDINGS[0])
        for patience in (None, 10)
    )
    history = short.history_["objective"]
    assert len(history) < len(long.history_["objective"]) == 400
    assert history[-11] * (1 - 1e-4) <= history[-1]
    assert np.all(history[:-11] * (1 - 1e-4) > history[10:-1])
    np.testing.assert_array_equal(history, long.history_["objective"][: len(history)])


def test_weights_choose_what_is_fitted():
    spoiled = SIMULATOR.record(TRUTH, 0.01, seed=0)
    spoiled.values[1] = -spoiled.values[1]
    first = PSOCalibrator(SIMULATOR, ["omega"], weights=[1, 0], random_state=0).fit(spoiled)
    second = PSOCalibrator(SIMULATOR, ["omega"], weights=[0, 1], random_state=0).fit(spoiled)
    assert abs(first.values_["omega"] - 8.0) < abs(second.values_["omega"] - 8.0)
    assert first.score(spoiled) > second.set_params(weights=[1, 0]).score(spoiled)


def test_nothing_but_failures_is_an_error_with_its_remedy():
    with pytest.raises(SimulationError, match=r"no simulation of the fit ended well: .*reduce the step"):
        PSOCalibrator(oscillator(fail_above=0.0), n_iterations=2, random_state=0).fit(RECORDINGS)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_particles": 0}, "n_particles is 0"),
        ({"n_iterations": 1.5}, "n_iterations is 1.5"),
        ({"patience": 0}, "patience is 0"),
        ({"tol": -1.0}, "tol is -1.0"),
        ({"weights": [1.0, 1.0, 1.0]}, "channel weights"),
        ({"inertia": np.nan}, "inertia is nan"),
        ({"random_state": "x"}, "random_state is 'x'"),
    ],
)
def test_wrong_options_are_named(options, message):
    with pytest.raises(InputError, match=message):
        PSOCalibrator(SIMULATOR, **options).fit(RECORDINGS)
