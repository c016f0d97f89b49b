"""The README's example and case file work as they are printed, and its links lead somewhere."""

import re
import runpy
from pathlib import Path

import pytest

from errorscreen.cases import load_case
from errorscreen.cases.demo import demo_recordings

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(language):
    return re.search(rf"```{language}\n(.*?)```", README, re.DOTALL).group(1)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the recording that the README speaks of."""
    frame = demo_recordings(1)[0].to_frame().iloc[::4].reset_index()
    frame.columns = ["time", "V_pu", "angle_rad", "P_MW", "Q_Mvar"]
    frame[["P_MW", "Q_Mvar"]] *= 737.0
    frame.to_csv(tmp_path / "unit2.csv", index=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_python_example_runs(folder, capsys):
    (folder / "example.py").write_text(block("python"), encoding="utf-8")
    runpy.run_path(str(folder / "example.py"))
    printed = capsys.readouterr().out
    assert "Tj" in printed
    assert "parameters" in printed
    assert (folder / "fit.png").stat().st_size > 1000


def test_the_case_file_is_valid(folder):
    (folder / "case.toml").write_text(block("toml"), encoding="utf-8")
    case = load_case(folder / "case.toml")
    assert case.parameters()["Xd"].upper == pytest.approx(0.95 * 1.4)
    assert case.load_recording().initial(["P"])["P"] == pytest.approx(0.72, abs=0.01)


def test_the_example_is_short():
    lines = [line for line in block("python").splitlines() if line.strip()]
    assert len(lines) <= 7


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(([^)#:]+)\)", README))))
def test_links_lead_to_files(target):
    assert (ROOT / target).exists()
