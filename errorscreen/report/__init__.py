"""Result of a study as JSON with a schema, and as a page for people."""

from errorscreen.report.html_report import ReportFigure, write_report
from errorscreen.report.pdf_report import write_pdf
from errorscreen.report.result import Result, read_result, write_result

__all__ = ["ReportFigure", "Result", "read_result", "write_pdf", "write_report", "write_result"]
