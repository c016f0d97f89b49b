"""The README's example and case file work as they are printed."""

import re
import runpy
from pathlib import Path

import pytest

from errorscreen.cases import load_case
from errorscreen.cases.demo import demo_recordings

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def block(language):
    return re.search(rf"```{language}\n(.*?)```", README, re.DOTALL).group(1)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the recording that the README speaks of."""
    frame = demo_recordings(1)[0].to_frame().iloc[::4].reset_index()
    frame.columns = ["time", "V_mag", "V_ang_rad", "P_MW", "Q_Mvar"]
    frame[["P_MW", "Q_Mvar"]] *= 737.0
    frame.to_csv(tmp_path / "unit2.csv", index=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_python_example_runs(folder, capsys):
    pytest.importorskip("torch")
    network = "contribution_pipeline(measured.event.dt, random_state=0)"
    small = "cwttransformer__n_frequencies=8, cwttransformer__n_columns=16, cnncontributionregressor__max_epochs=1"
    code = block("python")
    assert network in code
    code = code.replace(network, f"{network}.set_params({small})").replace("1000", "40")  # in seconds
    (folder / "example.py").write_text(code)
    runpy.run_path(str(folder / "example.py"))
    printed = capsys.readouterr().out
    assert "Tj" in printed
    assert "χ²/N is" in printed


def test_the_case_file_is_valid(folder):
    (folder / "case.toml").write_text(block("toml"))
    case = load_case(folder / "case.toml")
    assert case.parameters()["Xd"].upper == pytest.approx(0.95 * 1.4)
    assert case.load_recording().initial(["P"])["P"] == pytest.approx(0.72, abs=0.01)


def test_the_example_is_short():
    assert len([line for line in block("python").splitlines() if line.strip()]) <= 22
