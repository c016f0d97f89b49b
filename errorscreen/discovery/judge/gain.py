r"""What an extension of a model gains on events that were not fitted, against the best the old model can do.

With the squared deviations z of the recalibrated and of the extended model over all held-out events, the gain is

.. math:: g = 1 - \frac{\sum z_{ext}^2}{\sum z_{recal}^2}                                        \qquad (D4)

Its interval comes from a bootstrap over events and, within each, over blocks of time (the circular block bootstrap of
Politis and Romano, in *Exploring the Limits of Bootstrap*, 1992, because errors are smooth in time).
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.sampling import generator
from errorscreen._runtime.typed import Real
from errorscreen.calibration import MAPCalibrator
from errorscreen.data.observations import Observation
from errorscreen.data.signals import correlation_time
from errorscreen.discovery.fits.hypotheses import PRIOR
from errorscreen.exceptions import DataWarning, check_real
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import as_observations, with_initial_states

#: number of resampled sets
_RESAMPLED = 1000
#: length of the blocks in correlation times of the error, and how many there are at least
_BLOCK, _FEWEST_BLOCKS = 2.0, 4
#: wrong effects that are fitted, of which the best is the placebo: one alone may fit badly by chance
_PLACEBOS = 3

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class EventGain:
    """Rms of the deviations on one held-out event, in multiples of what is uncertain.

    Parameters
    ----------
    recording : str
    baseline, recalibrated, extended : float
        Of the model as it was, with calibrated parameters, and with what was added.
    """

    recording: str
    baseline: Real
    recalibrated: Real
    extended: Real


@dataclass(frozen=True)
class Gain:
    """Gain on events that were not fitted.

    Parameters
    ----------
    baseline, recalibrated, extended : float
        Rms of the deviations over all held-out events, in multiples of what is uncertain.
    gain : float
        (D4): 1 removes all of the error, 0 is no gain, negative a loss.
    interval : (float, float)
        Of the gain.
    level : float
        Probability of the interval.
    placebo : float or None
        Gain of the placebo; None where there is none.
    extension_parameters, placebo_parameters : int
        How many parameters the extension has, and the placebo.
    events : tuple of EventGain
    """

    baseline: Real
    recalibrated: Real
    extended: Real
    gain: Real
    interval: tuple[Real, Real]
    level: Real
    placebo: float | None
    events: tuple[EventGain, ...]
    extension_parameters: int = 0
    placebo_parameters: int = 0

    @property
    def holds(self) -> bool:
        """Whether the interval excludes no gain, and the placebo gains less, where both can be told."""
        told = any(np.isfinite(event.recalibrated) for event in self.events)
        return self.interval[0] > 0 and (self.placebo is None or not told or self.gain > self.placebo)


def measure_gain(
    old: Simulator,
    extended: Simulator,
    held_out: Any,
    *,
    fitted: Any = None,
    recalibrated: Simulator | None = None,
    placebo: Simulator | None = None,
    level: float = 0.9,
    random_state: Any = 0,
) -> Gain:
    """Compare simulators, each at its nominal values, on recordings that none of them was fitted to.

    All of them take the step of `extended`: a smaller one is no gain.

    Parameters
    ----------
    old : Simulator
        Without the extension.
    extended : Simulator
        With what was found, at its fitted values.
    held_out : Observation, or anything ``old.observe`` takes, or a list of them
    fitted : Observation, or anything ``old.observe`` takes, or a list of them, optional
        What `extended` was fitted to. Unless they are given, `recalibrated` and the best of some wrong effects, as
        `placebo`, are fitted to it.
    recalibrated : Simulator, optional
        The old model with the parameters that fit best without the extension: the fair baseline. Without it and without
        `fitted` the old model is taken for calibrated.
    placebo : Simulator, optional
        With a wrong effect, fitted in the same way.
    level : float
        Probability of the interval, between 0 and 1.
    random_state : None, int, SeedSequence, Generator or RandomState
        Of the bootstrap, of calibrations, and of the choice among wrong effects.

    Returns
    -------
    Gain
        A model that cannot be simulated on an event counts with an infinite error there. Where that is the recalibrated
        one, the event is left out of the gain; of such events alone it is 1 if the extended model can be simulated.

    Warns
    -----
    DataWarning
        If the recalibration on `fitted` did not end at a minimum.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, held_out, truth = demo_recordings(0)
    >>> plant = PlantSimulator("synchronous_machine", recording)
    >>> right = plant.with_nominal([truth[name] for name in plant.parameters.names])
    >>> measure_gain(plant, right, held_out).gain > 0.9
    True
    """
    check_real(level, "level", low=0.0, high=1.0, above=True)
    old = old.with_step_of(extended)
    observations = as_observations(old, held_out)
    rng = generator(random_state)
    if fitted is not None:
        seen = as_observations(old, fitted)
        recalibrated = recalibrated or _recalibrated(old, seen, rng)
        placebo = placebo or _placebo(old, extended, seen, rng)
    recalibrated = (recalibrated or old).with_step_of(extended)
    placebo = placebo and placebo.with_step_of(extended)
    errors = [deviations_of(model, observations) for model in (old, recalibrated, extended)]
    squares = [[(z**2).sum(axis=0) for z in rows] for rows in errors]
    totals = [[float(row.sum()) for row in rows] for rows in squares]
    counts = [int(o.mask.sum()) for o in observations]
    compared = [e for e, total in enumerate(totals[1]) if np.isfinite(total)] or range(len(observations))
    gain = _gain(*(sum(totals[k][e] for e in compared) for k in (1, 2)))
    draws = np.empty(_RESAMPLED)
    widths = [_width(z) for z in errors[1]]
    for i in range(_RESAMPLED):
        chosen = rng.integers(len(compared), size=len(compared))
        before = after = 0.0
        for event in (compared[e] for e in chosen):
            index = _blocks(len(squares[1][event]), widths[event], rng)
            before += float(squares[1][event][index].sum())
            after += float(squares[2][event][index].sum())
        draws[i] = _gain(before, after)
    low = high = -np.inf
    if np.isfinite(draws).all():
        low, high = np.quantile(draws, [0.5 - level / 2, 0.5 + level / 2])
    other = None
    if placebo is not None:
        rows = deviations_of(placebo, observations)
        other = _gain(sum(totals[1][e] for e in compared), sum(float((rows[e] ** 2).sum()) for e in compared))
    rms = [float(np.sqrt(sum(t) / sum(counts))) for t in totals]
    events = tuple(
        EventGain(o.event.name, *(float(np.sqrt(totals[k][e] / counts[e])) for k in range(3)))
        for e, o in enumerate(observations)
    )
    more = [0 if m is None else len(m.movable) - len(recalibrated.movable) for m in (extended, placebo)]
    return Gain(rms[0], rms[1], rms[2], gain, (float(low), float(high)), level, other, events, *more)


def _calibrated(model: Simulator, fitted: Sequence[Observation], rng: np.random.Generator) -> MAPCalibrator:
    return MAPCalibrator(model, prior_scale=PRIOR, random_state=rng).fit(list(fitted))


def _recalibrated(model: Simulator, fitted: Sequence[Observation], rng: np.random.Generator) -> Simulator:
    found = _calibrated(model, fitted, rng)
    if not found.converged_:
        warnings.warn(
            DataWarning(
                "The recalibration of the old model did not end at a minimum: the gain over it may be too large. "
                "`CauseFinder.measure_gain` leads it on."
            ),
            stacklevel=3,
        )
    return found.simulator_


def _placebo(
    old: Simulator, extended: Simulator, fitted: Sequence[Observation], rng: np.random.Generator
) -> Simulator | None:
    """The old model with the best of some wrong effects, with about as many parameters as the extension."""
    right = {effect.original for effect in extended.extensions}
    wrong = [e for e in old.effects_named(None) if e.original not in right and not e.event_specific]
    if not wrong or not right:
        return None
    own = len(extended.movable) - len(old.movable)
    off = np.array([abs(len(effect.fitted) - own) for effect in wrong])
    drawn = rng.permutation(np.flatnonzero(off == off.min()))[:_PLACEBOS]
    found = [_calibrated(old.extend(wrong[k]), fitted, rng) for k in drawn]
    best = min(found, key=lambda calibrator: calibrator.chi2_per_sample_)
    return best.simulator_


def deviations_of(model: Simulator, observations: Sequence[Observation]) -> list[_Array]:
    """Deviations (R, L) of a model from each recording, which begins at a state of its own; 0 where nothing was
    measured, infinite where the model fails.
    """
    out = []
    for observation in with_initial_states(model, observations):
        y = model.simulate(model.parameters.nominal, observation.event).values[0]
        failed = np.isnan(y).any()
        z = np.full(observation.values.shape, np.inf) if failed else observation.deviations(y)
        out.append(np.where(observation.mask, z, 0.0))
    return out


def _width(deviations: _Array) -> int:
    """Samples of a block."""
    if not np.isfinite(deviations).all():
        return 1
    longest = max(1, deviations.shape[1] // _FEWEST_BLOCKS)
    return min(max(1, round(_BLOCK * correlation_time(*deviations))), longest)


def _gain(old: float, new: float) -> float:
    if not np.isfinite(new):
        return -np.inf
    return 1.0 - new / old if old > 0 else 0.0


def _blocks(length: int, width: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices of blocks on a circle that together are as long as the series, so that each sample is drawn as often."""
    starts = rng.integers(length, size=-(-length // width))
    return np.asarray((starts[:, None] + np.arange(width)).ravel()[:length] % length)
