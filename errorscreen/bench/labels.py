"""Cost of the labels of the 39-bus case study: time, memory, growth with their number, and ratio to ANDES."""

from __future__ import annotations

import importlib.util
import json
import logging
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from errorscreen.bench.markdown import table_lines
from errorscreen.bench.timing import in_new_process, peak_gib
from errorscreen.cases import load_ieee39
from errorscreen.data.panels import COLOURS, MEASURED, figure_of, tidy
from errorscreen.exceptions import MissingExtraError
from errorscreen.learning.generation import generate_dataset

#: samples of the published method; each costs one simulation for every parameter and one for itself
SAMPLES = 2500
#: longest steps of the integration in seconds: a coarse one and the default
COARSE, DEFAULT = 0.005, 0.0025
#: numbers of simulations that measure the growth; up to `REPEATED` the best of three rounds counts
SIZES, REPEATED = (1_000, 3_000, 10_000, 30_000, 100_000), 10_000
#: New England system of ANDES, and runs of which the best counts, at its default step and at `COARSE`
ANDES_CASE, ANDES_RUNS, ANDES_COARSE_RUNS = "ieee39/ieee39_full.xlsx", 5, 2

_log = logging.getLogger(__name__)


def measure_labels() -> dict[str, Any]:
    """Measure, and return the keys of `errorscreen.bench.measure_speed` about labels."""
    coarse, default = (label_run_in_new_process(step, SAMPLES) for step in (COARSE, DEFAULT))
    for step, run in ((COARSE, coarse), (DEFAULT, default)):
        _log.info("labels at %g ms: %d simulations in %.1f s", 1e3 * step, run["simulations"], run["seconds"])
    growth = label_scaling()
    result = {
        "labels_102500_seconds": coarse["seconds"],
        "labels_102500_seconds_default_step": default["seconds"],
        "labels_peak_gib": max(filter(None, (coarse["peak_gib"], default["peak_gib"])), default=None),
        "labels_simulations": default["simulations"],
        "labels_threads": default["threads"],
        "labels_scaling": growth,
        "labels_exponent": exponent(growth),
        "andes": measure_andes(),
        "ratio_to_andes": None,
        "ratio_to_andes_default_step": None,
    }
    _log.info("labels: seconds grow with the %.2fth power of the number", result["labels_exponent"])
    andes = result["andes"]
    if andes is None:
        _log.info("%s, to measure the ratio to it", MissingExtraError("ANDES", extra="andes"))
        return result
    first, second, _ = andes["ratios"] = [
        _ratio(COARSE, coarse, "default_step", andes),
        _ratio(DEFAULT, default, "default_step", andes),
        _ratio(COARSE, coarse, "coarse_step", andes),
    ]
    _log.info("ANDES: %.2f s a run; %s", andes["default_step_seconds"], ratio_sentence(andes))
    return {**result, "ratio_to_andes": first["ratio"], "ratio_to_andes_default_step": second["ratio"]}


def label_run(step: float, samples: int) -> dict[str, Any]:
    """Time `generate_dataset` on the 39-bus system in this process, without imports and compilation."""
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
    """Return the result of `label_run` from a process that does nothing else."""
    return _call_in_new_process(label_run, step, samples)


def label_scaling() -> list[dict[str, float]]:
    """Seconds of `generate_dataset` at a step of 5 ms for about `SIZES` simulations, exactly multiples of 41.

    Small numbers take the best of three rounds, because a hiccup of the machine would count there.
    """
    cost, growth = len(load_ieee39().parameters) + 1, []
    for size in SIZES:
        runs = [label_run(COARSE, max(1, round(size / cost))) for _ in range(3 if size <= REPEATED else 1)]
        growth.append({"n": runs[0]["simulations"], "seconds": min(run["seconds"] for run in runs)})
    return growth


def exponent(growth: list[dict[str, float]]) -> float:
    """Exponent p of the power law seconds ~ n^p, fitted in logarithms."""
    n, seconds = np.log([[row["n"], row["seconds"]] for row in growth]).T
    return float(np.polyfit(n, seconds, 1)[0])


def measure_andes() -> dict[str, Any] | None:
    """Seconds of a run of ANDES in a new process at both steps; None where it is not installed."""
    if importlib.util.find_spec("andes") is None:
        return None
    found: dict[str, Any] = {"version": version("andes"), "case": ANDES_CASE}
    for kind, step, runs in (("default", None, ANDES_RUNS), ("coarse", COARSE, ANDES_COARSE_RUNS)):
        run = _call_in_new_process(andes_run, step, runs)
        found |= {
            f"{kind}_step": run["step"],
            f"{kind}_step_seconds": run["seconds"],
            "variables": run["variables"],
        }
    return found


def andes_run(step: float | None, runs: int) -> dict[str, Any]:
    """Time the New England system in ANDES: 5 s with a fault at bus 3 from 1.0 to 1.1 s; the best of several runs.

    Only the integration counts. `step` is a fixed step in seconds, that of ANDES where None.
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
    """Ratios of throughput to ANDES, each with its steps."""
    return "; ".join(
        f"{r['ratio']:.0f} times its throughput ({r['per_core']:.0f} per core) at {1e3 * r['step']:g} ms "
        f"against {1e3 * r['andes_step']:.3g} ms"
        for r in andes["ratios"]
    )


def label_rows(result: dict[str, Any]) -> list[str]:
    """Lines of the table about labels; none where labels were left out."""
    if "labels_scaling" not in result:
        return []
    peak, andes, number = result["labels_peak_gib"], result["andes"], result["labels_simulations"]
    cells = [
        (f"{number} simulations at {1e3 * COARSE:g} ms", f"{result['labels_102500_seconds']:.1f} s"),
        (
            f"{number} simulations at {1e3 * DEFAULT:g} ms",
            f"{result['labels_102500_seconds_default_step']:.1f} s",
        ),
        ("most memory of their process", "unknown" if peak is None else f"{peak:.2f} GiB"),
    ]
    for row in result["labels_scaling"]:
        cells.append((f"{row['n']} simulations at {1e3 * COARSE:g} ms", f"{row['seconds']:.2f} s"))
    cells.append(("fitted exponent of the growth", f"{result['labels_exponent']:.3f}"))
    note = []
    if andes is None:
        cells.append(("ratio to ANDES", f"not measured: {MissingExtraError('ANDES', extra='andes')}"))
    else:
        for kind in ("default", "coarse"):
            title = f"ANDES {andes['version']}, one run at {1e3 * andes[f'{kind}_step']:.3g} ms"
            cells.append((title, f"{andes[f'{kind}_step_seconds']:.2f} s"))
        for r in andes["ratios"]:
            title = f"ratio to ANDES: {1e3 * r['step']:g} ms against its {1e3 * r['andes_step']:.3g} ms"
            cells.append((title, f"{r['ratio']:.0f} ({r['per_core']:.0f} per core)"))
        note = [
            "",
            f"ANDES: its own {andes['case']} ({andes['variables']} variables; ten machines with governors, exciters "
            "and stabilisers, so not the same model), the same fault, integration only, best of "
            f"{ANDES_RUNS} and {ANDES_COARSE_RUNS} runs, extrapolated to the number of simulations. It runs on one "
            f"core; the labels ran on {result['labels_threads']}. The ratio per core assumes that as many runs of "
            "ANDES in parallel do not slow each other down.",
        ]
    return ["", *table_lines(("labels of the 39-bus system", ""), cells), *note]


def plot_labels(result: dict[str, Any], path: Path) -> None:
    """Write the growth of time with the number of simulations as a log-log plot, with a line in proportion."""
    n, seconds = np.array([[row["n"], row["seconds"]] for row in result["labels_scaling"]]).T
    figure = figure_of(5.5, 3.6)
    axes = figure.subplots()
    proportion = np.exp(np.mean(np.log(seconds / n)))
    axes.loglog(n, proportion * n, color=MEASURED, lw=1.2, ls="--", label="proportional to $n$")
    label = f"measured, $n^{{{result['labels_exponent']:.2f}}}$"
    axes.loglog(n, seconds, color=COLOURS[1], marker="o", ls="none", label=label)
    axes.set(xlabel="simulations $n$", ylabel="seconds")
    axes.set_title(f"labels of the 39-bus system, step {1e3 * COARSE:g} ms", fontsize=10)
    tidy(axes)
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
