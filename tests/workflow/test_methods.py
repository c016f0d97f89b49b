"""Every registered screener and calibrator can be built from the sections of a case file."""

import pytest

from errorscreen.calibration import CALIBRATORS
from errorscreen.cases.case_models import CalibrationSection, RunSection, ScreeningSection
from errorscreen.screening import SCREENERS
from tests.plants import dip, plant

PLANT = plant("pv_plant", dip(stop=2.0))
RUN = RunSection(random_state=5)


@pytest.mark.parametrize("name", SCREENERS)
def test_screeners_take_the_keys_of_a_case_file(name, tmp_path):
    section = ScreeningSection(samples=44, epochs=3, frequencies=9)
    screener = SCREENERS[name].from_case(PLANT, section, RUN, tmp_path)
    options = screener.get_params(deep=False)
    assert options["simulator"] is PLANT
    assert options.get("random_state", 5) == 5
    if name == "cnn":
        assert (options["n_samples"], options["epochs"], options["n_frequencies"]) == (44, 3, 9)
        assert options["checkpoint"] == tmp_path / "dataset"


@pytest.mark.parametrize("name", CALIBRATORS)
def test_calibrators_take_the_keys_of_a_case_file(name):
    section = CalibrationSection(level=0.8, starts=3, particles=7)
    calibrator = CALIBRATORS[name].from_case(PLANT, ["Tg"], section, RUN)
    options = calibrator.get_params(deep=False)
    assert (options["simulator"], list(options["names"]), options["random_state"]) == (PLANT, ["Tg"], 5)
    assert options.get("level", 0.8) == 0.8
    assert options.get("n_starts", 3) == 3
    assert options.get("n_particles", 7) == 7


def test_a_selection_is_calibrated_by_all_but_the_map():
    assert [name for name, calibrator in CALIBRATORS.items() if not calibrator.selects] == ["map"]
