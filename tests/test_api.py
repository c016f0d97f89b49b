import ast
import importlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import errorscreen
import errorscreen as es
from errorscreen.cases.demo import demo_recordings
from errorscreen.data.headers import guess_columns, guess_time
from errorscreen.exceptions import DataWarning

TIME = np.arange(200) / 50
BASES = {"base_mva": 50.0, "f_nominal": 50.0}


def dip(before, after):
    return np.where(TIME < 1.0, before, after)


def columns(**more):
    return {"time": TIME, "V [kV]": dip(20.0, 16.0), "P [MW]": dip(30.0, 25.0), **more}


def test_type_checkers_see_the_names_that_are_loaded():
    tree = ast.parse(Path(errorscreen.__file__).read_text(encoding="utf-8"))
    [guarded] = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {}
    for node in guarded.body:
        for alias in node.names:
            seen[alias.asname or alias.name] = getattr(importlib.import_module(node.module), alias.name)
    assert seen == {name: getattr(es, name) for name in es.__all__}
    assert set(es.__all__) <= set(dir(es))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'plant'"):
        es.plant  # noqa: B018


def test_the_main_module_runs_nothing_when_it_is_imported():
    code = "import errorscreen.__main__; print('still here')"
    found = subprocess.run([sys.executable, "-c", code, "--help"], capture_output=True, text=True, check=True)
    assert found.stdout == "still here\n"


def test_files_tables_and_arrays_are_read_alike(tmp_path):
    frame = pd.DataFrame(columns())
    frame.to_csv(tmp_path / "unit2.csv", index=False)
    given = {"base_kv": 20.0, **BASES}
    explicit = {"V": es.Column("V [kV]", unit="kV"), "P": es.Column("P [MW]", unit="MW")}
    recordings = [
        es.read(tmp_path / "unit2.csv", **given),
        es.read(str(tmp_path / "unit2.csv"), explicit, **given),
        es.read(frame, **given),
        es.read(frame.set_index("time"), **given),
        es.read(columns(), **given),
    ]
    for rec in recordings:
        assert rec.names == ("V", "P")
        assert rec.initial(["V", "P"]) == pytest.approx({"V": 1.0, "P": 0.6})
        assert rec.event_time == 1.0
    assert recordings[0].name == "unit2"
    assert (
        recordings[0].assumptions[0] == "Columns were taken by their names: V from 'V [kV]', P from 'P [MW]'."
    )


def test_the_unit_of_time_is_read_off_its_header(tmp_path):
    table = {"t (ms)": 1e3 * TIME, "P": dip(0.6, 0.5)}
    assert es.read(table, **BASES).event_time == 1.0
    assert es.read(table, {"P": "P"}, **BASES).event_time == 1.0
    with pytest.warns(
        DataWarning, match="Samples are 20 s apart: check time_unit, for example time_unit = 'ms'"
    ):
        assert es.read(table, time="t (ms)", time_unit="s", **BASES).event_time == 1000.0
    lines = [f"{1e3 * t:g};{p:g}".replace(".", ",") for t, p in zip(TIME, dip(0.6, 0.5), strict=True)]
    (tmp_path / "comma.csv").write_text("# exported\nt (ms);P\n" + "\n".join(lines), encoding="utf-8")
    assert es.read(tmp_path / "comma.csv", decimal=",", skip_rows=1, **BASES).event_time == 1.0


@pytest.mark.parametrize(
    ("header", "role", "unit"),
    [
        ("V", "V", None),
        ("V_mag_pu", "V", "pu"),
        ("Voltage in kV", "V", "kV"),
        ("U [p.u.]", "V", "pu"),
        ("V_ang_rad", "angle", "rad"),
        ("phase angle (°)", "angle", "deg"),
        ("freq [Hz]", "f", "Hz"),
        ("active power / MW", "P", "MW"),
        ("Q_Mvar", "Q", "Mvar"),
        ("Q (MVAR)", "Q", "Mvar"),
        ("active_power (MW)", "P", "MW"),
        ("V_mag[kV]", "V", "kV"),
    ],
)
def test_usual_headers_are_understood(header, role, unit):
    [(found, column)] = guess_columns([header, "tap", "P1", "V2 [kV]"], "table").items()
    assert (found, column.column, column.unit) == (role, header, unit)


@pytest.mark.parametrize(
    ("headers", "message"),
    [
        (["time", "MW", "tap"], "no column names a channel; the columns are 'time', 'MW', 'tap'. Allowed: V, angle"),
        (["active power"], "column 'active power' seems to hold P, but its unit is not clear"),
        (["P [%]"], "column 'P \\[%\\]' seems to hold P, .* Allowed: one column for P, in W, kW"),
        (["P_MW", "P_kW"], "columns 'P_MW' and 'P_kW' both seem to hold P; the columns are"),
    ],
)  # fmt: skip
def test_doubtful_headers_are_refused(headers, message):
    with pytest.raises(es.InputError, match=message):
        guess_columns(headers, "table")


def test_two_columns_of_time_leave_the_choice_open():
    assert guess_time(["t", "time [s]"]) == (None, None)
    assert guess_time(["t [fortnights]", "time [s]"]) == ("time [s]", "s")


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (3, "the source is of type int. Allowed: a path, a table or a mapping"),
        ({"time": TIME, "P": TIME[:5]}, "the columns have the shapes"),
        ("no-such-file.csv", "does not exist"),
    ],
)
def test_unusable_sources_are_refused(source, message):
    with pytest.raises(es.InputError, match=message):
        es.read(source, **BASES)


def test_an_unknown_method_is_named():
    with pytest.raises(es.InputError, match="calibrate: unknown calibrator 'mpa'.*did you mean 'map'"):
        es.calibrate(None, None, "mpa")


def test_the_swarm_is_a_method():
    rec = demo_recordings(0)[0]
    plant = es.Plant("synchronous_machine", rec)
    fit = es.calibrate(plant, rec, "pso", ["Xd1"], n_iterations=2, n_particles=4)
    assert (fit.names_, fit.random_state) == (("Xd1",), 0)


def test_a_format_can_be_stated(tmp_path):
    path = tmp_path / "unit2.dat"
    pd.DataFrame({"time": TIME, "P": dip(0.6, 0.5)}).to_csv(path, index=False)
    assert es.read(path, format="csv", **BASES).names == ("P",)
    with pytest.raises(es.InputError, match="read: unknown format 'xls'"):
        es.read(path, format="xls", **BASES)


SIX_LINES = """
rec = es.read("unit2.csv", base_mva=100.0, f_nominal=60.0)
plant = es.Plant("synchronous_machine", rec)
fit = es.calibrate(plant, rec)
print(fit.summary())
figure = fit.plot()
print(es.find_causes(plant, rec).summary())
"""


def test_six_lines_lead_from_a_file_to_a_summary_and_a_figure(tmp_path):
    recording = demo_recordings(0)[0]
    named = {"V": "V [pu]", "angle": "angle (rad)", "P": "P_pu"}
    recording.to_frame().rename(columns=named).to_csv(tmp_path / "unit2.csv")
    code = f"import errorscreen as es{SIX_LINES}print(*[axes.get_ylabel() for axes in figure.axes])"
    path = os.pathsep.join([str(Path(errorscreen.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    shown = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert "converged" in shown  # of the fit
    assert all(name in shown for name in es.Plant("synchronous_machine", recording).parameters.names)
    assert "reproduce the recording within its noise" in shown  # the verdict
    assert shown.splitlines()[-1] == "P in pu Q in pu"
