"""The screening stage."""

from types import SimpleNamespace

import numpy as np
import pytest

from errorscreen._runtime.sampling import latin_hypercube
from errorscreen.cases.case_models import RunSection, ScreeningSection
from errorscreen.cases.demo import demo_recordings
from errorscreen.screening import SCREENERS, RandomScreener
from errorscreen.simulators import PlantSimulator
from errorscreen.workflow.screen import screen


def study_of(plant, observation, section):
    return SimpleNamespace(simulator=plant, observation=observation, screening=section, run=RunSection())


@pytest.fixture(scope="module")
def demo():
    recording, *_ = demo_recordings(0)
    plant = PlantSimulator("synchronous_machine", recording)
    return plant, plant.observe(recording)


def test_training_errors_take_a_longer_step_whose_error_is_well_below_noise(demo, tmp_path, monkeypatch):
    plant, observation = demo
    made = []

    class Training(RandomScreener):
        trains = True

        def fit(self, X=None, y=None):
            made.append(self.simulator)
            return super().fit(X)

    monkeypatch.setitem(SCREENERS._items, "training", Training)
    found = screen("training", study_of(plant, observation, ScreeningSection()), tmp_path, False)
    (coarse,) = made
    assert plant.step < coarse.step <= observation.event.dt
    theta = latin_hypercube(plant.parameters, 40, 0)
    exact, rough = (one.simulate(theta, observation.event).values for one in (plant, coarse))
    added = ((rough - exact) / observation.noise[:, None])[:, observation.mask]
    assert np.quantile(np.sqrt(np.mean(added**2, axis=1)), 0.9) < 0.5
    assert found.n_simulations > 0  # those that chose the step count


@pytest.mark.parametrize(("method", "count"), [("sensitivity", 9), ("identifiability", 17), ("random", 0)])
def test_methods_count_their_simulations(demo, tmp_path, method, count):
    plant, observation = demo
    found = screen(method, study_of(plant, observation, ScreeningSection()), tmp_path, False)
    assert found.n_simulations == count
    assert found.threads is None
    assert set(found.selected) <= set(plant.parameters.names)


def test_the_network_ranks_all_parameters(demo, tmp_path):
    plant, observation = demo
    section = ScreeningSection(samples=40, epochs=1)
    found = screen("cnn", study_of(plant, observation, section), tmp_path, False)
    assert np.all(np.isfinite(list(found.contributions.values())))
    assert found.n_simulations > 40 * (len(plant.parameters) + 1)
    assert (found.threads, (tmp_path / "dataset").exists()) == (1, True)
