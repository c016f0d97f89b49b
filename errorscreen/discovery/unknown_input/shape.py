r"""What an unknown signal looks like: a step, a ramp, a pulse or an oscillation.

Each form is fitted to the signal by least squares and judged by the share of its energy that it explains,

.. math:: r = 1 - \frac{\sum_k (s_k - \hat s_k)^2}{\sum_k s_k^2}                                       \qquad (I2)

A damped oscillation is that of `errorscreen.validation.oscillation`, (V6).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.typed import Real
from errorscreen.effects.latent_input import KNOTS
from errorscreen.validation.oscillation import oscillation

#: share of the peak from which a signal counts as acting
_ACTS = 0.1
#: least share of the energy that a form has to explain, and of the next simple one to be taken before it
_LIKE = 0.85
#: knots of the signal, between which a step rises
_RISES = 2.5
#: instants that edges are sought at
_EDGES = 64
#: least damping ratio that is told
_UNDAMPED = 0.005
#: instants that a form is fitted to, at most
_POINTS = 400

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """Form of a signal.

    Parameters
    ----------
    kind : {"step", "ramp", "pulse", "oscillation", ""}
        The simplest form that explains 85 % of its energy; empty where none does.
    start, stop : float
        First and last instant in s at which the signal is more than a tenth of its peak; NaN where it is zero. Of a
        step, a ramp and a pulse the instants of the form.
    size : float
        Height of a step, ramp or pulse with its sign, in the unit of the signal; else the largest magnitude.
    frequency, damping : float
        Of an oscillation, in Hz, and its damping ratio, negative where it grows; NaN otherwise.
    explained : float
        Share of the energy that the form explains, (I2).
    """

    kind: Literal["step", "ramp", "pulse", "oscillation", ""] = ""
    start: Real = np.nan
    stop: Real = np.nan
    size: Real = 0.0
    frequency: Real = np.nan
    damping: Real = np.nan
    explained: Real = 0.0

    def text(self, unit: str) -> str:
        """In words; empty where the signal is zero."""
        if not np.isfinite(self.start):
            return ""
        size = f"{self.size:.2g} {unit}".rstrip()
        between = f"from {self.start:.4g} s to {self.stop:.4g} s"
        if self.kind == "step":
            return f"a step of {size} at {self.start:.4g} s"
        if self.kind == "ramp":
            return f"a ramp {between}, to {size}"
        if self.kind == "pulse":
            return f"a pulse of {size} {between}"
        if self.kind == "oscillation":
            damped = f"damping ratio {self.damping:.2f}" if self.damping > 0 else "growing"
            damped = "undamped" if abs(self.damping) < _UNDAMPED else damped
            return f"an oscillation of {self.frequency:.2g} Hz, {damped}, up to {size}, {between}"
        return f"up to {size}, {between}"


def shape_of(time: _Array, signal: _Array) -> Shape:
    """Form of a signal.

    Parameters
    ----------
    time : ndarray of shape (L,)
        Instants after the event in s.
    signal : ndarray of shape (L,)

    Returns
    -------
    Shape

    Examples
    --------
    >>> time = np.linspace(1.0, 6.0, 300)
    >>> shape_of(time, 0.2 * (time > 2.0)).text("pu")
    'a step of 0.2 pu at 1.989 s'
    >>> shape_of(time, np.exp(-0.3 * time) * np.sin(2 * np.pi * 0.8 * time)).kind
    'oscillation'
    """
    time, signal = np.asarray(time, dtype=float), np.asarray(signal, dtype=float)
    every = -(-len(time) // _POINTS)
    time, signal = time[::every], signal[::every]
    peak = float(np.abs(signal).max(initial=0.0))
    if len(time) < 3 or not peak > 0:
        return Shape()
    acting = np.flatnonzero(np.abs(signal) > _ACTS * peak)
    start, stop = float(time[acting[0]]), float(time[acting[-1]])
    for form in _forms(time, signal, start, stop, peak):
        if form.explained >= _LIKE:
            return form
    return Shape("", start, stop, peak)


def _forms(time: _Array, signal: _Array, start: float, stop: float, peak: float) -> Iterator[Shape]:
    """The best of each form, simple ones first."""
    # closer together just after the event, as the knots of the signal are
    edges = time[0] + (time[-1] - time[0]) * np.linspace(0.0, 1.0, _EDGES) ** 2
    first, last = (edges[index] for index in np.triu_indices(_EDGES, 1))
    rise = np.clip((time - first[:, None]) / (last - first)[:, None], 0.0, 1.0)
    explained, k, size = _best(signal, rise)
    middle, window = float(0.5 * (first[k] + last[k])), float(time[-1] - time[0])
    knot = 2.0 * np.sqrt((middle - time[0]) / window) / KNOTS * window
    if last[k] - first[k] <= _RISES * knot:
        yield Shape("step", middle, float(time[-1]), size, explained=explained)
    ramp = Shape("ramp", float(first[k]), float(last[k]), size, explained=explained)
    explained, k, size = _best(signal, (time >= first[:, None]) & (time < last[:, None]))
    pulse = Shape("pulse", float(first[k]), float(last[k]), size, explained=explained)
    yield max(ramp, pulse, key=lambda form: form.explained)
    frequency, damping, explained = oscillation(time, signal)
    yield Shape("oscillation", start, stop, peak, frequency, damping, explained)


def _best(signal: _Array, forms: NDArray[Any]) -> tuple[float, int, float]:
    """Share that the best of some forms (n, L) explains, its number and its factor."""
    forms = forms.astype(float)
    along, norm = forms @ signal, np.maximum((forms**2).sum(axis=1), 1e-300)
    explained = along**2 / norm / (signal @ signal)
    k = int(np.argmax(explained))
    return float(explained[k]), k, float(along[k] / norm[k])
