import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from errorscreen import plotting
from errorscreen.discovery import Verdict
from errorscreen.exceptions import InputError
from errorscreen.report import ReportFigure, write_report
from errorscreen.report.charts import Chart, Curve, Panel
from errorscreen.report.html_report import SECTIONS, render_report
from errorscreen.report.result import StudyInfo
from tests.report.samples import UNKNOWN, cause, found, gain, recording, result, withdrawn

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
    pictures = [a for a in outline.addresses if not a.startswith("#")]
    assert len(pictures) == len(SECTIONS)
    assert all(a.startswith("data:image/svg+xml;base64,") for a in pictures)
    assert {a[1:] for a in outline.addresses if a.startswith("#")} < {*outline.ids}
    svg = base64.b64decode(pictures[0].split(",")[1]).decode()
    assert svg.lstrip().startswith("<?xml")
    for pattern in (r"<script", r"@import", r"url\(", r'(src|href)="https?:'):
        assert not re.search(pattern, page)


def test_every_section_is_there():
    outline = Outline(render_report(result(), figures()))
    wanted = [
        "verdict", "discovery", "responses", "errors", "screening", "calibration", "case", "statistics", "data",
        "run", "glossary",
    ]  # fmt: skip
    assert outline.ids == wanted
    for words in (
        "Wrong parameter values explain the error: Xd 1.2 pu instead of 0.95.",
        "Why this cause All that is left is noise.",
        "0.1 0.02 −80 %",
        "second trip, held out",
        "not identifiable",
        "at a bound",
        "Determined only together, so single values must not be read: Xd, Xd1.",
        "trip: the sign of P was turned.",
        "25 %",
        "second trip, held out P (pu) 2 – (–) 0.4 (−80 %)",
        "1234, 5 of them failed",
        "Figure of responses.",
        "Selected: the largest contribution.",
    ):
        assert words in outline.text, words


def test_the_same_result_gives_the_same_page():
    assert render_report(result(), figures()) == render_report(result(), figures())


def test_names_cannot_break_the_page():
    study = StudyInfo("<script>alert(1)</script> & co", '"><b>', "", 1.0, 50.0, 1)
    page = render_report(result(study=study))
    assert "<script" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; co" in page
    Outline(page)


def test_curves_come_with_their_script_and_nothing_from_outside():
    time = np.linspace(0.0, 1.0, 5)
    chart = Chart(time, 0.2, (Panel("P in </script> pu", (Curve("measured", "measured", time),)),))
    bars = figures()[0].figure
    page = render_report(result(), [ReportFigure("responses", "Curves.", bars, chart)])
    outline = Outline(page)
    assert "chart-1" in outline.ids
    assert page.count("</script>") == 3  # the curves, uPlot, and what draws them
    packed = json.loads(re.search(r'<script type="application/json">(.*?)</script>', page)[1])
    assert packed["panels"][0]["label"] == "P in </script> pu"
    assert not re.search(r'@import|url\(|(src|href)="https?:', page)


def test_a_study_without_calibration_has_a_report():
    Outline(render_report(result(calibration=(), models=result().models[:1], screening=())))


def test_the_file_is_written_or_refused(tmp_path):
    path = write_report(result(), figures(), tmp_path / "report.html")
    assert path.read_text(encoding="utf-8") == render_report(result(), figures())
    with pytest.raises(InputError, match="cannot be written"):
        write_report(result(), [], tmp_path / "no" / "report.html")
    with pytest.raises(InputError, match="a dict is no result"):
        write_report({}, [], tmp_path / "report.html")
    with pytest.raises(InputError, match="unknown section 'error'.*did you mean 'errors'"):
        ReportFigure("error", "", figures()[0].figure)


def text_of(result):
    return Outline(render_report(result, figures())).text


def test_a_withdrawn_cause_is_told_as_withdrawn():
    text = text_of(withdrawn())
    assert "The extension" not in text
    for words in (
        "The cause is unknown. It enters at Efd of the synchronous_machine: up to 0.2 pu",
        "Before the held-out recordings were judged, the verdict was “effect”: So it is.",
        "Unknown – 1.00 – Withdrawn: Excitation control Efd 0.00 99.9 %",
        "Withdrawn: Excitation control The search named it, but held-out recordings do not confirm it, so "
        "the model is not extended by it. On them it adds 20 % of the squared error of the recalibrated model "
        "(interval of what it removes: -50 … 10 %), and a wrong effect does no worse.",
        "exciter.K gain pu 50 40 … 60",
        "Where something unknown enters",
        "synchronous_machine Efd 0.90 1.2 95 % up to 0.2 pu; it moves against V, correlation -0.80",
        "The withdrawn effect, with 3 parameters of its own, adds 20 % of the squared error",
        "Fit both together.",
    ):
        assert words in text, words


def test_what_was_named_is_the_extension():
    text = text_of(found())
    assert "The extension: Excitation control The machine holds its voltage." in text
    assert "Withdrawn" not in text
    assert "Effects that were tried: exciter, governor." in text
    assert "second trip, held out P (pu) 0.1 0.03 −70 %" in text


def test_the_nearest_mechanism_is_told_as_that():
    near = cause(probability=0.2, exact=False, explained=0.87)
    text = text_of(
        found(
            verdict=Verdict("unknown", "Something enters."), confirmed=Verdict("nearest", "It is near."),
            causes=(replace(UNKNOWN, probability=0.8), near), extension=near.effects,
        )
    )  # fmt: skip
    assert "The model lacks a mechanism. The nearest of the library: excitation control." in text
    assert "Why this cause It is near." in text
    assert "The nearest mechanism: Excitation control The machine holds its voltage." in text
    assert "its form differs from this equation" in text
    assert "Before the held-out recordings were judged" not in text


def test_the_values_of_the_extended_model_are_told():
    text = text_of(found())
    assert "Parameters of the extended model All of them" in text
    assert "D 1 1.5 +50 % 0 … 2 1.25 … 1.75" in text
    assert "exciter.T s 0.1 0.02 −80 % 0.02 … 1 – at a bound" in text
    for other in (result(), withdrawn()):
        assert "Parameters of the extended model" not in text_of(other)


def test_a_value_at_its_bound_has_no_interval():
    assert "exciter.K gain pu 50 40 … 60 exciter.T s 0.02 at its bound" in text_of(found())


def test_an_error_of_the_record_of_an_event_is_no_lack_of_the_model():
    text = text_of(found([cause("fault_duration", event=True, title="Fault of another duration"), UNKNOWN]))
    happened = "Something happened during this recording: fault of another duration."
    assert happened in text
    assert "Of this recording alone: Fault of another duration" in text
    assert "The extension" not in text
    assert "An effect of one recording alone is off here" in text
    mixed = found([cause("exciter + fault_duration"), UNKNOWN])
    assert happened not in text_of(mixed)


@pytest.mark.parametrize(
    ("measured", "words"),
    [
        (
            gain(),
            "The extension, with 3 parameters of its own, removes 60 % of the squared error that the recalibrated "
            "model has there (90 % interval of what it removes: 40 … 70 %). A placebo, a wrong effect with 2 "
            "parameters, removes 10 %.",
        ),
        (
            gain(placebo=None, placebo_parameters=0),
            "70 %). There is no placebo to compare with: no wrong effect was fitted.",
        ),
        (gain(placebo=-0.3), "A placebo, a wrong effect with 2 parameters, adds 30 %."),
        (gain(*[float("nan")] * 3), "with 3 parameters of its own, cannot be simulated there."),
    ],
)
def test_the_gain_says_what_it_was_compared_with(measured, words):
    assert words in text_of(found(gain=measured))


@pytest.mark.parametrize(
    ("events", "words"),
    [
        (1, "Caution: 1 recording was held out, so the interval is mostly over time within this event"),
        (2, "Caution: 2 recordings were held out, so the interval is mostly over time within these events"),
    ],
)
def test_few_events_are_no_sure_interval(events, words):
    assert words in text_of(found(gain=gain(events=events)))
    assert "Caution" not in text_of(found(gain=gain(events=3)))


def test_doubts_about_units_stand_beside_the_verdict():
    hint = "trip: P before the event is 72 pu: check its unit and base_mva."
    text = text_of(result(hints=(hint,)))
    assert (
        "Check these readings first. A wrong unit, base, sign or value looks like a cause, or parameters and effects "
        f"make up for it: {hint} Wrong parameter values explain the error"
    ) in text


def test_the_roles_of_recordings_are_told():
    several = result(recordings=(*result().recordings, recording("third trip", "together")))
    text = text_of(several)
    assert (
        "Fitted together third trip: 0 to 4.1 s every 0.02 s, event at 1 s; not used for screening and the swarm"
        in text
    )
    assert "third trip, fitted together channel unit" in text
