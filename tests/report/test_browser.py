"""The report in a browser: it draws, zooms, fits narrow and wide screens, and says nothing on the console."""

import html
import json
import re
import shutil
import subprocess

import numpy as np
import pytest

from errorscreen import plotting
from errorscreen.report import ReportFigure
from errorscreen.report.charts import Chart, Curve, Panel
from errorscreen.report.html_report import render_report
from tests.report.samples import found

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")

#: a page that shows the report in a frame, presses a button of it, and notes what it finds
AROUND = """<!DOCTYPE html><body><iframe id="f" width="{width}" height="900" srcdoc="{page}"></iframe><script>
const frame = document.getElementById("f");
frame.onload = () => setTimeout(() => {{
  const page = frame.contentDocument, drawn = () => [...page.querySelectorAll("canvas")].map((c) => c.toDataURL());
  const before = drawn();
  const root = page.documentElement;
  const found = {{ width: root.scrollWidth, room: root.clientWidth, canvases: before.length,
    blank: before.filter((d) => d.length < 2000).length, focusable: page.querySelectorAll("button, a[href]").length,
    hidden: getComputedStyle(page.querySelector("figure.live img")).display }};
  page.querySelector('button[aria-label="zoom in"]').click();
  setTimeout(() => {{
    found.changed = drawn().filter((d, n) => d !== before[n]).length;
    document.title = JSON.stringify(found);
  }}, 300);
}}, 300);
</script></body>"""


@pytest.fixture(scope="module")
def page():
    time = np.linspace(0.0, 60.0, 60_001)
    wave = np.sin(time) * np.exp(-time / 20)
    curves = (Curve("measured", "measured", wave), Curve("before", "before", 0.9 * wave))
    panels = (Panel("P in pu", curves), Panel("V in pu", (Curve("V", "input", 1 + 0.1 * wave),)))
    bars = plotting.plot_rankings({"cnn": {"Xd": 2.0, "D": 1.0}})
    return render_report(found(), [ReportFigure("responses", "Curves.", bars, Chart(time, 1.0, panels))])


def run(*arguments):
    command = [
        CHROMIUM,
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--enable-logging=stderr",
        *arguments,
    ]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)


@pytest.mark.parametrize("width", [400, 1280])
def test_it_draws_and_zooms_and_fits(page, tmp_path, width):
    around = tmp_path / "around.html"
    around.write_text(AROUND.format(width=width, page=html.escape(page)), encoding="utf-8")
    shown = run("--virtual-time-budget=5000", "--window-size=1400,1000", "--dump-dom", around.as_uri())
    assert "CONSOLE" not in shown.stderr
    seen = json.loads(html.unescape(re.search(r"<title>(.*?)</title>", shown.stdout)[1]))
    assert seen["canvases"] == 2
    assert seen["blank"] == 0
    assert seen["changed"] == 2  # both panels follow
    assert seen["hidden"] == "none"  # the picture is for print and for readers without scripts
    assert seen["width"] <= seen["room"]
    assert seen["focusable"] >= 10


def test_it_prints(page, tmp_path):
    (tmp_path / "report.html").write_text(page, encoding="utf-8")
    paper = tmp_path / "report.pdf"
    run(f"--print-to-pdf={paper}", "--virtual-time-budget=3000", (tmp_path / "report.html").as_uri())
    assert paper.read_bytes().startswith(b"%PDF")
    assert paper.stat().st_size > 20_000


def test_a_minute_at_a_kilohertz_is_no_heavy_page(page):
    assert len(page.encode()) < 2_000_000
