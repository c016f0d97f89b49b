"""From when to when an effect acts in a recording: simulated with it and without it, at its fitted values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from errorscreen._runtime.typed import Real
from errorscreen.discovery.fits.hypotheses import Hypothesis
from errorscreen.effects.base import Effect

#: share of the noise from which an effect counts as acting: more than rounding, and a limiter changes nothing at all
#: before it begins
_BEGINS = 1e-6


@dataclass(frozen=True)
class Acting:
    """When an effect acts in one recording.

    Parameters
    ----------
    recording : str
    begins : float
        Instant in s at which it begins to change the response, for example at which a limiter begins to act; NaN if it
        changes nothing.
    start, stop : float
        First and last instant in s at which it changes the response by more than noise; NaN if it never does.
    always : bool
        Whether noise alone moves it: it begins to act with the recording, as a regulator, or before the event, as a
        governor whose dead band is narrow, and changes the response by more than noise in the event only.
    """

    recording: str
    begins: Real
    start: Real
    stop: Real
    always: bool = False

    @property
    def text(self) -> str:
        """In words, with "it" for the effect; empty where it changes nothing but noise."""
        if not np.isfinite(self.start):
            return ""
        since = "all the time" if self.always else f"at {self.begins:.4g} s"
        return (
            f"takes effect {since}, and changes the response by more than noise from {self.start:.4g} s to "
            f"{self.stop:.4g} s"
        )


def acting(hypothesis: Hypothesis, effect: Effect) -> tuple[Acting, ...]:
    """When an effect of a hypothesis acts in each recording; none where it cannot be simulated without it.

    Parameters
    ----------
    hypothesis : Hypothesis
    effect : Effect
        One of its effects; the others stay on.
    """
    space = hypothesis.simulator.parameters
    rows = np.tile(hypothesis.theta, (2, 1))
    rows[1, space.index(effect.local(effect.strength.name))] = 0.0
    found = []
    for observation in hypothesis.observations:
        event = observation.event
        if not effect.acts_in(event):
            continue
        on, off = hypothesis.simulator.simulate(rows, event).values
        change = np.max(np.abs(on - off) / observation.sigma, axis=0)
        if np.isnan(change).any():
            continue
        begins, beyond = (np.flatnonzero(change > size) for size in (_BEGINS, 1.0))
        first = float(event.time[begins[0]]) if len(begins) else np.nan
        start, stop = event.time[beyond[[0, -1]]] if len(beyond) else (np.nan, np.nan)
        always = bool(len(begins) and (begins[0] <= 1 or first < event.start <= start))
        found.append(Acting(event.name, first, float(start), float(stop), always))
    return tuple(found)
