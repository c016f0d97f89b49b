"""Writes the result and the report of a study."""

from __future__ import annotations

from pathlib import Path

from errorscreen.report import write_pdf, write_report, write_result
from errorscreen.workflow.correction import write_corrected
from errorscreen.workflow.figures import figures
from errorscreen.workflow.outcome import Outcome


def write_outputs(outcome: Outcome, out: str | Path) -> tuple[Path, ...]:
    """Write ``result.json``, ``report.html``, ``report.pdf`` and a corrected model file, each complete or not at all.

    Returns
    -------
    tuple of Path
        The files, the corrected model file last, where there is one.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    out = Path(out)
    drawn = list(figures(outcome))
    written = (
        write_result(outcome.result, out / "result.json"),
        write_report(outcome.result, drawn, out / "report.html"),
        write_pdf(outcome.result, drawn, out / "report.pdf"),
    )
    correction = outcome.result.correction
    if correction is None:
        return written
    return (*written, write_corrected(outcome.study, correction, out))
