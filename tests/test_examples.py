"""Every case file of the examples is read; the examples themselves run while the documentation is built."""

import importlib
from pathlib import Path

import pytest

from errorscreen.cases import load_case
from errorscreen.simulators import PlantSimulator

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
CASES = sorted(EXAMPLES.rglob("*.toml"))


def test_every_example_is_checked(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    gallery = importlib.import_module("_tools.gallery")
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(gallery.SAYS)
    assert {path.name for path in CASES} >= {"grid_fault.toml", "volt_var.toml", "case.toml"}


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_case_file_is_read(path):
    case = load_case(path)
    assert len(case.parameters()) >= 8


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_recording_of_case_file_can_be_simulated(path):
    case = load_case(path)
    recording_path = case.folder / case.recording.path
    if not recording_path.exists():
        pytest.skip(f"the recording {recording_path} is not here")
    recording = case.load_recording()
    simulator = PlantSimulator(case.device.model(case.folder), recording, parameters=case.parameters())
    observation = simulator.observe(recording)
    assert observation.mask.any()
    assert simulator.simulate(simulator.parameters.nominal, observation.event).ok.all()
