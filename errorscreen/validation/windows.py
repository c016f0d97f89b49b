"""Windows of a recording: before, during and after a fault or step, without the first instants of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from errorscreen._runtime.typed import Real
from errorscreen.data.disturbances import fault_end
from errorscreen.data.observations import Observation

#: seconds before the event that count
BEFORE = 1.0
#: seconds after the beginning and the end of a fault that IEC 61400-27-2 lets be left out at most
IEC_BEGIN, IEC_END = 0.140, 0.500


@dataclass(frozen=True)
class Window:
    """One part of a recording.

    Parameters
    ----------
    name : {"before", "during", "after"}
    start, stop : float
        Seconds, on the time axis of the recording.
    """

    name: Literal["before", "during", "after"]
    start: Real
    stop: Real


def windows(observation: Observation, begin: float = IEC_BEGIN, end: float = IEC_END) -> tuple[Window, ...]:
    """Windows in which errors are counted, those that hold anything.

    Of a fault: a second before it, the fault, and all after its end. A step, which does not end, has the second before
    it and all after it.

    Parameters
    ----------
    observation : Observation
    begin, end : float
        Seconds that are left out after the beginning and after the end, because fast transients are not modelled.

    References
    ----------
    IEC 61400-27-2:2020, clauses 6.4.3 and 6.4.4.

    Examples
    --------
    >>> import numpy as np
    >>> from errorscreen.events import Playback
    >>> time = np.arange(0.0, 5.0, 0.01)
    >>> dip = np.where((time > 1.995) & (time < 2.295), 0.4, 1.0)
    >>> event = Playback(time, "dip", 2.0, {"V": dip, "angle": 0 * time}, {"V": 1.0, "P": 0.5, "Q": 0.0})
    >>> seen = Observation(event, np.zeros((1, 500)), np.ones(1), ("P",), ("pu",))
    >>> [(w.name, round(w.start, 2), round(w.stop, 2)) for w in windows(seen)]
    [('before', 1.0, 2.0), ('during', 2.14, 2.3), ('after', 2.8, 4.99)]
    """
    first, last, start = observation.time[0], observation.time[-1], observation.event.start
    stop = fault_end(observation)
    found = [Window("before", float(max(first, start - BEFORE)), float(start))]
    if stop is None:
        found.append(Window("after", float(start + begin), float(last)))
    else:
        found.append(Window("during", float(start + begin), float(stop)))
        found.append(Window("after", float(stop + end), float(last)))
    return tuple(window for window in found if window.stop > window.start)
