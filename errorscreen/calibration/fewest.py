"""Fewest parameters that reproduce recordings: what has to change in a model file, and nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2 as chi2_distribution

from errorscreen.calibration.map import MAPCalibrator
from errorscreen.calibration.problem import FitProblem
from errorscreen.exceptions import InputError, check_integer, check_real
from errorscreen.simulators.base import Simulator

#: values over the range of each further parameter at which its fit may start
_SCANNED = 7
#: fits of each size, of the most promising further parameters
_TRIED = 6
#: probability that noise alone exceeds the limit for χ²
_CHANCE = 0.01


def fewest_parameters(
    simulator: Simulator,
    recordings: Any,
    names: Iterable[str] | None = None,
    *,
    most: int = 6,
    factor: float = 1.0,
    enough: float | None = None,
    **options: Any,
) -> MAPCalibrator | None:
    r"""Calibrate the fewest parameters that reproduce the recordings; the others keep their nominal values.

    Forward selection: to the parameters so far, each other one is added at the best of several values over its range,
    and the most promising ones are fitted. The best stays. The selection ends where noise explains the rest, or where

    .. math:: \mathrm{BIC} = \chi^2 + k\,\ln N

    falls no further (G. Schwarz, Ann. Statist. 6, 1978). A parameter that later ones make superfluous is left out.

    Parameters
    ----------
    simulator : Simulator
    recordings : Recording, Observation, or a list of them
    names : iterable of str, optional
        Parameters that may move; all where not given.
    most : int, default 6
        Largest number of parameters.
    factor : float, default 1
        Each parameter must lower χ² by this factor. Where the form of a model leaves an error, further parameters make
        up for it bit by bit; what is wrong lowers it by far.
    enough : float, optional
        χ²/N at which the selection ends; what noise alone exceeds with a probability of 1 % where not given.
    **options
        Options of `MAPCalibrator`, for example ``prior_scale`` or ``level``.

    Returns
    -------
    MAPCalibrator or None
        Fitted, with intervals; None where the nominal values are the best.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, truth = demo_recordings(0)
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> plant = plant.with_nominal([truth[name] * (1.2 if name == "Xd1" else 1.0) for name in plant.parameters.names])
    >>> fewest_parameters(plant, recording).names_
    ('Xd1',)
    """
    problem = FitProblem(simulator, recordings, names)
    most, factor = check_integer(most, "most"), check_real(factor, "factor", low=1.0)
    nominal = problem.space.nominal
    price = float(np.log(problem.n_values))
    chi2 = float(np.nan_to_num(problem.chi_square(nominal)[0], nan=np.inf))
    best: MAPCalibrator | None = None
    score = chi2
    limit = chi2_distribution.isf(_CHANCE, problem.n_values) if enough is None else enough * problem.n_values
    while chi2 > limit and (best is None or (len(best.names_) < most and best.chi2_ > limit)):
        grown = _best_fit(problem, () if best is None else tuple(best.names_), best, options)
        if grown is None or not grown.chi2_ + price * len(grown.names_) < score:
            break
        if not factor * grown.chi2_ < (chi2 if best is None else best.chi2_):
            break
        best, score = grown, grown.chi2_ + price * len(grown.names_)
    while best is not None and len(best.names_) > 1:
        shorter = [
            _fit(problem, [n for n in best.names_ if n != left], best, options) for left in best.names_[:-1]
        ]
        least = min(shorter, key=lambda fit: fit.chi2_)
        if least.chi2_ + price * len(least.names_) > score:
            break
        best, score = least, least.chi2_ + price * len(least.names_)
    return best


def _best_fit(
    problem: FitProblem, chosen: Sequence[str], last: MAPCalibrator | None, options: dict[str, Any]
) -> MAPCalibrator | None:
    """Best fit of the chosen parameters and one more; None where every simulation fails."""
    current = _values(problem, last)
    lower, upper = problem.space.bounds.T
    others = [i for i, name in enumerate(problem.names) if name not in chosen]
    shares = np.linspace(0.0, 1.0, _SCANNED)
    starts = np.repeat(current[None], len(others) * _SCANNED, axis=0)
    for row, i in enumerate(others):
        starts[row * _SCANNED : (row + 1) * _SCANNED, i] = lower[i] + shares * (upper[i] - lower[i])
    cost = problem.chi_square(starts).reshape(len(others), _SCANNED)
    cost = np.where(np.isfinite(cost), cost, np.inf)
    if not others or not np.isfinite(cost).any():
        return None
    gain = _linear(problem, current, [problem.names.index(name) for name in chosen])[others]
    promising = {*np.argsort(cost.min(axis=1), kind="stable")[: _TRIED // 2].tolist()}
    promising |= {*np.argsort(gain, kind="stable")[: _TRIED - _TRIED // 2].tolist()}
    fits = []
    for row in sorted(promising):
        start = starts[row * _SCANNED + int(cost[row].argmin())].copy()
        fits.append(_fit(problem, [*chosen, problem.names[others[row]]], last, options, start))
    return min(fits, key=lambda fit: fit.chi2_)


def _linear(problem: FitProblem, values: NDArray[np.float64], chosen: list[int]) -> NDArray[np.float64]:
    """χ² that a linear model promises for each further parameter, beside the chosen ones, shape (k,)."""
    u = problem.scaled(values)
    steps = 1e-4 * np.where(u + 1e-4 <= problem.scaled_bounds[1], 1.0, -1.0)
    residuals = problem.residuals(problem.values(np.vstack([u, u + np.diag(steps)])))
    columns = np.nan_to_num((residuals[1:] - residuals[0]) / steps[:, None])
    rest = np.nan_to_num(residuals[0])
    if chosen:
        basis, _ = np.linalg.qr(columns[chosen].T)
        rest = rest - basis @ (basis.T @ rest)
        columns = columns - (columns @ basis) @ basis.T
    length = np.maximum((columns**2).sum(axis=1), 1e-12)
    return np.asarray((rest**2).sum() - (columns @ rest) ** 2 / length)


def _fit(
    problem: FitProblem,
    names: Sequence[str],
    last: MAPCalibrator | None,
    options: dict[str, Any],
    start: NDArray[np.float64] | None = None,
) -> MAPCalibrator:
    """Fit some parameters from the given values, or from those of the last fit."""
    values = _values(problem, last) if start is None else start
    if "n_starts" in options or "starts" in options:
        raise InputError("n_starts and starts follow from the selection", where="fewest_parameters")
    calibrator = MAPCalibrator(problem.simulator, names, n_starts=1, starts=problem.embed(values), **options)
    return calibrator.fit(problem.observations)


def _values(problem: FitProblem, last: MAPCalibrator | None) -> NDArray[np.float64]:
    """Values of all selectable parameters in a fit, nominal before the first."""
    values = problem.space.nominal.copy()
    if last is not None:
        for name, value in last.values_.items():
            values[problem.names.index(name)] = value
    return values
