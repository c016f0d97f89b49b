"""The report on paper: the first screen, the validation and the figures as a PDF, for files and signatures."""

from __future__ import annotations

import io
import os
import textwrap
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from errorscreen._runtime.display import visible
from errorscreen._runtime.persistence import write_bytes_atomic
from errorscreen.report.first_screen import certainty, error_rows, statement
from errorscreen.report.html_report import ReportFigure, format_change, format_number
from errorscreen.report.result import Result, Role

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: inches of a page in portrait format (A4), of its margin, and of a line of text
_WIDTH, _HEIGHT, _MARGIN, _LINE = 8.27, 11.69, 0.6, 0.175
#: characters of a line, of a heading, and of a line of a table
_COLUMNS, _LARGE, _TABLE = 108, 66, 112
_ROLES: dict[Role, str] = {"fit": "fitted", "together": "fitted", "held_out": "held out"}

#: a line of text: its size in points, whether it is bold, and whether it is set with equal widths
_Line = tuple[str, float, bool, bool]


def write_pdf(result: Result, figures: Iterable[ReportFigure], path: str | os.PathLike[str]) -> Path:
    """Write the report as a PDF, complete or not at all; the same result gives the same file.

    Parameters
    ----------
    result : Result
    figures : iterable of ReportFigure
        One page each.
    path : path-like

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    from matplotlib.backends.backend_pdf import PdfPages

    buffer = io.BytesIO()
    # without dates, so that the same result gives the same file
    facts = {"Title": visible(result.study.title), "CreationDate": None, "Creator": "errorscreen"}
    with warnings.catch_warnings(), PdfPages(buffer, metadata=facts) as pages:
        warnings.filterwarnings("ignore", "Glyph .* missing")  # a box stands for a letter that the font lacks
        for page in _text_pages(_lines(result)):
            pages.savefig(page)
        for item in figures:
            pages.savefig(_captioned(item))
    return write_bytes_atomic(path, buffer.getvalue())


def _lines(result: Result) -> Iterator[_Line]:
    """Text of the first pages."""
    yield from _wrapped(result.study.title, 11, bold=True)
    run, study = result.run, result.study
    yield from _wrapped(
        f"{study.device_title or study.device}. {run.started[:16].replace('T', ' ')} UTC, errorscreen {run.version}",
        9,
    )
    yield "", 9, False, False
    for hint in result.hints:
        yield from _wrapped(f"Check first: {hint}", 10, bold=True)
    yield from _wrapped(statement(result), 14, bold=True)
    yield from _wrapped(certainty(result), 10)
    if result.validation and result.validation.summary():
        told = f"{result.validation.summary()} Limits: {result.validation.source}."
        yield from _wrapped(
            told + (f" Set by {result.validation.set_by}." if result.validation.set_by else ""), 10
        )
    yield "", 9, False, False
    yield from _wrapped("Root mean square errors", 11, bold=True)
    for row in error_rows(result):
        factor, unit = (row.base, row.power) if row.power else (1.0, row.unit)
        before, after = (f"{format_number(value * factor)} {unit}" for value in (row.before, row.after))
        name = textwrap.shorten(f"{row.recording} ({_ROLES[row.role]})", 46, placeholder="...")
        yield (
            f"{name:<48}{row.channel:<8}{before:>16} ->{after:>16}{format_change(row.before, row.after):>10}",
            8,
            False,
            True,
        )
    if result.correction is not None:
        yield "", 9, False, False
        yield from _wrapped(f"Changes of {result.correction.original}", 11, bold=True)
        for line in result.correction.difference.splitlines():
            yield from ((part, 8, False, True) for part in textwrap.wrap(line, _TABLE) or [""])
    if result.advice:
        yield "", 9, False, False
        yield from _wrapped("What to do next", 11, bold=True)
        for sentence in result.advice:
            yield from _wrapped(f"- {sentence}", 10)
    yield "", 9, False, False
    yield from _wrapped("Why this cause", 11, bold=True)
    yield from _wrapped(result.diagnosis.final.text, 9)
    failed = [c for c in result.validation.criteria if c.outcome == "failed"] if result.validation else []
    if failed:
        yield "", 9, False, False
        yield from _wrapped("Criteria that failed", 11, bold=True)
        for c in failed:
            name = textwrap.shorten(c.recording, 40, placeholder="...")
            values = f"{format_number(c.after):>10} of {format_number(c.limit)} {c.unit}"
            yield f"{name:<42}{c.signal:<5}{c.window:<8}{c.measure:<18}{values}", 8, False, True
    yield "", 9, False, False
    yield from _wrapped("Recordings and files", 11, bold=True)
    if study.model_file:
        yield from _wrapped(f"{study.model_file}, SHA-256 {study.model_sha256}", 8)
    for one in result.recordings:
        start = ", ".join(
            f"{name} {format_number(one.initial[name], 4)} pu"
            for name in ("V", "P", "Q")
            if name in one.initial
        )
        digest = f"; {one.path}, SHA-256 {one.sha256}" if one.sha256 else ""
        yield from _wrapped(f"{one.name} ({_ROLES[one.role]}): {start}{digest}", 8)
    yield "", 9, False, False
    for role in ("prepared by", "reviewed by", "accepted by"):
        yield f"{role:<14}{'_' * 34}   date {'_' * 12}   signature {'_' * 24}", 8, False, True
        yield "", 9, False, False


def _wrapped(text: str, size: float, *, bold: bool = False) -> Iterator[_Line]:
    columns = int((_LARGE if bold else _COLUMNS) * (14 if bold else 10) / size)
    return ((line, size, bold, False) for line in textwrap.wrap(text, columns))


def _text_pages(lines: Iterable[_Line]) -> Iterator[Figure]:
    """Pages of text, from the top down."""
    from matplotlib.figure import Figure

    page, y = None, 0.0
    for text, size, bold, even in lines:
        height = _LINE * size / 9.0
        if page is None or y - height < _MARGIN:
            if page is not None:
                yield page
            page, y = Figure(figsize=(_WIDTH, _HEIGHT)), _HEIGHT - _MARGIN
        y -= height
        family = "monospace" if even else "sans-serif"
        # a name with dollar signs is no formula, and one with control characters has no glyphs for them
        page.text(
            _MARGIN / _WIDTH,
            y / _HEIGHT,
            visible(text),
            fontsize=size,
            family=family,
            weight="bold" if bold else "normal",
            parse_math=False,
        )
    if page is not None:
        yield page


def _captioned(item: ReportFigure) -> Figure:
    """The figure with its caption below, as it stands in a document."""
    figure = item.figure
    width = figure.get_figwidth()
    caption = "\n".join(textwrap.wrap(visible(item.caption), int(13 * width)))
    figure.supxlabel(caption, fontsize=8, x=0.01, ha="left", parse_math=False)
    return figure
