"""A longer step of the integration for what is only ranked, where its error is well below noise.

Most simulations of a search say which of many starts or effects is worth going on with. What the integration adds to
their errors hardly matters there, as long as it is less than noise. All that is compared with noise, or named, has the
step of the simulator.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.calibration.problem import FitProblem
from errorscreen.exceptions import InputError

#: times by which the step may be longer, and how many parameter vectors all over the ranges are asked
_TIMES, _ASKED = (4, 2), 16
#: root mean square that a longer step may add to the deviations of a recording, in multiples of the noise, and the
#: share of the vectors for which it must not be more
_BELOW, _SHARE = 0.5, 0.9


def rough_step(problem: FitProblem, u: ArrayLike, random_state: Any = 0) -> float | None:
    """Longest step in seconds that is good enough to rank fits; None where there is none beside the simulator's own.

    Parameters
    ----------
    problem : FitProblem
    u : array-like of shape (k,)
        Fitted deviations in multiples of the scales, which must be among those for which it is good enough.
    random_state : None, int, SeedSequence, Generator or RandomState
        Of the other parameter vectors.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, _ = demo_recordings(0)
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> problem = FitProblem(plant, recording)
    >>> plant.step, round(rough_step(problem, np.zeros(len(problem.names))), 4)
    (0.0025, 0.0083)
    """
    step = getattr(problem.simulator, "step", None)
    # a step never goes beyond the next instant that is compared
    longest = max(observation.event.dt for observation in problem.observations)
    if step is None or step >= longest:
        return None
    values = problem.values(np.vstack([u, problem.drawn(_ASKED, random_state)]))
    exact = _measured(problem, values)
    # what the simulator's own step cannot simulate says nothing; what only the longer one cannot counts against it
    known = np.all([np.isfinite(part).all(axis=1) for part in exact], axis=0)
    for longer in dict.fromkeys(min(times * step, longest) for times in _TIMES):
        rough = problem.with_step(longer)
        try:
            found = _measured(rough, values)
        except InputError:  # the grid must change on a step, and does not on one so long
            continue
        well = _added(found, exact) <= _BELOW
        if well[0] and well[known].mean() >= _SHARE:
            return float(longer)
    return None


def good_enough(problem: FitProblem, u: ArrayLike, step: float | None) -> float | None:
    """A longer step where it ranks a problem well at a point u (k,); None where it does not, or none is given.

    What is good enough without effects may not be so with one: friction that holds a shaft at rest, a clock that is a
    fraction of a step late.
    """
    if step is None:
        return None
    values = problem.values(np.atleast_2d(u))
    added = _added(_measured(problem.with_step(step), values), _measured(problem, values))
    return step if added[0] <= _BELOW else None


def _added(rough: list[NDArray[np.float64]], exact: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Largest root mean square (n,) that the longer step adds to a recording; NaN where it cannot be simulated."""
    parts = [np.sqrt(np.mean((r - e) ** 2, axis=1)) for r, e in zip(rough, exact, strict=True)]
    return np.asarray(np.max(parts, axis=0))


def _measured(problem: FitProblem, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Deviations (n, N) of each recording, where something was measured."""
    deviations = problem.deviations(values)
    return [d[:, o.mask] for d, o in zip(deviations, problem.observations, strict=True)]
