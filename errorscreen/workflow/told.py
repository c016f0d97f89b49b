"""What the command line says of a finished study."""

from __future__ import annotations

import math
from collections.abc import Iterator

from errorscreen.discovery.conclusions import probable
from errorscreen.report import Result


def told(title: str, result: Result) -> Iterator[str]:
    """Verdict, causes, advice, changes of the model file and failed simulations, in lines."""
    found = result.diagnosis
    yield f"{title}: {found.final.kind}\n{found.final.text}"
    for cause in found.causes[:3] if found.tried else ():
        withdrawn = ", withdrawn" if cause.withdrawn else ""
        yield f"  {probable(cause.probability):>6}  {cause.title}{withdrawn}"
    yield from (f"Next: {sentence}" for sentence in result.advice)
    if result.correction:
        changes = [f"new record {one.model}" for one in result.correction.records]
        changes += [
            f"{p.name} = {p.value:.4g}" + ("" if math.isnan(p.low) else f" [{p.low:.3g}, {p.high:.3g}]")
            for p in result.correction.parameters
        ]
        yield f"To change in {result.correction.original}: {', '.join(changes)}"
    if failed := _failed(result):
        yield failed


def _failed(result: Result) -> str:
    """How many simulations failed, and what to do about it; empty if none did."""
    stages = {f"screening by {s.method}": s.n_failed for s in result.screening}
    base = result.diagnosis.calibration
    stages |= {f"calibration by {c.label}": c.n_failed for c in (*result.calibration, base)}
    counts = ", ".join(f"{count} in {stage}" for stage, count in stages.items() if count)
    if not counts:
        return ""
    return (
        f"Simulations that failed and were left out: {counts}. If they are many, narrow the bounds of the parameters "
        "or shorten simulation.step."
    )
