from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from errorscreen.cases.demo import demo_recordings
from errorscreen.data.recordings import Recording
from errorscreen.discovery import Cause, Gain, Group, InputLocation
from errorscreen.models import DEVICES
from errorscreen.simulators import PlantSimulator
from errorscreen.workflow.advice import advice, doubts

UNKNOWN = Cause("unknown", "Unknown", "unknown", 0.1, "", {}, 0.0, False)
EXCITER = Cause("exciter", "Excitation control", "effect", 0.9, "Efd", {}, 0.99, True)
PLACE = InputLocation("synchronous_machine", "Efd", 0.9, 1.1, np.zeros(2), np.zeros(2), ())
HINTS = ["trip: P before the event is 72 pu: check its unit and base_mva."]


GAIN = Gain(5.0, 3.0, 1.0, 0.8, (0.7, 0.9), 0.9, 0.1, (None, None, None))


def library(names):
    return ["exciter", "lag_P", "governor"] if names is None else list(names)


def finder(kind, *causes, groups=(), places=(), effects=None):
    verdict, ports = SimpleNamespace(kind=kind), {"Efd": "field voltage"}
    simulator = SimpleNamespace(device=SimpleNamespace(ports=ports), effects_named=library)
    return SimpleNamespace(
        verdict_=verdict,
        causes_=list(causes),
        groups_=list(groups),
        input_locations_=list(places),
        simulator=simulator,
        effects=effects,
    )


def told(*arguments, **options):
    return " ".join(advice(*arguments, **options))


def test_doubts_come_first_whatever_the_verdict():
    """Parameters can make up for a wrong unit too."""
    assert advice(finder("unknown", UNKNOWN, places=[PLACE]), None, HINTS)[0] == HINTS[0]
    assert advice(finder("effect", EXCITER, UNKNOWN), None, HINTS)[0] == HINTS[0]
    parameters = Cause("parameters", "Parameters", "parameters", 0.9, "", {}, 0.0, True)
    assert advice(finder("parameters", parameters, UNKNOWN), None, HINTS, confirmed=True) == HINTS


def test_what_nothing_else_confirms_asks_for_another_event():
    assert "hold it out: only that shows whether these values hold" in told(
        finder("parameters", UNKNOWN), None
    )
    assert "whether the model as it is holds" in told(finder("within-noise", UNKNOWN), None)
    few = replace(GAIN, events=(None,))
    assert "Fewer than 3 recordings were held out" in told(finder("effect", EXCITER), few, confirmed=True)
    # a wrong effect that gains as much, as far as the interval tells
    alike = replace(GAIN, placebo=0.75)
    assert "gains as much from a wrong effect" in told(finder("effect", EXCITER), alike, confirmed=True)
    assert told(finder("effect", EXCITER), GAIN, confirmed=True) == ""


def test_effects_that_were_not_tried_are_told_where_nothing_is_known():
    text = told(finder("unknown", UNKNOWN, places=[PLACE], effects=["lag_P"]), None)
    assert "2 of 3 effects of the library were not tried" in text
    assert "not tried" not in told(finder("unknown", UNKNOWN, places=[PLACE]), None)


def test_what_is_unknown_always_has_an_advice():
    text = told(finder("unknown", UNKNOWN, places=[PLACE]), None)
    assert (
        "enters at Efd of the synchronous_machine: record the field voltage, and whatever acts on it" in text
    )
    assert "No place is known" in told(finder("unknown", UNKNOWN), None)
    little = told(finder("unknown", UNKNOWN, places=[replace(PLACE, explained=0.2)]), None)
    assert "record the field voltage" not in little
    assert "check time stamps and filters" in little
    gone = replace(EXCITER, withdrawn=True, probability=0.0)
    text = told(finder("unknown", UNKNOWN, gone, places=[PLACE]), None)
    assert "enters at Efd" in text
    assert "Excitation control was withdrawn" in text
    # parameters that suffice for what was fitted, but not for what was held out
    parameters = Cause("parameters", "Parameters", "parameters", 0.9, "", {}, 0.0, True)
    assert "does not show in what was fitted" in told(finder("unknown", parameters), None, refuted=True)
    # parameters that leave less than what was taken for noise
    assert told(finder("unknown", parameters), None).startswith("Give the noise of the channels")


def test_ports_of_a_grid_are_those_of_the_unit_and_own_equations_have_none_described():
    place = replace(PLACE, device="pv_plant", place="Ip_cmd")
    unit = SimpleNamespace(model=DEVICES["pv_plant"])
    grid = finder("unknown", UNKNOWN, places=[place])
    grid.simulator = SimpleNamespace(units_under_test=[unit], loads_under_test=[], effects_named=library)
    what = DEVICES["pv_plant"].ports["Ip_cmd"].removesuffix(" in pu")
    assert f"enters at Ip_cmd of the pv_plant: record the {what}, and" in told(grid, None)
    own = finder("unknown", UNKNOWN, places=[replace(PLACE, device="model", place="the equation of level")])
    own.simulator = SimpleNamespace(effects_named=library)
    assert "at the equation of level of the model: record whatever acts on it." in told(own, None)


def test_what_was_named_is_confirmed_by_another_event_unless_it_is_about_one():
    assert "Record another event" in told(finder("effect", EXCITER, UNKNOWN), None)
    assert told(finder("effect", EXCITER, UNKNOWN), GAIN) == ""
    late = replace(EXCITER, title="Fault of another duration", event=True)
    text = told(finder("effect", late, UNKNOWN), None)
    assert "Fault of another duration: this is about one recording alone" in text
    assert "Record another event" not in text


def test_what_cannot_be_told_apart_says_which_key_of_the_case_file_would():
    apart = Group(("exciter", "lag_P"), (("far fault", "Q", 40.0),))
    text = told(finder("effect", EXCITER, UNKNOWN, groups=[apart]), GAIN)
    assert "differ most in Q of an event like 'far fault', by 40 standard deviations" in text
    assert "fit that recording together with this one (list it under [[together]] in the case file)" in text
    assert "[[together]]" in told(
        finder("effect", EXCITER, UNKNOWN, groups=[replace(apart, separating=())]), None
    )
    assert "Inside" not in text


def test_what_cannot_be_told_apart_says_what_else_to_record():
    places = ("Efd of the synchronous_machine", "Pm of the synchronous_machine")
    apart = Group(places, (), (("synchronous_machine", "Eq1", 0.4), ("", "w", 0.06)))
    text = told(finder("unknown", UNKNOWN, places=[PLACE], groups=[apart]), None)
    assert "Efd of the synchronous_machine and Pm of the synchronous_machine cannot be told apart" in text
    assert "Eq1 of the synchronous_machine (by 40% of its range), w of the model (by 6% of its range)" in text


@pytest.mark.filterwarnings("ignore:.*before the event is")
@pytest.mark.parametrize(
    ("factors", "found"),
    [
        ({}, []),
        ({"P": 100.0}, ["P before the event is 72"]),
        ({"P": 0.01}, ["P before the event is only 0.0072"]),
        ({"P": -1.0}, ["but generation is positive: check its sign"]),
        ({"Q": 10.0}, ["check that they are not interchanged"]),
        ({"V": 0.1}, ["V before the event is 0.1"]),
    ],
)
def test_wrong_units_bases_and_signs_are_doubted(factors, found):
    """In the words of those who warn of them, which this depends on."""
    recording = demo_recordings(0)[0]
    machine = PlantSimulator("synchronous_machine", recording)
    values = {name: recording.channels[name].values * factors.get(name, 1.0) for name in recording.names}
    changed = Recording.from_arrays(
        recording.time, values, base_mva=100.0, f_nominal=60.0, name="trip", event_time=recording.event_time
    )
    hints = doubts([machine.observe(changed)])
    assert len(hints) >= len(found)
    assert all(hint.startswith("trip: ") for hint in hints)
    assert all(any(words in hint for hint in hints) for words in found)
    assert bool(hints) == bool(found)
