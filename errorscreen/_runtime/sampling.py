"""Samples of a parameter space."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from errorscreen.exceptions import InputError, check_integer
from errorscreen.parameters import ParameterSpace


def generator(random_state: Any = None) -> np.random.Generator:
    """Generator for a ``random_state``, or `InputError`. A Generator is returned itself; None draws fresh entropy."""
    if isinstance(random_state, np.random.RandomState):
        # one draw: the same state gives the same samples, and the next call gives others
        random_state = random_state.randint(2**31 - 1)
    try:
        return np.random.default_rng(random_state)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"random_state is {random_state!r}",
            allowed="None, an integer from 0 on, a SeedSequence, a Generator or a RandomState",
        ) from error


def latin_hypercube(space: ParameterSpace, n: int, random_state: Any = None) -> NDArray[np.float64]:
    """Latin hypercube of shape (n, m) inside the bounds of m parameters, in their units, equation (1).

    Each parameter's range is cut into `n` intervals of equal width, and each interval holds one sample.

    Examples
    --------
    >>> from errorscreen.parameters import Parameter, ParameterSpace
    >>> space = ParameterSpace([Parameter("H", 5.0, 3.5, 6.5, unit="s")])
    >>> theta = latin_hypercube(space, 3, random_state=0)
    >>> np.floor((np.sort(theta[:, 0]) - 3.5) / 1.0)
    array([0., 1., 2.])
    """
    n = check_integer(n, "the number of samples")
    if not len(space):
        raise InputError("the parameter space is empty", allowed="at least one parameter")
    unit = qmc.LatinHypercube(len(space), rng=generator(random_state)).random(n)
    lower, upper = space.bounds.T
    # not qmc.scale: rounding must not put a sample outside the bounds
    return np.clip(lower + unit * (upper - lower), lower, upper)
