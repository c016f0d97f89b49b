"""What each step of the search for causes is worth: the discovery study without one step after the other."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from errorscreen._runtime.persistence import write_json_atomic, write_text_atomic
from errorscreen.bench.discovery import discovery_study
from errorscreen.bench.discovery_rates import rate_of
from errorscreen.bench.markdown import table_lines
from errorscreen.bench.timing import machine
from errorscreen.discovery.search.plan import STEPS, check_plan
from errorscreen.exceptions import InputError

SCHEMA_VERSION = 1
#: steps without which nothing is searched
_NEEDED = ("add effects",)
_log = logging.getLogger(__name__)
_Record = dict[str, Any]


def ablation_study(
    out: str | Path,
    *,
    case: str = "plant",
    scenarios: int = 40,
    seed: int = 0,
    steps: Sequence[str] | None = None,
    noise_db: float = 40.0,
    n_jobs: int | None = None,
    progress: bool = False,
) -> _Record:
    """Search hidden scenarios with the whole plan and without each of some steps; write result and table into ``out``.

    Finished scenarios stay in the folders of the variants: the same call goes on from there.

    Parameters
    ----------
    out : str or Path
    case, scenarios, seed, noise_db, n_jobs, progress
        As of `discovery_study`.
    steps : sequence of str, optional
        Steps that are left out in turn, see `errorscreen.discovery.search.plan.PLAN`; all but the first where not
        given.

    Returns
    -------
    dict
        ``whole`` and ``without``, by step: ``right`` (scenarios whose outcome is correct, ``{value, interval, n}``),
        ``wrong``, and the medians of ``seconds`` and ``simulations``. Of ``without`` also ``lost`` and ``gained``,
        numbers of the scenarios with another outcome than with the whole plan, and ``cost`` and ``simulations_ratio``,
        medians over scenarios of the ratio to the whole plan.

    Raises
    ------
    InputError
        If an argument cannot be used, or a step is needed.
    """
    left_out = [step for step in STEPS if step not in _NEEDED] if steps is None else [*check_plan(steps)]
    for step in left_out:
        if step in _NEEDED:
            raise InputError(
                f"nothing is searched without the step {step!r}",
                where="steps",
                allowed=", ".join(s for s in STEPS if s not in _NEEDED),
            )
    out, started = Path(out), perf_counter()
    same: dict[str, Any] = {"case": case, "scenarios": scenarios, "seed": seed, "noise_db": noise_db}
    same |= {"n_jobs": n_jobs, "progress": progress}
    stages = out / "stages"
    _log.info("the whole plan")
    whole = discovery_study(stages / "whole", **same)["scenarios"]
    without = {}
    for step in left_out:
        _log.info("without the step: %s", step)
        plan = [one for one in STEPS if one != step]
        rows = discovery_study(stages / step.replace(" ", "-"), plan=plan, **same)["scenarios"]
        without[step] = {**_rates(rows), **_compared(whole, rows)}
    result = {
        "schema_version": SCHEMA_VERSION,
        "kind": "bench-ablation",
        "case": case,
        "seed": seed,
        "noise_db": noise_db,
        "scenarios": scenarios,
        "whole": _rates(whole),
        "without": without,
        "seconds": perf_counter() - started,
        "machine": machine(),
    }
    write_json_atomic(out / "result.json", result)
    write_text_atomic(out / "tables.md", table(result))
    return result


def _rates(rows: Sequence[_Record]) -> _Record:
    return {
        "right": rate_of([row["outcome"] == "correct" for row in rows]),
        "wrong": rate_of([row["outcome"] in ("wrong", "false alarm") for row in rows]),
        "seconds": float(np.median([row["seconds"] for row in rows])),
        "simulations": float(np.median([row["simulations"] for row in rows])),
    }


def _compared(whole: Sequence[_Record], rows: Sequence[_Record]) -> _Record:
    """Scenarios lost and gained without a step, and its cost."""
    pairs = list(zip(whole, rows, strict=True))
    before, after = ([row["outcome"] == "correct" for row in some] for some in (whole, rows))
    numbers = [row["number"] for row in whole]
    return {
        "lost": [n for n, was, now in zip(numbers, before, after, strict=True) if was and not now],
        "gained": [n for n, was, now in zip(numbers, before, after, strict=True) if now and not was],
        "cost": float(np.median([now["seconds"] / was["seconds"] for was, now in pairs])),
        "simulations_ratio": float(
            np.median([now["simulations"] / was["simulations"] for was, now in pairs])
        ),
    }


def table(result: _Record) -> str:
    """Rates and costs as Markdown."""

    def cells(row: _Record) -> tuple[str, ...]:
        rates = (row["right"], row["wrong"])
        return tuple(
            f"{one['value']:.3f} [{one['interval'][0]:.3f}, {one['interval'][1]:.3f}]" for one in rates
        )

    rows = [("nothing", *cells(result["whole"]), "", "", "1", "1")]
    for step, row in result["without"].items():
        moved = (", ".join(map(str, row[key])) or "none" for key in ("lost", "gained"))
        rows.append((step, *cells(row), *moved, f"{row['cost']:.2f}", f"{row['simulations_ratio']:.2f}"))
    header = ("left out", "right", "wrong or false alarm", "lost", "gained", "time", "simulations")
    head = (
        f"Case {result['case']}, {result['scenarios']} hidden scenarios, seed {result['seed']}, noise "
        f"{result['noise_db']:g} dB. In brackets: 95 % exact binomial interval. Lost and gained are numbers of "
        "scenarios; time and simulations are medians of the ratio to the whole plan, scenario by scenario."
    )
    return "\n".join([head, "", *table_lines(header, rows)]) + "\n"
