"""A study of hidden scenarios in several sittings: each finished one stays as a line of text beside the docs.

``python benchmarks/long_study.py [CASE [SCENARIOS [SEED [JOBS]]]]`` searches the scenarios that are missing in
``docs/studies/CASE-SEED.jsonl``, and writes table and figures of the finished ones up to the first gap. A line states
the commit that searched it. Delete the lines first where the search has changed so much that outcomes may change.
"""

import json
import subprocess
import sys
from pathlib import Path

from tqdm import tqdm

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.bench.discovery import result_of, search_all
from errorscreen.bench.discovery_output import power_figure, reliability_figure, tables
from errorscreen.bench.scenarios import LEAST_SIZE

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
#: folders that decide the outcome of a search
CODE = ("errorscreen", "benchmarks")
#: scenarios and seed of the tables in the docs
STUDIES = {"plant": (200, 7219), "ieee39": (200, 9137)}
JOBS, NOISE_DB, DIGITS = 2, 40.0, 6


def read(path):
    """Finished scenarios by number."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return {row["number"]: row for row in map(json.loads, lines)}


def write(path, rows):
    """Write one line for each scenario, in order."""
    write_text_atomic(path, "".join(json.dumps(rows[i], ensure_ascii=False) + "\n" for i in sorted(rows)))


def rounded(value):
    """Round all numbers in a row to `DIGITS` digits."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [rounded(item) for item in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def gapless(rows):
    """Rows up to the first gap: those that end early are no fair sample."""
    found = []
    while len(found) in rows:
        found.append(rows[len(found)])
    return found


def git(*arguments):
    """Output of a git command."""
    command = ["git", *arguments]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def main(case="ieee39", scenarios=None, seed=None, jobs=JOBS):
    """Search missing scenarios, and write table and figures."""
    usual = STUDIES[case]
    scenarios = usual[0] if scenarios is None else scenarios
    seed = usual[1] if seed is None else seed
    path = DOCS / "studies" / f"{case}-{seed}.jsonl"
    rows = read(path)
    commit = git("describe", "--always") + ("-dirty" if git("status", "--porcelain", *CODE) else "")
    missing = [i for i in range(scenarios) if i not in rows]
    found = search_all(case, seed, missing, NOISE_DB, LEAST_SIZE, jobs)
    for row in tqdm(found, total=scenarios, initial=len(rows), desc="scenarios"):
        rows[row["number"]] = {"commit": commit, **rounded(row)}
        write(path, rows)
    result = result_of(gapless(rows), case=case, seed=seed, noise_db=NOISE_DB, least_size=LEAST_SIZE)
    name = "discovery" if case == "plant" else f"discovery_{case}"
    write_text_atomic(DOCS / "tables" / f"{name}.md", tables(result))
    for kind, figure in (("power", power_figure(result)), ("reliability", reliability_figure(result))):
        figure.savefig(DOCS / "images" / f"{name.replace('_', '-')}-{kind}.png", dpi=150)


if __name__ == "__main__":
    main(*sys.argv[1:2], *(int(n) for n in sys.argv[2:]))
