"""Phasors in one cell of a text."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.data.complex_texts import complex_of, is_complex, is_no_reading

NUMBERS = st.floats(-1e9, 1e9, allow_nan=False)


@given(NUMBERS, NUMBERS)
def test_both_parts_come_back(real, imag):
    z = complex(real, imag)
    texts = [
        str(z),
        f"{real!r}{imag:+}i",
        f"( {real!r} , {imag!r} )",
        f"{abs(z)!r}∠{float(np.angle(z, deg=True))!r}",
    ]
    found = complex_of(pd.Series(texts))
    assert found[:3] == pytest.approx(np.array([z, z, z]), rel=1e-14, abs=0)
    assert found[3] == pytest.approx(z, rel=1e-9, abs=1e-9)
    assert all(map(is_complex, texts))


@pytest.mark.parametrize("text", ["230,1+12,3j", "(230,1; 12,3)", "230,44∠3,06"])
def test_decimal_commas(text):
    assert is_complex(text)
    assert complex_of(pd.Series([text]), ",")[0] == pytest.approx(230.1 + 12.3j, rel=1e-3)


@pytest.mark.parametrize(
    "text", ["", "230.1", "1-2", "12:30", "2024-05-01", "j", "1+j2", "∠30", "1@2@3", "(1,2"]
)
def test_other_texts_hold_none(text):
    assert not is_complex(text)
    assert np.isnan(complex_of(pd.Series([text]))).all()


@given(st.text())
def test_any_text_is_read_or_not(text):
    assert is_complex(text) or np.isnan(complex_of(pd.Series([text]))).all()


@pytest.mark.parametrize("text", ["1" * 10**6, "1." * 10**5, "+1" * 10**5, "1e" * 10**5, "1@" * 10**5])
def test_a_long_text_takes_no_longer_than_its_length(text):
    """Tried in all ways, each of them would take hours."""
    assert not is_complex(text)
    assert np.isnan(complex_of(pd.Series([text]))).all()


def test_complex_marks_of_a_gap():
    texts = pd.Series(["nan+nanj", "(nan+0j)", "NaN", "(nan+nanj)", "1+2j"])
    assert is_no_reading(texts).tolist() == [True, False, True, True, False]
