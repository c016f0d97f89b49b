"""Share of unknown signals that are put at the right device: renews its table in the docs.

``python benchmarks/places.py OUT [CASE [SCENARIOS [SEED [JOBS]]]]`` hides effects outside of the library, and ranks
input locations without the search for effects, which takes most of the time and would end as unknown. Finished
scenarios stay in OUT: the same call, or one with more scenarios, goes on.
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

from scipy.stats import binomtest
from tqdm import tqdm

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.bench.discovery import search_all
from errorscreen.bench.markdown import table_lines
from errorscreen.bench.scenarios import LEAST_SIZE

DOCS = Path(__file__).resolve().parents[1] / "docs"
#: scenarios and seed of the tables in the docs
STUDIES = {"plant": (60, 486), "ieee39": (40, 617)}
JOBS, NOISE_DB = 2, 40.0


def table(rows):
    """Markdown table by hidden effect: number of unknown ones, and of these at the right device and port."""
    kinds = defaultdict(list)
    for row in rows:
        kinds[row["truth"]["hidden"][0]].append(row)
    titles = (
        "hidden",
        "scenarios",
        "unknown",
        "right device",
        "right port",
        "probability of the first place",
    )
    lines = [_cells(f"`{name}`", kinds[name]) for name in sorted(kinds)]
    return "\n".join(table_lines(titles, [*lines, _cells("all", rows)]))


def _cells(name, rows):
    unknown = [row for row in rows if row["verdict"] == "unknown"]
    placed = [row for row in unknown if row["place"]]
    device = sum(_right(row) for row in unknown)
    port = sum(_right(row) and row["place"]["port"] == row["truth"]["place"] for row in unknown)
    probabilities = [row["place"]["probability"] for row in placed]
    span = f"{min(probabilities):.2f} to {max(probabilities):.2f}" if placed else ""
    return name, len(rows), len(unknown), device, port, span


def _right(row):
    return row["place"] is not None and row["place"]["device"] == row["truth"]["device"]


def main(out, case="ieee39", scenarios=None, seed=None, jobs=JOBS):
    """Search missing scenarios, and write the table."""
    usual = STUDIES[case]
    scenarios = usual[0] if scenarios is None else scenarios
    seed = usual[1] if seed is None else seed
    folder = Path(out) / f"{case}-{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    missing = [i for i in range(scenarios) if not (folder / f"{i}.json").exists()]
    found = search_all(case, seed, missing, NOISE_DB, LEAST_SIZE, jobs, kinds=("outside",), max_effects=0)
    for row in tqdm(found, total=len(missing), desc="scenarios"):
        write_text_atomic(folder / f"{row['number']}.json", json.dumps(row))
    rows = [json.loads((folder / f"{i}.json").read_text(encoding="utf-8")) for i in range(scenarios)]
    unknown = [row for row in rows if row["verdict"] == "unknown"]
    right = sum(_right(row) for row in unknown)
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
