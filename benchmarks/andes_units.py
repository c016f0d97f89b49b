"""Parts left out of units that another program, ANDES, simulated: renews a table of ``docs/studies``.

``python benchmarks/andes_units.py --make FOLDER`` simulates the units (extra ``andes``). ``--check
FOLDER`` compares the whole units with it in playback. ``--search FOLDER [CASE ...] [--seed N]`` searches the units
without a part, or with ``--whole`` the whole units, a line of ``FOLDER/results.jsonl`` for each search; finished ones
are not repeated.
"""

import argparse
import json
from pathlib import Path
from time import perf_counter

import numpy as np

from errorscreen.bench.andes_network import BASE, COLUMNS, F_NOMINAL, FAULT, RECORDS, GridEvent, simulate_unit

#: rating of the source in units, and where a governor is left out: a fault hardly moves the mean speed, so there the
#: source is weak, and a generator beside it of so many pu of the unit is lost when the fault is cleared
STRONG, WEAK = 20.0, 3.0
LOST = 0.15
CASES = {
    "sexs": ("GENROU", "SEXS"),
    "tgov1": ("GENROU", "TGOV1"),
    "hygov": ("GENROU", "HYGOV"),
    "ieeeg1": ("GENROU", "IEEEG1"),
    "esst4b": ("GENROU", "ESST4B"),
    "sexs_ieeest": ("GENROU", "SEXS", "IEEEST"),
    "sexs_tgov1_ieeest": ("GENROU", "SEXS", "TGOV1", "IEEEST"),
    "sexs_tgov1_ieeest_weak": ("GENROU", "SEXS", "TGOV1", "IEEEST"),
    "unequal": ("GENROU", "SEXS", "IEEEST"),
    "single": ("GENROU", "SEXS", "IEEEST"),
    "narrow": ("GENROU", "SEXS", "IEEEST"),
}
WEAK_CASES = ("tgov1", "hygov", "ieeeg1", "sexs_tgov1_ieeest_weak")
#: stabilisers with two lead-lags that differ, with one, and with a lower limit
OTHER_RECORDS = {
    "unequal": {"IEEEST": {"T1": 0.3, "T2": 0.03, "T3": 0.1, "T4": 0.04, "KS": 8.0}},
    "single": {"IEEEST": {"T1": 0.2, "T2": 0.02, "T3": 0.0, "T4": 0.0, "KS": 15.0}},
    "narrow": {"IEEEST": {"LSMAX": 0.05, "LSMIN": -0.05}},
}
#: parts left out, one at a time, where it is not the last one
LEFT_OUT = {"sexs_tgov1_ieeest": ("IEEEST", "SEXS"), "sexs_tgov1_ieeest_weak": ("TGOV1",)}
#: duration of the fault and end of the simulation in s
DURATION, END = 0.1, 12.0
STEP, SAMPLE = 1 / 960, 1 / 120
#: rest in front of the simulation in s: its noise has to show how noise of the voltage passes through the unit
LEAD = 4.0
#: signal to noise in dB
SNR = 40.0


def records_of(case):
    """Constants of each model of a case."""
    other = OTHER_RECORDS.get(case, {})
    return {model: RECORDS[model] | other.get(model, {}) for model in CASES[case]}


def simulate(case):
    """Terminal of a unit in ANDES at each step; two rows with one stamp are a jump."""
    weak = case in WEAK_CASES
    event = GridEvent(0.02, DURATION, LOST if weak else 0.0)
    return simulate_unit(records_of(case), event, source=WEAK if weak else STRONG, end=END, step=STEP)


def make(folder):
    """Simulate all cases that are not there yet."""
    for case in CASES:
        path = folder / f"{case}.csv"
        if not path.exists():
            rows = simulate(case)
            np.savetxt(path, rows, "%.10g", delimiter=",", header=",".join(COLUMNS), comments="")
            print(path)


def unit_of(folder, case, leave_out=()):
    """Unit of a case by way of its DYR file, which is written first."""
    from errorscreen.models.dyr import read_dyr
    from errorscreen.models.standard import PARTS

    lines = []
    for model, record in records_of(case).items():
        numbers = (f"{record[one.name]:g}" for one in PARTS[model].fields)
        lines.append(f"1 '{model}' 1  {' '.join(numbers)} /\n")
    path = folder / f"{case}.dyr"
    path.write_text("".join(lines), "utf-8")
    return read_dyr(path).unit(leave_out=leave_out)


def check(folder):
    """Print the error of each whole unit in playback."""
    from errorscreen.bench.reference_models import play

    for case in CASES:
        if not (folder / f"{case}.csv").exists():
            continue
        time, V, angle, P, Q = np.loadtxt(folder / f"{case}.csv", delimiter=",", skiprows=1).T
        out = play(
            unit_of(folder, case), time, V, angle, {"P": P[0], "Q": Q[0]}, ["P", "Q"], f_nominal=F_NOMINAL
        )
        errors = [out["P"] - P, out["Q"] - Q]
        rms = [np.sqrt(np.mean(error**2)) for error in errors]
        print(f"{case:20} rms P {rms[0]:.1e}, Q {rms[1]:.1e}, largest {np.abs(errors).max():.1e}", flush=True)


def recording_of(folder, case, seed):
    """Samples with noise, and their noise relative to what moves."""
    from errorscreen.data.recordings import Recording

    rows = np.loadtxt(folder / f"{case}.csv", delimiter=",", skiprows=1)
    time = np.arange(-LEAD, END, SAMPLE)
    rng = np.random.default_rng([seed, list(CASES).index(case)])
    channels = {}
    for name, column in zip(COLUMNS[1:], rows.T[1:], strict=True):
        clean = np.interp(time, rows[:, 0], column)
        # the angle runs away behind a weak source, so its noise is that of the voltage there
        if not (name == "angle" and case in WEAK_CASES):
            sigma = np.sqrt(np.mean((clean - clean[0]) ** 2)) * 10 ** (-SNR / 20)
        channels[name] = clean + sigma * rng.standard_normal(len(time))
    return Recording.from_arrays(
        time, channels, base_mva=BASE, f_nominal=F_NOMINAL, event_time=FAULT, name=case
    )


def search(folder, cases, seed, max_effects, whole):
    """Search each case without each part, or whole."""
    import errorscreen

    path = folder / "results.jsonl"
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    done = {(row["case"], row["left_out"], row["seed"]) for row in map(json.loads, lines)}
    for case in cases or tuple(CASES):
        for part in ("",) if whole else LEFT_OUT.get(case, CASES[case][-1:]):
            if (case, part, seed) in done or not (folder / f"{case}.csv").exists():
                continue
            recording = recording_of(folder, case, seed)
            plant = errorscreen.Plant(unit_of(folder, case, [part] if part else []), recording)
            started = perf_counter()
            found = errorscreen.diagnose(plant, recording, random_state=0, max_effects=max_effects)
            row = {
                "case": case,
                "left_out": part,
                "seed": seed,
                "max_effects": max_effects,
                "verdict": found.verdict.kind,
                "causes": [[one.name, round(one.probability, 3)] for one in found.causes[:3]],
                "chi2": {one.channel: round(one.chi2_per_sample, 3) for one in found.models[-1].channels},
                "values": {
                    one.name: [float(f"{v:.4g}") for v in (one.value, one.low, one.high)]
                    for one in found.parameters
                },
                "seconds": round(perf_counter() - started),
            }
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            print(found.summary(), flush=True)


def main():
    """Do what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    what = parser.add_mutually_exclusive_group(required=True)
    for name in ("make", "check", "search"):
        what.add_argument(f"--{name}", type=Path, metavar="FOLDER")
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--max-effects", type=int, default=2)
    parser.add_argument("--whole", action="store_true", help="the whole units")
    arguments = parser.parse_args()
    if arguments.make:
        arguments.make.mkdir(parents=True, exist_ok=True)
        make(arguments.make)
    elif arguments.check:
        check(arguments.check)
    else:
        search(arguments.search, arguments.cases, arguments.seed, arguments.max_effects, arguments.whole)


if __name__ == "__main__":
    main()
