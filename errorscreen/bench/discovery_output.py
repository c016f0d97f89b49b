"""Result, tables and figures of the discovery study."""

from __future__ import annotations

from itertools import cycle, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from errorscreen._runtime.persistence import write_json_atomic, write_text_atomic
from errorscreen.bench.discovery_rates import rate_of
from errorscreen.data.panels import COLOURS, figure_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: what each rate says, in the order of the table
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
#: limits of the sizes over which the power curve is drawn, in multiples of the noise
_SIZES = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, np.inf)
#: sizes that may be told at its axis
_TICKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
#: outcomes of scenarios that hide something, see `discovery_study`
_OUTCOMES = ("correct", "wrong", "unknown", "missed")
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
    lines = [
        f"Case {result['case']}, {len(result['scenarios'])} hidden scenarios, seed {result['seed']}, noise "
        f"{result['noise_db']:g} dB, effects at least {result['least_size']:g} times the noise. In brackets: 95 % "
        "exact binomial interval.",
        "",
        "| | rate | of |",
        "|---|---|---|",
    ]
    for name, text in _RATES.items():
        entry = result["rates"][name]
        # a plant is the only device of its simulator
        if entry["n"] and (name, result["case"]) != ("outside_place", "plant"):
            low, high = entry["interval"]
            lines.append(f"| {text} | {entry['value']:.3f} [{low:.3f}, {high:.3f}] | {entry['n']} |")
    lines += [
        "",
        "| hidden | correct | wrong | unknown | parameters | false alarm |",
        "|---|---|---|---|---|---|",
    ]
    for kind, counts in result["by_kind"].items():
        lines.append(f"| {kind} | " + " | ".join(str(n) for n in counts.values()) + " |")
    lines += [
        "",
        "| hidden in | correct | wrong | unknown | parameters |",
        "|---|---|---|---|---|",
    ]
    for device, counts in result["by_device"].items():
        lines.append(f"| {device} | " + " | ".join(str(n) for n in counts.values()) + " |")
    lines += ["", "| | |", "|---|---|"]
    facts = {
        "held-out error, extended over recalibrated model (median, named rightly)": result[
            "held_out_ratio_median"
        ],
        "the same over a fit of the true structure": result["true_structure_ratio_median"],
        "90 % quantile of that": result["true_structure_ratio_p90"],
        "expected calibration error of the probabilities": result["expected_calibration_error"],
        "seconds a search, median": result["seconds_median"],
        "longest": result["seconds_max"],
        "simulations a search, median": result["simulations_median"],
    }
    lines += [f"| {text} | {'' if value is None else f'{value:.3g}'} |" for text, value in facts.items()]
    failures = [r for r in result["scenarios"] if r["outcome"] != "correct"]
    if failures:
        lines += ["", "Not named rightly:", "", "| hidden | size | verdict | named |", "|---|---|---|---|"]
        for r in failures:
            hidden = " + ".join(r["truth"]["hidden"]) or "nothing"
            named = " + ".join(r["named"]) or (f"at {r['place']['port']}" if r["place"] else "")
            lines.append(
                f"| {r['truth']['device']}: {hidden} | {r['truth']['size']:.1f} | {r['verdict']} | {named} |"
            )
    return "\n".join(lines) + "\n"


def by_size(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Outcomes of single effects and measurement faults by the size of what is hidden.

    Parameters
    ----------
    result : dict
        Of `discovery_study`.

    Returns
    -------
    list of dict
        ``low`` and ``high``, limits of the size in multiples of the noise, its ``median``, ``n`` and the shares
        ``correct``, ``wrong``, ``unknown`` and ``missed``, each as `rate_of` gives it.
    """
    rows = [r for r in result["scenarios"] if r["truth"]["kind"] in ("effect", "other form", "measurement")]
    found = []
    for low, high in pairwise(_SIZES):
        inside = [r for r in rows if low <= r["truth"]["size"] < high]
        if inside:
            shares = {name: rate_of([r["outcome"] == name for r in inside]) for name in _OUTCOMES}
            median = float(np.median([r["truth"]["size"] for r in inside]))
            found.append({"low": low, "high": high, "median": median, "n": len(inside), **shares})
    return found


def power_figure(*results: dict[str, Any]) -> Figure:
    """Share of effects named rightly over their size, a line for each result: they differ in the noise.

    Bars are exact binomial 95 % intervals.
    """
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
        axes.annotate(
            f"{e['n']}",
            (e["probability"], e["share"]),
            textcoords="offset points",
            xytext=(6, -10),
            fontsize=8,
        )
    axes.set(
        xlabel="probability of the first cause",
        ylabel="share that is right",
        xlim=(-0.02, 1.05),
        ylim=(-0.02, 1.05),
        title=f"expected calibration error {result['expected_calibration_error']:.3f}",
    )
    return figure
