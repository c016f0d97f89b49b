"""Parts left out of units that PSS/E simulated: prints the causes that a search names.

``python benchmarks/psse_units.py DATA FOLDER [CASE ...] [--seed N]`` searches the units of ``DATA/psse_three_bus``,
whole and with a part left out, at 40 dB; a line of ``FOLDER/results.jsonl`` for each search. Of the exciter's run PSS/E
recorded the flows that give voltage and power at the terminal. Of the other runs it recorded rotor angle, speed and
magnitude of the voltage: there the unit runs in its network, and the deviation from these is printed first.
"""

import argparse
import json
import sys
from pathlib import Path
from time import perf_counter

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from errorscreen.data.recordings import Recording
from errorscreen.models.dyr import read_dyr
from tests.models.imposed import table
from tests.models.networks import ThreeBus, simulate

#: record, model file, what is left out of it, and columns of PSS/E to compare with
CASES = {
    "exciter": ("genrou_sexs", "SEXS/ThreeBus_SEXS", "SEXS", {}),
    "governor": (
        "genrou_sexs_hygov",
        "HYGOV/ThreeBus_HYGOV",
        "HYGOV",
        {"delta": "delta_deg", "omega": "dw_pu"},
    ),
    "saturation": ("genrou_normal_sat", "GENROU/ThreeBus_GENROU", "saturation", {"delta": "delta_deg"}),
}
UNIT, BASE, F_NOMINAL, TRIP, SNR = 102, 100.0, 60.0, 1.0, 40.0
#: rest in front of the record in s
LEAD = 4.0


def flows(record):
    """Terminal of the unit from the flow at bus 101 into the line to 103, in pu: V, angle, P, Q."""
    z, V1 = 0.01 + 0.12j, 1.05
    V3 = V1 - z * np.conj((record["P101_103_MW"] + 1j * record["Q101_103_Mvar"]) / BASE / V1)
    start = 0.99341 * np.exp(-1j * np.deg2rad(8.7697))
    load = V3 * np.conj((2.5 + 0.3j) / start) / start
    into = load + np.conj((record["P103_101_MW"] + 1j * record["Q103_101_Mvar"]) / BASE / V3)
    V2 = V3 + z * into
    current = into + np.where(record["time"] <= TRIP, (V2 - V1) / z, 0)
    power = V2 * np.conj(current)
    return np.abs(V2), np.angle(V2), power.real, power.imag


def terminal(data, case):
    """Time stamps and terminal of the unit, without noise."""
    name, file, _, columns = CASES[case]
    record = table(data / f"{name}.csv")
    if case == "exciter":
        found = flows(record)
        print(f"{case}: V2 by the flows differs by {np.abs(found[0] - record['V2']).max():.1e} pu at most")
        return record["time"], found
    unit = read_dyr(data / "inputs" / f"{file}.dyr").unit(UNIT)
    start = ThreeBus()
    at = {"V": start.V, "angle": start.angle, "P": start.power.real, "Q": start.power.imag}
    times, y = simulate(unit, ThreeBus(), at, ["Vr", "Vi", "P", "Q", "delta", "omega"], 0.005)
    keep = np.concatenate([[True], np.diff(times) > 0])
    inside = record["time"] <= times[-1]
    for quantity, column in columns.items():
        expected = np.deg2rad(record[column]) if quantity == "delta" else 1.0 + record[column]
        error = (np.interp(record["time"], times[keep], y[quantity][keep]) - expected)[inside]
        print(f"{case}: {quantity} differs from PSS/E's by {np.sqrt(np.mean(error**2)):.1e} rms")
    V = y["Vr"] + 1j * y["Vi"]
    found = [row[keep] for row in (np.abs(V), np.unwrap(np.angle(V)), y["P"], y["Q"])]
    return times[keep], found


def recording_of(data, case, seed):
    """Samples with noise relative to what moves."""
    time, columns = terminal(data, case)
    step = 0.005
    stamps = np.arange(-LEAD, time[-1], step)
    rng = np.random.default_rng([seed, list(CASES).index(case)])
    channels = {}
    for name, column in zip(("V", "angle", "P", "Q"), columns, strict=True):
        clean = np.interp(stamps, time, column)
        sigma = np.sqrt(np.mean((clean - clean[0]) ** 2)) * 10 ** (-SNR / 20)
        channels[name] = clean + sigma * rng.standard_normal(len(stamps))
    return Recording.from_arrays(
        stamps, channels, base_mva=BASE, f_nominal=F_NOMINAL, event_time=TRIP, name=case
    )


def unit_of(data, case, whole):
    """Unit of a case, whole or without a part."""
    _, file, part, _ = CASES[case]
    if whole or part != "saturation":
        return read_dyr(data / "inputs" / f"{file}.dyr").unit(UNIT, leave_out=[] if whole else [part])
    return read_dyr(data / "inputs" / f"{file}_NO_SAT.dyr").unit(UNIT)


def main():
    """Search the cases."""
    import errorscreen

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--whole", action="store_true", help="the whole units")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    data = options.data / "psse_three_bus"
    for case in options.cases or CASES:
        recording = recording_of(data, case, options.seed)
        plant = errorscreen.Plant(unit_of(data, case, options.whole), recording)
        started = perf_counter()
        found = errorscreen.diagnose(plant, recording, random_state=0)
        row = {
            "case": case,
            "left_out": "" if options.whole else CASES[case][2],
            "seed": options.seed,
            "verdict": found.verdict.kind,
            "causes": [[one.name, round(one.probability, 3)] for one in found.causes[:3]],
            "chi2": {one.channel: round(one.chi2_per_sample, 3) for one in found.models[-1].channels},
            "values": {
                one.name: [float(f"{v:.4g}") for v in (one.value, one.low, one.high)]
                for one in found.parameters
            },
            "seconds": round(perf_counter() - started),
        }
        with (options.folder / "results.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        print(found.summary(), row, flush=True)


if __name__ == "__main__":
    main()
