r"""Noise-bias correction of fits with injected signals.

The noise of an injected signal moves the simulation. A fit then prefers parameters that pass less noise, and ends
beside the right values: least squares with noise in the regressors (W. A. Fuller, *Measurement Error Models*, 1987,
section 1.1.1). With the energy E of propagated noise,

.. math:: E(u) = \mathrm{E}\,\Big\lVert \Sigma^{-1/2}\big(f(\tilde x + n, u) - f(\tilde x, u)\big)\Big\rVert^2

for the injected signals :math:`\tilde x` as they were recorded and noise n like theirs, the corrected objective

.. math:: \chi^2(u) - E(u) + \sum_j (u_j / s)^2                                                      \qquad (K1)

has the right slope on average (T. Nakamura, "Corrected score function for errors-in-variables models", *Biometrika*
77(1), 1990). E is simulated with added noise, as by J. R. Cook and L. A. Stefanski ("Simulation-extrapolation
estimation in parametric measurement error models", *Journal of the American Statistical Association* 89, 1994). Its
slope stands for it during two iterations, and is renewed. With ten of them, fits of a unit to a small event jumped to
and fro between parameters that pass too much and too little noise.

Steps that all lower (K1) are short along a curved valley, and end before its lowest point. So undamped steps follow,
with a new slope each: they leave the valley and return to it further on. The lowest point of all counts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen.calibration.problem import FitProblem
from errorscreen.calibration.search import BoundedSearch
from errorscreen.simulators.plant.injection_noise import typical

#: most times that the slope is renewed, iterations with each, and least decrease of (K1) in them to go on
_TIMES, _ITERATIONS, _GAIN = 30, 2, 0.1
#: most undamped steps behind them, and least share of its promise that each but the first must keep
_UNDAMPED, _KEPT = 8, 0.5
#: step of its differences in u
_STEP = 1e-2
#: χ²/N above which noise does not matter
_FAR = 10.0


def bias_corrected(search: BoundedSearch, problem: FitProblem, smooth: ArrayLike = True) -> BoundedSearch:
    """Return a search with the best track alone, moved to the minimum of (K1).

    Parameters
    ----------
    search : BoundedSearch
        Is not changed.
    problem : FitProblem
        Of this search.
    smooth : array-like of shape (k,), bool
        Parameters that the energy follows smoothly, also far away; it is taken as constant in the others. All where not
        given.

    Returns
    -------
    BoundedSearch
        Its track has a Jacobian by central differences. Without injected noise it is the best one of `search`.
    """
    search.differentiate([search.best])
    found = search.alone(replace(search.best))
    if not problem.passes_noise or float(np.mean(found.best.residuals**2)) > _FAR:
        return found
    slope, energy = noise_slope(problem, found.best.u)
    for _ in range(_TIMES):
        trial = search.alone(replace(found.best, state="active"))
        trial.tilt(np.where(smooth, slope, 0.0))
        before = trial.untilted - energy
        for _ in range(_ITERATIONS):
            if not trial.iterate():
                break
        slope, energy = noise_slope(problem, trial.best.u)
        after = trial.untilted - energy
        if after < before:  # else the slope has led astray
            found = trial
        if not before - after > _GAIN:
            break
    found = _lowest(found, problem)
    found.best.state = search.best.state
    found.differentiate(found.tracks)
    return found


def _lowest(search: BoundedSearch, problem: FitProblem) -> BoundedSearch:
    """Search at the lowest point of (K1) on undamped steps with a new slope each; the search itself at the start.

    The slope counts in all parameters: where the energy does not follow one smoothly, (K1) is not lower there. The
    first step may leave a curved valley. The next ones return to it if the linear model holds, and else lead nowhere.
    """
    slope, energy = noise_slope(problem, search.best.u)
    lowest = before = search.untilted - energy
    moving = search.alone(replace(search.best))
    for number in range(_UNDAMPED):
        moving.tilt(slope)
        track = moving.undamped(moving.best)
        if track is None:
            break
        moving, promise = moving.alone(track), track.promise
        slope, energy = noise_slope(problem, track.u)
        reached = moving.untilted - energy
        if reached < lowest:
            search, lowest = moving, reached
        if number and before - reached < _KEPT * promise:
            break
        before = reached
    return search


def noise_slope(problem: FitProblem, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Slope (k,) of the energy of propagated noise at u, 0 where a simulation fails, and the energy.

    Examples
    --------
    A larger transient reactance passes less noise.

    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, _ = demo_recordings(0)
    >>> problem = FitProblem(PlantSimulator("synchronous_machine", recording), recording)
    >>> slope, _ = noise_slope(problem, np.zeros(8))
    >>> bool(slope[problem.names.index("Xd1")] < 0)
    True
    """
    lower, upper = problem.scaled_bounds
    inwards = np.where(u <= 0.5 * (lower + upper), _STEP, -_STEP)
    moved = np.clip(u + np.diag(inwards), lower, upper)
    width = np.diag(moved) - u
    energy = problem.propagated_noise(problem.values(np.vstack([u, moved]))).sum(axis=2)
    # within each draw: energies of two draws differ by more than the step changes them
    slope = typical((energy[:, 1:] - energy[:, :1]) / np.where(width != 0, width, 1.0))
    return np.nan_to_num(slope), float(np.nan_to_num(typical(energy[:, 0])))
