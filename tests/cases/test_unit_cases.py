"""Keys of a case file for what drives a unit: recorded inputs, the source of the angle, steps of set-points."""

import numpy as np
import pytest

from errorscreen.cases.case_file import case_reference, load_case
from errorscreen.events import SetPointStep
from errorscreen.exceptions import InputError
from errorscreen.simulators import PlantSimulator
from errorscreen.workflow.check_case import check_case

DYR = """\
1 'GENROU' 1  6.0 0.04 0.8 0.06 4.0 0.0 1.8 1.7 0.3 0.5 0.22 0.15 0.1 0.4 /
1 'SEXS' 1  0.1 10.0 100.0 0.1 0.0 5.0 /
1 'TGOV1' 1  0.05 0.3 1.0 0.0 2.0 7.0 0.0 /
"""
CASE = """
[recording]
path = "test.csv"
base_mva = 100.0
f_nominal = 60.0
{recording}
[recording.columns]
V = {{ column = "V" }}
P = {{ column = "P" }}
Q = {{ column = "Q" }}
{columns}
{step}
[device]
dyr = "unit.dyr"
{device}
{further}
"""
STEP = '[recording.step]\nquantity = "Vref"\ntime = 1.0\nsize = 0.02'


def written(folder, recording="", columns="", step="", device="constant_frequency = true", further=""):
    time = np.arange(0.0, 3.0, 0.02)
    rng = np.random.default_rng(0)
    moved = np.where(time < 1.0, 0.0, 1 - np.exp(1.0 - time))
    table = {
        "time": time,
        "V": 1.0 + 0.002 * moved,
        "P": 0.8 + 0 * time,
        "Q": 0.2 + 0.05 * moved,
        "Efd": 2.1 + moved,
    }
    values = np.column_stack(
        [v + (name != "time") * rng.normal(0, 1e-4, len(v)) for name, v in table.items()]
    )
    np.savetxt(folder / "test.csv", values, delimiter=",", header=",".join(table), comments="")
    (folder / "unit.dyr").write_text(DYR)
    text = CASE.format(recording=recording, columns=columns, step=step, device=device, further=further)
    (folder / "case.toml").write_text(text)
    return folder / "case.toml"


def plant(case):
    recording, device = case.load_recording(), case.device
    return PlantSimulator(
        device.model(case.folder, case.steps), recording, parameters=case.parameters(), effects=(),
        constant_frequency=device.constant_frequency, angle_reactance=device.angle_reactance,
    )  # fmt: skip


def test_recorded_inputs_stand_for_models_of_the_file(tmp_path):
    path = written(
        tmp_path, 'event_time = 1.0', 'Efd = { column = "Efd" }', device='inputs = ["Efd"]\nangle_reactance = 0.2'
    )  # fmt: skip
    case = load_case(path)
    assert not [name for name in case.parameters().names if name.startswith("SEXS")]
    simulator = plant(case)
    assert simulator.channels == ("P", "Q")
    assert simulator.event.signals.keys() == {"V", "angle", "Efd"}


def test_a_step_is_the_event_and_its_size_may_be_a_candidate(tmp_path):
    case = load_case(written(tmp_path, step=STEP))
    recording = case.load_recording()
    assert (recording.event_time, recording.steps) == (1.0, (SetPointStep("Vref", 1.0, 0.02),))
    assert "Vref.step" not in case.parameters()
    twice = STEP.replace("[recording.step]", "[[recording.step]]").replace("\nsize = 0.02", "")
    further = '[[held_out]]\npath = "other.csv"\nstep = [{ quantity = "Pref", time = 1.5, size = 0.1 }]'
    case = load_case(
        written(tmp_path, step=f"{twice}\n{twice.replace('1.0', '2.0')}\nsize = -0.02", further=further)
    )
    assert case.parameters()["Vref.step"].upper == 0.1
    assert [one.size for one in case.steps] == [None, -0.02, 0.1]
    assert plant(case).device.steps == {"Vref": True, "Pref": False}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"device": 'inputs = ["Efd"]'}, "Efd is an input of the unit, but no column is mapped to it"),
        ({"device": 'inputs = ["Efd"]', "columns": "Efd = { value = 2.1 }"}, "no column is mapped"),
        ({"device": 'inputs = ["Vs"]'}, "device.inputs.*Allowed: Efd, Pm"),
        ({"device": 'inputs = ["Pm", "Pm"]'}, "found twice"),
        ({"device": "angle_reactance = -0.1"}, "a number >= 0"),
        ({"step": STEP, "recording": "event_time = 2.0"}, "Vref steps at 1 s, but event_time is 2 s"),
        ({"step": STEP.replace("Vref", "Vset")}, "Allowed: Vref, Pref, Qref, Qext"),
        ({"step": STEP.replace("Vref", "Qext")}, "has no set-point Qext.*Allowed: Vref, Pref"),
        ({"step": STEP.replace("0.02", "0.0")}, "the size is 0"),
        (
            {"step": STEP.replace("\nsize = 0.02", ""), "device": 'candidates = ["GENROU.H"]'},
            "'Vref.step' is no candidate",
        ),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path, options, words):
    with pytest.raises(InputError, match=words):
        load_case(written(tmp_path, **options))


def test_inputs_and_steps_need_a_model_file_or_a_device(tmp_path):
    path = written(tmp_path, device='inputs = ["Efd"]')
    path.write_text(path.read_text().replace('dyr = "unit.dyr"', 'type = "synchronous_machine"'))
    with pytest.raises(InputError, match="inputs are given without dyr"):
        load_case(path)
    path = written(tmp_path, "event_time = 1.0\n[recording.load_step]\nfactor = 1.2", step=STEP)
    head, _, _ = path.read_text().partition("[device]")
    path.write_text(f'{head}[grid]\ncase = "ieee39"\n')
    with pytest.raises(InputError, match="step is given. Allowed: only with"):
        load_case(path)


def test_the_reference_lists_the_keys_of_a_step():
    assert "### `[recording.step]`" in case_reference("recording")


def test_a_limit_is_a_candidate_where_the_case_names_it(tmp_path):
    device = "constant_frequency = true\n"
    default = load_case(written(tmp_path, device=device)).parameters().names
    bounds = '[device.parameters]\n"SEXS.EMAX" = { lower = 2.0, upper = 6.0 }'
    case = load_case(written(tmp_path, device=device, further=bounds))
    assert case.parameters().names == (*default, "SEXS.EMAX")
    ceiling = case.parameters()["SEXS.EMAX"]
    assert (ceiling.nominal, ceiling.lower, ceiling.upper) == (5.0, 2.0, 6.0)
    assert "SEXS.EMAX" in plant(case).parameters
    case = load_case(written(tmp_path, device=device + 'candidates = ["SEXS.K", "TGOV1.VMAX"]'))
    assert case.parameters().names == ("SEXS.K", "TGOV1.VMAX")
    with pytest.raises(InputError, match="unknown parameter 'SEXS.EMX'"):
        load_case(written(tmp_path, device=device, further=bounds.replace("EMAX", "EMX")))


def test_the_check_of_a_case_tells_what_is_not_compared(tmp_path):
    path = written(tmp_path, "event_time = 1.0", 'winding = { column = "Efd", unit = "pu" }')
    told = check_case(path).advice
    assert "winding is not compared: the model GENROU+SEXS+TGOV1 has P, Q, Efd, If, Pm, speed, gate." in told
