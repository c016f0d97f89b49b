"""Case files of a grid: what is compared, and what happened in it."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from errorscreen.cases.case_file import load_case
from errorscreen.cases.model_sections import FaultSection
from errorscreen.exceptions import InputError
from tests.cases.test_case_file import GOOD, write

GRID = """
[recording]
path = "a.csv"
base_mva = 100.0
f_nominal = 60.0
event_time = 1.0
columns.V.column = "V"
columns.P.column = "P"

[recording.fault]
bus = 3
duration = 0.1
reactance = 0.02

[[held_out]]
path = "b.csv"
event_time = 1.0
load_level = 0.9
load_step = { factor = 1.2, buses = [3, 4] }

[grid]
case = "ieee39"
candidates = ["Xd", "Tj"]
parameters.Xd.nominal = 1.5
"""


def test_a_grid_takes_the_place_of_a_device(tmp_path):
    case = load_case(write(tmp_path, GRID))
    assert case.device is None
    assert case.parameters().names == ("Xd", "Tj")
    assert case.parameters()["Xd"].nominal == 1.5
    time = np.arange(0, 2, 0.01)
    fault, step = (
        section.events[key].event(time, "e", 1.0, section.load_level)
        for section, key in ((case.recording, "fault"), (case.held_out[0], "load_step"))
    )
    assert (fault.bus, fault.duration, fault.impedance, fault.level) == (3, 0.1, 0.02j, 1.0)
    assert (step.factor, step.buses, step.level, step.start) == (1.2, (3, 4), 0.9, 1.0)
    simulator = case.grid.simulator(fault, 0.005)
    assert simulator.channels == ("V", "P")
    assert simulator.step == 0.005
    trip = load_case(
        write(
            tmp_path, GRID.replace("load_step = { factor = 1.2, buses = [3, 4] }", "line_trip.ends = [2, 3]")
        )
    )
    assert trip.held_out[0].events["line_trip"].event(time, "t", 1.0, 1.0).ends == (2, 3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('[grid]', '[device]\ntype = "pv_plant"\n[grid]', "[device] and [grid] are both given. Allowed: one of"),
        ('[grid]\ncase', '[run]\nout', "neither [device] nor [grid] is given. Allowed: one of the two."),
        ("[recording.fault]", "[recording.short]", "unknown key 'short'"),
        ("bus = 3\n", "", "[recording.fault]: key 'bus' is missing."),
        ("reactance = 0.02", "reactance = -0.02", "fault.reactance: -0.02 was found. Allowed: a number >= 0."),
        ('[[held_out]]\npath = "b.csv"', '[[together]]\npath = "c.csv"\n[[held_out]]\npath = "b.csv"',
         "together[1]: no event given. Allowed: one of [together[1].fault], "),
        ("load_step =", "#", "held_out[1]: no event given. Allowed: one of [held_out[1].fault], "),
        ("load_level = 0.9", "line_trip.ends = [2, 3]", "held_out[1]: line_trip and load_step given."),
        ("load_level = 0.9", "level = { V = 1.0 }", "held_out[1]: level is given. Allowed: only with [device]."),
        ("load_level = 0.9", "load_level = 0.0", "held_out[1].load_level: 0.0 was found. Allowed: a number > 0."),
        ('"ieee39"', '"ieee93"', "grid.case: unknown value 'ieee93' (did you mean 'ieee39'?)"),
        ('"Tj"', '"Tjj"', "unknown parameter 'Tjj'"),
        ('["Xd", "Tj"]', "[]", "grid.candidates: [] was found. Allowed: at least 1 entry."),
        ("factor = 1.2", "factor = 1.0", "load_step: a factor of 1 changes nothing. Allowed: another factor."),
        ("buses = [3, 4]", "buses = []", "load_step.buses: [] was found. Allowed: at least 1 entry."),
        ("event_time = 1.0\ncolumns", "columns", "recording: event_time is not given. Allowed: the instant of the"),
        ('"ieee39"', '"ieee39"\nchannels = { V = [25, 2] }', "grid: channel V is [25, 2]. Allowed: V = a bus."),
        ('"ieee39"', '"ieee39"\nchannels = { P = 2 }', "grid: channel P is 2. Allowed: P = [sending, receiving] bus."),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_grid_is_named(tmp_path, old, new, message):
    text = GRID.replace(old, new)
    if "[run]" in new:
        text = text[: text.index("candidates")]
    assert old in GRID
    with pytest.raises(InputError, match=re.escape(message)):
        load_case(write(tmp_path, text))


def test_a_device_knows_no_event_of_a_grid(tmp_path):
    for key, line in (("fault", "fault = { bus = 3, duration = 0.1 }"), ("load_level", "load_level = 0.9")):
        text = GOOD.replace("t_end = 2.5", f"t_end = 2.5\n{line}")
        with pytest.raises(InputError, match=rf"recording: {key} is given\. Allowed: only with \[grid\]"):
            load_case(write(tmp_path, text))


@pytest.mark.parametrize(
    ("stated", "start", "end"),
    [
        ((1.0, 0.1), 1.0, 1.1),
        ((1.0005, 0.1), 1.0025, 1.1025),  # the sample at 1 s is one before the fault
        ((1.0033, 0.0833), 1.0025, 1.0875),
        ((1.0095, 0.1), 1.01, 1.11),
        ((1.00000001, 0.09999999), 1.0, 1.1),  # rounded time stamps
    ],
)
def test_instants_of_an_event_stay_between_their_samples(stated, start, end):
    time = np.arange(0, 2, 0.01)
    recording = SimpleNamespace(event_time=stated[0], load_level=1.0)
    event, told = FaultSection(bus=3, duration=stated[1]).on_steps(time, "e", recording, 0.0025, "here")
    assert (event.start, event.start + event.duration) == pytest.approx((start, end))
    for instant, moved in ((stated[0], start), (sum(stated), end)):
        samples = np.abs(time - instant) > 1e-6  # one at the instant itself counts as after it
        assert np.array_equal(time[samples] > instant, time[samples] >= moved - 1e-9)
    assert len(told) == 1 + (abs(stated[0] - start) > 1e-4) + (abs(sum(stated) - end) > 1e-4)
    assert (
        told[0] == f"Event as stated: fault, bus 3, duration {stated[1]}, resistance 0.0, reactance 0.0, "
        "load level 1."
    )


@pytest.mark.parametrize("duration", [1e-6, 0.001, 5.0])
def test_a_fault_lasts_for_a_step_and_is_cleared(duration):
    time, recording = np.arange(0, 2, 0.01), SimpleNamespace(event_time=1.0, load_level=1.0)
    with pytest.raises(
        InputError, match=r"here: a duration of .* at least a step, 0.0025 s, and cleared before"
    ):
        FaultSection(bus=3, duration=duration).on_steps(time, "e", recording, 0.0025, "here")
