"""What was computed for the last events is kept, and nothing else."""

import copy
import pickle

from errorscreen.events import InputSignal
from errorscreen.simulators import recent as recent_module
from errorscreen.simulators.recent import Recent


def event(name="step"):
    return InputSignal([0.0, 1.0, 2.0], name, 0.0)


def test_the_same_event_and_settings_are_computed_once():
    recent, one, other = Recent(), event(), event()
    assert recent.get((one, 2), lambda: "first") == "first"
    assert recent.get((one, 2), lambda: "again") == "first"
    assert recent.get((one, 3), lambda: "finer") == "finer"
    assert recent.get((other, 2), lambda: "another object") == "another object"


def test_several_recordings_are_kept_and_not_more():
    recent, events = Recent(), [event() for _ in range(recent_module._KEPT + 1)]
    for number, one in enumerate(events):
        recent.get((one,), lambda number=number: number)
    assert [recent.get((one,), lambda: "new") for one in events[1:]] == list(
        range(1, recent_module._KEPT + 1)
    )
    assert recent.get((events[0],), lambda: "new") == "new"


def test_copies_begin_empty():
    recent, one = Recent(), event()
    recent.get((one,), lambda: "kept")
    for twin in (pickle.loads(pickle.dumps(recent)), copy.copy(recent), copy.deepcopy(recent)):
        assert twin.get((one,), lambda: "new") == "new"
    assert recent.get((one,), lambda: "new") == "kept"
