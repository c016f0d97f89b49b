"""The example of the command line: what is hidden is found, the file is corrected, and the gain holds elsewhere."""

from dataclasses import replace

import pytest

from errorscreen.cases.case_models import CalibrationSection, ScreeningSection
from errorscreen.cases.demo_unit import write_demo_case
from errorscreen.models.dyr import read_dyr
from errorscreen.report.first_screen import certainty, statement
from errorscreen.workflow import run_study, write_outputs
from errorscreen.workflow.demo import demo_study

pytestmark = pytest.mark.usefixtures("undrawn_figures")


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """What is hidden, and the study of it without a network."""
    folder = tmp_path_factory.mktemp("demo")
    hidden = write_demo_case(tmp_path_factory.mktemp("again"), 0)
    quick = replace(
        demo_study(0, folder / "inputs"),
        screening=ScreeningSection(methods=["sensitivity"], top_k=4),
        calibration=CalibrationSection(methods=["map"]),
    )
    return hidden, run_study(quick, folder / "out"), folder


def numbers(path):
    """All numbers of a unit in a file by name."""
    unit = read_dyr(path).unit()
    return {p.name: p.nominal for p in unit.candidates} | unit.constant_values()


def test_the_stabiliser_that_did_not_act_is_named_and_the_extension_gains_elsewhere(solved):
    _, outcome, _ = solved
    found = outcome.result.diagnosis
    assert found.final.kind == "effect"
    assert [effect.original for effect in found.extension] == ["stabiliser_acting"]
    assert found.causes[0].probability > 0.9
    assert found.gain.interval[0] > 0.5
    assert "On 2 recordings that were not fitted, the extension removes" in certainty(outcome.result)


def test_the_wrong_number_is_the_only_one_that_changes_in_the_file(solved):
    hidden, outcome, folder = solved
    (folder / "out").mkdir(exist_ok=True)
    *_, changed = write_outputs(outcome, folder / "out")
    (one,) = outcome.result.correction.parameters
    assert one.name == hidden.parameter
    assert one.value == pytest.approx(hidden.value, rel=0.02)
    before, after = (numbers(path) for path in (folder / "inputs" / "unit.dyr", changed))
    assert {name for name in before if before[name] != after[name]} == {hidden.parameter}
    told = statement(outcome.result)
    assert told.startswith("The stabiliser IEEEST of unit 1 did not act. Wrong in the model file: SEXS.K ")
