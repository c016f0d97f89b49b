"""Mechanisms whose form is not in the library: told as the nearest where recordings that were not fitted agree."""

from dataclasses import replace

import pytest

from errorscreen.bench.trap_scenarios import draw_trap_scenario
from errorscreen.discovery import CauseFinder
from errorscreen.discovery.conclusions import nearest


def searched(device, seed, effects):
    """A search for the hidden mechanism of a trap among others, and its recordings that were not fitted."""
    hidden = draw_trap_scenario(seed, 40.0, kind="effect", device=device)
    assert not set(hidden.effects) & set(effects)
    finder = CauseFinder(hidden.simulator, effects=effects, max_effects=1, random_state=0)
    return finder.fit(list(hidden.recordings)), list(hidden.held_out)


@pytest.fixture(scope="module")
def friction():
    """Stribeck friction where Coulomb friction is offered."""
    return searched("friction", 1, ["velocity.coulomb(velocity)", "velocity.hysteresis(velocity)"])


def test_without_held_out_recordings_the_verdict_is_unknown_and_tells_the_nearest(friction):
    finder, _ = friction
    found = finder.diagnosis_
    assert found.final.kind == "unknown"
    assert found.causes[0].kind == "unknown"
    assert found.causes[0].probability > 0.5
    assert found.extension == ()
    # what is known comes first
    assert found.final.text.startswith(f"Something unknown enters at {found.input_locations[0].name}: up to ")
    assert "The nearest mechanism is: Coulomb friction on velocity" in found.final.text
    cause = nearest(found.causes)
    assert cause.name == "velocity.coulomb(velocity)"
    assert f"It leaves {100 * (1 - cause.explained):.2g} % of the error" in found.final.text


def test_held_out_recordings_bear_out_the_nearest_mechanism(friction):
    finder, held_out = friction
    found = finder.confirm(held_out)
    assert (found.verdict.kind, found.final.kind, found.refuted) == ("unknown", "nearest", False)
    assert found.gain.interval[0] >= 0.5
    assert [effect.name for effect in found.extension] == [found.named.name] == ["velocity.coulomb(velocity)"]
    low, high = found.gain.interval
    assert f"it removes {100 * found.gain.gain:.0f} % [{100 * low:.0f}, {100 * high:.0f}]" in found.final.text
    assert "its form differs from the library's" in found.final.text
    # the extension is written, and no copy of it stays in the finder
    names = {p.name for p in found.parameters}
    assert {p.name for p in found.named.parameters} <= names
    assert (
        found.model("extended").channels[-1].chi2_per_sample
        < found.model("parameters only").channels[-1].chi2_per_sample
    )
    assert finder.verdict_.kind == "unknown"
    responses = found.responses["extended"]
    assert len(responses) == len(found.observations) == 3
    assert found.extended.parameters.names == finder.best_.simulator.extend(found.named.name).parameters.names


def test_a_mechanism_that_does_not_hold_elsewhere_is_not_told_as_confirmed(friction):
    finder, held_out = friction
    old = finder.recalibrated_simulator_
    against = [replace(one, values=old.baseline(one.event)) for one in held_out]
    found = finder.confirm(against)
    assert found.final.kind == "unknown"
    assert found.extension == ()


def test_forms_that_correct_the_model_alike_are_a_group():
    """An overflow of one tank where that of the other is offered, which may spill into the first or not."""
    names = ["lower.overflow_into_upper", "lower.overflow(lower)"]
    finder, held_out = searched("overflow", 0, names)
    found = finder.confirm(held_out)
    assert found.final.kind == "nearest"
    (other,) = set(names) - {found.named.name}
    assert f"These recordings cannot tell it from: {other}." in found.final.text
    (group,) = found.groups
    assert group.names == (found.named.name, other)


def test_an_event_a_measurement_or_one_at_a_bound_is_no_nearest_mechanism(friction):
    causes = friction[0].causes_
    near = nearest(causes)
    assert nearest([replace(c, event=True) for c in causes]) is None
    assert nearest([replace(c, kind="measurement") for c in causes if c is near]) is None
    assert nearest([replace(near, explained=0.4)]) is None
    ended = tuple(replace(p, at_bound=True) for p in near.parameters)
    assert nearest([replace(near, parameters=ended)]) is None
