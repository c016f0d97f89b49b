import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from errorscreen._runtime.sampling import generator, latin_hypercube
from errorscreen.exceptions import InputError
from errorscreen.parameters import Parameter, ParameterSpace

SPACE = ParameterSpace([Parameter("a", 1.0, 0.7, 1.3), Parameter("b", -2.0, -5.0, 4.0)])


@given(n=st.integers(1, 60), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_every_interval_of_every_parameter_holds_one_sample(n, seed):
    theta = latin_hypercube(SPACE, n, seed)
    lower, upper = SPACE.bounds.T
    assert theta.shape == (n, 2)
    assert np.all((theta >= lower) & (theta <= upper))
    cells = np.floor((theta - lower) / (upper - lower) * n * (1 - 1e-12)).astype(int)
    for column in cells.T:
        assert sorted(column) == list(range(n))


def test_the_same_seed_gives_the_same_samples_in_every_form():
    expected = latin_hypercube(SPACE, 7, 5)
    assert np.array_equal(latin_hypercube(SPACE, 7, np.random.default_rng(5)), expected)
    assert np.array_equal(latin_hypercube(SPACE, 7, np.random.SeedSequence(5)), expected)
    assert not np.array_equal(latin_hypercube(SPACE, 7, 6), expected)
    legacy = [latin_hypercube(SPACE, 7, np.random.RandomState(5)) for _ in range(2)]
    assert np.array_equal(*legacy)


def test_a_generator_moves_on_and_none_is_fresh():
    rng = np.random.default_rng(1)
    assert not np.array_equal(latin_hypercube(SPACE, 4, rng), latin_hypercube(SPACE, 4, rng))
    assert generator(rng) is rng
    assert not np.array_equal(latin_hypercube(SPACE, 4), latin_hypercube(SPACE, 4))


@pytest.mark.parametrize("n", [0, -3, 2.5, True, "ten"])
def test_a_wrong_number_of_samples_is_named(n):
    with pytest.raises(InputError, match="the number of samples is"):
        latin_hypercube(SPACE, n)


def test_an_empty_space_and_a_wrong_seed_are_named():
    with pytest.raises(InputError, match="space is empty"):
        latin_hypercube(ParameterSpace([]), 3)
    for seed in (-1, "x", 1.5):
        with pytest.raises(InputError, match="random_state is"):
            latin_hypercube(SPACE, 3, seed)
