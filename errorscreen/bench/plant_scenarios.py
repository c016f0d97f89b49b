"""Hidden scenarios of plant playback: a device, events, deviating parameters, and something or nothing missing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.bench.hidden_effects import OTHER_FORMS, OUTSIDE
from errorscreen.bench.scenarios import (
    LEAST_SIZE,
    Scenario,
    Setup,
    draw_kind,
    draw_scenario,
    pick,
)
from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.effects import Effect, common_skew, effects_of, measurement_effects
from errorscreen.engine.vmath import smooth_step
from errorscreen.events import Playback
from errorscreen.models import DEVICES
from errorscreen.simulators import PlantSimulator

#: step of the hidden truth in seconds, a tenth of the one that the fitted model uses
TRUTH_STEP = 2.5e-4
#: samples a second, and length of a record in seconds
RATE, START, STOP = 120, 1.0, 6.0
_FINE = 10
OPERATING_POINT = {"V": 1.0, "P": 0.72, "Q": 0.12}

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class GridSide:
    """What the grid does at the terminal.

    Parameters
    ----------
    name : str
    depth, duration : float
        Of the dip in pu and seconds.
    step : float
        Change of the voltage that stays, in pu.
    swing, swing_frequency : float
        Of the angle, in rad and Hz.
    offset : float
        Lasting deviation of the frequency in Hz.
    """

    name: str
    depth: float = 0.0
    duration: float = 0.1
    step: float = 0.0
    swing: float = 0.0
    swing_frequency: float = 1.0
    offset: float = 0.0

    def signals(self, time: _Array) -> dict[str, _Array]:
        """Magnitude in pu and angle in rad of the terminal voltage."""
        edge = 0.04  # phasors are estimated over about two cycles
        after = np.clip(time - START, 0, None)
        clear = np.clip(after - self.duration, 0, None)
        low = smooth_step(after / edge) - smooth_step(clear / edge)
        sag = self.depth * (low + 0.2 * smooth_step(clear / edge) * np.exp(-clear / 0.4))
        swing = self.swing * np.sin(2 * np.pi * self.swing_frequency * after) * np.exp(-after / 1.5)
        drift = 2 * np.pi * self.offset * (after - 0.5 * (1 - np.exp(-after / 0.5)))
        return {"V": 1.0 - sag + self.step * smooth_step(after / 0.1), "angle": swing + drift}


#: events that are fitted, and events that are only judged on
FIT = (
    GridSide("fault", 0.5, 0.12, -0.02, 0.30, 0.9, 0.05),
    GridSide("voltage up, frequency down", 0.0, 0.1, 0.06, 0.10, 0.6, -0.25),
)
HELD_OUT = (
    GridSide("far fault", 0.3, 0.20, -0.04, 0.20, 0.7, -0.10),
    GridSide("longer fault", 0.45, 0.25, 0.03, 0.35, 1.1, 0.15),
)


def draw_plant_scenario(
    seed: Any,
    noise_db: float,
    *,
    kind: str | None = None,
    device: str | None = None,
    least_size: float = LEAST_SIZE,
    largest_size: float | None = None,
) -> Scenario:
    """Draw one scenario.

    Parameters
    ----------
    seed : int or SeedSequence
    noise_db : float
        Level of each channel's deviation from its value before the event over that of the noise, both rms.
    kind, device : str, optional
        Drawn where not given.
    least_size : float
        Effects whose size is less are drawn again.
    largest_size : float, optional
        Where given, strengths are scaled to sizes drawn between the two, evenly by order of magnitude.
    """
    rng = np.random.default_rng(seed)
    drawn_kind, drawn_device = draw_kind(rng), str(rng.choice(list(DEVICES)))
    kind, device = kind or drawn_kind, device or drawn_device
    space = DEVICES[device].candidates
    theta = space.nominal * rng.uniform(0.75, 1.25, len(space))
    return draw_scenario(_setup(device), rng, kind, device, theta, noise_db, least_size, largest_size)


@cache
def _setup(device: str) -> Setup:
    events = [_fine_event(side) for side in (*FIT, *HELD_OUT)]
    return Setup(_truth(device), events, len(FIT), _FINE, _draw_effects, partial(_record, device, events))


def _draw_effects(
    kind: str, device: str, rng: np.random.Generator
) -> tuple[tuple[Effect, ...], tuple[str, ...]]:
    """Hidden effects and the names that are right."""
    mechanisms = [e for e in effects_of(device) if e.kind == "mechanism"]
    if kind == "nothing":
        return (), ()
    if kind == "effect":
        chosen = pick(rng, mechanisms)
        return (chosen,), (chosen.name,)
    if kind == "two effects":
        i, j = rng.choice(len(mechanisms), 2, replace=False)
        pair = tuple(mechanisms[k] for k in sorted((i, j)))
        return pair, tuple(e.name for e in pair)
    if kind == "other form":
        effect, name = OTHER_FORMS[device][rng.integers(len(OTHER_FORMS[device]))]
        return (effect,), (name,)
    if kind == "outside":
        return (pick(rng, OUTSIDE[device]),), ()
    chosen = pick(rng, _faults(device))
    return (chosen,), (chosen.name,)


@cache
def _truth(device: str) -> PlantSimulator:
    """Simulator of hidden truths, with every effect of the library and all that only truths have."""
    own = (*(e for e, _ in OTHER_FORMS[device]), *OUTSIDE[device])
    mechanisms = tuple(e for e in effects_of(device) if e.kind == "mechanism")
    event = _fine_event(FIT[0])
    return PlantSimulator(
        device, event, step=TRUTH_STEP, effects=(*mechanisms, *own, *_faults(device)), n_threads=1
    )


def _faults(device: str) -> tuple[Effect, ...]:
    """Of the measurement."""
    return (*measurement_effects(DEVICES[device].outputs), common_skew())


def _fine_event(side: GridSide) -> Playback:
    time = np.arange(0, STOP, 1 / (RATE * _FINE))
    return Playback(time, side.name, START, side.signals(time), OPERATING_POINT)


def _record(
    device: str, events: list[Playback], clean: list[_Array], noise_db: float, seed: int
) -> tuple[list[Observation], PlantSimulator]:
    """Sample, add noise to all four channels, and bring the recordings onto the grid of the fitted model."""
    rng = np.random.default_rng(seed)
    recordings = []
    for event, response in zip(events, clean, strict=True):
        time = event.time[::_FINE]
        channels = {**event.signals, "P": response[0], "Q": response[1]}
        noisy = {}
        for name, values in channels.items():
            sampled = values[::_FINE]
            level = sampled[time < START].mean()
            sigma = float(np.sqrt(np.mean((sampled - level) ** 2))) * 10 ** (-noise_db / 20)
            if name == "angle":  # a drifting angle would count as a large signal
                sigma = (
                    0.3
                    * float(np.sqrt(np.mean((channels["V"][::_FINE] - 1.0) ** 2)))
                    * 10 ** (-noise_db / 20)
                )
            noisy[name] = sampled + max(sigma, 1e-6) * rng.standard_normal(len(time))
        recordings.append(
            Recording.from_arrays(
                time, noisy, base_mva=100.0, f_nominal=60.0, name=event.name, event_time=START
            )
        )
    simulator = PlantSimulator(device, recordings[0], n_threads=1)
    return [simulator.observe(r) for r in recordings], simulator
