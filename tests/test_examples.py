"""Every example runs, without a warning, and says what it is meant to show; every case file is read."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import errorscreen
from errorscreen.cases import load_case
from errorscreen.simulators import PlantSimulator

EXAMPLES = Path(__file__).parents[1] / "examples"
#: what the output of each example must hold
SAYS = {
    "plot_quickstart.py": "Values of the parameters reproduce the recording",
    "plot_grid_search.py": "overlap of the five largest",
    "plot_ieee39_grid_search.py": "| mean contribution (blind) |",
    "plot_own_simulator.py": "Values of the parameters reproduce the recording",
    "plot_effect.py": "exciter.K",
    "plot_fmu.py": "Clock skew of y",
    "plot_own_equations.py": "Coulomb friction on speed, in the equation of speed",
    "plot_wavelet_image.py": "(2, 2, 64, 256)",
}
CASES = sorted(EXAMPLES.glob("*.toml"))


def test_every_example_is_tested():
    assert {path.name for path in EXAMPLES.glob("*.py")} == set(SAYS)
    assert {path.name for path in CASES} >= {"grid_fault.toml", "volt_var.toml"}


@pytest.mark.slow
@pytest.mark.parametrize("name", SAYS)
def test_example_runs(name, tmp_path):
    environment = {
        **os.environ,
        "PYTHONPATH": str(Path(errorscreen.__file__).parents[1]),
        "PYTHONIOENCODING": "utf-8",
    }
    run = subprocess.run(
        [sys.executable, "-W", "error", str(EXAMPLES / name)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        encoding="utf-8",
    )
    assert run.returncode == 0, run.stderr
    assert SAYS[name] in run.stdout
    assert not list(tmp_path.iterdir())  # an example leaves nothing behind


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
    simulator = PlantSimulator(case.device.type, recording, parameters=case.parameters())
    observation = simulator.observe(recording)
    assert observation.mask.any()
    assert simulator.simulate(simulator.parameters.nominal, observation.event).ok.all()
