import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.linear_model import LinearRegression

from errorscreen import metrics
from errorscreen.exceptions import InputError

FLOATS = st.floats(-10, 10).map(lambda x: round(x, 6))
RNG = np.random.default_rng(0)


def test_error_is_the_quotient_of_equation_23():
    y_meas, y_sim = RNG.standard_normal((2, 50)), RNG.standard_normal((3, 2, 50))
    level = np.array([0.2, -0.1])
    expected = ((y_sim - y_meas) ** 2).sum(-1) / ((y_meas - level[:, None]) ** 2).sum(-1)
    np.testing.assert_allclose(metrics.response_error(y_sim, y_meas, level), expected, rtol=1e-10)


@given(y=arrays(float, (2, 12), elements=FLOATS), scale=st.floats(0.1, 1e3), seed=st.integers(0, 99))
def test_error_does_not_depend_on_the_unit_or_on_what_was_not_measured(y, scale, seed):
    rng = np.random.default_rng(seed)
    y_sim = y + rng.standard_normal(y.shape)
    y[:, 0] += 1.0  # the channel moves, so the quotient is not governed by ε
    level = y.mean(axis=1) + 1.0
    plain = metrics.response_error(y_sim, y, level)
    np.testing.assert_allclose(
        metrics.response_error(scale * y_sim, scale * y, scale * level), plain, rtol=1e-6
    )
    gap = np.pad(y, ((0, 0), (0, 3)), constant_values=np.nan)
    wild = np.pad(y_sim, ((0, 0), (0, 3)), constant_values=1e6)
    np.testing.assert_allclose(metrics.response_error(wild, gap, level), plain, rtol=1e-12)
    np.testing.assert_allclose(metrics.rms(wild, gap), metrics.rms(y_sim, y), rtol=1e-12)
    np.testing.assert_allclose(
        metrics.chi_square(wild, gap, [0.1, 2.0]), metrics.chi_square(y_sim, y, [0.1, 2.0]), rtol=1e-12
    )


def test_perfect_is_zero_resting_is_one_and_a_still_channel_stays_finite():
    y = np.array([[0.0, 1.0, 0.5]])
    assert metrics.response_error(y, y, [0.0]) == 0
    assert metrics.response_error(np.zeros((1, 3)), y, [0.0]) == pytest.approx(1.0)
    assert np.isfinite(metrics.response_error(y, np.zeros((1, 3)), [0.0])).all()


def test_a_failed_simulation_is_nan_and_only_that_row():
    y = np.array([[0.0, 1.0, 0.5]])
    errors = metrics.response_error(np.stack([y, np.full_like(y, np.nan)]), y, [0.0])
    assert errors[0] == 0
    assert np.isnan(errors[1])
    assert np.array_equal(np.isnan(metrics.objective(errors)), [False, True])


def test_level_is_the_mean_of_the_quiet_part_or_the_first_measured_value():
    y = np.array([[1.0, 3.0, 9.0, 9.0], [np.nan, np.nan, 7.0, 8.0], [np.nan] * 4])
    np.testing.assert_array_equal(metrics.quiet_level(y, [0, 1, 2, 3], 2.0), [2.0, 7.0, np.nan])
    np.testing.assert_array_equal(metrics.quiet_level(y, [0, 1, 2, 3], 0.0), [1.0, 7.0, np.nan])


def test_objective_weighs_channels():
    assert metrics.objective([[0.2, 0.4]]) == pytest.approx([0.3])
    assert metrics.objective([0.2, 0.4], weights=[1.0, 0.0]) == pytest.approx(0.2)


@pytest.mark.parametrize("weights", [[1.0], [-1.0, 1.0], [0.0, 0.0], [np.nan, 1.0]])
def test_wrong_weights_are_named(weights):
    with pytest.raises(InputError, match="channel weights"):
        metrics.objective([0.2, 0.4], weights)


def test_reduction_reproduces_the_published_percentages():
    before, after = [0.05684, 0.70012], [0.00833, 0.06940]
    np.testing.assert_allclose(metrics.reduction(before, after), [0.8534, 0.9009], atol=5e-5)
    with pytest.raises(InputError, match="not positive"):
        metrics.reduction(0.0, 1.0)


def test_wrong_shapes_are_named():
    with pytest.raises(InputError, match="do not fit"):
        metrics.rms(np.zeros((2, 5)), np.zeros((2, 6)))
    with pytest.raises(InputError, match="do not fit"):
        metrics.top_k_overlap(np.zeros((2, 5)), np.zeros((2, 6)), 1)


@given(arrays(float, (3, 6), elements=st.floats(0, 10)), st.integers(1, 6), st.permutations(range(6)))
def test_overlap_is_one_for_itself_symmetric_and_blind_to_column_order(y, k, order):
    y = y + np.arange(6) * 1e-3 + np.linspace(0, 1e-4, 3)[:, None]  # no ties, which go by column order
    other = y[::-1]
    assert metrics.top_k_overlap(y, y, k) == 1
    assert metrics.top_k_overlap(y, 2 * y + 1, k) == 1
    overlap = metrics.top_k_overlap(y, other, k)
    assert overlap == metrics.top_k_overlap(other, y, k)
    unique = all(len(np.unique(row)) == 6 for row in y)
    if unique:
        assert metrics.top_k_overlap(y[:, order], other[:, order], k) == overlap


def test_overlap_counts_members_and_refuses_k_above_m():
    assert metrics.top_k_overlap([[4, 3, 2, 1], [4, 3, 2, 1]], [[4, 3, 0, 0], [0, 0, 3, 4]], k=2) == 0.5
    for k in (0, 5, 1.0):
        with pytest.raises(InputError, match="from 1 to 4"):
            metrics.top_k_overlap([4, 3, 2, 1], [4, 3, 2, 1], k=k)


def test_ndcg_matches_its_definition_and_refuses_what_it_cannot_read():
    gains, order = np.array([3.0, 2.0, 0.5]), [1, 0, 2]
    discounts = 1 / np.log2([2, 3, 4])
    expected = (gains[order] * discounts).sum() / (gains * discounts).sum()
    assert metrics.ndcg(gains, [2.0, 3.0, 1.0]) == pytest.approx(expected)
    for true, predicted in (([1.0], [1.0]), ([-1.0, 2.0], [1.0, 2.0]), ([np.nan, 2.0], [1.0, 2.0])):
        with pytest.raises(InputError):
            metrics.ndcg(true, predicted)


def test_scorers_rank_a_good_model_above_a_bad_one():
    X = RNG.standard_normal((40, 3))
    y = np.abs(X @ RNG.standard_normal((3, 6)))
    model = LinearRegression().fit(X, y)
    for scorer, metric in (
        (metrics.overlap_scorer(2), metrics.top_k_overlap),
        (metrics.ndcg_scorer(2), metrics.ndcg),
    ):
        assert scorer(model, X, y) == metric(y, model.predict(X), k=2)
