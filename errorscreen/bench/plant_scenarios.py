"""Hidden scenarios of plant playback: a device, four events, deviating parameters and hidden effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.bench.hidden_effects import OTHER_FORMS, OUTSIDE
from errorscreen.bench.scenarios import Scenario, Setup, draw_kind, draw_scenario, pick
from errorscreen.data.moves import first_move
from errorscreen.data.observations import Observation
from errorscreen.data.preparation import LEAST_MOVE
from errorscreen.data.recordings import Recording
from errorscreen.effects import Effect, common_skew, effects_of, measurement_effects
from errorscreen.engine.vmath import smooth_step
from errorscreen.events import Playback
from errorscreen.exceptions import InputError
from errorscreen.models import DEVICES
from errorscreen.simulators import PlantSimulator

#: step of the truth in seconds, a tenth of the fitted model's step
TRUTH_STEP = 2.5e-4
#: samples a second, and start of the event and end of a recording in seconds
RATE, START, STOP = 120, 1.0, 6.0
#: samples of the truth for each recorded one
_FINE = 10
OPERATING_POINT = {"V": 1.0, "P": 0.72, "Q": 0.12}

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class GridSide:
    """Event at the terminal of a plant: a dip and a lasting step (pu), a swing (rad, Hz), a frequency offset (Hz)."""

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


#: events to fit, and events to judge on
FIT = (
    GridSide("fault", 0.5, 0.12, -0.02, 0.30, 0.9, 0.05),
    GridSide("voltage up, frequency down", 0.0, 0.1, 0.06, 0.10, 0.6, -0.25),
)
HELD_OUT = (
    GridSide("far fault", 0.3, 0.20, -0.04, 0.20, 0.7, -0.10),
    GridSide("longer fault", 0.45, 0.25, 0.03, 0.35, 1.1, 0.15),
)


def draw_plant_scenario(
    seed: Any, noise_db: float, *, kind: str | None = None, device: str | None = None, **sizes: Any
) -> Scenario:
    """Draw one scenario; kind and device are drawn where not given. See `draw_scenario` for the sizes."""
    rng = np.random.default_rng(seed)
    drawn_kind, drawn_device = draw_kind(rng), str(rng.choice(list(OTHER_FORMS)))
    kind, device = kind or drawn_kind, device or drawn_device
    space = DEVICES[device].candidates
    theta = space.nominal * rng.uniform(0.75, 1.25, len(space))
    return draw_scenario(plant_setup(device), rng, kind, device, theta, noise_db, **sizes)


@cache
def plant_setup(device: str) -> Setup:
    """Truth, events and recordings of the scenarios of a device."""
    events = [_fine_event(side) for side in (*FIT, *HELD_OUT)]
    return Setup(_truth(device), events, len(FIT), _FINE, _draw_effects, partial(_record, device, events))


def _draw_effects(
    kind: str, device: str, rng: np.random.Generator
) -> tuple[tuple[Effect, ...], tuple[str, ...]]:
    """Draw hidden effects and the names that are right."""
    mechanisms = _mechanisms(device)
    if kind == "other form":
        effect, name = pick(rng, OTHER_FORMS[device])
        return (effect,), (name,)
    if kind == "outside":
        return (pick(rng, OUTSIDE[device]),), ()
    if kind == "nothing":
        chosen: tuple[Effect, ...] = ()
    elif kind == "two effects":
        chosen = tuple(mechanisms[k] for k in sorted(rng.choice(len(mechanisms), 2, replace=False)))
    else:
        chosen = (pick(rng, mechanisms if kind == "effect" else _faults(device)),)
    return chosen, tuple(e.name for e in chosen)


@cache
def _truth(device: str) -> PlantSimulator:
    """Simulator of hidden truths, with all effects of the library and of `hidden_effects`."""
    own = (*(e for e, _ in OTHER_FORMS[device]), *OUTSIDE[device])
    effects = (*_mechanisms(device), *own, *_faults(device))
    return PlantSimulator(device, _fine_event(FIT[0]), step=TRUTH_STEP, effects=effects, n_threads=1)


def _mechanisms(device: str) -> list[Effect]:
    return [e for e in effects_of(device) if e.kind == "mechanism"]


def _faults(device: str) -> tuple[Effect, ...]:
    return (*measurement_effects(DEVICES[device].outputs), common_skew())


def _fine_event(side: GridSide) -> Playback:
    time = np.arange(0, STOP, 1 / (RATE * _FINE))
    return Playback(time, side.name, START, side.signals(time), OPERATING_POINT)


def _record(
    device: str, events: list[Playback], clean: list[_Array], noise_db: float, seed: int
) -> tuple[list[Observation], PlantSimulator]:
    """Sample, add noise to all four channels, and observe the recordings with the model to fit."""
    rng, ratio = np.random.default_rng(seed), 10 ** (-noise_db / 20)
    recordings = []
    for event, response in zip(events, clean, strict=True):
        time, noisy = event.time[::_FINE], {}
        for name, values in {**event.signals, "P": response[0], "Q": response[1]}.items():
            sampled = values[::_FINE]
            if name == "angle":  # a drifting angle would count as a large signal
                moved = 0.3 * _rms(event.signals["V"][::_FINE] - 1.0)
            else:
                moved = _rms(sampled - sampled[time < START].mean())
            noisy[name] = sampled + max(moved * ratio, 1e-6) * rng.standard_normal(len(time))
        _refuse_moves(time, noisy)
        options: dict[str, Any] = {"base_mva": 100.0, "f_nominal": 60.0, "event_time": START}
        recordings.append(Recording.from_arrays(time, noisy, name=event.name, **options))
    simulator = PlantSimulator(device, recordings[0], n_threads=1)
    return [simulator.observe(r) for r in recordings], simulator


def _refuse_moves(time: _Array, channels: Mapping[str, _Array]) -> None:
    """Refuse a response that makes a clear move before the event: each scenario begins at rest."""
    for name in ("V", "P", "Q"):
        move = first_move(time, channels[name], least=LEAST_MOVE)
        if move is not None and move.clear + 2 < np.searchsorted(time, START):
            raise InputError(f"{name} moves from {time[move.onset]:g} s on, before the event at {START:g} s")


def _rms(values: _Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
