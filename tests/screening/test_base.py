"""A ranking as text, figure and data frame."""

import numpy as np
import pandas as pd
import pytest
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LinearRegression

from errorscreen.screening import ContributionScreener, RandomScreener
from tests.toys import linear

SIMULATOR = linear(np.eye(4))


def test_a_fitted_screener_shows_its_ranking():
    screener = RandomScreener(SIMULATOR, random_state=0).fit()
    frame = screener.to_frame()
    assert tuple(frame["parameter"]) == screener.ranked_names_
    assert frame.index.tolist() == [1, 2, 3, 4]
    np.testing.assert_array_equal(frame["contribution"], np.sort(screener.contributions_)[::-1])
    assert [line.split()[0] for line in screener.summary().splitlines()[1:]] == list(frame["parameter"])
    (axes,) = screener.plot().axes
    assert [text.get_text() for text in axes.get_yticklabels()] == list(frame["parameter"])
    for html in (screener._repr_html_(), screener._repr_mimebundle_()["text/html"]):
        assert f"<td>{screener.ranked_names_[0]}</td>" in html
    assert repr(screener).startswith("RandomScreener(")
    assert len(repr(screener)) < 200


def test_an_unfitted_screener_has_no_ranking_yet():
    screener = RandomScreener(SIMULATOR)
    for show in (screener.summary, screener.plot, screener.to_frame):
        with pytest.raises(NotFittedError):
            show()
    assert "RandomScreener" in screener._repr_html_()


def test_the_contributions_of_one_error_are_a_ranking():
    errors = np.random.default_rng(0).normal(size=(30, 6))
    screener = ContributionScreener(LinearRegression(), ["a", "b"], whiten=False)
    found = screener.fit(errors, errors[:, :2]).ranking_of(errors[0])
    assert found.ranked_names == screener.rank_names(errors[:1])[0]
    assert isinstance(found.to_frame(), pd.DataFrame)
    assert len(repr(found)) < 200
    assert "<td>a</td>" in found._repr_html_()
