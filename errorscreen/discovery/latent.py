"""Where something enters that no effect explains: an unknown signal, estimated at each port in turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.hypotheses import Hypothesis, fit_hypothesis
from errorscreen.effects.latent_input import KNOTS
from errorscreen.events import InputSignal, Playback
from errorscreen.exceptions import SimulationError
from errorscreen.observations import Observation

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """A port at which an unknown signal would explain the recordings.

    Parameters
    ----------
    device, place : str
        Device and its port.
    probability : float
        Among all ports.
    chi2_per_sample : float
        With the signal.
    time, waveform : ndarray of shape (L,)
        Of the signal in the first recording, in the unit of the port.
    follows : tuple of (str, float)
        Quantities that it moves with, and the correlation, the largest first.
    unit : str
        Of the waveform.
    """

    device: str
    place: str
    probability: float
    chi2_per_sample: float
    time: _Array
    waveform: _Array
    follows: tuple[tuple[str, float], ...]
    unit: str = "pu"

    @property
    def text(self) -> str:
        """Size and dependence in words."""
        size = f"up to {np.abs(self.waveform).max():.2g} {self.unit}".rstrip()
        if not self.follows:
            return size
        name, correlation = self.follows[0]
        return f"{size}, moves with {name}, correlation {correlation:.2f}"


def rank_places(base: Hypothesis) -> tuple[list[Place], int]:
    """Fit an unknown signal at each port together with all parameters.

    Parameters
    ----------
    base : Hypothesis
        Without effects.

    Returns
    -------
    places : list of Place
        The most probable first; empty where the simulator has no ports.
    n_simulations : int
    """
    found: list[tuple[Hypothesis, _Array]] = []
    count = 0
    for effect in base.simulator.effects:
        if effect.kind != "latent":
            continue
        simulator = base.simulator.extend(effect)
        names = [n for n in simulator.parameters.names if n != effect.local("on")]
        problem = FitProblem(simulator, list(base.observations), names)
        start = np.concatenate([base.u, np.zeros(KNOTS)])
        try:
            hypothesis = fit_hypothesis((effect,), problem, start)
        except SimulationError:
            continue
        finally:
            count += problem.n_simulations
        index = [simulator.parameters.index(effect.local(f"a{i}")) for i in range(KNOTS)]
        found.append((hypothesis, hypothesis.theta[index]))
    if not found:
        return [], count
    weights = np.array([h.evidence for h, _ in found])
    weights = np.exp(weights - weights.max())
    weights /= weights.sum()
    places = [
        _place(h, knots, float(w), base.observations[0]) for (h, knots), w in zip(found, weights, strict=True)
    ]
    return sorted(places, key=lambda p: (-p.probability, p.chi2_per_sample)), count


def waveform(knots: _Array, time: _Array, start: float) -> _Array:
    """Values of (I1) at some instants in seconds, for an event at `start`.

    Examples
    --------
    >>> waveform(np.ones(16), np.array([0.0, 1.0, 2.0]), 1.0)
    array([0., 0., 1.])
    """
    s = np.sqrt(np.clip(time - start, 0.0, None) / (time[-1] - start)) * KNOTS
    return np.interp(s, np.arange(KNOTS + 1), np.r_[0.0, knots])


def _place(hypothesis: Hypothesis, knots: _Array, probability: float, observation: Observation) -> Place:
    (effect,) = hypothesis.effects
    time, start = observation.time, observation.event.start
    signal = waveform(knots, time, start)
    after = time >= start
    simulated = hypothesis.predict(observation.event)
    signals = dict(zip(observation.channels, simulated, strict=True))
    if isinstance(observation.event, InputSignal):
        signals |= observation.event.signals
    if isinstance(observation.event, Playback):
        V = observation.event.signals["V"]
        signals["V"] = V
        if "angle" in observation.event.signals:
            signals["frequency"] = np.gradient(observation.event.signals["angle"], time)
    follows = []
    for name, values in signals.items():
        a, b = signal[after] - signal[after].mean(), values[after] - values[after].mean()
        norm = float(np.sqrt((a @ a) * (b @ b)))
        if norm > 0:
            follows.append((name, float(a @ b / norm)))
    follows.sort(key=lambda item: -abs(item[1]))
    device = effect.device or getattr(getattr(hypothesis.simulator, "device", None), "name", "model")
    unit = effect.parameters[1].unit
    return Place(
        device, effect.port, probability, hypothesis.chi2_per_sample, time, signal, tuple(follows), unit
    )
