"""Time and memory of simulations of units of standard models, and time of their compilation.

``python benchmarks/standard_models_speed.py`` prints a row for each unit, number of simulations and number of threads.
A cache directory of its own makes the first compilation cold; another process then loads the code. ``--andes PYTHON``,
the interpreter of an environment with ANDES 2.0, has that program play the same voltage back (PLBVFU1 with TimeSeries,
GENROU + SEXS + TGOV1) before and after, and prints how many times as fast each row is. Each time is the least of
several runs.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

UNITS = {
    "GENROU+SEXS+TGOV1": ("GENROU", "SEXS", "TGOV1"),
    "GENROU+ESST4B+PSS2A+GGOV1": ("GENROU", "ESST4B", "PSS2A", "GGOV1"),
}
NUMBERS, THREADS, RUNS = (1, 64, 1024), (1, 2), 5
#: length of the playback and distance of its samples, in s
LENGTH, DT = 10.0, 0.01


TIME = np.arange(0.0, LENGTH, DT)
V = 1.0 - 0.4 * ((TIME > 1.0) & (TIME < 1.1))
ANGLE = 0.1 * np.sin(5 * (TIME - 1.0)) * np.exp(-(TIME - 1.0)) * (TIME > 1.0)
F_NOMINAL, P, Q = 60.0, 0.7, 0.1
#: simulations whose memory is measured
MANY = 100_000


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--step", type=float, default=0.005)
    parser.add_argument("--andes", metavar="PYTHON", help="interpreter of an environment with ANDES")
    parser.add_argument("--only", choices=("andes", "load", "memory"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.only == "andes":
        print(andes_seconds())
    elif options.only:
        {"load": load, "memory": memory}[options.only](options.step)
    else:
        with tempfile.TemporaryDirectory() as folder:
            os.environ["ERRORSCREEN_CACHE_DIR"] = folder
            measure(options)


def again(python: str, only: str) -> str:
    """Run this script in another process for one measurement."""
    call = [python, __file__, "--only", only]
    return subprocess.run(call, check=True, capture_output=True, text=True).stdout.strip().splitlines()[-1]


def plant_of(parts: tuple[str, ...], step: float, threads: int = 1):
    """Simulator of a unit with typical constants."""
    from errorscreen.events import Playback
    from errorscreen.models.standard import PARTS
    from errorscreen.models.unit import Record, unit
    from errorscreen.simulators import PlantSimulator

    device = unit([Record(PARTS[part], {}) for part in parts])
    event = Playback(TIME, "dip", 1.0, {"V": V, "angle": ANGLE}, {"V": 1.0, "P": P, "Q": Q})
    return PlantSimulator(device, event, step=step, n_threads=threads, effects=())


def measure(options: argparse.Namespace) -> None:
    """Compile and time every unit."""
    beside = [float(again(options.andes, "andes"))] if options.andes else []
    rows = []
    for name, parts in UNITS.items():
        start = perf_counter()
        plant = plant_of(parts, options.step)
        nominal = plant.parameters.nominal
        plant.simulate(nominal).require_ok()
        print(f"{name}: {len(plant.device.states)} states, compiled in {perf_counter() - start:.1f} s")
        for threads in THREADS:
            plant = plant_of(parts, options.step, threads)
            for n in NUMBERS:
                theta = np.tile(nominal, (n, 1))
                plant.simulate(theta)
                rows.append((name, threads, n, min(timed(plant, theta) for _ in range(RUNS)) / n))
    for only in ("load", "memory"):
        print(again(sys.executable, only))
    beside += [float(again(options.andes, "andes"))] if options.andes else []
    if beside:
        print(f"ANDES: {beside[0]:.1f} and {beside[1]:.1f} s")
    for name, threads, n, seconds in rows:
        ratio = f", {min(beside) / seconds:,.0f} times as fast" if beside else ""
        print(f"{name}, {threads} thread(s), n = {n}: {1e6 * seconds:.0f} us a run{ratio}")


def load(step: float) -> None:
    """Time until the first simulation is done where the code is in the cache, imports aside."""
    import errorscreen.simulators  # noqa: F401

    start = perf_counter()
    plant = plant_of(UNITS["GENROU+ESST4B+PSS2A+GGOV1"], step)
    plant.simulate(plant.parameters.nominal).require_ok()
    print(f"from the cache in {perf_counter() - start:.1f} s")


def memory(step: float) -> None:
    """Largest memory of a process that makes many simulations and keeps their responses."""
    import resource

    plant = plant_of(UNITS["GENROU+SEXS+TGOV1"], step)
    theta = np.tile(plant.parameters.nominal, (MANY, 1))
    values = plant.simulate(theta).values
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"{MANY} runs: {peak:.2f} GiB, {values.nbytes / 2**30:.2f} GiB of these are the responses")


def timed(plant, theta) -> float:
    """Seconds of one call."""
    start = perf_counter()
    plant.simulate(theta)
    return perf_counter() - start


def andes_seconds() -> float:
    """Seconds in which ANDES plays the voltage back, without its set-up."""
    import andes

    andes.config_logger(40)
    frequency = 1.0 + np.gradient(ANGLE, DT) / (2 * np.pi * F_NOMINAL)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "voltage.csv"
        rows = np.column_stack([TIME, V, frequency])
        np.savetxt(path, rows, "%.8f", delimiter=",", header="t,V,f", comments="")
        system = andes.System(no_output=True, default_config=True)
        system.config.freq = F_NOMINAL
        rated = {"Vn": 20.0, "Sn": 100.0}
        for bus in (1, 2):
            system.add("Bus", {"idx": bus, "Vn": 20.0})
        system.add(
            "Line",
            {"idx": "link", "bus1": 1, "bus2": 2, "r": 0.0, "x": 1e-4, "b": 0.0, "Vn1": 20.0, "Vn2": 20.0},
        )
        system.add("Slack", {"idx": "source", "bus": 2, "v0": 1.0, **rated})
        system.add("PV", {"idx": "set", "bus": 1, "p0": P, "v0": 1.0, **rated})
        played = {"gen": "source", "xs": 1e-3, "Tv": 0.0, "Tf": 0.0, "fn": F_NOMINAL, "filename": ""}
        system.add("PLBVFU1", {"idx": "playback", "bus": 2, **played, **rated})
        series = {"path": str(path), "sheet": "", "fields": "V,f", "tkey": "t", "dests": "Vts,fts"}
        system.add(
            "TimeSeries", {"idx": "series", "mode": 1, "model": "PLBVFU1", "dev": "playback", **series}
        )
        reactances = {"xd": 1.8, "xq": 1.7, "xd1": 0.3, "xq1": 0.55, "xd2": 0.25, "xq2": 0.25, "xl": 0.15}
        times = {
            "Td10": 6.5,
            "Td20": 0.035,
            "Tq10": 0.6,
            "Tq20": 0.06,
            "M": 8.0,
            "D": 0.0,
            "S10": 0.1,
            "S12": 0.4,
        }
        system.add(
            "GENROU", {"idx": "unit", "bus": 1, "gen": "set", "fn": F_NOMINAL, **rated, **reactances, **times}
        )
        limits = {"EMIN": 0.0, "EMAX": 5.0}
        system.add(
            "SEXS",
            {"idx": "exciter", "syn": "unit", "TATB": 0.1, "TB": 10.0, "K": 100.0, "TE": 0.1, **limits},
        )
        gates = {"VMAX": 1.2, "VMIN": 0.0}
        system.add(
            "TGOV1", {"idx": "governor", "syn": "unit", "R": 0.05, "T1": 0.3, "T2": 2.0, "T3": 7.0, **gates}
        )
        system.setup()
        system.PFlow.run()
        config = system.TDS.config
        config.tf, config.no_tqdm, config.criteria, config.reset_tiny = TIME[-1], 1, 0, 1
        system.TDS.init()
        start = perf_counter()
        if not system.TDS.run():
            raise RuntimeError("ANDES did not reach the end")
        return perf_counter() - start


if __name__ == "__main__":
    main()
