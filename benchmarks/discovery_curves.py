"""How many causes are named rightly, by size of the effect and by noise: renews table and figure in the docs.

``python benchmarks/discovery_curves.py OUT [CASE [SCENARIOS [SEED [JOBS]]]]``: so many hidden scenarios at each noise
level, with effects down to a third of the noise. What is finished stays in OUT; the same call, also one with more
scenarios, goes on from there.
"""

import sys
from pathlib import Path

from errorscreen.bench import discovery_study
from errorscreen.bench.discovery_output import by_size, power_figure
from errorscreen.persistence import write_text_atomic

DOCS = Path(__file__).resolve().parents[1] / "docs"
LEVELS = (40.0, 30.0, 20.0)
#: scenarios at each level, and seed, of the tables in the docs
STUDIES = {"plant": (40, 227), "ieee39": (24, 239)}
JOBS, LEAST_SIZE = 2, 0.3


def table(results):
    """Markdown table of outcomes by noise and size, and of false alarms."""
    header = ("noise", "size", "scenarios", "named rightly", "wrongly", "unknown", "explained by parameters")
    lines = [f"| {' | '.join(header)} |", "|---" * len(header) + "|"]
    for result in results:
        for b in by_size(result):
            size = f"{b['low']:g} to {b['high']:g}" if b["high"] < float("inf") else f"over {b['low']:g}"
            shares = " | ".join(f"{b[name]:.2f}" for name in ("correct", "wrong", "unknown", "missed"))
            lines.append(f"| {result['noise_db']:g} dB | {size} | {b['n']} | {shares} |")
    lines += [
        "",
        "| noise | nothing hidden: something reported | two effects: both named | outside: unknown, right port |",
    ]
    lines.append("|---|---|---|---|")
    for result in results:
        rates = result["rates"]
        cells = [_of(rates["false_alarm"]), _of(rates["both_found"])]
        cells.append(f"{_of(rates['outside_unknown'])}, {_of(rates['outside_port'])}")
        lines.append(f"| {result['noise_db']:g} dB | {' | '.join(cells)} |")
    first = results[0]
    return "\n".join(lines) + (
        f"\n\nCase {first['case']}, {len(first['scenarios'])} scenarios at each level, seed {first['seed']}, "
        f"effects at least {first['least_size']:g} times the noise.\n"
    )


def _of(rate):
    return "" if rate["value"] is None else f"{round(rate['value'] * rate['n'])} of {rate['n']}"


def main(out, case="plant", scenarios=None, seed=None, jobs=JOBS):
    """Run all levels, and write table and figure."""
    usual = STUDIES[case]
    results = [
        discovery_study(
            Path(out) / f"{level:g}",
            case=case,
            scenarios=usual[0] if scenarios is None else scenarios,
            seed=usual[1] if seed is None else seed,
            noise_db=level,
            least_size=LEAST_SIZE,
            n_jobs=jobs,
            progress=True,
        )
        for level in LEVELS
    ]
    name = "discovery_curves" if case == "plant" else f"discovery_curves_{case}"
    write_text_atomic(DOCS / "tables" / f"{name}.md", table(results))
    power_figure(*results).savefig(DOCS / "images" / f"{name.replace('_', '-')}.png", dpi=150)


if __name__ == "__main__":
    main(*sys.argv[1:3], *(int(n) for n in sys.argv[3:]))
