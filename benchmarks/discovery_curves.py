"""Share of single causes that are named rightly, by size and by noise: renews table and figure in the docs.

``python benchmarks/discovery_curves.py OUT [CASE [SCENARIOS [SEED [JOBS]]]]`` hides effects and measurement faults at
each noise level. Their strengths are scaled to sizes from a thirtieth of the noise to three times the noise. A number
hides the same at each level. Finished scenarios stay in OUT: the same call, or one with more scenarios, goes on.
"""

import sys
from pathlib import Path

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.bench import discovery_study
from errorscreen.bench.discovery_output import by_size, power_figure
from errorscreen.bench.markdown import table_lines

DOCS = Path(__file__).resolve().parents[1] / "docs"
LEVELS = (40.0, 30.0, 20.0)
#: scenarios at each level, and seed
STUDIES = {"plant": (60, 5113), "ieee39": (20, 6257)}
#: kinds hidden in turn, and limits of their sizes
KINDS = ("effect", "effect", "effect", "other form", "measurement")
LEAST_SIZE, LARGEST_SIZE = 0.03, 3.0
JOBS = 2


def table(results):
    """Markdown table of outcomes by noise and size."""
    titles = ("noise", "size", "scenarios", "named rightly", "wrongly", "unknown", "explained by parameters")
    rows = []
    for result in results:
        for b in by_size(result):
            low, high = b["correct"]["interval"]
            cells = [f"{b['correct']['value']:.2f} [{low:.2f}, {high:.2f}]"]
            cells += [f"{b[name]['value']:.2f}" for name in ("wrong", "unknown", "missed")]
            rows.append((f"{result['noise_db']:g} dB", f"{b['low']:g} to {b['high']:g}", b["n"], *cells))
    first = results[0]
    return "\n".join(table_lines(titles, rows)) + (
        f"\n\nCase {first['case']}, {len(first['scenarios'])} scenarios at each level, seed {first['seed']}, sizes "
        "in multiples of the noise. In brackets: 95 % exact binomial interval.\n"
    )


def at_levels(out, usual, case="plant", scenarios=None, seed=None, jobs=JOBS, **options):
    """Results of `discovery_study` at each noise level, of the usual scenarios and seed where none are given."""
    return [
        discovery_study(
            Path(out) / f"{level:g}",
            case=case,
            scenarios=usual[case][0] if scenarios is None else scenarios,
            seed=usual[case][1] if seed is None else seed,
            noise_db=level,
            n_jobs=jobs,
            progress=True,
            **options,
        )
        for level in LEVELS
    ]


def main(out, case="plant", *numbers):
    """Run all levels, and write table and figure."""
    sizes = {"least_size": LEAST_SIZE, "largest_size": LARGEST_SIZE}
    results = at_levels(out, STUDIES, case, *numbers, kinds=KINDS, **sizes)
    name = "discovery_curves" if case == "plant" else f"discovery_curves_{case}"
    write_text_atomic(DOCS / "tables" / f"{name}.md", table(results))
    power_figure(*results).savefig(DOCS / "images" / f"{name.replace('_', '-')}.png", dpi=150)


if __name__ == "__main__":
    main(*sys.argv[1:3], *(int(n) for n in sys.argv[3:]))
