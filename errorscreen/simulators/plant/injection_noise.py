"""Uncertainty of a recorded response from the injected signals: their noise, and their course between samples."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter, minimum_filter1d

from errorscreen._runtime.threads import parallel_map
from errorscreen.data.observations import Observation
from errorscreen.data.resampling import interpolate
from errorscreen.data.signals import scatter
from errorscreen.events import Playback
from errorscreen.simulators.plant.playback import input_noise

#: seconds in a block of injected noise, shorter than a quarter of any swing's period, and its fewest samples: what
#: acts within them is no slow error
_BLOCK, _FEWEST = 0.08, 3
#: least size of a mode that is kept, in standard deviations of the noise: others raise its variance by a tenth at most
_MATTERS = 0.3
#: two blocks act alike if their responses differ by no more, summed up, in standard deviations of the noise
_ALIKE = 0.3 * _MATTERS
#: blocks between those that are simulated first
_APART = 16
#: least remaining share of a channel's noise where the channel is injected as well
_LEAST_SHARE = 0.1
#: the response changes its kind where it changes (rms) by more than this share of its movement and so many times the
#: noise
_ANOTHER, _LEAST = 0.2, 3.0
#: a signal jumps where it changes by so many standard deviations of its noise more than beside; most such jumps
_JUMP, _MOST_JUMPS = 8.0, 48
#: standard deviation of a uniform distribution, as a share of its interval
_ANYWHERE = 12**-0.5
#: draws of the noise for its energy; with five, the slope of the energy is known to about a thirtieth
NOISE_DRAWS = 5

_Array = NDArray[np.float64]
#: Response (R, L) to an event, or its change; takes ``interpolation``, ``step`` and ``jump`` by name.
_Run = Callable[..., _Array]
#: For each signal, effect of one sample of noise in time, and the noise's standard deviation.
_Inputs = Mapping[str, tuple[_Array, float]]


def noise_left(observation: Observation, errors: _Array, part: NDArray[np.bool_]) -> _Array:
    """Noise (R,) that remains in `errors` (R, K) before the event, which `part` (L,) marks.

    It is the channel's noise, or the scatter where that is larger. Less may remain where the channel is also injected,
    because its noise moves the simulation as well.
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


def with_uncertainty(
    observation: Observation, run: _Run, step: float, nominal: _Run, threads: int = 1
) -> Observation:
    """Return an observation with `Observation.extra` and `Observation.modes` of a model.

    ``run(event, interpolation=..., step=..., jump=...)`` gives the response (R, L), with steps up to `step` seconds;
    `nominal` is the same for the model that `Observation.noise` was estimated with, which holds its propagated noise.
    Where a small change of the input changes the kind of response (a plant trips, or not), it is left out: a model on
    that edge would explain any recording.
    """
    event = observation.event
    assert isinstance(event, Playback)
    response = run(event)
    if np.isnan(response).any():  # the caller sees this failure when it simulates
        return observation
    part = observation.time < event.start - 2.5 * event.dt
    noise = np.asarray(observation.noise)
    changed = _changes(run, response, noise)
    extra = np.zeros(observation.values.shape)
    between = [changed(event, interpolation="linear"), changed(event, step=0.5 * step)]
    if event.fine is not None:
        between.append(_changes(partial(_averaged, run), response, noise)(event))
    for change in map(np.abs, between):
        usual = 3.0 * change[:, part].max(axis=1, initial=0.0)  # from noise alone
        extra = np.hypot(extra, np.where(change > usual[:, None], change, 0.0))
    extra = np.hypot(extra, _late(observation, part))
    inputs = input_noise(event)
    propagated = _propagated(changed, event, inputs, observation.channels)
    counted = _propagated(_changes(nominal, nominal(event), noise), event, inputs, observation.channels)
    quiet = np.median(counted[:, part], axis=1)[:, None] if part.any() else counted
    extra = np.sqrt(extra**2 + np.maximum(propagated - quiet, 0.0))
    # where less noise propagates than was counted, as through a filter, less is expected
    less = np.median((counted - propagated)[:, part], axis=1) if part.any() else np.zeros(len(noise))
    own = np.sqrt(np.maximum(noise**2 - np.maximum(less, 0.0), (_LEAST_SHARE * noise) ** 2))
    modes = _modes(changed, event, inputs, own, step, threads)
    known = replace(observation, noise=own, extra=extra, modes=modes, propagated=None)
    propagated_now = typical(propagated_energy(known, lambda event: run(event)[None]))[0]
    return replace(known, propagated=propagated_now if np.isfinite(propagated_now).all() else None)


def propagated_energy(observation: Observation, run: _Run) -> _Array:
    """Energy (NOISE_DRAWS, n, R) of the propagated noise, for responses ``run(event)`` (n, R, L); NaN where it fails.

    The draws are the same for all rows and calls, so the energy is a smooth function of the parameters.
    """
    event = observation.event
    assert isinstance(event, Playback)
    response = run(event)
    rng = np.random.default_rng(NOISE_DRAWS)
    found = []
    for _ in range(NOISE_DRAWS):
        added = {
            name: np.convolve(sigma * rng.standard_normal(len(event.time)), shape)[: len(event.time)]
            for name, (shape, sigma) in input_noise(event).items()
        }
        drawn = event
        for name, change in added.items():
            drawn = _moved(drawn, name, change)
        changes = run(drawn) - response
        same = [
            _same_response(c, y, np.asarray(observation.noise))
            for c, y in zip(changes, response, strict=True)
        ]
        for name in added.keys() & observation.channels:  # a compared channel moves both sides
            changes[:, observation.channels.index(name)] -= added[name]
        energy = np.nansum(observation.deviations(observation.values + changes) ** 2, axis=-1)
        found.append(np.where(np.array(same)[:, None], energy, np.nan))
    return np.array(found)


def typical(energies: _Array) -> _Array:
    """Median over draws that are not NaN, because a limiter may act in a single draw; NaN without any."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # rows without any draw
        return np.asarray(np.nanmedian(energies, axis=0))


def _same_response(change: _Array, response: _Array, noise: _Array) -> bool:
    """Whether a change (R, L) leaves the kind of response as it is; False for NaN."""
    movement = np.sqrt(np.mean((response - response[:, :1]) ** 2, axis=1))
    most = np.maximum(_ANOTHER * movement, _LEAST * noise)
    return bool((np.sqrt(np.mean(change**2, axis=1)) <= most).all())


def _changes(run: _Run, response: _Array, noise: _Array) -> _Run:
    """Changes of a model's response; 0 where it fails or changes its kind."""

    def changed(event: Playback, **options: Any) -> _Array:
        change = run(event, **options) - response
        return np.where(_same_response(change, response, noise), change, 0.0)

    return changed


def _averaged(run: _Run, event: Playback) -> _Array:
    """Response to all readings, averaged as the signals were: what a jump does is not what its average does."""
    assert event.fine is not None
    return np.array([interpolate(event.fine.time, row, event.time) for row in run(event.fine)])


def _propagated(changed: _Run, event: Playback, inputs: _Inputs, channels: tuple[str, ...]) -> _Array:
    """Variance (R, L) of the error from injected noise that propagates without delay.

    A signal that moves up and down for two samples each leaves slow dynamics as they are, so two simulations show how
    much noise propagates. Of white noise that is read between two samples, a share f after the first, 1 − 2 f (1 − f)
    of the variance remains, and the same of the two courses together.
    """
    samples = np.arange(len(event.time))
    total = np.zeros((len(channels), len(event.time)))
    for name, (shape, sigma) in inputs.items():
        size = sigma * shape[0]
        for first in (0, 1):
            course = size * np.where((samples + first) // 2 % 2, -1.0, 1.0)
            change = changed(_moved(event, name, course))
            if name in channels:
                change[channels.index(name)] -= course
            total += 0.5 * change**2
    # where the model itself jumps, the change is no noise
    return np.asarray(median_filter(total, size=(1, 5)))


def _modes(
    changed: _Run, event: Playback, inputs: _Inputs, noise: _Array, step: float, threads: int
) -> NDArray[np.float32]:
    """Slow errors (K, R, L) from the noise and the unknown instants of the injected signals.

    White noise over a block of samples acts on slow dynamics like its sum, so each block moves by the standard
    deviation of its sum. Only the change after the block is kept, because `noise` holds that within it.
    """
    length = len(event.time)
    width = max(_FEWEST, round(_BLOCK / event.dt))

    # imposed power holds no speed, so that the coarser step alone lets the frequency drift
    coarse = changed(event, step=2 * step) if event.by_power else 0.0

    def after(name: str, shape: _Array, sigma: float, first: int) -> _Array:
        block = np.zeros(length)
        block[first : first + width] = 1.0
        moved = np.convolve(block, shape)[:length] * sigma / np.sqrt(width)
        change = changed(_moved(event, name, moved), step=2 * step) - coarse
        change[:, : first + width + 2] = 0.0
        return change

    def unknown_instant(first: int, last: int) -> _Array:
        early, late = (changed(event, jump=(first, last, early), step=2 * step) for early in (True, False))
        return _ANYWHERE * (early - late)

    starts = range(0, length - 1, width)
    jumps = parallel_map([partial(unknown_instant, *jump) for jump in _jumps(event, inputs)], threads)
    # of a minute at 1 kHz these are the largest arrays of all: six decimals are enough
    rows = np.zeros((len(inputs) * len(starts) + len(jumps), len(noise), length), dtype=np.float32)
    for k, (name, (shape, sigma)) in enumerate(inputs.items()):
        part = rows[k * len(starts) : (k + 1) * len(starts)]
        _each_block(partial(after, name, shape, sigma), starts, noise, threads, part)
    for row, jump in zip(rows[len(rows) - len(jumps) :], jumps, strict=True):
        row[:] = jump / noise[:, None]
    if not len(rows):
        return rows
    scaled = rows.reshape(len(rows), -1)
    squares, vectors = np.linalg.eigh((scaled @ scaled.T).astype(float))
    kept = vectors[:, squares > _MATTERS**2].T.astype(np.float32) @ scaled
    modes = kept.reshape(-1, len(noise), length)
    modes *= noise[:, None].astype(np.float32)
    return modes


def _each_block(
    after: Callable[[int], _Array], starts: range, noise: _Array, threads: int, rows: NDArray[np.float32]
) -> None:
    """Write the response to each block into zeros, in multiples of the noise.

    Where the unit rests, and where its response has died away, a block acts as one before it, only later: only as many
    are simulated as show that those between them act alike.
    """
    known: set[int] = set()

    def later(i: int, k: int) -> tuple[slice, NDArray[np.float32]]:
        delay = starts[k] - starts[i]
        return slice(delay, None), rows[i, :, : rows.shape[2] - delay]

    def alike(i: int, k: int) -> bool:
        part, expected = later(i, k)
        return bool(np.linalg.norm(rows[k, :, part] - expected) < _ALIKE)

    ends = [*range(0, len(starts) - 1, _APART), len(starts) - 1]
    parts = list(pairwise(ends)) or [(0, 0)]
    while parts:
        wanted = sorted({k for i, j in parts for k in (i, (i + j) // 2, j)} - known)
        for k, found in zip(
            wanted, parallel_map([partial(after, starts[k]) for k in wanted], threads), strict=True
        ):
            rows[k] = found / noise[:, None]
        known.update(wanted)
        halves = []
        for i, j in parts:
            middle = (i + j) // 2
            if alike(i, middle) and alike(i, j):
                for k in {*range(i + 1, j)} - {middle}:
                    part, expected = later(i, k)
                    rows[k, :, part] = expected
            else:
                halves += [part for part in ((i, middle), (middle, j)) if part[1] - part[0] > 1]
        parts = halves


def _late(observation: Observation, part: NDArray[np.bool_]) -> _Array:
    """Standard deviation (R, L) of readings that a meter holds: each may be any value of the time it was held for."""
    event = observation.event
    assert isinstance(event, Playback)
    out = np.zeros(observation.values.shape)
    if event.age == 0.0:
        return out
    size = 2 * int(np.ceil(event.age / event.dt)) + 1
    for r, values in enumerate(observation.values):
        known = np.isfinite(values)
        if known.any():
            filled = np.interp(event.time, event.time[known], values[known])
            spread = maximum_filter1d(filled, size) - minimum_filter1d(filled, size)
            usual = spread[part].max(initial=0.0)  # from noise alone
            out[r] = _ANYWHERE * np.where(spread > usual, spread, 0.0)
    return out


def _jumps(event: Playback, inputs: _Inputs) -> list[tuple[int, int]]:
    """First and last sample of intervals in which a signal jumps, the largest jumps first.

    A change between two samples, or within a held reading, may have come at any instant between them.
    """
    width = max(1, round(event.age / event.dt))
    if not inputs or len(event.time) <= 3 * width:
        return []
    strength = np.zeros(len(event.time) - width)
    for name, (shape, sigma) in inputs.items():
        change = np.abs(event.signals[name][width:] - event.signals[name][:-width])
        alone = change.copy()
        alone[width:] -= change[:-width]
        alone[:-width] -= change[width:]
        strength = np.maximum(strength, alone / (sigma * shape[0]))
    peaks = np.flatnonzero((strength > _JUMP) & (strength == maximum_filter1d(strength, 2 * width + 1)))
    largest = sorted(peaks, key=lambda k: -strength[k])[:_MOST_JUMPS]
    return [(int(k), int(k) + width) for k in largest]


def _moved(event: Playback, name: str, change: _Array) -> Playback:
    """Event with a changed signal. Imposed power holds no speed, so that an error of its level before the event makes
    the speed drift: there the level that the unit starts from changes as well.
    """
    moved = replace(event, signals={**event.signals, name: event.signals[name] + change})
    if not event.by_power or name not in ("P", "Q"):
        return moved
    quiet = event.time < event.start - 2.5 * event.dt
    level = event.initial[name] + (float(change[quiet].mean()) if quiet.any() else 0.0)
    return replace(moved, initial={**event.initial, name: level})
