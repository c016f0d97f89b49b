"""Time and memory of ``errorscreen run`` on a long recording, beside another checkout.

``python benchmarks/long_recordings.py OUT [OLD] [--rate 1000] [--seconds 60]`` makes a recording of a synchronous
machine whose parameters are wrong and nothing else, and runs the command on it here and in the checkout OLD, one after
the other. Memory is the largest resident set of the command and of the processes that it waited for. Let nothing else
run.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path
from time import perf_counter

import numpy as np
import pandas as pd

from errorscreen.bench.timing import machine
from errorscreen.events import Playback
from errorscreen.simulators import PlantSimulator

ROOT = Path(__file__).resolve().parents[1]
#: standard deviation of the noise in pu and rad
NOISE = 2e-3
CASE = """title = "A long recording"
[recording]
path = "unit.csv"
time = "time"
base_mva = 100.0
f_nominal = 60.0
[recording.columns]
V = { column = "V", unit = "pu" }
angle = { column = "angle", unit = "rad" }
P = { column = "P", unit = "pu" }
Q = { column = "Q", unit = "pu" }
[device]
type = "synchronous_machine"
"""


def voltage(time):
    """A dip of 0.15 s at 5 s, after which magnitude and angle swing for some seconds."""
    after = np.clip(time - 5.0, 0.0, None)
    dip = 0.3 * (np.tanh((time - 5.0) / 0.01) - np.tanh((time - 5.15) / 0.01)) / 2
    swing = np.exp(-after / 3.0) * np.sin(2 * np.pi * 1.1 * after)
    return 1.0 - dip - 0.01 * swing, 0.05 * swing


def write_case(folder, rate, seconds):
    """Table and case file."""
    folder.mkdir(parents=True, exist_ok=True)
    time = np.arange(0.0, seconds, 1.0 / rate)
    V, angle = voltage(time)
    event = Playback(time, "dip", 5.0, {"V": V, "angle": angle}, {"V": V[0], "P": 0.7, "Q": 0.2})
    unit = PlantSimulator("synchronous_machine", event, step=1.0 / rate, effects=())
    rng = np.random.default_rng(3)
    theta = unit.parameters.nominal * rng.uniform(0.8, 1.2, len(unit.parameters.names))
    P, Q = unit.simulate(theta).require_ok("truth").values[0]
    columns = {"V": V, "angle": angle, "P": P, "Q": Q}
    table = pd.DataFrame(
        {"time": time} | {key: x + NOISE * rng.standard_normal(len(x)) for key, x in columns.items()}
    )
    table.round(7).to_csv(folder / "unit.csv", index=False)
    (folder / "case.toml").write_text(CASE)


def measured(checkout, folder, label):
    """Seconds, bytes and exit code of one run of the command."""
    command = [sys.executable, "-m", "errorscreen", "run", "case.toml", "--out", label, "--fresh"]
    start = perf_counter()
    with open(folder / f"{label}.txt", "w") as said:
        process = subprocess.Popen(
            command, cwd=folder, env={**os.environ, "PYTHONPATH": str(checkout)}, stdout=said, stderr=said
        )
        _, status, used = os.wait4(process.pid, 0)
    return perf_counter() - start, 1024 * used.ru_maxrss, os.waitstatus_to_exitcode(status)


def main():
    """Print a line for each checkout."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", help="folder for the case and its reports")
    parser.add_argument("old", nargs="?", help="another checkout")
    parser.add_argument("--rate", type=float, default=1000.0, help="samples a second")
    parser.add_argument("--seconds", type=float, default=60.0)
    options = parser.parse_args()
    folder = Path(options.out).resolve()
    write_case(folder, options.rate, options.seconds)
    print(machine(), f"{options.seconds:g} s at {options.rate:g} Hz", sep="; ")
    rows = []
    for label, checkout in {"here": ROOT, "old": options.old and Path(options.old).resolve()}.items():
        if not checkout:
            continue
        seconds, peak, code = measured(checkout, folder, label)
        rows.append((seconds, peak))
        print(f"{label}: {seconds:.0f} s, {peak / 1e9:.2f} GB, exit code {code}")
    if len(rows) == 2:
        (new, small), (old, large) = rows
        print(f"time {new / old:.3f} x, memory {small / large:.3f} x")


if __name__ == "__main__":
    main()
