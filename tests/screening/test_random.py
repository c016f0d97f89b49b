import numpy as np

from errorscreen.screening import RandomScreener
from tests.toys import linear

SIMULATOR = linear(np.eye(6))


def test_it_ranks_every_parameter_once_and_repeats_itself_for_a_seed():
    one, again = (RandomScreener(SIMULATOR, random_state=3).fit("any recording") for _ in range(2))
    assert sorted(one.ranked_names_) == sorted(SIMULATOR.parameters.names)
    assert one.ranked_names_ == again.ranked_names_
    assert np.all(np.diff(one.contributions_[one.ranking_]) <= 0)
    assert SIMULATOR.calls == 0


def test_every_parameter_comes_first_about_equally_often():
    first = [RandomScreener(SIMULATOR, random_state=seed).fit().ranking_[0] for seed in range(600)]
    # 100 expected for each, standard deviation sqrt(600 * 1/6 * 5/6) = 9.1
    assert np.all(np.abs(np.bincount(first, minlength=6) - 100) < 4 * 9.2)
