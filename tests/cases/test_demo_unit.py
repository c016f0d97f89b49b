"""The example of the command line: what it hides, and that a wrong polarity is seen before any search."""

import pytest

from errorscreen.cases import load_case
from errorscreen.cases.demo_unit import DYR, EVENTS, FILE, write_demo_case
from errorscreen.workflow import Study
from errorscreen.workflow.demo import demo_study
from errorscreen.workflow.suspect_readings import doubts


def files(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


def written(folder, seed, **options):
    folder.mkdir()
    return write_demo_case(folder, seed, **options)


def test_a_seed_hides_the_same_in_the_same_files(tmp_path):
    one, again = written(tmp_path / "a", 3), written(tmp_path / "b", 3)
    other = written(tmp_path / "c", 4)
    assert one == again != other
    assert files(tmp_path / "a") == files(tmp_path / "b")
    assert set(files(tmp_path / "a")) == {"unit.dyr", "case.toml", *(f"{name}.csv" for name in EVENTS)}


def test_the_model_file_holds_the_wrong_number_and_a_stabiliser_in_service(tmp_path):
    hidden = written(tmp_path / "a", 0)
    assert (tmp_path / "a" / "unit.dyr").read_text() == DYR.format(**FILE)
    stated = {"GENROU.H": FILE["H"], "SEXS.K": FILE["K"]}[hidden.parameter]
    assert 0.7 < hidden.value / stated < 1.41
    assert abs(hidden.value / stated - 1.0) > 0.16


@pytest.mark.parametrize("seed", [0, 3, 4])  # Q, Q and the angle
def test_the_wrong_polarity_is_seen_and_corrected(tmp_path, seed):
    hidden = written(tmp_path / "a", seed)
    told = doubts(Study.from_case(load_case(tmp_path / "a" / "case.toml")).observations)
    assert any(hidden.turned in text for text in told)
    study = demo_study(seed, tmp_path / "b")
    assert doubts(study.observations) == []
    assert f"polarity of {hidden.turned} corrected" in study.title
    columns = load_case(tmp_path / "b" / "case.toml").recording.columns
    assert [name for name, column in columns.items() if column.scale == -1.0] == [hidden.turned]
