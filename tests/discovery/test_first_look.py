"""Labels of effects, and a network's first look at parameters and effects together."""

from functools import cache

import numpy as np
import pytest
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline

from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.discovery import FirstLook, effect_dataset
from errorscreen.exceptions import InputError
from errorscreen.features import CWTTransformer
from errorscreen.learning.generation import contribution_labels
from tests.plants import plant
from tests.toys import oscillator

MACHINE = plant("synchronous_machine")


def test_labels_of_an_effect_are_what_its_strength_changes():
    data = effect_dataset(MACHINE, 60, effects=["exciter", "lag_P"], random_state=0).valid()
    m = len(MACHINE.parameters)
    assert data.names == (*MACHINE.parameters.names, "exciter", "lag_P")
    strengths, labels = data.theta[:, m:], data.contributions[:, m:]
    assert np.array_equal(labels > 0, strengths != 0)
    assert np.all((strengths != 0).sum(axis=1) <= 1)  # one at a time
    assert 0.4 < (strengths != 0).any(axis=1).mean() < 0.95
    # those without an effect are what the parameters alone make
    alone = ~(strengths != 0).any(axis=1)
    assert np.array_equal(data.responses[alone], MACHINE.simulate(data.theta[alone, :m]).values)
    expected = contribution_labels(MACHINE, data.theta[:, :m])
    np.testing.assert_allclose(data.contributions[:, :m], expected, rtol=1e-12)
    # (D5), by hand
    row = int(np.flatnonzero(strengths[:, 1])[0])
    change = data.responses[row] - MACHINE.simulate(data.theta[row, :m]).values[0]
    norm = np.sqrt((change**2).sum(axis=1) * MACHINE.event.dt).mean()
    assert labels[row, 1] == pytest.approx(norm, rel=1e-9)


def test_an_extended_model_is_looked_at_like_any_other():
    extended = plant("synchronous_machine").extend("exciter")
    data = effect_dataset(extended, 20, random_state=0)
    m = len(extended.parameters)
    assert "exciter" not in data.names
    with_effect = int((data.theta[:, m:] != 0).any(axis=1).sum())
    assert data.metadata["n_simulations"] == 20 * (m + 1) + with_effect
    with pytest.raises(InputError, match="'exciter' has been added before"):
        effect_dataset(extended, 20, effects=["exciter", "governor"])


def test_the_same_seed_gives_the_same_samples_for_any_number_of_workers():
    one, two = (effect_dataset(MACHINE, 30, random_state=3, n_jobs=n) for n in (1, 2))
    assert np.array_equal(one.contributions, two.contributions, equal_nan=True)


NEIGHBOURS = make_pipeline(
    CWTTransformer(n_frequencies=16, n_columns=32, sampling_period=1 / 120, output="flat"),
    KNeighborsRegressor(3, weights="distance"),
)


@cache
def large():
    """A machine with a large effect."""
    return draw_plant_scenario(4, 40.0, kind="effect", device="synchronous_machine", least_size=25.0)


@pytest.mark.parametrize(("estimator", "n_samples"), [(NEIGHBOURS, 400), (None, 400)], ids=["own", "network"])
def test_hidden_effects_are_looked_at_first(estimator, n_samples):
    """In errors that it has not seen, each with one of four effects."""
    hidden = large()
    recording, names = hidden.recordings[0], ["stabiliser", "exciter", "lag_P", "offset_Q"]
    look = FirstLook(hidden.simulator, names, n_samples=n_samples, estimator=estimator, random_state=0)
    look.fit(recording)
    assert set(look.ranking_) == set(look.names_)
    assert set(look.effects_) == set(names)
    assert look.contributions(recording) == pytest.approx(look.contributions_)
    with pytest.raises(InputError, match="2 recordings"):
        look.contributions(list(hidden.recordings))
    new = effect_dataset(
        hidden.simulator, 120, recording.event, effects=names, share=1.0, random_state=1
    ).valid()
    m = len(hidden.simulator.parameters)
    found = look.screener_.predict(np.where(recording.mask, new.errors, 0.0))
    assert np.mean(found[:, m:].argmax(axis=1) == new.contributions[:, m:].argmax(axis=1)) > 0.7


def test_what_cannot_be_looked_at_is_refused():
    with pytest.raises(InputError, match="no effects to add"):
        effect_dataset(oscillator(), 10)
    with pytest.raises(InputError, match="unknown effect 'volt_var'"):
        effect_dataset(MACHINE, 10, effects=["volt_var"])
    with pytest.raises(InputError, match="share"):
        effect_dataset(MACHINE, 10, share=1.5)
    with pytest.raises(InputError, match="2 recordings"):
        FirstLook(large().simulator).fit(list(large().recordings))
