"""Another package adds a device, an effect, a reader, a screener and a calibrator by entry points."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import errorscreen

OTHER = Path(__file__).parent / "other_package"
CASE = """
[recording]
path = "dip.toy"
base_mva = 100.0
f_nominal = 60.0
event_time = 1.0
columns = { V = { column = "volts" }, P = { column = "watts" }, Q = { column = "vars" } }
[device]
type = "toy_plant"
[screening]
methods = ["toy"]
top_k = 1
[calibration]
methods = ["toy"]
library = 16
starts = 1
[discovery]
effects = ["boost"]
max_effects = 1
fits = 1
draws = 8
"""
CHECKS = """
import errorscreen_toys as toys
from errorscreen.cases import case_reference, load_case
from errorscreen.effects import effects_of
from errorscreen.exceptions import InputError
from errorscreen.screening import SCREENERS
from errorscreen.simulators import PlantSimulator
from errorscreen.testing import check_calibrator, check_effect, check_screener, check_simulator
recording = load_case("case.toml").load_recording()
plant = PlantSimulator("toy_plant", recording)
check_simulator(plant)
check_effect(plant, "boost")
check_screener(toys.ToyScreener(plant), recording)
check_calibrator(toys.ToyCalibrator(plant, random_state=0), recording)
assert effects_of("synchronous_machine")[-1] is toys.TOY_SHIFT
formats = next(line for line in case_reference("recording").splitlines() if line.startswith("| `format` |"))
assert '`"csv"`' in formats and '`"toy"`' in formats
try:
    SCREENERS["broken"]
except InputError as error:
    print(error)
"""


def run(folder, *command):
    path = os.pathsep.join([str(OTHER), str(Path(errorscreen.__file__).parents[1])])
    return subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Case file and recording of a toy plant whose power also follows the voltage at once."""
    folder = tmp_path_factory.mktemp("toys")
    time = np.arange(0, 4, 0.02)
    volts = np.where((time >= 1) & (time < 1.5), 0.8, 1.0)
    x = np.ones_like(time)
    for k in range(1, len(time)):
        x[k] = volts[k - 1] + (x[k - 1] - volts[k - 1]) * np.exp(-0.02 / 0.3)
    rng = np.random.default_rng(0)
    watts = 0.7 * x + 0.5 * (volts - 1) + 1e-3 * rng.standard_normal(len(time))
    signals = {
        "time": time,
        "volts": volts + 1e-4 * rng.standard_normal(len(time)),
        "watts": watts,
        "vars": 0.1 * volts + 1e-3 * rng.standard_normal(len(time)),
    }
    (folder / "dip.toy").write_text("TOY" + json.dumps({k: v.tolist() for k, v in signals.items()}))
    (folder / "case.toml").write_text(CASE)
    return folder


def test_a_case_file_names_what_another_package_adds(folder):
    done = run(folder, "-m", "errorscreen", "run", "case.toml", "--out", "out", "--quiet")
    assert done.returncode == 0, done.stderr
    result = json.loads((folder / "out" / "result.json").read_text())
    assert [one["method"] for one in result["screening"]] == ["toy"]
    assert [(m["method"], m["selection"]) for m in result["calibration"]] == [("toy", "toy")]
    assert result["diagnosis"]["extension"][0]["name"] == "boost"


def test_it_keeps_the_contracts_and_a_broken_entry_point_is_named(folder):
    done = run(folder, "-c", CHECKS)
    assert done.returncode == 0, done.stderr
    assert "package errorscreen-toys, entry point 'broken' of errorscreen.screeners: " in done.stdout
    assert "does not load: AttributeError" in done.stdout
