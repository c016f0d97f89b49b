"""Influence of noise on pairs, on effects outside of the library and where nothing is hidden: renews its docs table.

``python benchmarks/discovery_noise.py OUT [CASE [SCENARIOS [SEED [JOBS]]]]`` searches hidden scenarios at each noise
level, with effects down to a third of the noise. Finished scenarios stay in OUT: the same call, or one with more
scenarios, goes on. Single effects by size: ``discovery_curves.py``.
"""

import sys
from pathlib import Path

from discovery_curves import at_levels

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.bench.markdown import table_lines

DOCS = Path(__file__).resolve().parents[1] / "docs"
#: scenarios at each level, and seed, of the tables in the docs
STUDIES = {"plant": (40, 227), "ieee39": (24, 239)}
LEAST_SIZE = 0.3
COLUMNS = {
    "nothing hidden: something reported": "false_alarm",
    "one effect or fault: named rightly": "correct",
    "two effects: both named": "both_found",
    "outside: unknown": "outside_unknown",
    "outside: right port": "outside_port",
}


def table(results):
    """Markdown table of outcomes by noise."""
    rows = []
    for result in results:
        rates = [result["rates"][name] for name in COLUMNS.values()]
        cells = [f"{round(r['value'] * r['n'])} of {r['n']}" if r["n"] else "" for r in rates]
        rows.append((f"{result['noise_db']:g} dB", *cells))
    first = results[0]
    return "\n".join(table_lines(("noise", *COLUMNS), rows)) + (
        f"\n\nCase {first['case']}, {len(first['scenarios'])} scenarios at each level, seed {first['seed']}, "
        f"effects at least {first['least_size']:g} times the noise.\n"
    )


def main(out, case="plant", *numbers):
    """Run all levels, and write the table."""
    results = at_levels(out, STUDIES, case, *numbers, least_size=LEAST_SIZE)
    name = "discovery_noise" if case == "plant" else f"discovery_noise_{case}"
    write_text_atomic(DOCS / "tables" / f"{name}.md", table(results))


if __name__ == "__main__":
    main(*sys.argv[1:3], *(int(n) for n in sys.argv[3:]))
