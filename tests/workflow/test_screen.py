"""The screening stage."""

import numpy as np
import pytest

from errorscreen.cases.case_models import RunSection, ScreeningSection
from errorscreen.cases.demo import demo_recordings
from errorscreen.simulators import PlantSimulator
from errorscreen.workflow import screen as stage


@pytest.fixture(scope="module")
def demo():
    recording, *_ = demo_recordings(0)
    plant = PlantSimulator("synchronous_machine", recording)
    return plant, plant.observe(recording)


def test_a_network_learns_from_a_longer_step_whose_error_is_well_below_noise(demo, tmp_path, monkeypatch):
    plant, observation = demo
    made = []

    def generated(simulator, *args, **options):
        made.append((simulator.step, generate(simulator, *args, **options)))
        return made[0][1]

    generate = stage.generate_dataset
    monkeypatch.setattr(stage, "generate_dataset", generated)
    section, run = ScreeningSection(samples=40, epochs=1), RunSection()
    found = stage.screen("cnn", plant, observation, section, run, tmp_path, False)
    ((step, dataset),) = made
    assert plant.step < step <= observation.event.dt
    theta, responses = dataset.theta, dataset.responses
    exact = plant.simulate(theta, observation.event).values
    added = ((responses - exact) / observation.noise[:, None])[:, observation.mask]
    assert np.quantile(np.sqrt(np.mean(added**2, axis=1)), 0.9) < 0.5
    # what was asked about the step counts, too
    assert found.n_simulations > 40 * (len(plant.parameters) + 1)
    assert np.all(np.isfinite(list(found.contributions.values())))


@pytest.mark.parametrize(("method", "count"), [("sensitivity", 9), ("random", 0)])
def test_other_methods_count_what_they_simulate(demo, tmp_path, method, count):
    plant, observation = demo
    found = stage.screen(method, plant, observation, ScreeningSection(), RunSection(), tmp_path, False)
    assert found.n_simulations == count
    assert set(found.selected) <= set(plant.parameters.names)
