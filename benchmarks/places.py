"""How often an unknown signal is put at the right device: renews its table in the docs.

``python benchmarks/places.py OUT [CASE [SCENARIOS [SEED [JOBS]]]]``: hides so many effects that the library does not
hold, and ranks places without a search for effects, which would end as unknown anyway and takes most of the time. What
is finished stays in OUT; the same call, also one with more scenarios, goes on from there.
"""

import json
import sys
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from scipy.stats import binomtest
from tqdm import tqdm

from errorscreen.bench.discovery import CASES
from errorscreen.discovery import CauseFinder
from errorscreen.exceptions import DataWarning
from errorscreen.persistence import write_text_atomic

DOCS = Path(__file__).resolve().parents[1] / "docs"
#: scenarios and seed of the tables in the docs
STUDIES = {"plant": (60, 486), "ieee39": (40, 486)}
JOBS, NOISE_DB = 2, 40.0


def searched(case, seed, number):
    """Draw one scenario, and rank places; what was hidden and what was found."""
    streams = np.random.SeedSequence(seed, spawn_key=(number,)).spawn(2)
    draw, _ = CASES[case]
    with warnings.catch_warnings():  # of recordings that look odd, which is meant
        warnings.simplefilter("ignore", DataWarning)
        hidden = draw(streams[0], NOISE_DB, kind="outside")
        finder = CauseFinder(
            hidden.simulator, max_effects=0, random_state=int(streams[1].generate_state(1)[0])
        ).fit(list(hidden.recordings))
    return {
        "number": number,
        "hidden": hidden.hidden[0],
        "size": hidden.size,
        "device": hidden.device,
        "place": hidden.place,
        "verdict": finder.verdict_.kind,
        "places": [[p.device, p.place, p.probability, p.chi2_per_sample] for p in finder.places_],
    }


def table(rows):
    """Markdown table by what is hidden: how many are unknown, and of these at the right device and port."""
    kinds = defaultdict(list)
    for row in rows:
        kinds[row["hidden"]].append(row)
    header = (
        "hidden",
        "scenarios",
        "unknown",
        "right device",
        "right port",
        "probability of the first place",
    )
    lines = [f"| {' | '.join(header)} |", "|---" * len(header) + "|"]
    lines += [_line(f"`{name}`", kinds[name]) for name in sorted(kinds)]
    lines.append(_line("all", rows))
    return "\n".join(lines)


def _line(name, rows):
    unknown = [row for row in rows if row["verdict"] == "unknown"]
    first = [(row, row["places"][0]) for row in unknown if row["places"]]
    device = sum(place[0] == row["device"] for row, place in first)
    port = sum(place[:2] == [row["device"], row["place"]] for row, place in first)
    probabilities = [place[2] for _, place in first]
    span = f"{min(probabilities):.2f} to {max(probabilities):.2f}" if first else ""
    return f"| {name} | {len(rows)} | {len(unknown)} | {device} | {port} | {span} |"


def main(out, case="ieee39", scenarios=None, seed=None, jobs=JOBS):
    """Run what is missing, and write the table."""
    usual = STUDIES[case]
    scenarios = usual[0] if scenarios is None else scenarios
    seed = usual[1] if seed is None else seed
    folder = Path(out) / f"{case}-{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    missing = [i for i in range(scenarios) if not (folder / f"{i}.json").exists()]
    found = Parallel(n_jobs=jobs, return_as="generator_unordered")(
        delayed(searched)(case, seed, i) for i in missing
    )
    for row in tqdm(found, total=len(missing), desc="scenarios"):
        write_text_atomic(folder / f"{row['number']}.json", json.dumps(row))
    rows = [json.loads((folder / f"{i}.json").read_text(encoding="utf-8")) for i in range(scenarios)]
    unknown = [row for row in rows if row["verdict"] == "unknown"]
    right = sum(bool(row["places"]) and row["places"][0][0] == row["device"] for row in unknown)
    text = (
        f"{table(rows)}\n\nCase {case}, seed {seed}, {NOISE_DB:g} dB. Right device: {right} of {len(unknown)}"
    )
    if unknown:
        interval = binomtest(right, len(unknown)).proportion_ci(0.95)
        text += f", 95 % interval of the rate {interval.low:.2f} to {interval.high:.2f}"
    text += ".\n"
    write_text_atomic(DOCS / "tables" / f"places_{case}.md", text)


if __name__ == "__main__":
    main(*sys.argv[1:3], *(int(n) for n in sys.argv[3:]))
