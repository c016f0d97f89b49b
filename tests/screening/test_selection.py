from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.utils.estimator_checks import parametrize_with_checks

from errorscreen.exceptions import InputError
from errorscreen.screening import RelativeThresholdSelector, TopKSelector

scores_like = hnp.arrays(float, st.integers(1, 15), elements=st.integers(-3, 9).map(float))


@parametrize_with_checks([TopKSelector(), TopKSelector(1), RelativeThresholdSelector()])
def test_scikit_learn_contract(estimator, check):
    check(estimator)


@given(scores=scores_like, data=st.data())
def test_top_k_takes_the_k_largest_in_order(scores, data):
    k = data.draw(st.integers(1, len(scores)))
    chosen = TopKSelector(k).select(scores)
    assert len(set(chosen)) == k
    np.testing.assert_array_equal(scores[chosen], np.sort(scores)[::-1][:k])
    # equal scores keep their order
    assert all(a < b for a, b in pairwise(chosen) if scores[a] == scores[b])


@given(scores=scores_like, threshold=st.floats(0, 1))
def test_the_threshold_is_relative_to_the_largest(scores, threshold):
    chosen = RelativeThresholdSelector(threshold).select(scores)
    assert scores.argmax() == chosen[0]
    assert np.all(np.diff(scores[chosen]) <= 0)
    left_out = np.delete(scores, chosen)
    if scores.max() > 0:
        assert np.all(scores[chosen] >= threshold * scores.max())
        assert np.all(left_out < threshold * scores.max())
    else:
        assert np.all(scores[chosen] == scores.max())
        assert np.all(left_out < scores.max())


@given(scores=scores_like, factor=st.sampled_from([0.25, 2.0, 1024.0]))
def test_the_unit_of_the_scores_does_not_matter(scores, factor):
    for selector in (TopKSelector(), RelativeThresholdSelector(0.25)):
        np.testing.assert_array_equal(selector.select(factor * scores), selector.select(scores))


def test_fit_uses_the_mean_contribution_and_transform_picks_columns():
    contributions = np.array([[0.0, 4.0, 1.0, 0.2], [0.0, 0.0, 3.0, 0.2]])
    theta = np.arange(12.0).reshape(3, 4)
    top = TopKSelector(2).fit(contributions)
    np.testing.assert_array_equal(top.scores_, [0.0, 2.0, 2.0, 0.2])
    np.testing.assert_array_equal(top.get_support(indices=True), [1, 2])
    np.testing.assert_array_equal(top.transform(theta), theta[:, 1:3])
    np.testing.assert_array_equal(top.inverse_transform(theta[:, 1:3])[:, [0, 3]], np.zeros((3, 2)))
    relative = RelativeThresholdSelector(0.1).fit(contributions)
    np.testing.assert_array_equal(relative.selected_, [1, 2, 3])
    assert list(relative.get_feature_names_out(["a", "b", "c", "d"])) == ["b", "c", "d"]


def test_default_k_is_ten_or_all():
    assert len(TopKSelector().select(np.arange(40.0))) == 10
    assert len(TopKSelector().select(np.arange(4.0))) == 4


def test_composes_in_a_pipeline():
    rng = np.random.default_rng(0)
    contributions = rng.uniform(size=(50, 6)) * [1, 9, 1, 9, 1, 9]
    pipeline = make_pipeline(TopKSelector(3), LinearRegression())
    assert pipeline.fit(contributions, contributions[:, 1::2].sum(axis=1)).score(
        contributions, contributions[:, 1::2].sum(axis=1)
    ) == pytest.approx(1)


@pytest.mark.parametrize(
    ("selector", "message"),
    [
        (TopKSelector(5), "k is 5. Allowed: an integer from 1 to 4"),
        (TopKSelector(0), "k is 0"),
        (TopKSelector(1.5), "k is 1.5"),
        (RelativeThresholdSelector(-0.1), "threshold is -0.1. Allowed: a number >= 0 and <= 1"),
        (RelativeThresholdSelector(10), "threshold is 10"),
    ],
)
def test_options_that_cannot_be_used_are_input_errors(selector, message):
    for call in (lambda: selector.select(np.ones(4)), lambda: selector.fit(np.ones((2, 4)))):
        with pytest.raises(InputError) as caught:
            call()
        assert message in str(caught.value)


@pytest.mark.parametrize("scores", [[], [[1.0, 2.0]], [1.0, np.nan], 3.0])
def test_scores_must_be_one_finite_number_for_each_parameter(scores):
    for selector in (TopKSelector(), RelativeThresholdSelector()):
        with pytest.raises(InputError, match="one finite number for each parameter"):
            selector.select(scores)
