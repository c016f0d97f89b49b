"""A longer integration step for fits that are only ranked, where its error is well below noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.calibration.problem import FitProblem
from errorscreen.exceptions import InputError

#: factors by which the step may be longer, and parameter vectors from all over the ranges that test it
_FACTORS, _TESTED = (4, 2), 16
#: largest root mean square error of a longer step in multiples of the noise, and share of the vectors that must keep it
_LARGEST, _SHARE = 0.5, 0.9


def rough_step(problem: FitProblem, u: ArrayLike, random_state: Any = 0) -> float | None:
    """Longest step in seconds that is good enough to rank fits; None where only the simulator's own is.
    It is tested at a point u (k,) and at vectors from all over the ranges.
    """
    step = getattr(problem.simulator, "step", None)
    # no step goes beyond the next sample
    longest = max(observation.event.dt for observation in problem.observations)
    if step is None or step >= longest:
        return None
    values = problem.values(np.vstack([u, problem.drawn(_TESTED, random_state)]))
    exact = _measured(problem, values)
    # vectors that fail with the simulator's own step say nothing; those that only fail with the longer one count
    known = np.all([np.isfinite(part).all(axis=1) for part in exact], axis=0)
    for longer in dict.fromkeys(min(factor * step, longest) for factor in _FACTORS):
        rough = problem.with_step(longer)
        try:
            found = _measured(rough, values)
        except InputError:  # an event of the grid must fall on a step
            continue
        well = _added(found, exact) <= _LARGEST
        if well[0] and well[known].mean() >= _SHARE:
            return float(longer)
    return None


def good_enough(problem: FitProblem, u: ArrayLike, step: float | None) -> float | None:
    """The longer step if it is good enough at a point u (k,), else None: friction may need a shorter one."""
    if step is None:
        return None
    values = problem.values(np.atleast_2d(u))
    added = _added(_measured(problem.with_step(step), values), _measured(problem, values))
    return step if added[0] <= _LARGEST else None


def _added(rough: list[NDArray[np.float64]], exact: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Root mean square error (n,) of the longer step in the worst recording; NaN where a simulation fails."""
    parts = [np.sqrt(np.mean((r - e) ** 2, axis=1)) for r, e in zip(rough, exact, strict=True)]
    return np.asarray(np.max(parts, axis=0))


def _measured(problem: FitProblem, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Measured deviations (n, N) of each recording."""
    deviations = problem.deviations(values)
    return [d[:, o.mask] for d, o in zip(deviations, problem.observations, strict=True)]
