"""The embedded example: a synchronous machine whose hidden parameters the seed draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.sampling import generator
from errorscreen.data.recordings import Recording
from errorscreen.engine.vmath import smooth_step
from errorscreen.events import Playback
from errorscreen.models import SYNCHRONOUS_MACHINE
from errorscreen.simulators import PlantSimulator

#: standard deviations of the measurement noise: V in pu, angle in rad, P and Q in pu (about 50 dB)
NOISE = {"V": 2e-4, "angle": 2e-4, "P": 2e-3, "Q": 2e-3}
#: step of the hidden truth in seconds, a tenth of the fitted model's
TRUTH_STEP = 2.5e-4
#: seconds in which the magnitude falls and returns: the window of a phasor estimate, about two cycles
EDGE = 0.04
_OPERATING_POINT = {"V": 1.0, "P": 0.72, "Q": 0.12}


@dataclass(frozen=True)
class Dip:
    """A fault seen from a terminal: depth and duration of the dip, and the swing of the angle behind it."""

    name: str
    depth: float
    duration: float
    swing: float
    swing_frequency: float

    def signals(self, time: NDArray[np.float64], start: float) -> dict[str, NDArray[np.float64]]:
        """Magnitude in pu and angle in rad of the terminal voltage."""
        after = np.clip(time - start, 0, None)
        clear = np.clip(after - self.duration, 0, None)
        low = smooth_step(after / EDGE) - smooth_step(clear / EDGE)
        sag = self.depth * (low + 0.25 * smooth_step(clear / EDGE) * np.exp(-clear / 0.4))
        swing = self.swing * np.sin(2 * np.pi * self.swing_frequency * after) * np.exp(-after / 1.5)
        # the step of the frame at the fault is small compared with the swing that follows
        return {"V": 1.0 - sag, "angle": swing - 0.1 * self.depth * low}


FIT = Dip("fault near the terminal", 0.55, 0.12, 0.30, 0.9)
HELD_OUT = (Dip("fault far away", 0.25, 0.20, 0.20, 0.7), Dip("longer fault", 0.45, 0.25, 0.35, 1.1))


def demo_recordings(random_state: Any = 0) -> tuple[Recording, tuple[Recording, ...], dict[str, float]]:
    """Recordings of a machine with hidden parameters: one to fit, two to judge on, and the truth.

    All eight parameters are drawn uniformly within ±25 % of the typical values. The truth is simulated with a
    tenth of the step of the fitted model, and noise is added to all four recorded channels.

    Parameters
    ----------
    random_state : None, int, SeedSequence, Generator or RandomState

    Returns
    -------
    recording : Recording
    held_out : tuple of Recording
    truth : dict of str to float

    Examples
    --------
    >>> recording, held_out, truth = demo_recordings(1)
    >>> recording.names, len(held_out), sorted(truth)[:3]
    (('V', 'angle', 'P', 'Q'), 2, ['D', 'Td10', 'Tj'])
    """
    rng = generator(random_state)
    space = SYNCHRONOUS_MACHINE.candidates
    theta = space.nominal * rng.uniform(0.75, 1.25, len(space))
    recordings = tuple(_record(dip, theta, rng) for dip in (FIT, *HELD_OUT))
    return recordings[0], recordings[1:], dict(zip(space.names, theta.tolist(), strict=True))


def _record(dip: Dip, theta: NDArray[np.float64], rng: np.random.Generator) -> Recording:
    """Simulate the truth on a fine grid, sample it 120 times a second and add noise."""
    start, stop, rate, fine = 1.0, 6.0, 120, 10
    time = np.arange(0, stop, 1 / (rate * fine))
    event = Playback(time, dip.name, start, dip.signals(time, start), _OPERATING_POINT)
    truth = PlantSimulator(SYNCHRONOUS_MACHINE, event, step=TRUTH_STEP)
    P, Q = truth.simulate(theta).require_ok("the truth of the demo").values[0]
    values = {"V": event.signals["V"], "angle": event.signals["angle"], "P": P, "Q": Q}
    noisy = {
        name: signal[::fine] + NOISE[name] * rng.standard_normal(len(time[::fine]))
        for name, signal in values.items()
    }
    return Recording.from_arrays(
        time[::fine], noisy, base_mva=100.0, f_nominal=60.0, name=dip.name, event_time=start
    )
