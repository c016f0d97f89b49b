import numpy as np
import pytest
from sklearn.base import clone
from sklearn.linear_model import LinearRegression, RidgeCV
from sklearn.metrics import make_scorer
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.utils.estimator_checks import parametrize_with_checks

from errorscreen.exceptions import InputError
from errorscreen.features import ChannelScaler, CWTTransformer, ErrorWhitener, ResponseErrorTransformer
from errorscreen.learning.generation import generate_dataset
from errorscreen.learning.regressors import CNNContributionRegressor
from errorscreen.metrics import top_k_overlap
from errorscreen.screening import ContributionScreener, contribution_pipeline
from tests.plants import dip, plant

TIME = np.arange(128) * 0.03
NOMINAL = np.array([0.3, 0.5, 0.2, 1.0, 1.5, 0.4, 0.3, 0.25])


def respond(theta):
    """Two channels of a plant in closed form: a recovering dip with a damped swing, and a lag."""
    dip, recovery, swing, damping, frequency, power, lag, coupling = theta.T[:, :, None]
    wave = swing * np.exp(-damping * TIME) * np.sin(2 * np.pi * frequency * TIME)
    voltage = 1 - dip * np.exp(-TIME / recovery) + wave
    return np.stack([voltage, power * (1 - np.exp(-TIME / lag)) + coupling * (voltage - 1)], axis=1)


def dataset(n, seed):
    """Response errors of plants that deviate by up to 30 %, and the labels of equations (12)–(15)."""
    theta = NOMINAL * np.random.default_rng(seed).uniform(0.7, 1.3, size=(n, 8))
    steps = np.repeat(theta[:, None], 8, axis=1) * (1 + 1e-4 * np.eye(8))
    moved = respond(steps.reshape(-1, 8)).reshape(n, 8, -1)
    sensitivity = np.linalg.norm(moved - respond(theta).reshape(n, 1, -1), axis=2) / 1e-4
    return respond(theta) - respond(NOMINAL[None]), np.abs(theta / NOMINAL - 1) * sensitivity


def small_pipeline(max_epochs=30):
    return make_pipeline(
        CWTTransformer(sampling_period=0.03, f_max=8, n_frequencies=16, n_columns=32, signed="compressed"),
        ChannelScaler(),
        CNNContributionRegressor(max_epochs=max_epochs, random_state=0),
    )


TINY = make_pipeline(
    CWTTransformer(n_frequencies=8, n_columns=16, signed="compressed"),
    ChannelScaler(),
    CNNContributionRegressor((8, 8, 8), 16, lr=3e-3, random_state=0),
)


@parametrize_with_checks(
    [
        ContributionScreener(TINY),
        ContributionScreener(LinearRegression(), noise=0.01, n_copies=2, random_state=0),
    ]
)
def test_scikit_learn_contract(estimator, check):
    check(estimator)


def test_ranks_better_than_what_needs_no_network():
    errors, contributions = dataset(600, 1)
    test_errors, test_contributions = dataset(300, 2)
    overlaps = []
    for seed in range(2):  # one network varies by 0.01, also with the processor and its number of threads
        pipeline = small_pipeline().set_params(cnncontributionregressor__random_state=seed)
        screener = ContributionScreener(pipeline).fit(errors, contributions)
        overlaps.append(top_k_overlap(test_contributions, screener.predict(test_errors), k=3))
    overlap = np.mean(overlaps)
    mean = np.tile(contributions.mean(axis=0), (300, 1))
    ridge = RidgeCV(np.logspace(-6, 2, 9)).fit(errors.reshape(600, -1), contributions)
    linear = ridge.predict(test_errors.reshape(300, -1))
    assert overlap > top_k_overlap(test_contributions, mean, k=3) + 0.05
    assert overlap > top_k_overlap(test_contributions, linear, k=3) + 0.01


def test_ranking_follows_the_prediction():
    errors, contributions = dataset(40, 3)
    names = [f"p{j}" for j in range(8)]
    screener = ContributionScreener(small_pipeline(2), names).fit(errors, contributions)
    predicted, order = screener.predict(errors), screener.rank(errors)
    assert screener.names_ == tuple(names)
    assert np.all(np.diff(np.take_along_axis(predicted, order, axis=1), axis=1) <= 0)
    assert screener.rank_names(errors[:1]) == [tuple(f"p{j}" for j in order[0])]
    np.testing.assert_array_equal(np.sort(order, axis=1), np.tile(np.arange(8), (40, 1)))


def test_equal_contributions_keep_their_order():
    constant = ContributionScreener(LinearRegression()).fit(
        np.zeros((4, 3)), np.tile([1.0, 2.0, 2.0, 0.5], (4, 1))
    )
    np.testing.assert_array_equal(constant.rank(np.zeros((1, 3))), [[1, 2, 0, 3]])
    single = ContributionScreener(LinearRegression()).fit(np.zeros((4, 3)), np.ones(4))
    np.testing.assert_array_equal(single.rank(np.zeros((2, 3))), [[0], [0]])
    assert single.names_ == ("parameter_0",)


def test_grid_search_over_wavelet_and_network_width():
    errors, contributions = dataset(90, 4)
    search = GridSearchCV(
        ContributionScreener(small_pipeline(3)),
        {
            "estimator__cwttransformer__wavelet": ["cmor2.0-1.0", "mexh"],
            "estimator__cnncontributionregressor__n_filters": [(4, 4, 4), (8, 8, 8)],
        },
        scoring=make_scorer(top_k_overlap, k=3),
        cv=2,
        error_score="raise",
    ).fit(errors, contributions)
    assert len(search.cv_results_["params"]) == 4
    assert search.best_score_ > 0.6  # by chance: 0.375
    assert search.predict(errors).shape == contributions.shape


def test_grid_search_on_errors_of_a_simulated_plant():
    simulator = plant("pv_plant", dip(stop=2.5))
    data = generate_dataset(simulator, 80, random_state=0)
    pipeline = make_pipeline(
        ResponseErrorTransformer(data.baseline),
        CWTTransformer(sampling_period=1 / 60, n_frequencies=12, n_columns=24, signed="compressed"),
        ChannelScaler(),
        CNNContributionRegressor((8, 8, 8), 16, max_epochs=15, random_state=0),
    )
    search = GridSearchCV(
        ContributionScreener(pipeline, simulator.parameters.names),
        {
            "estimator__cwttransformer__energy": ["log", "linear"],
            "estimator__cnncontributionregressor__n_hidden": [8, 16],
        },
        scoring=make_scorer(top_k_overlap, k=5),
        cv=2,
        error_score="raise",
    ).fit(data.responses, data.contributions)
    assert search.best_score_ > 0.5  # by chance: 0.29
    ranked = search.best_estimator_.rank_names(data.responses[:1])[0]
    assert sorted(ranked) == sorted(simulator.parameters.names)


def test_the_default_estimator_is_the_papers_pipeline():
    errors, contributions = dataset(12, 5)
    screener = ContributionScreener(random_state=0)
    first = clone(screener).fit(errors, contributions).predict(errors)
    assert list(screener.fit(errors, contributions).estimator_.named_steps) == list(
        contribution_pipeline().named_steps
    )
    np.testing.assert_array_equal(screener.predict(errors), first)
    assert np.all(first >= 0)


class Remember(LinearRegression):
    """Keeps what it was fitted on."""

    def fit(self, X, y):
        self.seen_ = X.copy(), y.copy()
        return super().fit(X.reshape(len(X), -1), y)


def test_noise_can_differ_from_sample_to_sample():
    errors, contributions = np.zeros((4, 2, 10)), np.ones((4, 3))
    noise = np.ones((2, 10))
    noise[1, 3:6] = 0.0  # nothing was measured there
    screener = ContributionScreener(Remember(), noise=noise, whiten=False, random_state=0).fit(
        errors, contributions
    )
    seen = screener.estimator_.seen_[0]
    assert np.all(seen[:, 1, 3:6] == 0)
    assert np.all(seen[:, 0] != 0)


def test_noise_is_added_to_the_training_errors_only():
    errors, contributions = dataset(400, 6)
    noise = np.array([0.02, 0.5])
    screener = ContributionScreener(Remember(), noise=noise, n_copies=3, whiten=False, random_state=0).fit(
        errors, contributions
    )
    seen, labels = screener.estimator_.seen_
    assert seen.shape == (1200, 2, 128)
    np.testing.assert_array_equal(labels, np.repeat(contributions, 3, axis=0))
    added = (seen - np.repeat(errors, 3, axis=0)) / noise[:, None]
    np.testing.assert_allclose(added.std(axis=(0, 2)), 1, rtol=0.02)
    np.testing.assert_allclose(added.mean(axis=(0, 2)), 0, atol=0.02)
    assert np.abs(np.corrcoef(added[:3].reshape(3, -1)) - np.eye(3)).max() < 0.3
    # the noise of a sample is its own, whatever comes after it
    fewer = clone(screener).fit(errors[:50], contributions[:50]).estimator_.seen_[0]
    np.testing.assert_array_equal(fewer, seen[:150])


def test_the_estimator_sees_whitened_errors_with_whitened_noise():
    errors, contributions = dataset(60, 6)
    noise = np.array([0.02, 0.5])
    raw, white = (
        ContributionScreener(Remember(), noise=noise, whiten=whiten, random_state=0).fit(
            errors, contributions
        )
        for whiten in (False, True)
    )
    whitener = ErrorWhitener(noise).fit(errors)
    np.testing.assert_array_equal(white.estimator_.seen_[0], whitener.transform(raw.estimator_.seen_[0]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"parameter_names": ["a", "b"]}, "Allowed: 8 different names, one for each column of y"),
        ({"parameter_names": ["a"] * 8}, "Allowed: 8 different names"),
        ({"noise": [0.1, 0.1, 0.1]}, "Allowed: a finite number >= 0 for each of 2 channels"),
        ({"noise": -1.0}, "noise is -1.0"),
        ({"noise": 0.1, "n_copies": 0}, "n_copies is 0"),
    ],
)
def test_options_that_cannot_be_used_are_input_errors(options, message):
    with pytest.raises(InputError) as caught:
        ContributionScreener(Remember(), **options).fit(*dataset(5, 0))
    assert message in str(caught.value)


def test_an_error_of_another_length_is_an_input_error():
    errors, contributions = dataset(5, 0)
    screener = ContributionScreener(Remember()).fit(errors, contributions)
    with pytest.raises(InputError, match=r"\(n, 2, 128\), as in fit"):
        screener.predict(errors[..., :100])
