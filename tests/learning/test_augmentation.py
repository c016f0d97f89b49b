import numpy as np
import pytest

from errorscreen.cases.demo import demo_recordings
from errorscreen.exceptions import InputError
from errorscreen.learning.augmentation import LabelRegressor, enlarge_dataset
from errorscreen.learning.generation import contribution_labels, generate_dataset
from errorscreen.metrics import top_k_overlap
from errorscreen.simulators import PlantSimulator


@pytest.fixture(scope="module")
def plant():
    return PlantSimulator("synchronous_machine", demo_recordings(random_state=0)[0])


@pytest.fixture(scope="module")
def exact(plant):
    return generate_dataset(plant, 800, random_state=1)


@pytest.fixture(scope="module")
def larger(plant, exact):
    return enlarge_dataset(exact, plant, 300, random_state=2)


def test_regressed_labels_agree_with_exact_ones(plant, exact, larger):
    new = larger.take(np.arange(len(exact), len(larger))).valid()
    labels = contribution_labels(plant, new.theta)
    error = np.abs(new.contributions - labels) / labels
    assert np.median(error) < 0.05
    # the figure that comes with it is honest
    told = larger.metadata["regression"]
    assert told["samples"] == 300
    assert np.median(error) == pytest.approx(told["label_error"], rel=0.5)
    # and better than one sensitivity for all samples
    mean = exact.valid()
    constant = np.mean(mean.contributions / plant.parameters.deviation(mean.theta), axis=0)
    constant = constant * plant.parameters.deviation(new.theta)
    assert top_k_overlap(labels, new.contributions, 3) > top_k_overlap(labels, constant, 3)


def test_the_responses_are_those_of_the_new_parameters(plant, exact, larger):
    np.testing.assert_array_equal(larger.responses[: len(exact)], exact.responses)
    np.testing.assert_array_equal(larger.contributions[: len(exact)], exact.contributions)
    again = plant.simulate(larger.theta[len(exact) :])
    np.testing.assert_array_equal(larger.responses[len(exact) :], again.values)
    inside = (larger.theta >= plant.parameters.bounds[:, 0]) & (larger.theta <= plant.parameters.bounds[:, 1])
    assert inside.all()


def test_the_same_seed_gives_the_same_samples_for_any_number_of_workers(plant, exact, larger):
    again = enlarge_dataset(exact, plant, 300, random_state=2, n_jobs=2)
    np.testing.assert_array_equal(again.theta, larger.theta)
    np.testing.assert_array_equal(again.contributions, larger.contributions)
    assert not np.array_equal(enlarge_dataset(exact, plant, 300, random_state=3).theta, larger.theta)


def test_nothing_is_added_where_nothing_is_asked_for(plant, exact):
    assert enlarge_dataset(exact, plant, 0) is exact


def test_labels_are_zero_at_nominal_values_and_never_negative(plant, exact):
    model = LabelRegressor(plant.parameters, random_state=0).fit(
        exact.valid().theta, exact.valid().contributions
    )
    np.testing.assert_array_equal(model.predict(plant.parameters.nominal), 0.0)
    assert np.all(model.predict(exact.theta) >= 0)


def test_a_parameter_without_effect_stays_without(plant, exact):
    data = exact.valid()
    labels = data.contributions.copy()
    labels[:, 2] = 0.0
    model = LabelRegressor(plant.parameters, random_state=0).fit(data.theta, labels)
    np.testing.assert_array_equal(model.predict(data.theta)[:, 2], 0.0)


def test_a_few_samples_are_enough_to_begin_with(plant, exact):
    larger = enlarge_dataset(exact.take(np.arange(20)), plant, 5, random_state=0)
    assert len(larger) == 25
    assert larger.metadata["regression"]["label_error"] > 0


def test_what_cannot_be_used_is_an_input_error(plant, exact):
    other = PlantSimulator("dfig_plant", demo_recordings(random_state=0)[0])
    with pytest.raises(InputError, match="the simulator's 15 parameters"):
        enlarge_dataset(exact, other, 10)
    with pytest.raises(InputError, match="n_samples"):
        enlarge_dataset(exact, plant, -1)
    with pytest.raises(InputError, match="at least 10 samples"):
        LabelRegressor(plant.parameters).fit(exact.theta[:5], exact.contributions[:5])
    with pytest.raises(InputError, match="finite labels"):
        LabelRegressor(plant.parameters).fit(exact.theta, np.full_like(exact.contributions, np.nan))
