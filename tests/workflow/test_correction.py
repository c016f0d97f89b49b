"""From a DYR and a recording to the corrected DYR."""

import numpy as np
import pytest

from errorscreen.cases import load_case
from errorscreen.events import Playback
from errorscreen.exceptions import InputError
from errorscreen.models.dyr import read_dyr
from errorscreen.models.standard import PARTS
from errorscreen.simulators import PlantSimulator
from errorscreen.workflow import Study, run_study, write_outputs

pytestmark = pytest.mark.usefixtures("undrawn_figures")

DYR = """// unit 1 of the plant
101 'GENROU' 1  6.0 0.04 0.8 0.06 {H} 0.0 1.8 1.7 0.3 0.5 0.22 0.15 0.0 0.0 /
101 'TGOV1'  1  0.05 0.3 1.0 0.0 2.0 7.0 0.0 /   tested in spring
"""
CASE = """
title = "Unit 1"
[recording]
path = "event.csv"
time = "t"
base_mva = 100.0
f_nominal = 60.0
event_time = 1.0
columns = {V = {column = "V", unit = "pu"}, angle = {column = "angle", unit = "rad"},
  P = {column = "P", unit = "pu"}, Q = {column = "Q", unit = "pu"}}
[device]
dyr = "unit.dyr"
[discovery]
enabled = false
[screening]
methods = ["sensitivity"]
top_k = 3
[calibration]
methods = ["map"]
library = 64
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A file with H = 3.2 s, and a recording of a unit with 4 s, simulated with half the step."""
    folder = tmp_path_factory.mktemp("unit")
    (folder / "truth.dyr").write_text(DYR.format(H="4.0"))
    (folder / "unit.dyr").write_text(DYR.format(H="3.2"))
    (folder / "case.toml").write_text(CASE.replace(",\n  ", ", "))
    time = np.arange(0.0, 6.0, 0.01)
    after = np.clip(time - 1.0, 0.0, None)
    signals = {
        "V": 1.0 - 0.3 * ((time > 1.0) & (time < 1.12)) - 0.03 * (1 - np.exp(-after)),
        "angle": -0.2 * (1 - np.exp(-2 * after)),
    }
    event = Playback(time, "dip", 1.0, signals, {"V": 1.0, "P": 0.7, "Q": 0.1})
    truth = PlantSimulator(read_dyr(folder / "truth.dyr").unit(), event, step=0.00125)
    P, Q = truth.simulate(truth.parameters.nominal).require_ok().values[0]
    rng = np.random.default_rng(5)
    columns = [time, signals["V"], signals["angle"], P, Q]
    columns[1:] = [one + rng.normal(0, 5e-4, len(time)) for one in columns[1:]]
    np.savetxt(
        folder / "event.csv", np.column_stack(columns), "%.7g", ",", header="t,V,angle,P,Q", comments=""
    )
    return folder


@pytest.fixture(scope="module")
def outcome(folder):
    return run_study(Study.from_case(load_case(folder / "case.toml")), folder / "out")


def test_the_wrong_number_alone_is_named_with_an_interval_that_holds(outcome):
    assert outcome.result.diagnosis.final.kind == "parameters"
    (moved,) = outcome.result.correction.parameters
    assert moved.name == "GENROU.H"
    assert moved.low < 4.0 < moved.high
    assert moved.high - moved.low < 0.2
    assert outcome.result.correction.chi2_per_sample < 1.3 < outcome.result.correction.before


def test_the_written_file_differs_in_that_number_only(outcome, folder):
    written = write_outputs(outcome, folder / "out")[-1]
    lines, old = (path.read_text().splitlines() for path in (written, folder / "unit.dyr"))
    assert [n for n, (a, b) in enumerate(zip(lines, old, strict=True)) if a != b] == [1]
    assert lines[2].endswith("/   tested in spring")
    assert read_dyr(written).unit().candidates["GENROU.H"].nominal == pytest.approx(4.0, abs=0.1)


def test_the_report_shows_the_difference(outcome, folder):
    report = write_outputs(outcome, folder / "out")[1].read_text(encoding="utf-8")
    assert "What to change in the model file" in report
    assert "calibrated.dyr" in report
    assert "-101 &#39;GENROU&#39;" in report or "-101 'GENROU'" in report


def test_a_second_run_takes_the_correction_over(outcome, folder):
    again = run_study(Study.from_case(load_case(folder / "case.toml")), folder / "out")
    assert again.result.correction == outcome.result.correction


PLANT = """201 'REGCA1' 1  {REGCA1} /
201 'REECB1' 1  {REECB1} /   as built
"""


@pytest.fixture(scope="module")
def of_flag(tmp_path_factory):
    """Outcome for a converter whose file has another flag and another lag than the unit, and the folder."""
    folder = tmp_path_factory.mktemp("plant")

    def text(**changes):
        values = {name: {**PARTS[name].typical} for name in ("REGCA1", "REECB1")}
        for name, value in changes.items():
            values[name.partition("__")[0]][name.partition("__")[2]] = value
        return PLANT.format(**{k: " ".join(f"{v:g}" for v in row.values()) for k, row in values.items()})

    (folder / "truth.dyr").write_text(text(REECB1__PQFLAG=1, REECB1__Kqv=3.0))
    (folder / "unit.dyr").write_text(text(REECB1__PQFLAG=0))
    listed = '[discovery]\neffects = ["REECB1.PQFLAG", "REECB1.PFFLAG", "lag_P"]\nfits = 2\nmax_effects = 1'
    (folder / "case.toml").write_text(
        CASE.replace(",\n  ", ", ").replace("[discovery]\nenabled = false", listed)
    )
    time = np.arange(0.0, 3.0, 0.01)
    signals = {"V": 1.0 - 0.4 * ((time > 1.0) & (time < 1.15)), "angle": 0.0 * time}
    event = Playback(time, "dip", 1.0, signals, {"V": 1.0, "P": 0.9, "Q": 0.1})
    truth = PlantSimulator(read_dyr(folder / "truth.dyr").unit(), event, step=0.00125)
    P, Q = truth.simulate(truth.parameters.nominal).require_ok().values[0]
    rng = np.random.default_rng(5)
    columns = [time, signals["V"], signals["angle"], P, Q]
    columns[1:] = [one + rng.normal(0, 1e-4, len(time)) for one in columns[1:]]
    np.savetxt(
        folder / "event.csv", np.column_stack(columns), "%.7g", ",", header="t,V,angle,P,Q", comments=""
    )
    return run_study(Study.from_case(load_case(folder / "case.toml")), folder / "out"), folder


def test_a_flag_that_is_named_is_changed_in_the_file(of_flag):
    outcome, folder = of_flag
    found = outcome.result
    assert [effect.name for effect in found.diagnosis.extension] == ["REECB1.PQFLAG"]
    assert "PQFLAG of REECB1 is 1, the file says 0" in found.diagnosis.final.text
    flag, *others = found.correction.parameters
    assert (flag.name, flag.value, flag.nominal) == ("REECB1.PQFLAG", 1.0, 0.0)
    assert np.isnan(flag.low)
    assert [one.name for one in others] == ["REECB1.Kqv"]
    assert others[0].low < 3.0 < others[0].high
    assert found.correction.chi2_per_sample < 1.5 < found.correction.before
    written = write_outputs(outcome, folder / "out")[-1]
    own = read_dyr(written).unit().constant_values()
    assert own["REECB1.PQFLAG"] == 1
    assert "as built" in written.read_text()


def test_the_report_tells_the_flag_without_an_interval(of_flag):
    outcome, folder = of_flag
    report = write_outputs(outcome, folder / "out")[1].read_text(encoding="utf-8")
    assert "The extension: PQFLAG of REECB1 is 1, the file says 0" in report
    assert "What to change in the model file" in report
    assert "Something unknown remains" not in report
    assert "REECB1.PQFLAG.on" not in report


@pytest.fixture(scope="module")
def of_part(tmp_path_factory):
    """Outcome for a machine whose file lacks its exciter, and the folder."""
    folder = tmp_path_factory.mktemp("part")
    machine = DYR.format(H="4.0").splitlines()[1]
    (folder / "truth.dyr").write_text(f"{machine}\n101 'SEXS' 1  0.1 10.0 100.0 0.1 0.0 5.0 /\n")
    (folder / "unit.dyr").write_text(f"{machine}   as built\n")
    listed = '[discovery]\neffects = ["exciter", "lag_Q"]\nfits = 2\nmax_effects = 1'
    (folder / "case.toml").write_text(
        CASE.replace(",\n  ", ", ").replace("[discovery]\nenabled = false", listed)
    )
    time = np.arange(0.0, 8.0, 0.01)
    after = np.clip(time - 2.0, 0.0, None)
    signals = {
        "V": 1.0 - 0.3 * ((time > 2.0) & (time < 2.12)) - 0.03 * (1 - np.exp(-after)),
        "angle": -0.2 * (1 - np.exp(-2 * after)),
    }
    event = Playback(time, "dip", 2.0, signals, {"V": 1.0, "P": 0.7, "Q": 0.1})
    truth = PlantSimulator(read_dyr(folder / "truth.dyr").unit(), event, step=0.00125)
    P, Q = truth.simulate(truth.parameters.nominal).require_ok().values[0]
    rng = np.random.default_rng(6)
    columns = [time, signals["V"], signals["angle"], P, Q]
    columns[1:] = [one + rng.normal(0, 2e-4, len(time)) for one in columns[1:]]
    np.savetxt(
        folder / "event.csv", np.column_stack(columns), "%.7g", ",", header="t,V,angle,P,Q", comments=""
    )
    text = (folder / "case.toml").read_text().replace("event_time = 1.0", "event_time = 2.0")
    (folder / "case.toml").write_text(text)
    return run_study(Study.from_case(load_case(folder / "case.toml")), folder / "out"), folder


def test_a_part_that_the_file_lacks_becomes_a_record(of_part):
    outcome, folder = of_part
    found = outcome.result
    assert [effect.name for effect in found.diagnosis.extension] == ["exciter"]
    (record,) = found.correction.records
    assert record.model == "SEXS"
    assert found.correction.chi2_per_sample < 1.2 < found.correction.before
    K = next(one for one in found.correction.parameters if one.name == "exciter.K")
    assert K.low < 100.0 < K.high
    written = write_outputs(outcome, folder / "out")[-1]
    first, second = written.read_text().splitlines()[:2]
    assert first.endswith("as built")
    assert second.startswith("101 'SEXS' 1  ")
    case = load_case(folder / "case.toml")
    plant = PlantSimulator(read_dyr(written).unit(), case.load_recording())
    observation = plant.observe(case.load_recording())
    y = plant.simulate(plant.parameters.nominal, observation.event).values[0]
    z = observation.deviations(y)[observation.mask]
    assert np.mean(z**2) < 1.2


def test_the_report_tells_the_new_record(of_part):
    outcome, folder = of_part
    report = write_outputs(outcome, folder / "out")[1].read_text(encoding="utf-8")
    assert "lacks SEXS" in report
    assert "+101 &#39;SEXS&#39;" in report or "+101 'SEXS'" in report


def test_a_stated_model_error_counts_in_all_recordings(folder):
    text = CASE.replace(",\n  ", ", ") + "[simulation]\nmodel_error = {P = 0.02}\nmodel_error_time = 0.2\n"
    text += '[[held_out]]\npath = "event.csv"\nname = "other"\nt_start = 0.1\n'
    (folder / "error.toml").write_text(text)
    study = Study.from_case(load_case(folder / "error.toml"))
    plain = Study.from_case(load_case(folder / "case.toml"))
    wave = 0.02 * np.sin(study.observation.time) * (study.observation.time > 1.0)
    errors = study.observation.values + np.stack([wave, 0 * wave])
    allowed, counted = (np.square(s.observation.deviations(errors)).sum() for s in (study, plain))
    assert allowed < 0.05 * counted
    assert all(o.model_error == {"P": 0.02} and o.model_error_time == 0.2 for o in study.observations)
    assert study.fingerprint("diagnosis") != plain.fingerprint("diagnosis")
    (folder / "error.toml").write_text(text.replace("{P =", "{p ="))
    with pytest.raises(InputError, match=r"model_error: unknown channel 'p'"):
        Study.from_case(load_case(folder / "error.toml"))
