"""Where an unknown input enters: a signal is fitted at each port in turn."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.display import Displayed
from errorscreen._runtime.threads import parallel_map
from errorscreen._runtime.typed import InMemory, Real, Series
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.halving import fit_to_end, try_all
from errorscreen.discovery.fits.hypotheses import SLICE, Hypothesis, JointFit
from errorscreen.discovery.judge.separation import States, device_name, states_of
from errorscreen.discovery.search.journal import Journal
from errorscreen.discovery.unknown_input.fine_detail import DetailedSignal, with_fine_detail
from errorscreen.discovery.unknown_input.shape import Shape, shape_of
from errorscreen.effects.base import Effect
from errorscreen.effects.latent_input import KNOTS, PULSE
from errorscreen.events import InputSignal, Playback

_log = logging.getLogger(__name__)

#: least share of the excess of the base fit (χ² beyond noise) that a signal must explain
_EXPLAINS = 0.1
#: least correlation at which a signal is said to move with a quantity
_MOVES = 0.5
#: least correlation of a signal with the state that it slows down to be called friction or damping
_OPPOSES = 0.8
#: power of the excess of a location, as for effects of another form
_FORM = 2.0
#: largest odds from the simplicity of a signal
_SIMPLER = 3.0
#: instants of a waveform in the result, at most
_POINTS = 200

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class InputLocation(Displayed):
    """A port at which an unknown signal would explain the recordings.

    Parameters
    ----------
    device, place : str
        Device and its port.
    probability : float
        Among all ports.
    chi2_per_sample : float
        With the signal and its fine detail, over the degrees of freedom that are left.
    time, waveform : ndarray of shape (L,)
        The signal with its detail in the first recording, in the unit of the port.
    follows : tuple of (str, float)
        Signals and states of the device in the model without it, and their correlation with it, the largest first.
    unit : str
        Of the waveform.
    explained : float
        Share of the base fit's excess that the signal explains without the detail.
    shape : Shape
        What the waveform looks like.
    states : mapping of (str, str) to ndarray of shape (L,)
        Of all devices with the signal without the detail, in the first recording, by device and name.
    """

    device: str
    place: str
    probability: Real
    chi2_per_sample: Real
    time: Series
    waveform: Series
    follows: tuple[tuple[str, Real], ...]
    unit: str = "pu"
    explained: Real = 1.0
    shape: Shape = field(default_factory=Shape)
    states: InMemory[States] = field(default_factory=dict, compare=False)

    def _facts(self) -> dict[str, Any]:
        return {"location": self.name, "probability": f"{self.probability:.2f}", "signal": self.text}

    @property
    def name(self) -> str:
        """Port and device in words."""
        return f"{self.place} of the {self.device}"

    def thinned(self) -> InputLocation:
        """The same with at most 200 instants: the ends, and the extremes of each stretch between, so peaks stay.

        Examples
        --------
        >>> place = InputLocation("unit", "Efd", 1.0, 1.0, np.arange(501.0), np.arange(501.0), ())
        >>> len(place.thinned().time)
        200
        """
        length = len(self.time)
        if length <= _POINTS:
            return self
        kept = {0, length - 1}
        for columns in np.array_split(np.arange(1, length - 1), (_POINTS - 2) // 2):
            values = self.waveform[columns]
            kept |= {int(columns[np.argmin(values)]), int(columns[np.argmax(values)])}
        return replace(self, time=self.time[sorted(kept)], waveform=self.waveform[sorted(kept)])

    @property
    def text(self) -> str:
        """Form, size and dependence in words."""
        form = self.shape.text(self.unit) or f"up to {np.abs(self.waveform).max():.2g} {self.unit}".rstrip()
        if not self.follows or abs(self.follows[0][1]) < _MOVES:
            return form
        name, correlation = self.follows[0]
        moves = "against" if correlation < 0 else "with"
        text = f"{form}; it moves {moves} {name}, correlation {correlation:.2f}"
        opposes = correlation < -_OPPOSES and self.place == f"equation of {name}"
        return f"{text}, as friction or damping does" if opposes else text


def rank_input_locations(base: Hypothesis, journal: Journal | None = None) -> tuple[list[InputLocation], int]:
    """Fit an unknown signal together with all parameters, at each port in turn.

    Each recording has a signal of its own. A fit that ends far above the best is stopped (`fit_to_end`). Signals are
    compared with the fine detail that their knots cannot show (`with_fine_detail`); see `probabilities_of`.

    Parameters
    ----------
    base : Hypothesis
        Without effects.
    journal : Journal, optional
        Keeps the fits.

    Returns
    -------
    locations : list of InputLocation
        The most probable first; empty where the simulator has no ports, or no signal explains enough.
    n_simulations : int
    """
    journal = Journal() if journal is None else journal
    problems: dict[tuple[Effect, ...], FitProblem] = {}
    calls: list[Callable[[], JointFit]] = []
    events = dict.fromkeys(o.event.name for o in base.observations)
    for effect in base.simulator.effects:
        if effect.kind != "latent":
            continue
        signals = tuple(effect.during(name) for name in events)
        simulator = base.simulator
        for signal in signals:
            simulator = simulator.extend(signal)
        fixed = {signal.local(name) for signal in signals for name in (signal.strength.name, *PULSE)}
        names = [name for name in simulator.movable if name not in fixed]
        problems[signals] = FitProblem(simulator, base.observations, names)
        # also from nominal: fitted parameters have made up for the input, and lead to a local minimum
        starts = np.zeros((2, len(names)))
        starts[0, : len(base.u)] = base.u
        calls.append(partial(_first_fit, signals, problems[signals], starts))
    threads = base.simulator.threads
    _log.info("unknown input at %d ports", len(calls))

    def fitted() -> list[Hypothesis]:
        fits = fit_to_end(try_all(calls, threads), threads)
        return parallel_map([fit.hypothesis for fit in fits], threads)

    found = journal.all_fitted(problems, fitted)
    count = sum(problem.n_simulations for problem in problems.values())
    # fine detail without a signal would explain anything a little
    found = [hypothesis for hypothesis in found if _explained(hypothesis, base) >= _EXPLAINS]
    tried = try_all([partial(with_fine_detail, hypothesis) for hypothesis in found], threads)
    full = [signal for signal in tried if signal is not None]
    count += sum(signal.n_simulations for signal in full)
    if not full:
        return [], count
    quantities = _quantities(base)
    pairs = zip(full, probabilities_of(full), strict=True)
    locations = [_location(s, float(w), _explained(s.hypothesis, base), quantities) for s, w in pairs]
    return sorted(locations, key=lambda p: (-p.probability, p.chi2_per_sample)), count


def _first_fit(signals: Sequence[Effect], problem: FitProblem, starts: _Array) -> JointFit:
    return JointFit(signals, problem, starts).run(SLICE).keep(1)


def probabilities_of(found: Sequence[DetailedSignal]) -> _Array:
    """Probabilities (n,) of locations by their excess, and a little by how simple the signal is.
    The best excess counts as noise of that size and smoothness, but it is partly error of form: the odds are at most
    the squared ratio of two excesses. Evidence, (D7), depends on the prior of each port, so it counts at most three to
    one.
    """
    n = len(found[0].residuals)
    evidence, excess = (np.array([getattr(s, name) for s in found]) for name in ("evidence", "excess"))
    left = np.maximum(excess, np.sqrt(2.0 * n))
    least = np.lexsort((-evidence, left))[0]
    inflation = found[least].inflation
    by_noise = 0.5 * (left - left[least]) / inflation
    by_form = _FORM * np.log(left / left[least])
    simpler = np.clip((evidence - evidence[least]) / inflation, -np.log(_SIMPLER), np.log(_SIMPLER))
    weights = np.exp(simpler - np.minimum(by_noise, by_form))
    return np.asarray(weights / weights.sum())


def _explained(hypothesis: Hypothesis, base: Hypothesis) -> float:
    """Share of the base fit's excess that a hypothesis explains."""
    n = len(base.residuals)
    return float(np.clip((base.chi2 - hypothesis.chi2) / max(base.chi2 - n, 1.0), 0.0, 1.0))


def waveform(knots: _Array, time: _Array, start: float, pulses: _Array | None = None) -> _Array:
    """Values of (I1) at instants in seconds for an event at `start`, with equally spaced pulses if given."""
    share = np.clip(time - start, 0.0, None) / (time[-1] - start)
    signal = np.interp(np.sqrt(share) * KNOTS, np.arange(KNOTS + 1), np.r_[0.0, knots])
    if pulses is None:
        return signal
    return signal + np.interp(share * len(pulses), np.arange(len(pulses) + 1), np.r_[0.0, pulses])


def _quantities(base: Hypothesis) -> dict[str, dict[str, _Array]]:
    """Signals and states of each device in the first recording, without the input, which all would follow."""
    observation = base.observations[0]
    event, time = observation.event, observation.time
    signals = dict(zip(observation.channels, base.predict(event), strict=True))
    if isinstance(event, InputSignal):
        signals |= event.signals
    if isinstance(event, Playback):
        signals |= {name: event.signals[name] for name in (("P", "Q") if event.by_power else ("V",))}
        if "angle" in event.signals:
            signals["frequency"] = np.gradient(event.signals["angle"], time)
    devices = {effect.device for effect in base.simulator.effects if effect.kind == "latent"}
    return {device: signals | base.simulator.trajectories(base.theta, event, device) for device in devices}


def _location(
    found: DetailedSignal, probability: float, explained: float, quantities: dict[str, dict[str, _Array]]
) -> InputLocation:
    hypothesis = found.hypothesis
    effect, observation = hypothesis.effects[0], hypothesis.observations[0]
    time, start = observation.time, observation.event.start
    signal = waveform(found.knots, time, start, found.pulses)
    after = time >= start
    follows = []
    for name, values in quantities[effect.device].items():
        a, b = signal[after] - signal[after].mean(), values[after] - values[after].mean()
        norm = float(np.sqrt((a @ a) * (b @ b)))
        if norm > 0:
            follows.append((name, float(a @ b / norm)))
    follows.sort(key=lambda item: -abs(item[1]))
    return InputLocation(
        device_name(hypothesis.simulator, effect.device),
        effect.port,
        probability,
        found.chi2_per_sample,
        time,
        signal,
        tuple(follows),
        next(p.unit for p in effect.parameters if p.name == "a0"),
        explained,
        shape_of(time[after], signal[after]),
        states_of(hypothesis.simulator, hypothesis.theta, observation.event),
    )
