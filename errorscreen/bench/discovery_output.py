"""Result, tables and figures of the discovery study."""

from __future__ import annotations

from itertools import cycle, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from errorscreen._runtime.persistence import write_json_atomic, write_text_atomic
from errorscreen.bench.discovery_rates import OUTCOMES, hides_one, rate_of
from errorscreen.bench.markdown import table_lines
from errorscreen.data.panels import COLOURS, figure_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: rows of the table of rates
_RATES = {
    "correct": "one effect or measurement fault hidden: named rightly",
    "wrong": "named wrongly",
    "unknown": "unknown",
    "missed": "explained by parameters",
    "false_alarm": "nothing hidden: something reported",
    "outside_unknown": "outside of the library: unknown",
    "outside_place": "outside of the library: right device",
    "outside_port": "outside of the library: right port",
    "both_found": "two effects hidden: both named",
    "both_wrong": "two effects hidden: something named that is not there",
    "interval_holds": "90 % intervals of the parameters of effects named rightly: hold the true value",
}
#: bins of the power curve by size, in multiples of the noise, and ticks of its axis
_SIZES = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, np.inf)
_TICKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
_DPI = 150


def write_discovery(result: dict[str, Any], out: Path) -> None:
    """Write ``result.json``, ``tables.md``, ``power.png`` and ``reliability.png`` into ``out``."""
    out.mkdir(parents=True, exist_ok=True)
    write_json_atomic(out / "result.json", result)
    write_text_atomic(out / "tables.md", tables(result))
    power_figure(result).savefig(out / "power.png", dpi=_DPI)
    reliability_figure(result).savefig(out / "reliability.png", dpi=_DPI)


def tables(result: dict[str, Any]) -> str:
    """Rates, counts by kind and held-out errors as Markdown."""
    head = (
        f"Case {result['case']}, {len(result['scenarios'])} hidden scenarios, seed {result['seed']}, noise "
        f"{result['noise_db']:g} dB, effects at least {result['least_size']:g} times the noise. In brackets: 95 % "
        "exact binomial interval."
    )
    rates = []
    for name, text in _RATES.items():
        entry = result["rates"][name]
        # a plant is the only device of its simulator
        if entry["n"] and (name, result["case"]) != ("outside_place", "plant"):
            low, high = entry["interval"]
            rates.append((text, f"{entry['value']:.3f} [{low:.3f}, {high:.3f}]", entry["n"]))
    facts = {
        "held-out error, extended over recalibrated model (median, named rightly)": "held_out_ratio_median",
        "the same over a fit of the true structure": "true_structure_ratio_median",
        "90 % quantile of that": "true_structure_ratio_p90",
        "expected calibration error of the probabilities": "expected_calibration_error",
        "seconds a search, median": "seconds_median",
        "longest": "seconds_max",
        "simulations a search, median": "simulations_median",
    }
    figures = [(text, result[name]) for text, name in facts.items()]
    outcomes = ("correct", "wrong", "unknown", "parameters")
    parts = [
        [head],
        table_lines(("", "rate", "of"), rates),
        table_lines(("hidden", *outcomes, "false alarm"), _counts(result["by_kind"])),
        table_lines(("hidden in", *outcomes), _counts(result["by_device"])),
        table_lines(("", ""), [(text, "" if value is None else f"{value:.3g}") for text, value in figures]),
    ]
    failures = []
    for r in result["scenarios"]:
        if r["outcome"] != "correct":
            truth, place = r["truth"], f"at {r['place']['port']}" if r["place"] else ""
            hidden = f"{truth['device']}: {' + '.join(truth['hidden']) or 'nothing'}"
            failures.append((hidden, f"{truth['size']:.1f}", r["verdict"], " + ".join(r["named"]) or place))
    if failures:
        parts += [["Not named rightly:"], table_lines(("hidden", "size", "verdict", "named"), failures)]
    return "\n\n".join("\n".join(part) for part in parts) + "\n"


def _counts(counts: dict[str, dict[str, int]]) -> list[list[Any]]:
    return [[name, *row.values()] for name, row in counts.items()]


def by_size(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Outcomes of single effects and measurement faults by size in multiples of the noise."""
    rows = [r for r in result["scenarios"] if hides_one(r)]
    found = []
    for low, high in pairwise(_SIZES):
        inside = [r for r in rows if low <= r["truth"]["size"] < high]
        if inside:
            shares = {name: rate_of([r["outcome"] == name for r in inside]) for name in OUTCOMES}
            median = float(np.median([r["truth"]["size"] for r in inside]))
            found.append({"low": low, "high": high, "median": median, "n": len(inside), **shares})
    return found


def power_figure(*results: dict[str, Any]) -> Figure:
    """Share of effects named rightly over their size, with exact 95 % intervals; a line for each level of noise."""
    figure = figure_of(6.0, 4.0)
    axes = figure.subplots()
    for result, color in zip(results, cycle(COLOURS[1:]), strict=False):
        bins = by_size(result)
        at, shares = [b["median"] for b in bins], [b["correct"]["value"] for b in bins]
        low, high = np.array([b["correct"]["interval"] for b in bins]).reshape(-1, 2).T
        axes.errorbar(
            at, shares, (shares - low, high - shares), fmt="o-", color=color, elinewidth=0.8, capsize=2,
            label=f"{result['noise_db']:g} dB",
        )  # fmt: skip
        if len(results) == 1:
            for x, y, b in zip(at, shares, bins, strict=True):
                axes.annotate(
                    f"{b['n']}", (x, y), textcoords="offset points", xytext=(0, 6), ha="center", fontsize=8
                )
        if at:
            axes.set_xscale("log")
            ticks = [t for t in _TICKS if 0.8 * axes.get_xlim()[0] < t < 1.25 * axes.get_xlim()[1]]
            axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
            axes.set_xticks([], minor=True)
    only = f"{results[0]['noise_db']:g} dB (numbers: scenarios)" if len(results) == 1 else "by noise"
    axes.set(
        xlabel="part of the effect that survives a refit, in multiples of the noise",
        ylabel="share named rightly",
        ylim=(-0.02, 1.1),
        title=f"{results[0]['case']}, {only}",
    )
    if len(results) > 1:
        axes.legend(loc="lower right")
    return figure


def reliability_figure(result: dict[str, Any]) -> Figure:
    """Share of first causes that are right over the probability they were given."""
    figure = figure_of(6.0, 4.0)
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    entries = result["reliability"]
    axes.plot([e["probability"] for e in entries], [e["share"] for e in entries], "o", color="#0b5fa5")
    for e in entries:
        at = (e["probability"], e["share"])
        axes.annotate(f"{e['n']}", at, textcoords="offset points", xytext=(6, -10), fontsize=8)
    axes.set(
        xlabel="probability of the first cause",
        ylabel="share that is right",
        xlim=(-0.02, 1.05),
        ylim=(-0.02, 1.05),
        title=f"expected calibration error {result['expected_calibration_error']:.3f}",
    )
    return figure
