"""Phasors that stand in one cell of a text, such as ``230.1+12.3j`` or ``230.1∠12.5``."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
from numpy.typing import NDArray

#: with quantifiers that give nothing back, because a long cell would be tried in all ways else
_NUMBER = r"(?:\d++\.?+\d*+|\.\d++)(?:[eE][+-]?+\d++)?+"
#: real and imaginary part, in brackets or not (Python writes no real part that is zero); magnitude and angle in degrees
_FORMS = (
    rf"\(?([+-]?{_NUMBER}(?=[+-]))?([+-]?{_NUMBER})[ij]\)?",
    rf"\(([+-]?{_NUMBER})[,;]([+-]?{_NUMBER})\)",
    rf"([+-]?{_NUMBER})[∠@]([+-]?{_NUMBER})(?:°|deg)?",
)
_POLAR = 2
#: texts of a phasor without a reading, as numpy and pandas write it
_NONE = r"\(?[+-]?nan(?:[+-]nan[ij])?\)?"


def is_complex(text: str) -> bool:
    """Whether a text holds a complex number.

    Examples
    --------
    >>> [is_complex(one) for one in ("230.1+12.3j", "(230.1, 12.3)", "230.1∠12.5", "230.1 @ 12.5°", "230.1", "1-2")]
    [True, True, True, True, False, False]
    """
    plain = re.sub(r"\s", "", text)
    return any(re.fullmatch(form, one) for form in _FORMS for one in (plain, plain.replace(",", ".")))


def complex_of(texts: pd.Series, decimal: str = ".") -> NDArray[np.complex128]:
    """Complex numbers of texts, with angles in degrees; NaN where a text holds none.

    Examples
    --------
    >>> complex_of(pd.Series(["3+4j", "(3, 4)", "5@90", ""])).round(3)
    array([ 3. +4.j,  3. +4.j,  0. +5.j, nan+nanj])
    """
    plain = texts.astype("string").fillna("").str.replace(r"\s", "", regex=True)
    if decimal == ",":  # a comma between both parts of (230,1; 12,3) must be a semicolon then
        plain = plain.str.replace(",", ".", regex=False)
    found = np.full(len(plain), np.nan, dtype=complex)
    for kind, form in enumerate(_FORMS):
        left = np.flatnonzero(np.isnan(found))
        parts = plain.iloc[left].str.extract(f"^{form}$")
        first, second = (pd.to_numeric(parts[k]).to_numpy(dtype=float, na_value=np.nan) for k in (0, 1))
        if kind == _POLAR:
            found[left] = first * np.exp(1j * np.deg2rad(second))
        else:
            found[left] = np.where(np.isnan(first), 0.0, first) + 1j * second
        if not np.isnan(found).any():
            break
    return found


def is_no_reading(texts: pd.Series) -> NDArray[np.bool_]:
    """Which texts are a complex NaN."""
    plain = texts.astype("string").fillna("").str.replace(r"\s", "", regex=True).str.lower()
    return plain.str.fullmatch(_NONE).to_numpy(dtype=bool)
