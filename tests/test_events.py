import numpy as np
import pytest

from errorscreen.events import BusFault, Event, GridEvent, LoadStep, Playback, SetPointStep

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


@pytest.mark.parametrize(
    ("P", "steps", "kind"),
    [
        (np.where(TIME < 1.0, 0.8, 0.02), (), "load rejection"),
        (np.where(TIME < 1.0, 0.8, 0.4), (), "disturbance"),
        (0.01 * np.sin(20 * TIME), (), "open-circuit test"),
        (0.0 * TIME, (SetPointStep("Vref", 1.0, 0.02),), "open-circuit test"),
        (0.8 + 0.0 * TIME, (SetPointStep("Vref", 1.0, 0.02),), "step test"),
    ],
)
def test_imposed_power_and_steps_tell_the_kind_of_an_event(P, steps, kind):
    power = Playback(TIME, "test", 1.0, {"P": P, "Q": 0.1 * P}, {"V": 1.0, "P": P[0], "Q": 0.0}, steps=steps)
    assert power.kind == kind
    voltage = Playback(TIME, "test", 1.0, {"V": P}, {"V": 1.0, "P": P[0], "Q": 0.0}, steps=steps)
    assert voltage.kind == ("step test" if steps else "disturbance")
