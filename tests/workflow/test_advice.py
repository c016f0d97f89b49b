from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from errorscreen.calibration.result import Calibration, Estimate
from errorscreen.cases.demo import demo_recordings
from errorscreen.data.recordings import Recording
from errorscreen.discovery import (
    Cause,
    Gain,
    Group,
    InputLocation,
    Separation,
    StateDifference,
    Verdict,
)
from errorscreen.models import DEVICES
from errorscreen.simulators import PlantSimulator
from errorscreen.workflow.advice import advice
from errorscreen.workflow.suspect_readings import doubts
from tests.report.samples import diagnosis

UNKNOWN = Cause("unknown", "Unknown", "unknown", 0.1)
EXCITER = Cause("exciter", "Excitation control", "effect", 0.9, "Efd", explained=0.99, exact=True)
PARAMETERS = Cause("parameters", "Parameters", "parameters", 0.9, exact=True)
PLACE = InputLocation("synchronous_machine", "Efd", 0.9, 1.1, np.zeros(2), np.zeros(2), ())
HINTS = ["trip: P before the event is 72 pu: check its unit and base_mva."]
GAIN = Gain(5.0, 3.0, 1.0, 0.8, (0.7, 0.9), 0.9, 0.1, (None, None, None))


def library(names):
    return ["exciter", "lag_P", "governor"] if names is None else list(names)


MACHINE = SimpleNamespace(device=SimpleNamespace(ports={"Efd": "field voltage"}), effects_named=library)


def told(
    kind,
    *causes,
    groups=(),
    places=(),
    effects=None,
    gain=None,
    confirmed=None,
    hints=(),
    simulator=MACHINE,
    typical="",
    notes=(),
):
    """Advice on a verdict, and on another one after held-out recordings if that is given."""
    found = diagnosis(
        Verdict(kind, ""), causes=causes or (UNKNOWN,), groups=groups, input_locations=places, gain=gain,
        confirmed=Verdict(confirmed, "") if confirmed else None, calibration=Calibration("map", "all", ()),
    )  # fmt: skip
    discovery = SimpleNamespace(effects=effects, enabled=True)
    study = SimpleNamespace(simulator=simulator, discovery=discovery, typical=typical, notes=notes)
    return " ".join(advice(found, study, hints))


def test_doubts_come_first_whatever_the_verdict():
    """Parameters can make up for a wrong unit too."""
    assert told("unknown", places=[PLACE], hints=HINTS).startswith(HINTS[0])
    assert told("effect", EXCITER, UNKNOWN, hints=HINTS).startswith(HINTS[0])
    assert told("parameters", PARAMETERS, UNKNOWN, hints=HINTS, confirmed="parameters") == HINTS[0]
    assert told("parameters", PARAMETERS, UNKNOWN, confirmed="parameters").startswith(
        "Take over the calibrated"
    )


@pytest.mark.parametrize(
    ("names", "beginning"),
    [
        (["D"], "D ends at a bound"),
        (["GENROU.D"], "GENROU.D ends"),
        (["Xq", "Tj"], "Xq, Tj end at"),
        (["Xq"], None),
    ],
)
def test_values_at_bounds_are_a_sign_of_a_missing_part(names, beginning):
    ends = {"Ra": 0.0} | dict.fromkeys(names, 2.0)
    fitted = [
        Estimate(n, v, np.nan, np.nan, True, nominal=1.0, lower=0.0, upper=2.0) for n, v in ends.items()
    ]
    calibration = Calibration("map", "all", tuple(fitted))
    found = diagnosis(Verdict("unknown", ""), causes=(UNKNOWN,), calibration=calibration)
    study = SimpleNamespace(
        simulator=MACHINE, discovery=SimpleNamespace(effects=None, enabled=True), typical="", notes=()
    )
    first = advice(found, study)[0]
    assert first.startswith(beginning) if beginning else "at a bound" not in first
    if beginning:
        assert "allow a wider range" in first
        assert "the model lacks a part" in first


def test_what_was_left_out_is_told_before_typical_values():
    text = told("effect", EXCITER, UNKNOWN, gain=GAIN, notes=("Without cnn.",), typical="Typical values.")
    assert text.endswith("Without cnn. Typical values.")


def test_typical_values_are_told_last():
    text = told("parameters", PARAMETERS, typical="The model begins with typical values.")
    assert text.endswith("The model begins with typical values.")
    assert text.startswith("Record another event")


def test_a_verdict_that_nothing_confirms_asks_for_another_event():
    assert "hold it out: only that shows whether these values hold" in told("parameters", PARAMETERS)
    assert "whether the model as it is holds" in told("within-noise", PARAMETERS)
    few = replace(GAIN, events=(None,))
    assert "Fewer than 3 recordings were held out" in told("effect", EXCITER, gain=few, confirmed="effect")
    alike = replace(GAIN, placebo=0.75)
    assert "a wrong effect gains as much" in told("effect", EXCITER, gain=alike, confirmed="effect")
    assert told("effect", EXCITER, gain=GAIN, confirmed="effect") == ""


def test_effects_that_were_not_tried_are_told_where_the_cause_is_unknown():
    assert "2 of 3 effects of the library were not tried" in told(
        "unknown", places=[PLACE], effects=["lag_P"]
    )
    assert "not tried" not in told("unknown", places=[PLACE])


def test_an_unknown_cause_always_has_an_advice():
    text = told("unknown", places=[PLACE])
    assert (
        "enters at Efd of the synchronous_machine: record the field voltage, and signals that act on it"
        in text
    )
    assert "No port is known" in told("unknown")
    little = told("unknown", places=[replace(PLACE, explained=0.2)])
    assert "record the field voltage" not in little
    assert "check time stamps and filters" in little
    gone = replace(EXCITER, withdrawn=True, probability=0.0)
    text = told("effect", UNKNOWN, gone, places=[PLACE], confirmed="unknown")
    assert "enters at Efd" in text
    assert "Excitation control was withdrawn" in text
    # parameters that suffice for the fitted recordings, but not for held-out ones
    refuted = told("parameters", PARAMETERS, confirmed="unknown")
    assert "does not show in the fitted recordings" in refuted
    # parameters that leave less than the noise that was taken
    assert told("unknown", PARAMETERS).startswith("Give the noise of the channels")


def test_ports_of_a_grid_are_those_of_the_unit_and_own_equations_have_none_described():
    place = replace(PLACE, device="pv_plant", place="Ip_cmd")
    unit = SimpleNamespace(model=DEVICES["pv_plant"])
    grid = SimpleNamespace(units_under_test=[unit], loads_under_test=[], effects_named=library)
    port = DEVICES["pv_plant"].ports["Ip_cmd"].removesuffix(" in pu")
    assert f"enters at Ip_cmd of the pv_plant: record the {port}, and" in told(
        "unknown", places=[place], simulator=grid
    )
    own = SimpleNamespace(effects_named=library)
    place = replace(PLACE, device="model", place="the equation of level")
    text = told("unknown", places=[place], simulator=own)
    assert "at the equation of level of the model: record signals that act on it." in text


def test_a_named_cause_is_confirmed_by_another_event_unless_it_is_about_one():
    assert "Record another event" in told("effect", EXCITER, UNKNOWN)
    late = replace(EXCITER, title="Fault of another duration", event=True)
    text = told("effect", late, UNKNOWN)
    assert "Fault of another duration: this is about one recording alone" in text
    assert "Record another event" not in text


def test_explanations_that_look_alike_say_which_key_of_the_case_file_separates_them():
    apart = Group(("exciter", "lag_P"), (Separation("far fault", "Q", 40.0),))
    text = told("effect", EXCITER, UNKNOWN, groups=[apart], gain=GAIN)
    assert "differ most in Q of an event like 'far fault', by 40 standard deviations" in text
    assert "fit that recording together with this one (list it under [[together]] in the case file)" in text
    assert "[[together]]" in told("effect", EXCITER, UNKNOWN, groups=[replace(apart, separating=())])
    assert "Inside" not in text


def test_explanations_that_look_alike_say_what_else_to_record():
    places = ("Efd of the synchronous_machine", "Pm of the synchronous_machine")
    states = (StateDifference("synchronous_machine", "Eq1", 0.4), StateDifference("", "w", 0.06))
    text = told("unknown", places=[PLACE], groups=[Group(places, (), states)])
    assert "cannot tell Efd of the synchronous_machine and Pm of the synchronous_machine apart" in text
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
