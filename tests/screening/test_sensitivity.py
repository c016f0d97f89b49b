import numpy as np
import pytest
from sklearn.exceptions import NotFittedError

from errorscreen.exceptions import InputError, SimulationError
from errorscreen.screening import SensitivityScreener
from tests.toys import TIME, Pulse, linear, oscillator

MATRIX = np.random.default_rng(0).standard_normal((30, 4)) * [1.0, 3.0, 0.0, 2.0]


def test_it_ranks_by_the_norm_of_the_sensitivity():
    simulator = linear(MATRIX)
    screener = SensitivityScreener(simulator).fit(simulator.record({}, 0.1, seed=0))
    np.testing.assert_allclose(screener.contributions_, np.linalg.norm(MATRIX, axis=0), rtol=1e-9)
    assert screener.ranking_.tolist() == [1, 3, 0, 2]
    assert screener.ranked_names_ == ("p1", "p3", "p0", "p2")
    assert simulator.rows == 1 + 5  # one for the recording


def test_only_what_was_measured_counts():
    simulator = linear(MATRIX)
    values = simulator.record({}, 0.1, seed=0).values
    values[:, 10:] = np.nan
    found = SensitivityScreener(simulator).fit(values).contributions_
    np.testing.assert_allclose(found, np.linalg.norm(MATRIX[:10], axis=0), rtol=1e-9)


def test_several_recordings_are_averaged():
    simulator = oscillator()
    recordings = [
        simulator.record({}, 0.01, seed=0, event=Pulse(TIME, start=0.5, height=height))
        for height in (1.0, 3.0)
    ]
    one, both = (SensitivityScreener(simulator).fit(r).contributions_ for r in (recordings[0], recordings))
    np.testing.assert_allclose(both, 2 * one, rtol=1e-9)


def test_relative_sensitivity_is_that_of_a_relative_change():
    simulator = oscillator()
    recording = simulator.record({}, 0.01, seed=0)
    relative, absolute = (
        SensitivityScreener(simulator, relative=relative).fit(recording).contributions_
        for relative in (True, False)
    )
    np.testing.assert_allclose(relative, absolute * simulator.parameters.scales, rtol=1e-9)


def test_selection_takes_the_first_k_or_asks_a_selector():
    simulator = linear(MATRIX)
    screener = SensitivityScreener(simulator)
    with pytest.raises(NotFittedError):
        screener.select(1)
    screener.fit(simulator.record({}, 0.1, seed=0))
    assert screener.select(2) == ("p1", "p3")

    class AboveFive:
        def select(self, contributions):
            return np.flatnonzero(contributions > 5)

    assert screener.select(AboveFive()) == ("p1", "p3", "p0")
    for k in (0, 5, 2.0):
        with pytest.raises(InputError, match="from 1 to 4"):
            screener.select(k)


def test_a_failure_next_to_nominal_is_an_error_with_its_remedy():
    simulator = oscillator(fail_above=6.001)
    recording = simulator.record({}, 0.01, seed=0)
    with pytest.raises(SimulationError, match="next to the nominal parameters failed: .*reduce the step"):
        SensitivityScreener(simulator).fit(recording)
