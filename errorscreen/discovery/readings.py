r"""Readings of a plant's recording that would explain its error better than the plant.

Of the uncalibrated model's response y and the recorded channels z

.. math:: J = \sum_c \frac{\sum_t (z_c - y_c)^2}{\sum_t (z_c - z_c(0))^2}                      \qquad (1)

is what it leaves of what moves. A wrong sign leaves more than all, whatever the parameters are. The recording is read
in the usual wrong ways, one after the other; a reading with which J is far smaller is a suspect. Factors on the
voltage show in its level before the event, see `errorscreen.data.plausibility`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.plausibility import Doubt
from errorscreen.data.recordings import Recording
from errorscreen.exceptions import DataWarning, InputError
from errorscreen.simulators.plant.simulator import PlantSimulator

_Values = dict[str, NDArray[np.float64]]
#: J that a model leaves whose parameters are wrong by a third: nothing is asked below
_WELL = 0.5
#: J that a reading must leave at most: beyond it explains nothing
_MOST = 1.0
#: factor by which another reading must lower J, or the part of the channel that it changes alone; hidden effects alone
#: lowered J by 1.7 at most, and the part of Q by 1.5
_FAR = 3.0
#: factor between readings that are named together
_ALIKE = 1.5


class Reading(NamedTuple):
    """Another way to read a recording.

    Parameters
    ----------
    words : str
        With the key of the case file.
    needed : tuple of str
        Channels that it needs.
    changed : callable
        From the values of all channels to those that change.
    keys : mapping of str to mapping
        Keys of ``[recording.columns.NAME]`` by channel; empty where other headers have to be given.
    """

    words: str
    needed: tuple[str, ...]
    changed: Callable[[_Values], _Values]
    keys: Mapping[str, Mapping[str, Any]]


def _turned(name: str) -> Reading:
    words = f"the other sign of {'the ' if name == 'angle' else ''}{name} (scale = -1)"
    return Reading(words, (name,), lambda values: {name: -values[name]}, {name: {"scale": -1.0}})


#: other ways to read a recording
_OTHERS = (
    _turned("Q"),
    _turned("P"),
    Reading(
        "the other sign of P and Q (sign = 'load')",
        ("P", "Q"),
        lambda v: {"P": -v["P"], "Q": -v["Q"]},
        {"P": {"sign": "load"}, "Q": {"sign": "load"}},
    ),
    Reading("P and Q interchanged", ("P", "Q"), lambda v: {"P": v["Q"], "Q": v["P"]}, {}),
    _turned("angle"),
)


def better_readings(simulator: PlantSimulator, recording: Recording) -> list[Doubt]:
    """Other ways to read a recording that explain its error better than the plant does.

    Parameters
    ----------
    simulator : PlantSimulator
        With its uncalibrated parameters.
    recording : Recording

    Returns
    -------
    list of Doubt
        Sentences with the key that would have to change; empty where the recording is read as it should be.

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, _, _ = demo_recordings(0)
    >>> better_readings(PlantSimulator("synchronous_machine", recording), recording)
    []
    """
    left, found = ranked_readings(simulator, recording)
    if not found:
        return []
    other = found[0][0]
    words = ", or ".join(reading.words for left_over, reading in found if left_over <= _ALIKE * other)
    return [
        Doubt(
            f"With {words} the model as it is leaves {100 * other:.0f} % of what moves; as the recording is read, it "
            f"leaves {100 * left:.0f} %."
        )
    ]


def ranked_readings(
    simulator: PlantSimulator, recording: Recording
) -> tuple[float, list[tuple[float, Reading]]]:
    """J of (1) as a recording is read, and of each other reading with which it is far smaller, the least first."""
    parts = _left(simulator, recording)
    left = sum(parts.values())
    if left <= _WELL or np.isinf(left):  # a model that cannot start has a message of its own
        return left, []
    values = {name: channel.values for name, channel in recording.channels.items()}
    found = []
    for reading in _OTHERS:
        needed = reading.needed
        if values.keys() >= {*needed}:
            changed = _with(recording, reading.changed(values))
            there = _left(simulator, changed)
            other = sum(there.values())
            generates = "P" not in needed or changed.initial(["P"])["P"] > 0
            # of a channel alone, its own part tells more: parameters may hide it in the others
            own = needed[0] if len(needed) == 1 and needed[0] in parts else None
            far = other < min(_MOST, left / _FAR)
            if own is not None:
                far |= other < left and there[own] < min(_MOST, parts[own] / _FAR)
            if far and generates:
                found.append((other, reading))
    return left, sorted(found, key=lambda one: (one[0], one[1].words))


def _with(recording: Recording, changed: _Values) -> Recording:
    """The recording with other numbers in some channels."""
    channels = {name: replace(recording.channel(name), values=values) for name, values in changed.items()}
    return replace(recording, channels={**recording.channels, **channels})


def _left(simulator: PlantSimulator, recording: Recording) -> dict[str, float]:
    """Parts of J of (1); infinite where the recording cannot be used so, or the model cannot be simulated."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        try:
            observation = simulator.without_uncertainty(recording)
        except InputError:
            return {"": np.inf}
    responses = simulator.simulate(simulator.parameters.nominal, observation.event)
    if not responses.ok.all():
        return {"": np.inf}
    before = observation.time < observation.event.start
    parts = {}
    rows = zip(observation.channels, observation.values, responses.values[0], observation.mask, strict=True)
    for name, z, y, known in rows:
        rest = np.median(z[before & known]) if (before & known).any() else np.median(z[known])
        moved = float(np.sum((z[known] - rest) ** 2))
        parts[name] = float(np.sum((z[known] - y[known]) ** 2)) / moved if moved else 0.0
    return parts
