"""Curves over time in the report: what its page draws, thinned so that a long record stays small."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: most samples of one panel; a screen has fewer columns
MOST = 20_000


@dataclass(frozen=True)
class Curve:
    """One curve of a panel.

    Parameters
    ----------
    name : str
        For the legend.
    role : {"measured", "before", "after", "extended", "input"}
        Decides colour and stroke.
    values : array-like of shape (L,)
        NaN where there is nothing.
    """

    name: str
    role: Literal["measured", "before", "after", "extended", "input"]
    values: ArrayLike


@dataclass(frozen=True)
class Panel:
    """Curves of one quantity; `label` names it with its unit."""

    label: str
    curves: tuple[Curve, ...]


@dataclass(frozen=True)
class Chart:
    """Panels over the same time axis.

    Parameters
    ----------
    time : ndarray of shape (L,)
        Seconds.
    start : float
        Start of the event.
    panels : tuple of Panel
    """

    time: NDArray[np.float64]
    start: float
    panels: tuple[Panel, ...]

    @property
    def thinned(self) -> bool:
        """Whether some samples are left out."""
        return len(self.time) > MOST

    def packed(self) -> str:
        """JSON for the page; numbers as base64 of little-endian floats, times with 64 bits and values with 32."""
        panels = []
        for panel in self.panels:
            keep = kept([np.asarray(curve.values, dtype=float) for curve in panel.curves], MOST)
            curves = [
                {"name": c.name, "role": c.role, "values": _base64(np.asarray(c.values)[keep], "<f4")}
                for c in panel.curves
            ]
            panels.append({"label": panel.label, "time": _base64(self.time[keep], "<f8"), "curves": curves})
        # "</" would end the script that holds it
        return json.dumps({"start": self.start, "panels": panels}).replace("<", "\\u003c")


def kept(curves: Sequence[NDArray[np.float64]], most: int) -> NDArray[np.intp]:
    """Samples that show the course of curves (L,): the least and the largest value of each in each stretch of time.

    Parameters
    ----------
    curves : sequence of ndarray of shape (L,)
    most : int
        Largest number of samples, the first and the last included.

    Returns
    -------
    ndarray of int
        Increasing; all samples where there are not more than `most`.

    Examples
    --------
    >>> spike = np.zeros(1000)
    >>> spike[617] = 1.0
    >>> found = kept([spike], 50)
    >>> len(found) <= 50, 617 in found
    (True, True)
    """
    length = len(curves[0])
    if length <= most:
        return np.arange(length)
    stretches = max((most - 2) // (2 * len(curves)), 1)
    edges = np.linspace(0, length, stretches + 1).astype(int)
    found = {0, length - 1}
    for values in curves:
        low, high = np.where(np.isnan(values), np.inf, values), np.where(np.isnan(values), -np.inf, values)
        for begin, end in pairwise(edges.tolist()):
            found |= {begin + int(low[begin:end].argmin()), begin + int(high[begin:end].argmax())}
    return np.array(sorted(found))


def _base64(values: NDArray[np.float64], kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
