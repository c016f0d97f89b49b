"""The report: one self-contained HTML file that can be read, printed and sent."""

from __future__ import annotations

import base64
import io
import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from errorscreen._runtime.persistence import write_text_atomic
from errorscreen.discovery.conclusions import probable
from errorscreen.exceptions import InputError, unknown_name
from errorscreen.report.charts import Chart
from errorscreen.report.first_screen import acting, certainty, error_rows, statement
from errorscreen.report.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Places in the report where figures can stand.
SECTIONS = ("responses", "errors", "screening", "calibration", "discovery")
_DASH = "–"


@dataclass(frozen=True)
class ReportFigure:
    """A figure with its place in the report.

    Parameters
    ----------
    section : {"responses", "errors", "screening", "calibration", "discovery"}
    caption : str
        Also read aloud in place of the figure.
    figure : matplotlib.figure.Figure
        For print, and for readers without scripts.
    chart : Chart, optional
        The same as curves that the page draws, with zoom and values.
    """

    section: str
    caption: str
    figure: Figure
    chart: Chart | None = None

    def __post_init__(self) -> None:
        if self.section not in SECTIONS:
            raise unknown_name(self.section, SECTIONS, kind="section", where="ReportFigure")


def write_report(result: Result, figures: Iterable[ReportFigure], path: str | os.PathLike[str]) -> Path:
    """Write the report of a study, complete or not at all.

    Parameters
    ----------
    result : Result
    figures : iterable of ReportFigure
        Drawn into the file as SVG; they stand in the order given.
    path : path-like

    Raises
    ------
    InputError
        If `result` is no `Result`, or the file cannot be written.
    """
    return write_text_atomic(path, render_report(result, figures))


def render_report(result: Result, figures: Iterable[ReportFigure] = ()) -> str:
    """Text of the report, see `write_report`; the same result gives the same text."""
    if not isinstance(result, Result):
        raise InputError(f"a {type(result).__name__} is no result", allowed="errorscreen.report.Result")
    from markupsafe import Markup

    placed: dict[str, list[dict[str, Any]]] = {section: [] for section in SECTIONS}
    for item in figures:
        chart = Markup(item.chart.packed()) if item.chart else ""
        placed[item.section].append(
            {"caption": item.caption, "source": data_uri(item.figure), "chart": chart}
        )
    drawn = any(item["chart"] for every in placed.values() for item in every)
    # without curves the page needs no script
    return template("report.html.j2").render(
        r=result,
        figures=placed,
        answer=statement(result),
        acting=acting(result),
        certainty=certainty(result),
        errors=list(error_rows(result)),
        sheet=Markup(_part("uPlot.min.css")) if drawn else "",
        scripts=[Markup(_part(name)) for name in ("uPlot.iife.min.js", "charts.js")] if drawn else [],
    )


def data_uri(figure: Figure) -> str:
    """Figure as SVG inside an address, so that a page needs no other file."""
    import matplotlib

    buffer = io.BytesIO()
    # names inside the file are random by default, and its date would differ from run to run
    with matplotlib.rc_context({"svg.hashsalt": "errorscreen"}):
        figure.savefig(buffer, format="svg", dpi=160, metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def format_number(value: float, digits: int = 3) -> str:
    """Number with so many significant digits, without exponent where that stays short; a dash if it does not exist."""
    if not math.isfinite(value):
        return _DASH
    text = f"{value:.{digits}g}"
    rounded = float(text)
    return f"{rounded:.0f}" if 10**digits <= abs(rounded) < 1e6 else text


def format_seconds(value: float) -> str:
    """Instant in seconds with milliseconds where it has any; a dash if it does not exist."""
    return f"{value:.3f}".rstrip("0").rstrip(".") if math.isfinite(value) else _DASH


def format_percent(share: float, digits: int = 3) -> str:
    """Share in percent; a dash if it does not exist."""
    return f"{format_number(100 * share, digits)} %" if math.isfinite(share) else _DASH


def format_change(before: float, after: float) -> str:
    """Change from `before` to `after` in percent, with its sign."""
    if not before or not math.isfinite(before) or not math.isfinite(after):
        return _DASH
    percent = round(100 * (after / before - 1))
    sign = "−" if percent < 0 else "+" if percent > 0 else "±"
    return f"{sign}{abs(percent)} %"


def template(name: str) -> Any:
    """Template of a page, with the filters that all pages share."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["num"] = format_number
    environment.filters["probable"] = probable
    environment.globals["change"] = format_change
    environment.globals["nan"] = math.nan
    environment.globals["style"] = Markup(_part("style.css"))
    environment.filters["percent"] = format_percent
    environment.filters["seconds"] = format_seconds
    environment.filters["zip"] = zip
    environment.tests["known"] = math.isfinite
    return environment.from_string(_part(name))


def _part(name: str) -> str:
    """File of the page."""
    return files("errorscreen.report").joinpath("page", name).read_text("utf-8")
