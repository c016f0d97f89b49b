"""What the errors come from as far as parameters alone can explain them: the verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from errorscreen.data.observations import Observation
from errorscreen.discovery.fits.noise import noise_limit, quiet_part
from errorscreen.simulators.base import Simulator

#: χ²/N below which noise that was stated, not estimated before the event, is far too large
_FAR_BELOW = 0.1


@dataclass(frozen=True)
class Verdict:
    """What the errors come from, as far as the recordings tell.

    Parameters
    ----------
    kind : str
        ``"within-noise"``: nothing to explain; ``"parameters"``: calibration explains the errors; ``"effect"`` and
        ``"measurement"``: something that is named does, see `CauseFinder`; ``"nearest"``: a mechanism explains most of
        the errors, also of recordings that were not fitted, but its form is not that of the unit; ``"unknown"``:
        nothing does, or that cannot be told.
    text : str
        The reasons in plain words.
    """

    kind: Literal["within-noise", "parameters", "effect", "measurement", "nearest", "unknown"]
    text: str


def judge(
    observations: Sequence[Observation],
    before: Sequence[ArrayLike],
    calibrator: Any,
    held_out: Sequence[Observation] = (),
    *,
    passes: tuple[bool, bool] | None = None,
) -> Verdict:
    """Compare the errors before and after the calibration of all parameters with the noise.

    Parameters
    ----------
    observations : sequence of Observation
        What was fitted.
    before : sequence of array-like of shape (R, L)
        Responses of the uncalibrated simulator.
    calibrator : MAPCalibrator
        Fitted on `observations` with all parameters free, because only then residuals say something about the
        model's structure.
    held_out : sequence of Observation
        What was not fitted. Parameters count as the explanation only if they also reproduce these, and so does the
        model as it was.
    passes : (bool, bool), optional
        Whether the errors before and after the calibration pass for noise, where a sharper test has decided that
        (`residual_test`); by `noise_limit` where not given.

    Returns
    -------
    Verdict

    Examples
    --------
    >>> from errorscreen.calibration import MAPCalibrator
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, _ = demo_recordings(0)
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> calibrator = MAPCalibrator(plant, n_starts=2, library_size=64, random_state=0).fit(recording)
    >>> judge([plant.observe(recording)], [plant.baseline()], calibrator).kind
    'parameters'
    """
    limit = noise_limit(observations, before)
    z = [o.deviations(y)[o.mask] for o, y in zip(observations, before, strict=True)]
    nominal = float(np.mean(np.concatenate(z) ** 2))
    fitted = calibrator.chi2_per_sample_
    figures = (
        f"χ²/N is {nominal:.3g} before and {fitted:.3g} after calibration; noise explains up to {limit:.3g}."
    )
    before_passes, after_passes = (nominal <= limit, fitted <= limit) if passes is None else passes
    estimated = any(quiet_part(o).any() for o in observations)
    if after_passes and not before_passes and fitted < (limit**-2 if estimated else _FAR_BELOW):
        moves = "Something else than noise moves before the event: use a window without it, or give"
        return Verdict(
            "unknown",
            "The fitted errors are far below the assumed noise, so nobody can conclude anything from them. "
            f"{figures} {moves if estimated else 'Give'} the noise of the channels.",
        )
    if before_passes:
        return _agreed(figures, calibrator.simulator, held_out)
    if after_passes:
        return _explained(figures, calibrator, held_out)
    if not calibrator.converged_:
        return Verdict(
            "unknown",
            f"The fit did not converge, so nobody can tell whether parameters explain the error. {figures} "
            "Allow more iterations or starts, or narrow the bounds.",
        )
    bounds = [name for name, at in zip(calibrator.names_, calibrator.at_bound_, strict=True) if at]
    pressed = ""
    if bounds:
        pressed = (
            f" At a bound: {', '.join(bounds)}, which points to a missing effect, a wrong bound, or a wrong unit, "
            "base or sign of the recording."
        )
    return Verdict(
        "unknown",
        f"No values of these parameters inside their bounds reproduce the recording. {figures} Calibration removes "
        f"{100 * (1.0 - fitted / nominal):.0f} % of the weighted squared error. A fit from {len(calibrator.starts_)} "
        "starts finds no parameters for the rest, and its cause is not named here. So calibrated values also "
        "compensate for the missing cause: do not take them for measured ones. Rankings assume that parameters carry "
        f"the error.{pressed}",
    )


def held_out_limit(calibrator: Any, observation: Observation) -> tuple[float, float]:
    """χ²/N of a recording that was not fitted, and the largest that noise and uncertain parameters explain.

    Uncertain parameters raise the expected χ²/N by the mean predictive variance, trace(J C Jᵀ)/N with the covariance C
    of the fit and the sensitivities J; six times that is exceeded in about 1 % of cases even if a single direction
    carries it all (χ² with one degree of freedom).

    Parameters
    ----------
    calibrator : MAPCalibrator
        Fitted, with `covariance_`.
    observation : Observation

    Returns
    -------
    value : float
        χ²/N of the recording.
    limit : float
        What noise and uncertain parameters explain.

    Examples
    --------
    >>> from errorscreen.calibration import MAPCalibrator
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, held_out, _ = demo_recordings(0)
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> calibrator = MAPCalibrator(plant, n_starts=2, library_size=64, random_state=0).fit(recording)
    >>> value, limit = held_out_limit(calibrator, plant.observe(held_out[0]))
    >>> value < limit
    True
    """
    simulator, space = calibrator.simulator_, calibrator.simulator_.parameters
    observation = simulator.fit_initial_state(observation)
    columns = [space.index(name) for name in calibrator.names_]
    variances, directions = np.linalg.eigh(calibrator.covariance_)
    steps = np.zeros((len(columns), len(space)))
    steps[:, columns] = (directions * np.sqrt(np.maximum(variances, 0.0))).T
    low, high = space.bounds.T
    theta = np.clip(
        np.vstack([calibrator.theta_[None], calibrator.theta_ + steps, calibrator.theta_ - steps]), low, high
    )
    responses = simulator.simulate(theta, observation.event).values
    z = observation.deviations(responses)[:, observation.mask]
    forward, backward = np.split(z[1:], 2)
    spread = np.nansum((0.5 * (forward - backward)) ** 2, axis=0)
    limit = noise_limit([observation], [responses[0]]) + 6.0 * float(np.mean(spread))
    return float(np.mean(z[0] ** 2)), limit


def _agreed(figures: str, simulator: Simulator, held_out: Sequence[Observation]) -> Verdict:
    """Verdict where the model as it is agrees with the fitted recordings."""

    def limit(observation: Observation) -> tuple[float, float]:
        observation = simulator.fit_initial_state(observation)
        y = simulator.simulate(simulator.parameters.nominal, observation.event).values[0]
        chi2_per_sample = float(np.mean(observation.deviations(y)[observation.mask] ** 2))
        return chi2_per_sample, noise_limit([observation], [y])

    failed = _beyond(held_out, limit)
    if failed:
        return Verdict(
            "unknown",
            "The simulation agrees with the fitted recordings within their noise, but not with held-out ones: "
            f"{', '.join(failed)}. {figures} The error shows only there: fit those recordings.",
        )
    more = f" It also agrees with {_counted(held_out)}." if held_out else ""
    return Verdict(
        "within-noise", f"The simulation agrees with the recording within its noise.{more} {figures}"
    )


def _beyond(
    held_out: Sequence[Observation], limit: Callable[[Observation], tuple[float, float]]
) -> list[str]:
    """Recordings whose χ²/N is above its limit, in words."""
    found = []
    for observation in held_out:
        value, allowed = limit(observation)
        if not value <= allowed:  # also where the simulation failed
            found.append(f"{observation.event.name} (χ²/N {value:.3g}, explained up to {allowed:.3g})")
    return found


def _explained(figures: str, calibrator: Any, held_out: Sequence[Observation]) -> Verdict:
    """Verdict where the fitted recordings are reproduced within noise."""
    failed = _beyond(held_out, partial(held_out_limit, calibrator))
    if failed:
        return Verdict(
            "unknown",
            "Values of the parameters reproduce the fitted recordings, but not held-out ones: "
            f"{', '.join(failed)}. {figures} So they compensate for another cause, which is not named here.",
        )
    judged = (
        f"They also reproduce {_counted(held_out)}."
        if held_out
        else "No recording was held out, so this is not confirmed on another event."
    )
    caution = (
        "A scale error of a measurement, a wrong constant of the model or a weak effect that it lacks can look the "
        "same."
    )
    if not calibrator.converged_:
        return Verdict(
            "parameters",
            f"Values of the parameters reproduce the recording within its noise, but the search did not converge: the "
            f"values are not the best ones and their intervals do not hold. {figures} {judged} {caution}",
        )
    moved = _moved(calibrator)
    names = ", ".join(moved) if moved else "several parameters together, none of them alone"
    return Verdict(
        "parameters",
        f"Values of the parameters reproduce the recording within its noise. {figures} {judged} Their intervals "
        f"exclude the nominal value for: {names}. {caution}",
    )


def _counted(recordings: Sequence[Observation]) -> str:
    """Number of held-out recordings in words."""
    return "one held-out recording" if len(recordings) == 1 else f"{len(recordings)} held-out recordings"


def _moved(calibrator: Any) -> list[str]:
    """Names of the parameters whose interval excludes the nominal value."""
    space = calibrator.simulator.parameters.subset(calibrator.names_)
    low, high = np.asarray(calibrator.intervals_).T
    return [p.name for p, a, b in zip(space, low, high, strict=True) if not a <= p.nominal <= b]
