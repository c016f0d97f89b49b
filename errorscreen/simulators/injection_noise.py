"""How uncertain a recorded response is because of the signals that are injected: their noise, and what lies between."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from errorscreen.events import Playback
from errorscreen.observations import Observation
from errorscreen.signals import scatter
from errorscreen.simulators.playback import input_noise

#: seconds over which the noise of an injected signal is taken together, and the most such blocks in a record
_BLOCK, _MOST_BLOCKS = 0.08, 96
#: errors from injected noise that are kept: at least so many standard deviations of the noise as a whole, so many
_MATTERS, _MOST_MODES = 0.3, 48
#: part of a channel's noise that is left at least where the channel is injected as well
_LEAST_SHARE = 0.1
#: a change of the response, rms, by more than this part of its movement and so many times the noise is another response
_ANOTHER, _LEAST = 0.2, 3.0

_Array = NDArray[np.float64]
#: Response (R, L) to an event, or its change; takes ``interpolation`` and ``step`` by name.
_Run = Callable[..., _Array]
#: Shape in time of what one sample of noise does to a signal, and its standard deviation, for each signal.
_Inputs = Mapping[str, tuple[_Array, float]]


def noise_left(observation: Observation, errors: _Array, part: NDArray[np.bool_]) -> _Array:
    """Standard deviation (R,) of the noise that is left in the errors of a simulation.

    That of a channel itself, or what the errors scatter by before the event where that is more. Where a channel is also
    injected, its noise moves the simulation as well, and less of it may be left.

    Parameters
    ----------
    observation : Observation
        Its event is a `Playback`.
    errors : ndarray of shape (R, K)
        Measured minus simulated before the event.
    part : ndarray of shape (L,), bool
        The samples before the event.
    """
    assert isinstance(observation.event, Playback)
    time, noise = observation.time[part], np.array(observation.noise)
    left = np.array([scatter(time, e) for e in errors])
    for r, name in enumerate(observation.channels):
        if name in observation.event.signals:
            own = scatter(time, observation.values[r, part])
            rest = np.sqrt(max(noise[r] ** 2 - own**2, 0.0) + left[r] ** 2)
            noise[r] = np.clip(rest, _LEAST_SHARE * noise[r], noise[r])
    return np.maximum(noise, left)


def quantified(observation: Observation, run: _Run, step: float, nominal: _Run) -> Observation:
    """Return an observation with `Observation.extra` and `Observation.modes` as they follow from a model.

    Where a small change of the input changes what happens (a plant trips that else does not), the responses say nothing
    about uncertainty and are left out: a model on the edge between them would explain any recording.

    Parameters
    ----------
    observation : Observation
        Its event is a `Playback`.
    run : callable
        ``run(event, interpolation=..., step=...)`` gives the response (R, L) of the model, NaN where it fails.
    step : float
        Longest step of the integration that `run` uses, in seconds.
    nominal : callable
        As `run`, of the model that `Observation.noise` was estimated with. What the noise of the injected signals makes
        of *its* response before the event is part of that noise; with another operating point more of it passes.
    """
    event = observation.event
    assert isinstance(event, Playback)
    response = run(event)
    if np.isnan(response).any():  # whoever simulates will be told
        return observation
    part = observation.time < event.start - 2.5 * event.dt
    noise = np.asarray(observation.noise)
    changed = _changes(run, response, noise)
    extra = np.zeros(observation.values.shape)
    for options in ({"interpolation": "linear"}, {"step": 0.5 * step}):
        change = np.abs(changed(event, **options))
        usual = 3.0 * change[:, part].max(axis=1, initial=0.0)  # what noise alone makes of it
        extra = np.hypot(extra, np.where(change > usual[:, None], change, 0.0))
    inputs = input_noise(event)
    passed = _passed(changed, event, inputs, observation.channels)
    counted = _passed(_changes(nominal, nominal(event), noise), event, inputs, observation.channels)
    quiet = np.median(counted[:, part], axis=1)[:, None] if part.any() else counted
    extra = np.sqrt(extra**2 + np.maximum(passed - quiet, 0.0))
    return replace(observation, extra=extra, modes=_modes(changed, event, inputs, noise, step))


def _changes(run: _Run, response: _Array, noise: _Array) -> _Run:
    """Changes of a model's response to its event, 0 where it fails or another response comes out."""
    movement = np.sqrt(np.mean((response - response[:, :1]) ** 2, axis=1))
    most = np.maximum(_ANOTHER * movement, _LEAST * noise)

    def changed(event: Playback, **options: Any) -> _Array:
        change = run(event, **options) - response
        small = np.sqrt(np.mean(change**2, axis=1)) <= most  # False for NaN
        return np.where(small.all(), change, 0.0)

    return changed


def _passed(changed: _Run, event: Playback, inputs: _Inputs, channels: tuple[str, ...]) -> _Array:
    """Variance (R, L) of what the noise of the injected signals makes of the error at once.

    A signal that is moved up and down from sample to sample leaves slow dynamics at rest, so that one simulation shows
    at every sample how much of its noise passes through the device there. The noise of a signal that is also compared
    moves both sides.
    """
    alternating = np.where(np.arange(len(event.time)) % 2, -1.0, 1.0)
    total = np.zeros((len(channels), len(event.time)))
    for name, (shape, sigma) in inputs.items():
        size = sigma * shape[0]
        change = changed(_moved(event, name, size * alternating))
        if name in channels:
            change[channels.index(name)] -= size * alternating
        total += change**2
    # where the model itself jumps, the change is no noise
    return np.asarray(median_filter(total, size=(1, 5)))


def _modes(changed: _Run, event: Playback, inputs: _Inputs, noise: _Array, step: float) -> _Array:
    """Slow errors (K, R, L) that the noise of the injected signals makes behind the dynamics of the model.

    White noise over a block of samples acts on slow dynamics as their sum does, so each block is moved as a whole by
    what its sum scatters, and what follows after the block is kept: what passes at once is white and part of `noise`.
    Principal components that matter against the noise are returned.
    """
    length = len(event.time)
    width = max(1, round(_BLOCK / event.dt), -(-length // _MOST_BLOCKS))
    rows = []
    for name, (shape, sigma) in inputs.items():
        for first in range(0, length - 1, width):
            block = np.zeros(length)
            block[first : first + width] = 1.0
            moved = np.convolve(block, shape)[:length] * sigma / np.sqrt(width)
            change = changed(_moved(event, name, moved), step=2 * step)
            change[:, : first + width + 2] = 0.0
            rows.append(change)
    if not rows:
        return np.zeros((0, len(noise), length))
    scaled = (np.array(rows) / noise[:, None]).reshape(len(rows), -1)
    _, S, Vt = np.linalg.svd(scaled, full_matrices=False)
    keep = min(int((S > _MATTERS).sum()), _MOST_MODES)
    modes = (S[:keep, None] * Vt[:keep]).reshape(keep, len(noise), length)
    return np.asarray(modes * noise[:, None])


def _moved(event: Playback, name: str, change: _Array) -> Playback:
    """Return the event with one signal changed."""
    return replace(event, signals={**event.signals, name: event.signals[name] + change})
