import numpy as np
import pytest

from errorscreen.simulators import Responses, Simulator, Status
from tests.plants import plant


@pytest.fixture
def responses():
    values = np.arange(12.0).reshape(2, 2, 3)
    values[1] = np.nan
    status = np.array([Status.OK, Status.DIVERGED])
    return Responses(values, status, np.array([0.0, 0.5, 1.0]), ("P", "Q"))


def test_responses_become_a_table_a_figure_and_a_sentence(responses):
    frame = responses.to_frame()
    assert list(frame.columns) == ["P", "Q"]
    assert frame.loc[(0, 0.5)].tolist() == [1.0, 4.0]
    assert len(frame) == 6
    assert [axes.get_ylabel() for axes in responses.plot().axes] == ["P", "Q"]
    assert "1 of 2 simulations ended well" in responses.summary()
    assert "DIVERGED" in responses.summary()


def test_texts_of_responses_and_simulators_are_short(responses):
    simulator = plant("synchronous_machine")
    assert repr(simulator) == f"PlantSimulator(synchronous_machine, {len(simulator.parameters)} parameters)"
    for effect in simulator.effects[:9]:
        simulator = simulator.extend(effect)
    assert len(repr(simulator)) < 200
    assert len(repr(responses)) < 200


def test_a_simulator_is_abstract():
    with pytest.raises(TypeError, match="abstract"):
        Simulator()
