"""Recordings of a grid: which errors of the record of which event can be named."""

import numpy as np

from errorscreen.cases import ieee39_events, load_ieee39
from errorscreen.cases.case_file import load_case
from errorscreen.workflow import Study

CASE = """
[recording]
path = "trip.csv"
base_mva = 100.0
f_nominal = 60.0
event_time = 1.0
columns.V.column = "V"
columns.P.column = "P"
line_trip = { ends = [2, 3] }

[[together]]
path = "fault.csv"
event_time = 1.0
fault = { bus = 16, duration = 0.1 }

[[held_out]]
path = "other.csv"
event_time = 1.0
fault = { bus = 26, duration = 0.1 }

[grid]
case = "ieee39"
candidates = ["Xd", "Tj"]
"""


def test_errors_of_the_record_of_each_fitted_event_are_in_the_library(tmp_path):
    simulator, events = load_ieee39(), ieee39_events()
    named = {"trip": "line 2-3 out", "fault": "fault at bus 16", "other": "fault at bus 26"}
    for name, event in named.items():
        values = simulator.baseline(events[event])
        table = np.column_stack([events[event].time, *values])
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header="time,V,P", comments="")
    (tmp_path / "case.toml").write_text(CASE)
    study = Study.from_case(load_case(tmp_path / "case.toml"))
    found = {e.name for e in study.simulator.effects if e.kind == "event"}
    assert {"fault_duration", "fault_impedance", "trip_16_17"} <= found
    assert "trip_2_3" not in found  # it is what happened
    assert not any("26" in name for name in found)  # what is held out is not fitted
