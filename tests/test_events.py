import numpy as np
import pytest

from errorscreen.events import BusFault, Event, GridEvent, LoadStep, Playback

TIME = np.arange(500) / 100


@pytest.mark.parametrize(
    ("event", "text"),
    [
        (
            Event(TIME, "dip", 1.0),
            "Event(name: dip, time: 500 samples from 0 to 4.99 s, start: 1 s)",
        ),
        (
            Playback(TIME, "dip", 1.0, {"V": TIME, "angle": TIME}, {"V": 1.0}),
            "Playback(name: dip, time: 500 samples from 0 to 4.99 s, start: 1 s, signals: V, angle, initial: V)",
        ),
        (GridEvent(TIME), "GridEvent(name: event, time: 500 samples from 0 to 4.99 s, start: 0 s)"),
        (
            BusFault(TIME, "fault", 1.0, bus=3, level=0.9),
            "BusFault(name: fault, time: 500 samples from 0 to 4.99 s, start: 1 s, level: 0.9, bus: 3)",
        ),
    ],
)
def test_an_event_is_shown_in_short(event, text):
    assert repr(event) == text


def test_a_long_event_is_cut():
    step = LoadStep(TIME, "step", 1.0, factor=1.2, buses=tuple(range(100)))
    assert len(repr(step)) < 200
    assert "<th>factor</th><td>1.2</td>" in step._repr_html_()
