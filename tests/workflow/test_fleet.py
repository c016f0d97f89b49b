"""Many cases: each ends on its own, one page shows all, and a second run takes over what is there."""

import json
import re

import pytest

from errorscreen.cli import main
from errorscreen.exceptions import InputError
from errorscreen.report import read_result
from errorscreen.report.fleet_page import FleetRow, render_fleet
from errorscreen.workflow.fleet import _message, _names, run_fleet
from tests.report import samples
from tests.report.test_html_report import Outline
from tests.workflow.test_correction import CASE, folder  # noqa: F401


@pytest.fixture(scope="module")
def fleet(folder, tmp_path_factory):  # noqa: F811
    """Two cases that go through and one that does not."""
    text = CASE.replace(",\n  ", ", ")
    cases = [folder / "one.toml", folder / "two.toml", folder / "wrong.toml"]
    cases[0].write_text(text)
    cases[1].write_text(text.replace('"Unit 1"', '"Unit <2>"'))
    cases[2].write_text(text.replace("unit.dyr", "nowhere.dyr"))
    out = tmp_path_factory.mktemp("fleet")
    return cases, out, run_fleet(cases, out, jobs=2)


def test_each_case_has_its_report_and_a_wrong_one_its_message(fleet):
    _, out, found = fleet
    assert [row.verdict for row in found.rows] == ["parameters", "parameters", "not run"]
    assert found.code == 2
    assert "nowhere.dyr" in found.rows[2].message
    assert all((out / name / "report.html").exists() for name in ("one", "two"))
    assert found.summary() == "3 cases: 2 parameters, 1 not run"
    assert [row["code"] for row in json.loads(found.as_json())] == [0, 0, 2]


def test_the_page_links_the_reports_and_puts_the_open_one_first(fleet):
    found = fleet[2]
    page = found.page.read_text(encoding="utf-8")
    outline = Outline(page)
    assert outline.addresses == ["one/report.html", "two/report.html"]
    assert "Unit <2>" in outline.text
    assert outline.text.index("not run") < outline.text.index("Unit 1")
    assert "Wrong parameter values explain the error: GENROU.H" in outline.text
    assert page.count("<svg") == 2
    assert not re.search(r"<script|@import|url\(|https?:", page)


def test_a_second_run_takes_over_and_gives_the_same_page(fleet):
    cases, out, found = fleet
    first = found.page.read_text(encoding="utf-8")
    again = run_fleet(cases, out, jobs=1)
    assert read_result(out / "one" / "result.json").run.reused
    # times of the runs are in no cell
    assert again.page.read_text(encoding="utf-8") == first


def test_folders_have_names_of_their_own(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    cases = [tmp_path / "a" / "case.toml", tmp_path / "b" / "case.toml", tmp_path / "other.toml"]
    assert list(_names(cases)) == ["a-case", "b-case", "other"]
    with pytest.raises(InputError, match="is given twice"):
        _names([cases[0], tmp_path / "b" / ".." / "a" / "case.toml"])


def test_wrong_numbers_of_jobs_are_refused(tmp_path, capsys):
    with pytest.raises(InputError, match="the number of jobs is 0"):
        run_fleet(["a.toml", "b.toml"], tmp_path, jobs=0)
    assert main(["run", "a.toml", "--jobs", "2"]) == 2
    assert "2 jobs for one case" in capsys.readouterr().err


def test_doubtful_readings_and_limits_are_told():
    row = FleetRow("u1", "u1.toml", 0, samples.result(hints=("check P",)))
    # chi2/N of the only channel that both models have: 1e4 rms**2, so 0.02 over 0.1
    assert row.change == pytest.approx(0.2)
    text = Outline(render_fleet([row])).text
    assert "1 doubtful" in text
    assert "Wrong parameter values" in text


def test_a_message_is_the_programs_own():
    told = "note: a warning\nerrorscreen: file u.dyr: does not exist.\n  - a line\nx/resource_tracker.py:1: leaked"
    assert _message(told) == "file u.dyr: does not exist.   - a line"
    assert _message("Traceback\n  File x\nValueError: no") == "ValueError: no"
    assert _message("") == ""
