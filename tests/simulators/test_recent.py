"""What was computed for the last events and rows is kept, and nothing else."""

import copy
import pickle

import numpy as np

from errorscreen.events import InputSignal
from errorscreen.simulators import recent as recent_module
from errorscreen.simulators.recent import Recent


def event(name="step"):
    return InputSignal([0.0, 1.0, 2.0], name, 0.0)


def test_the_same_event_and_settings_are_computed_once():
    recent, one, other = Recent(), event(), event()
    assert recent.get((one,), (2,), lambda: "first") == "first"
    assert recent.get((one,), (2,), lambda: "again") == "first"
    assert recent.get((one,), (3,), lambda: "finer") == "finer"
    assert recent.get((other,), (2,), lambda: "another object") == "another object"


def test_several_recordings_are_kept_and_not_more():
    recent, events = Recent(), [event() for _ in range(recent_module._KEPT + 1)]
    for number, one in enumerate(events):
        recent.get((one,), (), lambda number=number: number)
    assert [recent.get((one,), (), lambda: "new") for one in events[1:]] == list(
        range(1, recent_module._KEPT + 1)
    )
    assert recent.get((events[0],), (), lambda: "new") == "new"


def test_copies_begin_empty():
    recent, one = Recent(), event()
    recent.get((one,), (), lambda: "kept")
    for twin in (pickle.loads(pickle.dumps(recent)), copy.copy(recent), copy.deepcopy(recent)):
        assert twin.get((one,), (), lambda: "new") == "new"
    assert recent.get((one,), (), lambda: "new") == "kept"


def test_the_same_rows_of_the_same_model_are_computed_once():
    recent, model, rows = Recent(), (object(),), np.arange(6.0).reshape(2, 3)
    assert recent.get(model, (1,), lambda: "first", rows) == "first"
    assert recent.get(model, (1,), lambda: "again", rows.copy()) == "first"
    assert recent.get(model, (2,), lambda: "another setting", rows) == "another setting"
    assert recent.get((object(),), (1,), lambda: "another model", rows) == "another model"
    assert recent.get(model, (1,), lambda: "fewer", rows[:1]) == "fewer"
    rows[1, 1] += 1e-12  # in place
    assert recent.get(model, (1,), lambda: "changed", rows) == "changed"


def test_a_few_sets_of_rows_are_kept_and_no_large_one():
    recent, model, sets = Recent(3), (object(),), [np.full((1, 2), float(k)) for k in range(4)]
    for k, rows in enumerate(sets):
        recent.get(model, (), lambda k=k: k, rows)
    assert [recent.get(model, (), lambda: "new", rows) for rows in sets[1:]] == [1, 2, 3]
    assert recent.get(model, (), lambda: "new", sets[0]) == "new"
    large = np.zeros((recent_module._MOST_ROWS + 1, 1))
    assert recent.get(model, (), lambda: "first", large) == "first"
    assert recent.get(model, (), lambda: "again", large) == "again"
    # and as few by a copy
    twin = copy.copy(recent)
    for rows in sets:
        twin.get(model, (), lambda: "old", rows)
    assert twin.get(model, (), lambda: "new", sets[0]) == "new"
