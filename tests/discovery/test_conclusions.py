"""What follows from fitted hypotheses: groups, placebo, sentences."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.discovery import CauseFinder, EventGain, Gain, InputLocation, conclusions
from errorscreen.discovery.judge.separation import group_of
from errorscreen.effects import GOVERNOR, STABILISER, measurement_effects
from errorscreen.simulators import PlantSimulator


@pytest.fixture(scope="module")
def twins():
    """A governor hidden in a machine, and two effects in the library that are the same."""
    hidden = draw_plant_scenario(12, 40.0, kind="effect", device="synchronous_machine")
    old = hidden.simulator
    twin = replace(STABILISER, name="twin", title="Twin of the stabiliser")
    model = PlantSimulator(
        "synchronous_machine",
        hidden.recordings[0],
        effects=(GOVERNOR, STABILISER, twin, *measurement_effects(("P", "Q"))),
        n_threads=1,
    )
    truth = old.extend("stabiliser")
    values = [*hidden.theta, *(p.nominal for p in STABILISER.parameters)]
    recordings = [
        replace(
            o,
            values=truth.simulate(values, o.event).values[0]
            + o.noise[:, None] * np.random.default_rng(k).standard_normal(o.values.shape),
        )
        for k, o in enumerate(hidden.recordings)
    ]
    events = [o.event for o in hidden.held_out]
    finder = CauseFinder(
        model, ["stabiliser", "twin", "governor", "lag_P"], events=events, random_state=0
    ).fit(recordings)
    return finder, events


def test_what_cannot_be_told_apart_is_named_together(twins):
    finder, events = twins
    (group,) = finder.groups_
    assert set(group.names) == {"stabiliser", "twin"}
    assert sum(c.probability for c in finder.causes_ if c.name in group.names) > 0.9
    other = group.names[1]
    assert f"cannot tell it from: {other}" in finder.verdict_.text
    # an event and channel for each, and nothing that separates what is the same
    assert {(s.event, s.channel) for s in group.separating} == {
        (e.name, c) for e in events for c in ("P", "Q")
    }
    assert max(s.distance for s in group.separating) < 3.0


def test_the_event_in_which_explanations_differ_most_comes_first(twins):
    finder, events = twins
    by_name = {h.name: h for h in finder.hypotheses_}
    two, three = (
        group_of([by_name[name] for name in names], events)
        for names in (("stabiliser", "governor"), ("stabiliser", "governor", "twin"))
    )
    for group in (two, three):
        distances = [s.distance for s in group.separating]
        assert distances == sorted(distances, reverse=True)
        assert distances[0] > 3.0
    # of three pairs one is twins, and the others are alike
    squares = [
        np.array([s.distance for s in sorted(g.separating, key=lambda s: (s.event, s.channel))]) ** 2
        for g in (two, three)
    ]
    assert np.allclose(squares[1], 2 / 3 * squares[0], rtol=0.2)
    assert {s.device for s in two.states} == {"synchronous_machine"}


def test_a_placebo_has_as_many_parameters_where_one_was_fitted(twins):
    finder, _ = twins
    assert finder.placebo_ is not None
    used = set(finder.groups_[0].names)
    assert used.isdisjoint(e.name for e in finder.placebo_.effects)
    wrong = [h for h in finder.hypotheses_ if h.effects and used.isdisjoint(e.name for e in h.effects)]
    own = conclusions.freedom(finder.best_.effects)
    most = max(min(conclusions.freedom(h.effects), own) for h in wrong)
    assert min(conclusions.freedom(finder.placebo_.effects), own) == most


def test_sentences_say_what_was_tried(twins):
    finder, _ = twins
    base = next(h for h in finder.hypotheses_ if not h.effects)
    test = finder.residual_tests_[base.name]
    assert "no effect was tried" in conclusions.unknown_text((), True, base, test, base)
    text = conclusions.unknown_text(("governor", "lag_P"), False, base, test, finder.best_)
    assert "any of the effects that were tried (governor, lag_P)" in text
    assert finder.best_.name in text
    worst = test.significant[0]
    assert (
        f" What parameters leave is most conspicuous in {worst.channel} of {worst.recording}, {worst.stage}, "
        in text
    )
    assert f" Hz: {worst.ratio:.2g} times the energy of noise." in text
    text = conclusions.unknown_text(("governor",), True, base, test, base, finder.causes_[0])
    assert "any effect of the library" in text
    assert f"The nearest mechanism is: {finder.causes_[0].title}. It leaves " in text
    assert "no ports" in conclusions.location_text([], finder.simulator)


def test_a_place_says_how_much_it_explains():
    place = InputLocation(
        "synchronous_machine", "Efd", 0.9, 1.1, np.zeros(2), np.zeros(2), (), explained=0.9996
    )
    text = conclusions.location_text([place], None)
    assert "99.9 % of the error that parameters leave" in text
    assert "little" not in text
    assert "That is little: time stamps" in conclusions.location_text([replace(place, explained=0.2)], None)
    assert "cannot tell" not in text
    others = [replace(place, place="Pm", probability=0.09), replace(place, device="wind", probability=0.01)]
    text = conclusions.location_text([place, *others], None)
    assert "These recordings cannot tell it from an input at Pm of the synchronous_machine." in text


def test_a_withdrawn_cause_says_why(twins):
    finder, _ = twins
    event = EventGain("other", 5.0, 3.0, 2.9)
    gain = Gain(5.0, 3.0, 2.9, 0.07, (-0.1, 0.2), 0.9, 0.01, (event,))
    text = conclusions.withdrawn_text(finder.causes_[0], gain)
    assert "gains nothing on held-out ones: 0.07 [-0.10, 0.20] of the squared error, a placebo 0.01" in text
    failed = replace(gain, gain=-np.inf, events=(replace(event, extended=np.inf),))
    text = conclusions.withdrawn_text(finder.causes_[0], failed)
    assert "the model with it cannot be simulated on held-out ones: other." in text
    assert "inf" not in text


def test_nothing_is_said_to_be_missing_before_parameters_have_come_to_rest(twins):
    finder, _ = twins
    base = next(h for h in finder.hypotheses_ if not h.effects)
    text = conclusions.unknown_text(
        ("governor",), True, replace(base, state="stalled"), finder.residual_tests_[base.name], finder.best_
    )
    assert "did not end at a minimum" in text
    assert "any effect" not in text
    cornered = conclusions.unknown_text(
        ("governor",), True, replace(base, state="corner"), finder.residual_tests_[base.name], finder.best_
    )
    assert "No start around it lowered the rest by enough to matter" in cornered
