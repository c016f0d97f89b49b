"""Outcome of a study: the result that is written, and the responses that are drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from errorscreen.report import Result
from errorscreen.workflow.study import Study


@dataclass(frozen=True)
class Outcome:
    """Outcome of a study.

    Parameters
    ----------
    study : Study
    result : Result
    responses : dict of str to tuple of ndarray of shape (R, L)
        Of each model of ``result.models`` to each of ``study.observations``, by label.
    """

    study: Study
    result: Result
    responses: dict[str, tuple[NDArray[np.float64], ...]]
