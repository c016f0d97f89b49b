"""Parts left out of units that another program, ANDES, simulated: renews a table of ``docs/studies``.

``python benchmarks/andes_units.py --make FOLDER`` simulates the units, and needs ANDES but not errorscreen. ``--check
FOLDER`` compares the whole units with it in playback. ``--search FOLDER [CASE ...] [--seed N]`` searches the units
without a part, or with ``--whole`` the whole units, a line of ``FOLDER/results.jsonl`` for each search; finished ones
are not repeated.
"""

import argparse
import json
from pathlib import Path
from time import perf_counter

import numpy as np

#: mechanical power in pu
POWER = 0.75
#: rating of the source in units, and where a governor is left out: a fault hardly moves the mean speed, so there the
#: source is weak, and a generator beside it of so many pu of the unit is lost when the fault is cleared
STRONG, WEAK = 20.0, 3.0
LOST = 0.15
#: records by the names that errorscreen gives the constants. HYGOV of ANDES leaves the factor r Tr out: it is 1 here.
RECORDS = {
    "GENROU": {
        "Tpdo": 6.5, "Tppdo": 0.035, "Tpqo": 0.6, "Tppqo": 0.06, "H": 4.0, "D": 0.75, "Xd": 1.8, "Xq": 1.7, "Xpd": 0.3,
        "Xpq": 0.55, "Xpp": 0.25, "Xl": 0.15, "S10": 0.1, "S12": 0.4,
    },
    "SEXS": {"TA_TB": 0.1, "TB": 10.0, "K": 100.0, "TE": 0.1, "EMIN": 0.0, "EMAX": 5.0},
    "ESST4B": {
        "TR": 0.02, "KPR": 3.0, "KIR": 3.0, "VRMAX": 3.0, "VRMIN": -3.0, "TA": 0.01, "KPM": 1.0, "KIM": 0.0,
        "VMMAX": 3.0, "VMMIN": -3.0, "KG": 0.0, "KP": 6.7, "KI": 0.0, "VBMAX": 8.4, "KC": 0.1, "XL": 0.0, "THETAP": 0.0,
    },
    "TGOV1": {"R": 0.05, "T1": 0.3, "VMAX": 1.2, "VMIN": 0.0, "T2": 2.0, "T3": 7.0, "Dt": 0.0},
    "HYGOV": {
        "R": 0.05, "r": 0.4, "Tr": 2.5, "Tf": 0.05, "Tg": 0.3, "VELM": 0.5, "GMAX": 1.0, "GMIN": 0.0, "TW": 1.2,
        "At": 1.2, "Dturb": 0.0, "qNL": 0.08,
    },
    "IEEEG1": {
        "JBUS": 0, "M": 0, "K": 20.0, "T1": 0.15, "T2": 0.0, "T3": 0.2, "UO": 0.3, "UC": -0.5, "PMAX": 1.0, "PMIN": 0.0,
        "T4": 0.3, "K1": 0.3, "K2": 0.0, "T5": 7.0, "K3": 0.4, "K4": 0.0, "T6": 0.4, "K5": 0.3, "K6": 0.0, "T7": 0.05,
        "K7": 0.0, "K8": 0.0,
    },
    "IEEEST": {
        "IC": 1, "IB": 0, "A1": 0.02, "A2": 0.0004, "A3": 0.0, "A4": 0.0, "A5": 0.0, "A6": 0.0, "T1": 0.15, "T2": 0.03,
        "T3": 0.15, "T4": 0.03, "T5": 10.0, "T6": 10.0, "KS": 10.0, "LSMAX": 0.1, "LSMIN": -0.1, "VCU": 0.0, "VCL": 0.0,
    },
}  # fmt: skip
#: names in ANDES where they differ; None: not there
RENAMED = {
    "GENROU": {
        "Tpdo": "Td10", "Tppdo": "Td20", "Tpqo": "Tq10", "Tppqo": "Tq20", "H": None, "Xd": "xd", "Xq": "xq",
        "Xpd": "xd1", "Xpq": "xq1", "Xpp": "xd2", "Xl": "xl",
    },
    "SEXS": {"TA_TB": "TATB"},
    "HYGOV": {"TW": "Tw", "Dturb": "Dt"},
    "IEEEG1": {"JBUS": None, "M": None},
    "IEEEST": {"IC": "MODE", "IB": None},
}  # fmt: skip
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
NAMES = ("time", "V", "angle", "P", "Q")
#: fault and its clearing, between two samples, and end of the simulation in s
FAULT, CLEARING, END = 1.0 + 1 / 240, 1.1 + 1 / 240, 12.0
STEP, SAMPLE = 1 / 960, 1 / 120
#: rest in front of the simulation in s: its noise has to show how noise of the voltage passes through the unit
LEAD = 4.0
#: signal to noise in dB
SNR = 40.0
F_NOMINAL, BASE = 60.0, 100.0


def records_of(case):
    """Constants of each model of a case."""
    other = OTHER_RECORDS.get(case, {})
    return {model: RECORDS[model] | other.get(model, {}) for model in CASES[case]}


def simulate(case):
    """Terminal of a unit in ANDES at each step, columns as `NAMES`; two rows with one stamp are a jump."""
    import andes

    source = WEAK if case in WEAK_CASES else STRONG

    andes.config_logger(40)
    system = andes.System(no_output=True, default_config=True)
    system.config.freq = F_NOMINAL
    for bus, kV in ((1, 20.0), (2, 230.0), (3, 230.0), (4, 230.0)):
        system.add("Bus", {"idx": bus, "Vn": kV})
    line = {"b": 0.0, "Sn": BASE, "Vn2": 230.0}
    system.add("Line", {"idx": "transformer", "bus1": 1, "bus2": 2, "r": 0.0, "x": 0.12, "Vn1": 20.0, **line})
    system.add("Line", {"idx": "line", "bus1": 2, "bus2": 3, "r": 0.01, "x": 0.25, "Vn1": 230.0, **line})
    system.add("Slack", {"idx": "slack", "bus": 3, "v0": 1.0, "Vn": 230.0, "Sn": source * BASE})
    system.add("PV", {"idx": "set", "bus": 1, "p0": POWER, "v0": 1.02, "Vn": 20.0, "Sn": BASE})
    rated = {"fn": F_NOMINAL, "Vn": 230.0, "Sn": source * BASE}
    system.add(
        "GENCLS", {"idx": "source", "bus": 3, "gen": "slack", "M": 10.0, "D": 0.0, "xd1": 0.2, **rated}
    )
    system.add("Line", {"idx": "other line", "bus1": 3, "bus2": 4, "r": 0.0, "x": 0.1, "Vn1": 230.0, **line})
    if source == WEAK:
        system.add("PQ", {"idx": "load", "bus": 3, "p0": 1.0, "q0": 0.0, "Vn": 230.0})
        system.add("PV", {"idx": "set lost", "bus": 4, "p0": LOST, "v0": 1.0, "Vn": 230.0, "Sn": BASE})
        of_lost = {"gen": "set lost", "M": 4.0, "D": 0.0, "xd1": 0.3, **rated, "Sn": LOST * BASE}
        system.add("GENCLS", {"idx": "lost", "bus": 4, **of_lost})
        system.add("Toggle", {"idx": "trip", "model": "GENCLS", "dev": "lost", "t": CLEARING})
    for model, record in records_of(case).items():
        renamed = RENAMED.get(model, {})
        named = {renamed.get(name, name): value for name, value in record.items()}
        named.pop(None, None)
        if model == "GENROU":
            # ANDES takes the mechanical power as a torque, which damps less
            named |= {"M": 2 * record["H"], "D": record["D"] + POWER, "xq2": record["Xpp"]}
            named |= {"bus": 1, "gen": "set", "fn": F_NOMINAL, "Vn": 20.0, "Sn": BASE}
        else:
            named |= {"avr": "SEXS"} if model == "IEEEST" else {"syn": "GENROU"}
        system.add(model, {"idx": model, **named})
    system.add("Fault", {"idx": "fault", "bus": 2, "tf": FAULT, "tc": CLEARING, "xf": 0.02, "rf": 0.0})
    system.setup()
    system.PFlow.run()
    config = system.TDS.config
    config.tf, config.tstep, config.fixt, config.shrinkt, config.no_tqdm = END, STEP, 1, 0, 1
    config.criteria = 0  # the generator that is lost turns on alone
    system.TDS.run()
    time, y = np.array(system.dae.ts.t), system.dae.ts.y
    of = (system.Bus.v.a[0], system.Bus.a.a[0], system.GENROU.Pe.a[0], system.GENROU.Qe.a[0])
    for instant in (FAULT, CLEARING):  # an event acts within the 0.1 ms behind its instant
        row = int(np.abs(time - instant).argmin())
        time[row : row + 2] = 0.5 * (time[row] + time[row + 1])
    return np.column_stack([time, y[:, of]])


def make(folder):
    """Simulate all cases that are not there yet."""
    for case in CASES:
        path = folder / f"{case}.csv"
        if not path.exists():
            rows = simulate(case)
            np.savetxt(path, rows, "%.10g", delimiter=",", header=",".join(NAMES), comments="")
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
    for name, column in zip(NAMES[1:], rows.T[1:], strict=True):
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
