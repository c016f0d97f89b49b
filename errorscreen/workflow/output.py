"""Writes the result and the report of a study."""

from __future__ import annotations

from pathlib import Path

from errorscreen.report import write_report, write_result
from errorscreen.workflow.figures import figures
from errorscreen.workflow.outcome import Outcome


def write_outputs(outcome: Outcome, out: str | Path) -> tuple[Path, Path]:
    """Write ``result.json`` and ``report.html`` into a folder, each complete or not at all.

    Returns
    -------
    tuple of Path
        The two files.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    out = Path(out)
    return (
        write_result(outcome.result, out / "result.json"),
        write_report(outcome.result, figures(outcome), out / "report.html"),
    )
