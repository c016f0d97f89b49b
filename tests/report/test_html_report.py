import base64
import re
from html.parser import HTMLParser

import pytest

from errorscreen import plotting
from errorscreen.exceptions import InputError
from errorscreen.report import ReportFigure, write_report
from errorscreen.report.html_report import HEADLINES, SECTIONS, render_report
from errorscreen.report.result_schema import Calibration, Study, Verdict
from tests.report.samples import result

VOID = {"meta", "img", "br"}


class Outline(HTMLParser):
    """Checks that tags are closed in order, and collects ids, addresses and text."""

    def __init__(self, page):
        super().__init__()
        self.open, self.ids, self.addresses, self.words = [], [], [], []
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.ids += [attrs["id"]] if "id" in attrs else []
        self.addresses += [attrs[k] for k in ("src", "href") if k in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


def figures():
    bars = plotting.plot_rankings({"cnn": {"Xd": 2.0, "D": 1.0}})
    return [ReportFigure(section, f"Figure of {section}.", bars) for section in SECTIONS]


def test_the_page_stands_alone():
    page = render_report(result(), figures())
    outline = Outline(page)
    assert len(outline.addresses) == len(SECTIONS) - 1  # no causes were searched
    assert all(a.startswith("data:image/svg+xml;base64,") for a in outline.addresses)
    svg = base64.b64decode(outline.addresses[0].split(",")[1]).decode()
    assert svg.lstrip().startswith("<?xml")
    for pattern in (r"<script", r"@import", r"url\(", r'(src|href)="https?:'):
        assert not re.search(pattern, page)


def test_every_section_is_there():
    outline = Outline(render_report(result(), figures()))
    wanted = ["verdict", "case", "responses", "errors", "screening", "calibration", "data", "run"]
    assert outline.ids == wanted
    for words in (
        "Parameters of the model can explain the error All that is left is noise.",
        "0.1 0.02 −80 %",
        "second trip, held out",
        "not identifiable",
        "at a bound",
        "Determined only together, so single values must not be read: Xd, Xd1.",
        "trip: the sign of P was turned.",
        "25 %",
        "second trip, held out P (pu) 1 0.2 (−80 %) 0.2 (−80 %)",
        "1234, 5 of them failed",
        "Figure of responses.",
        "Selected: the largest contribution.",
    ):
        assert words in outline.text, words


def test_the_same_result_gives_the_same_page():
    assert render_report(result(), figures()) == render_report(result(), figures())


def test_names_cannot_break_the_page():
    study = Study(title="<script>alert(1)</script> & co", device='"><b>', parameters=1)
    page = render_report(result(study=study))
    assert "<script" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; co" in page
    Outline(page)


@pytest.mark.parametrize("kind", list(HEADLINES))
def test_every_verdict_has_its_words(kind):
    page = render_report(result(verdict=Verdict(kind=kind, text="So it is.")))
    assert HEADLINES[kind] in Outline(page).text


def test_a_study_without_calibration_has_a_report():
    Outline(render_report(result(calibration=Calibration(methods=[]))))


def test_the_file_is_written_or_refused(tmp_path):
    path = write_report(result(), figures(), tmp_path / "report.html")
    assert path.read_text(encoding="utf-8") == render_report(result(), figures())
    with pytest.raises(InputError, match="cannot be written"):
        write_report(result(), [], tmp_path / "no" / "report.html")
    with pytest.raises(InputError, match="a dict is no result"):
        write_report({}, [], tmp_path / "report.html")
    with pytest.raises(InputError, match="unknown section 'error'.*did you mean 'errors'"):
        ReportFigure("error", "", figures()[0].figure)
