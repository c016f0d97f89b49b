"""Time of a simulation of units of standard models, and of their compilation.

``python benchmarks/standard_models_speed.py`` prints a row for each unit and number of simulations. With ``--beside
SECONDS``, the time that another program takes for the same playback, the ratio is printed, too. Each time is the least
of several runs; a cache directory of its own makes the compilation cold.
"""

import argparse
import os
import tempfile
from time import perf_counter

UNITS = {
    "GENROU+SEXS+TGOV1": ("GENROU", "SEXS", "TGOV1"),
    "GENROU+ESST4B+PSS2A+GGOV1": ("GENROU", "ESST4B", "PSS2A", "GGOV1"),
}
NUMBERS, RUNS = (1, 64, 1024), 5
#: length of the playback and distance of its samples, in s
LENGTH, DT = 10.0, 0.01


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--step", type=float, default=0.005)
    parser.add_argument("--beside", type=float, help="seconds of another program for one playback of 10 s")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["ERRORSCREEN_CACHE_DIR"] = folder
        measure(options)


def measure(options: argparse.Namespace) -> None:
    """Compile and time every unit."""
    import numpy as np

    from errorscreen.events import Playback
    from errorscreen.models.standard import PARTS
    from errorscreen.models.unit import Record, unit
    from errorscreen.simulators import PlantSimulator

    time = np.arange(0.0, LENGTH, DT)
    voltage = 1.0 - 0.4 * ((time > 1.0) & (time < 1.1))
    angle = 0.1 * np.sin(5 * (time - 1.0)) * np.exp(-(time - 1.0)) * (time > 1.0)
    event = Playback(time, "dip", 1.0, {"V": voltage, "angle": angle}, {"V": 1.0, "P": 0.7, "Q": 0.1})
    print(f"{'unit':28} {'states':>6} {'compile s':>9} {'n':>5} {'us a run':>9} {'times as fast':>13}")
    for name, parts in UNITS.items():
        device = unit([Record(PARTS[part], {}) for part in parts])
        start = perf_counter()
        plant = PlantSimulator(device, event, step=options.step, n_threads=options.threads, effects=())
        nominal = plant.parameters.nominal
        plant.simulate(nominal).require_ok()
        compiled = perf_counter() - start
        for n in NUMBERS:
            theta = np.tile(nominal, (n, 1))
            plant.simulate(theta)
            best = min(timed(plant, theta) for _ in range(RUNS))
            ratio = f"{options.beside * n / best:13.0f}" if options.beside else ""
            print(f"{name:28} {len(device.states):6} {compiled:9.1f} {n:5} {1e6 * best / n:9.1f} {ratio}")


def timed(plant, theta) -> float:
    """Seconds of one call."""
    start = perf_counter()
    plant.simulate(theta)
    return perf_counter() - start


if __name__ == "__main__":
    main()
