"""What is named, and how probable it is, from what hypotheses leave."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from errorscreen.discovery.judge.ranking import rank_causes, stamped
from errorscreen.effects import EXCITER, GOVERNOR, RIDE_THROUGH_TRIP, measurement_effects
from errorscreen.events import Event, Playback
from errorscreen.parameters import ParameterSpace

SCALE_P = next(e for e in measurement_effects(["P"]) if e.name == "scale_P")


SPACE = ParameterSpace(
    replace(p, name=e.local(p.name))
    for e in (EXCITER, GOVERNOR, SCALE_P, RIDE_THROUGH_TRIP)
    for p in e.parameters
)


def hypothesis(effects, excess):
    return SimpleNamespace(
        chi2=1000.0 + excess,
        name=" + ".join(e.name for e in effects) or "parameters",
        effects=effects,
        at_rest=True,
        chi2_per_sample=2.0,
        inflation=2.0,
        residuals=np.zeros(200),
        observations=(SimpleNamespace(event=Event(np.arange(4.0), start=2.0)),),
        simulator=SimpleNamespace(parameters=SPACE),
        parameters_of=lambda effect, width: {effect.strength.name: (1.0, 1.0 - width, 1.0 + width)},
    )


def competition(*entries, significance=0.002):
    """A competition of (effects, excess, p-value, score), the first without effects."""
    found = [hypothesis(effects, excess) for effects, excess, *_ in entries]
    adequate = [h for h, entry in zip(found, entries, strict=True) if entry[2] > significance]
    scores = {h.name: entry[3] for h, entry in zip(found, entries, strict=True)}
    return SimpleNamespace(
        hypotheses=found,
        base=found[0],
        with_effects=lambda size: [h for h in found if len(h.effects) == size],
        residual_tests={
            h.name: SimpleNamespace(excess=entry[1], p_value=entry[2])
            for h, entry in zip(found, entries, strict=True)
        },
        scores=scores,
        signatures=dict.fromkeys(["exciter", "governor", "scale_P"], 0.0),
        significance=significance,
        max_effects=2,
        adequate=sorted(adequate, key=lambda h: -scores[h.name]),
    )


def test_what_leaves_only_noise_is_named_and_exact():
    causes = rank_causes(
        competition(
            ((), 1000.0, 0.001, -500.0),
            ((EXCITER,), 10.0, 0.4, -20.0),
            ((GOVERNOR,), 5.0, 0.001, -400.0),  # leaves less, but not noise
        )
    )
    assert [c.name for c in causes] == ["exciter", "unknown"]
    assert causes[0].exact
    assert causes[0].explained == pytest.approx(0.99)
    assert causes[0].probability > 0.99
    assert sum(c.probability for c in causes) == pytest.approx(1)


def test_parameters_that_suffice_are_beaten_only_by_a_margin():
    small, large = (
        rank_causes(competition(((), 30.0, 0.01, -30.0 - gain), ((SCALE_P,), 10.0, 0.4, -20.0)))
        for gain in (0.0, 40.0)
    )
    assert small[0].name == "parameters"
    assert large[0].name == "scale_P"
    assert large[0].kind == "measurement"


@pytest.mark.parametrize("left", [0.001, 0.4])  # in another form, and only noise
def test_parameters_that_were_not_led_to_a_minimum_are_no_reason_to_name_an_effect(left):
    found = competition(((), 1000.0, 0.001, -500.0), ((EXCITER,), 5.0, left, -20.0))
    assert [c.name for c in rank_causes(found)] == ["exciter", "unknown"]
    found.base.at_rest = False
    assert [(c.name, c.probability) for c in rank_causes(found)] == [("unknown", 1.0)]


def test_parameters_that_leave_only_noise_need_not_be_at_a_minimum():
    found = competition(((), 10.0, 0.4, -20.0), ((SCALE_P,), 9.0, 0.4, -19.0))
    found.base.at_rest = False
    assert rank_causes(found)[0].name == "parameters"


def test_an_effect_that_beats_parameters_on_their_way_is_not_named_though_these_leave_only_noise():
    led, stalled = (competition(((), 60.0, 0.004, -60.0), ((SCALE_P,), 10.0, 0.4, -20.0)) for _ in range(2))
    stalled.base.at_rest = False
    assert rank_causes(led)[0].name == "scale_P"
    assert {c.name for c in rank_causes(stalled)} == {"parameters", "unknown"}
    assert rank_causes(stalled)[0].name == "parameters"


def test_an_effect_that_explains_little_more_than_parameters_on_their_way_is_not_named():
    led, stalled = (competition(((), 30.0, 0.001, -30.0), ((SCALE_P,), 10.0, 0.4, -20.0)) for _ in range(2))
    stalled.base.at_rest = False
    assert {c.name for c in rank_causes(led)} == {"parameters", "scale_P", "unknown"}
    assert {c.name for c in rank_causes(stalled)} == {"parameters", "unknown"}


def test_an_effect_of_another_form_is_named_by_its_kind():
    causes = rank_causes(
        competition(
            ((), 1000.0, 0.001, -500.0),
            ((EXCITER,), 5.0, 0.001, -20.0),
            ((GOVERNOR,), 15.0, 0.001, -30.0),
        )
    )
    assert causes[0].name == "exciter"
    assert not causes[0].exact
    assert 0.5 < causes[0].probability < 0.9
    assert causes[1].name in ("governor", "unknown")
    assert sum(c.probability for c in causes) == pytest.approx(1)
    # what it leaves widens its intervals
    value, low, high = causes[0].values["exciter.K"]
    assert high - value == pytest.approx(1.645 * 2.0**0.5, rel=1e-3)
    assert low == 0.0


@pytest.mark.parametrize("left", [60.0, 400.0])
def test_what_leaves_too_much_is_unknown(left):
    unknown, nearest = rank_causes(competition(((), 1000.0, 0.001, -500.0), ((EXCITER,), left, 0.001, -20.0)))
    assert (unknown.name, nearest.name, nearest.exact) == ("unknown", "exciter", False)
    assert nearest.probability == pytest.approx(1.0 / (1.0 + left / 50.0))
    assert nearest.explained == pytest.approx(1.0 - left / 1000.0)


def test_few_readings_make_nothing_certain():
    found = competition(((), 1000.0, 0.001, -500.0), ((EXCITER,), 0.0, 0.5, -20.0))
    sure = rank_causes(found)[0]
    found.base.residuals = np.zeros(30)
    first, unknown = rank_causes(found)
    assert first.probability == pytest.approx(0.75 * sure.probability)
    assert unknown.probability == pytest.approx(1.0 - first.probability)


def test_what_explains_nothing_is_no_cause():
    (only,) = rank_causes(competition(((), 1000.0, 0.001, -500.0), ((EXCITER,), 1000.0, 0.001, -600.0)))
    assert (only.name, only.probability) == ("unknown", 1.0)


def test_two_effects_that_make_up_for_a_wrong_form_are_not_named():
    first, nearest = rank_causes(
        competition(
            ((), 1000.0, 0.001, -500.0),
            ((EXCITER,), 80.0, 0.001, -60.0),
            ((EXCITER, GOVERNOR), 10.0, 0.001, -20.0),
        )
    )
    assert (first.name, nearest.name) == ("unknown", "exciter")


def test_two_effects_that_leave_hardly_anything_are_named():
    first, other = rank_causes(
        competition(
            ((), 1000.0, 0.001, -500.0),
            ((EXCITER,), 80.0, 0.001, -60.0),
            ((EXCITER, GOVERNOR), 0.5, 0.001, -20.0),
        )
    )
    assert (first.name, first.exact, other.name) == ("exciter + governor", False, "unknown")


@pytest.mark.parametrize(("other", "name"), [(10.2, "exciter"), (14.0, "unknown")])
def test_unknown_is_compared_with_all_that_predicts_the_same(other, name):
    # each of the two is less probable than "unknown", because what they leave just passes for noise
    causes = rank_causes(
        competition(
            ((), 1000.0, 0.001, -500.0),
            ((EXCITER,), 10.0, 0.0035, -20.0),
            ((GOVERNOR,), other, 0.0035, -20.1),
        )
    )
    assert causes[0].name == name
    assert max(causes, key=lambda c: c.probability).name == "unknown"


@pytest.mark.parametrize(("left", "name"), [(0.5, "exciter"), (5.0, "exciter + governor")])
def test_a_trace_of_a_second_effect_is_the_form_of_the_first(left, name):
    causes = rank_causes(
        competition(
            ((), 1000.0, 0.001, -500.0),
            ((EXCITER,), left, 0.001, -40.0),
            ((EXCITER, GOVERNOR), 0.0, 0.4, -20.0),
        )
    )
    assert causes[0].name == name
    assert causes[0].exact == (name != "exciter")
    assert sum(c.probability for c in causes) == pytest.approx(1)
    if name == "exciter":  # or a little of a second effect, which nothing there tells
        assert (causes[1].name, causes[1].exact) == ("exciter + governor", True)
        assert causes[1].probability == causes[0].probability > 0.4


def test_of_two_effects_the_one_that_leaves_a_trace_shares_its_probability():
    first, second, *others = rank_causes(
        competition(
            ((), 1000.0, 0.001, -500.0),
            ((SCALE_P,), 0.9, 0.001, -41.0),
            ((EXCITER,), 0.5, 0.001, -40.0),
            ((EXCITER, GOVERNOR), 0.0, 0.4, -20.0),
        )
    )
    assert (first.name, second.name) == ("exciter", "exciter + governor")
    assert {c.name for c in others} == {"scale_P", "unknown"}


@pytest.mark.parametrize(("pair", "name"), [(14.0, "exciter"), (4.0, "exciter + governor")])
def test_a_second_effect_that_mends_little_passes_for_noise_by_luck(pair, name):
    causes = rank_causes(
        competition(
            ((), 1000.0, 0.001, -500.0),
            ((EXCITER,), 15.0, 0.001, -40.0),
            ((EXCITER, GOVERNOR), pair, 0.005, -36.0),
        )
    )
    assert causes[0].name == name


def test_what_looks_hardly_more_like_noise_is_not_named_beside_parameters_that_suffice():
    """Evidence alone would: it also counts how far the parameters had to move."""
    first, second = (
        rank_causes(competition(((), 30.0, 0.05, -80.0), ((SCALE_P,), 10.0, p, -20.0)))[0] for p in (0.3, 0.6)
    )
    assert first.name == "parameters"
    assert second.name == "scale_P"


def test_times_are_known_no_better_than_readings_are_stamped():
    time = np.arange(0.0, 4.0, 0.1)
    held, read = (
        SimpleNamespace(
            simulator=SimpleNamespace(parameters=SPACE),
            observations=[SimpleNamespace(event=Playback(time, "held", 1.0, {"V": 1.0 + 0 * time}, age=age))],
            effects=(),
        )
        for age in (0.2, 0.0)
    )
    timer, threshold = (1.0, 0.99, 1.02), (0.9, 0.89, 0.91)
    assert stamped(read, "trip.Tth", timer) == pytest.approx(timer)
    assert stamped(held, "trip.Vth", threshold) == pytest.approx(threshold)
    value, low, high = stamped(held, "trip.Tth", timer)
    half = 1.645 * 0.2 / np.sqrt(12)
    assert (value, low, high) == pytest.approx((1.0, 1.0 - np.hypot(0.01, half), 1.0 + np.hypot(0.02, half)))
    # what starts a timer is crossed at any instant between two samples
    trip = SimpleNamespace(
        minima=8, local="trip.{}".format, parameters=[SimpleNamespace(name=name) for name in ("Vth", "Tth")]
    )
    read.effects = (trip,)
    half = 1.645 * 0.1 / np.sqrt(12)
    assert stamped(read, "trip.Tth", (1.0, 1.0, 1.0)) == pytest.approx((1.0, 1.0 - half, 1.0 + half))
    assert stamped(read, "trip.Vth", threshold) == pytest.approx(threshold)
    # it stays inside of its bounds
    assert stamped(held, "trip.Tth", (0.31, 0.305, 0.32))[1] == 0.3
