"""What the labels of the 39-bus case study cost: time, memory, growth with their number, and the ratio to ANDES."""

from __future__ import annotations

import importlib.util
import json
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from errorscreen.bench.timing import in_new_process, peak_gib
from errorscreen.cases import load_ieee39
from errorscreen.exceptions import MissingExtraError
from errorscreen.learning.generation import generate_dataset

#: samples of the published method; each costs one simulation for every parameter and one for itself
SAMPLES = 2500
#: longest steps of the integration in seconds: a coarse one and the default
COARSE, DEFAULT = 0.005, 0.0025
#: about how many simulations the growth is measured with, and up to how many the best of three rounds counts
SIZES, REPEATED = (1_000, 3_000, 10_000, 30_000, 100_000), 10_000
#: New England system as it comes with ANDES, and runs of which the best counts, at its default step and at `COARSE`
ANDES_CASE, ANDES_RUNS, ANDES_COARSE_RUNS = "ieee39/ieee39_full.xlsx", 5, 2
_COLOUR, _GRID = "#0072b2", "#dddddd"


def measure_labels(report: Callable[[str], None]) -> dict[str, Any]:
    """Measure and return the keys of `errorscreen.bench.measure_speed` that are about labels.

    Parameters
    ----------
    report : callable
        Takes lines of text while it measures.
    """
    coarse, default = (label_run_in_new_process(step, SAMPLES) for step in (COARSE, DEFAULT))
    for step, run in ((COARSE, coarse), (DEFAULT, default)):
        report(f"labels at {1e3 * step:g} ms: {run['simulations']} simulations in {run['seconds']:.1f} s")
    peaks = [run["peak_gib"] for run in (coarse, default) if run["peak_gib"] is not None]
    growth = label_scaling()
    result = {
        "labels_102500_seconds": coarse["seconds"],
        "labels_102500_seconds_default_step": default["seconds"],
        "labels_peak_gib": max(peaks, default=None),
        "labels_simulations": default["simulations"],
        "labels_threads": default["threads"],
        "labels_scaling": growth,
        "labels_exponent": exponent(growth),
    }
    report(f"labels: seconds grow with the {result['labels_exponent']:.2f}th power of the number")
    result["andes"] = andes = measure_andes()
    if andes is None:
        report(f"{MissingExtraError('ANDES', extra='andes')}, to measure the ratio to it")
        return {**result, "ratio_to_andes": None, "ratio_to_andes_default_step": None}
    andes["ratios"] = [
        _ratio(step, run, name, andes)
        for step, run, name in (
            (COARSE, coarse, "default_step"),
            (DEFAULT, default, "default_step"),
            (COARSE, coarse, "coarse_step"),
        )
    ]
    report(f"ANDES: {andes['default_step_seconds']:.2f} s a run; {ratio_sentence(andes)}")
    ratio, ratio_default_step, _ = (row["ratio"] for row in andes["ratios"])
    return {**result, "ratio_to_andes": ratio, "ratio_to_andes_default_step": ratio_default_step}


def label_run(step: float, samples: int) -> dict[str, Any]:
    """Time `generate_dataset` on the 39-bus system in this process, without imports and compilation.

    Returns
    -------
    dict
        ``simulations``, ``seconds``, ``threads``, and ``peak_gib`` of the whole process.
    """
    import numba

    system = load_ieee39(step=step)
    generate_dataset(system, 2, random_state=0)
    start = perf_counter()
    data = generate_dataset(system, samples, random_state=0)
    return {
        "seconds": perf_counter() - start,
        "simulations": len(data) * (len(system.parameters) + 1),
        "threads": numba.config.NUMBA_NUM_THREADS,
        "peak_gib": peak_gib(),
    }


def label_run_in_new_process(step: float, samples: int) -> dict[str, Any]:
    """Return what `label_run` finds in a process that does nothing else."""
    return _call_in_new_process(label_run, step, samples)


def label_scaling() -> list[dict[str, float]]:
    """Seconds of `generate_dataset` at a step of 5 ms for about so many simulations as `SIZES` says.

    Returns
    -------
    list of dict
        ``n`` is the exact number of simulations (a multiple of 41) and ``seconds`` what they took; up to `REPEATED`
        the best of three rounds, because there a hiccup of the machine would count.
    """
    growth = []
    for size in SIZES:
        cost = len(load_ieee39().parameters) + 1
        runs = [label_run(COARSE, max(1, round(size / cost))) for _ in range(3 if size <= REPEATED else 1)]
        growth.append({"n": runs[0]["simulations"], "seconds": min(run["seconds"] for run in runs)})
    return growth


def exponent(growth: list[dict[str, float]]) -> float:
    """Exponent p of the power law seconds ~ n^p that fits best in logarithms.

    Examples
    --------
    >>> round(exponent([{"n": n, "seconds": 0.1 * n**1.5} for n in (10, 20, 50)]), 6)
    1.5
    """
    n, seconds = np.log([[row["n"], row["seconds"]] for row in growth]).T
    return float(np.polyfit(n, seconds, 1)[0])


def measure_andes() -> dict[str, Any] | None:
    """Seconds of a run of ANDES in a new process at both steps; None where it is not installed."""
    if importlib.util.find_spec("andes") is None:
        return None
    default = _call_in_new_process(andes_run, None, ANDES_RUNS)
    coarse = _call_in_new_process(andes_run, COARSE, ANDES_COARSE_RUNS)
    return {
        "version": version("andes"),
        "case": ANDES_CASE,
        "variables": default["variables"],
        "default_step": default["step"],
        "default_step_seconds": default["seconds"],
        "coarse_step": coarse["step"],
        "coarse_step_seconds": coarse["seconds"],
    }


def andes_run(step: float | None, runs: int) -> dict[str, Any]:
    """Time the New England system in ANDES: 5 s with a fault at bus 3 from 1.0 to 1.1 s; the best of several runs.

    Only the integration counts; reading the case, set-up, load flow and initialisation do not.

    Parameters
    ----------
    step : float or None
        Fixed step in seconds; that of ANDES where None.
    runs : int
    """
    import andes

    andes.config_logger(50, file=False, log_path="")  # without a path it makes a folder for its log
    seconds = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(runs):
            system = andes.load(andes.get_case(ANDES_CASE), setup=False, no_output=True, default_config=True)
            system.add("Fault", {"bus": 3, "tf": 1.0, "tc": 1.1})
            system.setup()
            system.PFlow.run()
            config = system.TDS.config
            config.tf, config.no_tqdm = 5.0, 1
            config.tstep = config.tstep if step is None else step
            system.TDS.init()
            start = perf_counter()
            done = system.TDS.run()
            seconds.append(perf_counter() - start)
            if not done:
                raise RuntimeError(f"ANDES stopped at {float(system.dae.t):g} s")
    return {"seconds": min(seconds), "step": config.tstep, "variables": system.dae.n + system.dae.m}


def ratio_sentence(andes: dict[str, Any]) -> str:
    """Ratios of throughput to ANDES, each with the steps it holds for."""
    return "; ".join(
        f"{r['ratio']:.0f} times its throughput ({r['per_core']:.0f} per core) at {1e3 * r['step']:g} ms "
        f"against {1e3 * r['andes_step']:.3g} ms"
        for r in andes["ratios"]
    )


def label_rows(result: dict[str, Any]) -> list[str]:
    """Lines of the table of a result about labels; none where they were left out."""
    if "labels_scaling" not in result:
        return []
    peak, growth, andes = (result[k] for k in ("labels_peak_gib", "labels_scaling", "andes"))
    times = (result["labels_102500_seconds"], result["labels_102500_seconds_default_step"])
    headings = (f"{result['labels_simulations']} simulations at {1e3 * s:g} ms" for s in (COARSE, DEFAULT))
    lines = [
        "",
        "| labels of the 39-bus system | |",
        "|---|---|",
        *(f"| {heading} | {seconds:.1f} s |" for heading, seconds in zip(headings, times, strict=True)),
        f"| most memory of their process | {'unknown' if peak is None else f'{peak:.2f} GiB'} |",
        *(f"| {row['n']} simulations at {1e3 * COARSE:g} ms | {row['seconds']:.2f} s |" for row in growth),
        f"| fitted exponent of the growth | {result['labels_exponent']:.3f} |",
    ]
    if andes is None:
        return [*lines, f"| ratio to ANDES | not measured: {MissingExtraError('ANDES', extra='andes')} |"]
    for kind in ("default", "coarse"):
        step, seconds = andes[f"{kind}_step"], andes[f"{kind}_step_seconds"]
        lines.append(f"| ANDES {andes['version']}, one run at {1e3 * step:.3g} ms | {seconds:.2f} s |")
    lines += [
        f"| ratio to ANDES: {1e3 * r['step']:g} ms against its {1e3 * r['andes_step']:.3g} ms | "
        f"{r['ratio']:.0f} ({r['per_core']:.0f} per core) |"
        for r in andes["ratios"]
    ]
    return [
        *lines,
        "",
        f"ANDES: its own {andes['case']} ({andes['variables']} variables; ten machines with governors, exciters and "
        "stabilisers, so not the same model), the same fault, integration only, best of "
        f"{ANDES_RUNS} and {ANDES_COARSE_RUNS} runs, extrapolated to the number of simulations. It runs on one "
        f"core; the labels ran on {result['labels_threads']}, and the ratio per core is what is left if as many "
        "runs of ANDES go side by side without slowing each other down.",
    ]


def plot_labels(result: dict[str, Any], path: Path) -> None:
    """Write the growth of time with the number of simulations as a log-log plot, beside a straight proportion."""
    from matplotlib.figure import Figure

    n, seconds = np.array([[row["n"], row["seconds"]] for row in result["labels_scaling"]]).T
    figure = Figure(figsize=(5.5, 3.6), layout="constrained")
    axes = figure.subplots()
    proportion = np.exp(np.mean(np.log(seconds / n)))
    axes.loglog(n, proportion * n, color="#8d99a3", lw=1.2, ls="--", label="proportional to $n$")
    label = f"measured, $n^{{{result['labels_exponent']:.2f}}}$"
    axes.loglog(n, seconds, color=_COLOUR, marker="o", ls="none", label=label)
    axes.set_xlabel("simulations $n$")
    axes.set_ylabel("seconds")
    axes.set_title(f"labels of the 39-bus system, step {1e3 * COARSE:g} ms", fontsize=10)
    axes.grid(color=_GRID, lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _ratio(step: float, run: dict[str, Any], kind: str, andes: dict[str, Any]) -> dict[str, float]:
    """Simulations a second of a label run over those of ANDES, as they are and for one core."""
    ratio = run["simulations"] / run["seconds"] * andes[f"{kind}_seconds"]
    return {"step": step, "andes_step": andes[kind], "ratio": ratio, "per_core": ratio / run["threads"]}


def _call_in_new_process(function: Callable[..., dict[str, Any]], *arguments: float | None) -> dict[str, Any]:
    name = function.__name__
    code = f"import json; from {__name__} import {name}; print(json.dumps({name}(*{arguments!r})))"
    return json.loads(in_new_process(code))
