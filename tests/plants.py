"""Events and operating points that bring every part of the three devices into action."""

import numpy as np

from errorscreen.events import Playback
from errorscreen.models import DEVICES
from errorscreen.simulators import PlantSimulator

OPERATING_POINT = {"V": 1.0, "P": 0.7, "Q": 0.15}
DEVICE_NAMES = tuple(DEVICES)


def dip(depth=0.55, duration=0.15, stop=4.0, dt=1 / 60, swing=0.25):
    """A voltage dip at 1 s with an angle swing behind it."""
    time = np.arange(0, stop, dt)
    after = np.clip(time - 1.0, 0, None)
    voltage = np.where((time > 1) & (time < 1 + duration), 1.0 - depth, 1.0)
    voltage = voltage - np.where(time >= 1 + duration, 0.08 * np.exp(-(after - duration) / 0.3), 0)
    angle = swing * np.sin(2 * np.pi * 0.8 * after) * np.exp(-after / 2)
    return Playback(time, "dip", 1.0, {"V": voltage, "angle": angle}, OPERATING_POINT)


def flat(stop=4.0, dt=1 / 60):
    """Nothing happens."""
    time = np.arange(0, stop, dt)
    signals = {"V": np.ones_like(time), "angle": np.zeros_like(time)}
    return Playback(time, "flat", 1.0, signals, OPERATING_POINT)


def random_rows(simulator, n, seed=0):
    """Parameter vectors inside the bounds, shape (n, m)."""
    low, high = simulator.parameters.bounds.T
    return np.random.default_rng(seed).uniform(low, high, (n, len(low)))


def plant(device, event=None, **options):
    """Simulator of a device, driven with the dip."""
    return PlantSimulator(device, dip() if event is None else event, **options)
