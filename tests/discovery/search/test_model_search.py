"""Which hypotheses are fitted again with a smaller step, and which effects go on to finer signatures."""

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.calibration import MAPCalibrator
from errorscreen.calibration.problem import FitProblem
from errorscreen.data.recordings import Recording
from errorscreen.discovery import CauseFinder
from errorscreen.discovery.fits.hypotheses import parameters_only
from errorscreen.discovery.judge.candidate_set import CandidateSet
from errorscreen.discovery.search import model_search, partwise_fits, refinement
from errorscreen.discovery.search.model_search import ModelSearch
from errorscreen.discovery.search.partwise_fits import start_partwise
from errorscreen.discovery.starts.signatures import SignatureSearch
from tests.simulators.models import oscillator, push

TIME = np.arange(0.0, 60.0, 0.3)
NAMES = "velocity.cubic(position)", "force.lag"


def new_search(simulator, observation, **options):
    fitted = MAPCalibrator(simulator, random_state=0).fit(observation)
    base = parameters_only(FitProblem(simulator, observation), fitted.theta_, "converged")
    options = {"max_effects": 1, "n_fits": 6, "n_draws": 32, "significance": 0.002, "seed": 0} | options
    return ModelSearch(base, **options)


def recorded(effects, values, noise):
    """An oscillator in small steps, seen through noise, seldom."""
    event = push(time=TIME)
    truth = oscillator(event, step=0.005)
    for effect in effects:
        truth = truth.extend(effect)
    y = truth.simulate(values, event).values[0, 0]
    y = y + noise * np.random.default_rng(4).standard_normal(len(y))
    return Recording.from_signals(event.time, {**event.signals, "position": y}, noise={"position": noise})


def pair_search():
    """A search that has not begun for two hidden effects, and the effects of the model by name."""
    simulator = oscillator(push(time=TIME), step=0.05)
    known = {effect.name: effect for effect in simulator.effects}
    observation = simulator.observe(recorded(NAMES, [0.45, 4.4, 0.6, 0.4], 2e-3))
    found = new_search(simulator, observation, max_effects=2)
    return found, known


@pytest.mark.parametrize(
    ("effects", "values", "noise", "finer"),
    [((), [0.45, 4.4], 2e-4, True), (("velocity.cubic(position)",), [0.45, 4.4, 0.6], 2e-2, False)],
    ids=["steps too long", "something missing"],
)
def test_a_smaller_step_is_taken_only_where_it_explains_what_is_left(
    effects, values, noise, finer, monkeypatch
):
    refits = []
    plain = ModelSearch._fit_effects
    monkeypatch.setattr(ModelSearch, "_fit_effects", lambda *args: refits.append(1) or plain(*args))
    simulator = oscillator(push(time=TIME), step=0.3)
    found = new_search(simulator, simulator.observe(recorded(effects, values, noise)))
    assert (found.base.simulator.step < simulator.step) == finer
    assert found.is_adequate(found.base) == finer
    assert len(refits) == finer


def test_signatures_are_refined_for_the_effects_that_are_ahead(spring, monkeypatch):
    rounds = {}
    plain = SignatureSearch.run

    def counted(search, n=4):
        rounds[search.effect.name] = n
        return plain(search, n)

    monkeypatch.setattr(SignatureSearch, "run", counted)
    simulator, observation = spring
    found = new_search(simulator, observation, n_fits=3)
    found.run(simulator.effects)
    reached = sorted(rounds.values(), reverse=True)
    assert reached == [4] * 3 + [3] * 3 + [2] * 6 + [1] * (len(simulator.effects) - 12)
    assert rounds["velocity.cubic(position)"] == 4
    assert "velocity.cubic(position)" in {h.name for h in found.adequate}


@pytest.mark.parametrize(("p_value", "goes_on"), [(0.05, True), (0.5, False)])
def test_what_hardly_passes_for_noise_does_not_end_the_search(spring, p_value, goes_on, monkeypatch, caplog):
    simulator, observation = spring
    names = ("velocity.cubic(position)", "cubic_position")
    candidates = [effect for effect in simulator.effects if effect.name in names]
    plain = ModelSearch.test

    def test(self, hypothesis):
        residual_test = plain(self, hypothesis)
        passes = residual_test.p_value > self.significance
        return replace(residual_test, p_value=p_value) if hypothesis.effects and passes else residual_test

    monkeypatch.setattr(ModelSearch, "test", test)
    monkeypatch.setattr(
        "errorscreen.discovery.search.model_search._NEARLY", 0.0
    )  # else so large an effect ends it
    found = new_search(simulator, observation)
    found.run(candidates)
    assert any("from the nominal parameters" in line for line in caplog.messages) == goes_on
    assert [h.name for h in found.adequate] == ["velocity.cubic(position)"]


def test_an_effect_that_imitates_another_one_is_exchanged(monkeypatch):
    found, effects = pair_search()

    def begin_wrongly(self, candidates):  # a lag of what is measured looks like one of what acts
        self._refit((effects["lag_position"], effects[NAMES[0]]), self.base, [self.base], everywhere=False)

    monkeypatch.setattr(ModelSearch, "_add_effects", begin_wrongly)
    found.run(found.simulator.effects)
    assert [{e.name for e in h.effects} for h in found.adequate] == [set(NAMES)]
    assert found.adequate[0].theta == pytest.approx([0.45, 4.4, 0.6, 0.4], rel=0.05)


def partwise_sets(monkeypatch, pair, candidates=None):
    """Sets of effects of the partwise fits where a pair is nearest to noise, and the fit that each begins with."""
    found, known = pair_search()
    effects = [known[name] for name in pair]
    rounds = []
    monkeypatch.setattr(
        ModelSearch,
        "_add_effects",
        lambda self, _: self._refit(effects, self.base, [self.base], everywhere=False),
    )
    monkeypatch.setattr(ModelSearch, "_fit_partwise", lambda self, sets, *starts: rounds.append(sets))
    monkeypatch.setattr(ModelSearch, "_restart_nearest", lambda self: None)
    found.run([known[name] for name in candidates or known])
    return rounds


LEAVES_LITTLE = ("lag_position", NAMES[0])
LEAVES_MOST = ("velocity.quadratic(position)", "velocity.viscous(velocity)")


def test_others_are_tried_in_place_of_each_effect_of_a_pair_that_leaves_less_than_half(monkeypatch):
    (sets,) = partwise_sets(monkeypatch, LEAVES_LITTLE)
    assert all(set(base.effects) == set(effects[:-1]) and base.effects for effects, base in sets.items())
    assert {e.name for base in sets.values() for e in base.effects} >= set(LEAVES_LITTLE)


def test_all_pairs_are_tried_where_the_nearest_leaves_more_unless_they_are_too_many(monkeypatch):
    assert partwise_sets(monkeypatch, LEAVES_MOST) == []
    candidates = (*LEAVES_MOST, *NAMES, "lag_position")
    (sets,) = partwise_sets(monkeypatch, LEAVES_MOST, candidates)
    assert [{e.name for e in effects} for effects in sets] == [set(p) for p in combinations(candidates, 2)]
    assert not any(base.effects for base in sets.values())


def test_two_effects_that_leave_much_of_a_part_of_the_recordings_are_led_no_further():
    found, known = pair_search()
    worth = []
    for names in (NAMES, LEAVES_MOST):
        effects = [known[name] for name in names]
        problem = FitProblem(found.simulator.extend(effects[0]).extend(effects[1]), found.measured)
        fit = start_partwise(found.base, effects, problem, 6, 0).run(3)
        worth.append(found._may_leave_noise(fit))
        # of noise alone nothing can be told
        fit.objective = 1.5 * fit.part.n_values
        assert found._may_leave_noise(fit)
    assert worth == [True, False]


@pytest.mark.parametrize(
    ("alone", "joined"),
    [
        (("skew_position", "lag_position", NAMES[1]), {NAMES[1], "lag_position"}),
        (("scale_position", NAMES[1]), {NAMES[1]}),
    ],
    ids=["the best two", "not what leaves most"],
)
def test_an_exchange_also_begins_at_the_best_single_effects(alone, joined, monkeypatch):
    """The pair that comes nearest holds none of the effects that are best alone: both of it imitate something."""
    found, known = pair_search()
    pair = ("force.delay", "velocity.cubic(velocity)")
    for names in [(name,) for name in alone] + [pair]:
        found._refit([known[name] for name in names], found.base, [found.base], everywhere=False)
    rounds = []
    monkeypatch.setattr(ModelSearch, "_fit_partwise", lambda self, sets, *starts: rounds.append(sets))
    found._exchange_effects(found.simulator.effects)
    assert {base.name for base in rounds[0].values()} == {*pair, *joined}


def test_a_pair_of_which_neither_explains_anything_alone_is_found():
    """Alone each leaves nearly all of what parameters leave, and a trip, which is not there, less."""
    streams = np.random.SeedSequence(874, spawn_key=(100,)).spawn(2)
    hidden = draw_plant_scenario(streams[0], 40.0)
    assert hidden.hidden == ("lag_active", "ramp")
    finder = CauseFinder(hidden.simulator, effects=["lag_active", "ramp", "trip"], random_state=0)
    finder.fit(list(hidden.recordings))
    assert finder.verdict_.kind == "effect"
    assert finder.causes_[0].name == "lag_active + ramp"
    assert finder.causes_[0].exact
    whole = finder.residual_tests_["parameters"].excess
    alone = [finder.residual_tests_[h.name].excess for h in finder.hypotheses_ if len(h.effects) == 1]
    assert min(alone) > 0.5 * whole


def test_a_second_effect_that_no_signature_promises_is_found_by_growing_fits(monkeypatch, caplog):
    """Beside the first effect, joint fits from signatures are all of others than the right one."""
    plain = model_search.fits_from_signatures

    def others(base, searches, *args):
        hidden = [s for s in searches if not base.effects or s.effect.name not in NAMES]
        return plain(base, hidden, *args)

    monkeypatch.setattr(model_search, "fits_from_signatures", others)
    found, _ = pair_search()
    found.run(found.simulator.effects)
    assert any("growing parts" in line for line in caplog.messages)
    assert {e.name for e in found.adequate[0].effects} == set(NAMES)
    assert found.adequate[0].theta[:2] == pytest.approx([0.45, 4.4], rel=0.05)


def test_other_starts_are_tried_so_many_times_in_all_and_no_more(spring, caplog):
    simulator, observation = spring
    found = new_search(simulator, observation)
    for times in (1, 1, 3, 3, 1):
        found._restart_everywhere(found.base, times)
    assert caplog.messages.count("other starts of parameters") == 3


@pytest.mark.parametrize(
    ("names", "hopes"), [(LEAVES_LITTLE, 0), (LEAVES_LITTLE, 2), (LEAVES_LITTLE, 5), (LEAVES_LITTLE[:1], 0)]
)
def test_other_starts_of_a_pair_end_as_soon_as_it_is_hopeless(names, hopes, monkeypatch):
    found, known = pair_search()
    fitted = found._refit([known[name] for name in names], found.base, [found.base], everywhere=False)
    asked, followed = [], []

    def hopeful(self, fit):
        asked.append(fit.part.n_values)
        return len(asked) <= hopes

    monkeypatch.setattr(ModelSearch, "_may_leave_noise", hopeful)
    monkeypatch.setattr(ModelSearch, "_leave_local_minima", lambda self, hypotheses: list(hypotheses))
    monkeypatch.setattr(refinement, "fit_from_starts", lambda *args: followed.append(args))
    found._restart_everywhere(fitted)
    single, parts = len(names) == 1, len(partwise_fits.CHECKED)
    assert len(asked) == (0 if single else min(hopes + 1, parts))
    assert asked == sorted(set(asked))  # of an ever longer part
    assert bool(followed) == (single or hopes >= parts)


@pytest.mark.parametrize(("minima", "adds", "times"), [(1, True, 0), (8, True, 2), (8, False, 0)])
def test_only_what_has_several_minima_is_fitted_from_everywhere_again(
    minima, adds, times, monkeypatch, caplog
):
    found, known = pair_search()
    pair = [replace(known[name], minima=minima) for name in LEAVES_LITTLE]
    found._restart_everywhere(found._refit(pair, found.base, [found.base], everywhere=False))
    monkeypatch.setattr(ModelSearch, "explained", lambda self, size, share: True)
    monkeypatch.setattr(ModelSearch, "adds", lambda self, fitted: adds)
    caplog.clear()
    found._restart_again()
    assert sum("other starts" in line for line in caplog.messages) == times


@pytest.mark.parametrize("little", [True, False])
def test_pairs_that_leave_as_little_as_may_be_named_are_fitted_from_everywhere_too(little, monkeypatch):
    """The nearest may be a wrong one, beside which the right one is stuck."""
    found, known = pair_search()
    pairs = ("force.lag", "lag_position"), LEAVES_LITTLE
    for pair in pairs:
        found._refit([known[name] for name in pair], found.base, [found.base], everywhere=False)
    spread = []
    monkeypatch.setattr(
        ModelSearch, "_restart_everywhere", lambda self, fitted, times=1: spread.append(fitted.name) or fitted
    )
    monkeypatch.setattr("errorscreen.discovery.search.refinement.PART", np.inf)
    monkeypatch.setattr(ModelSearch, "adequate", property(lambda self: []))
    monkeypatch.setattr(ModelSearch, "is_adequate", lambda self, fitted: False)
    monkeypatch.setattr(ModelSearch, "leaves_less", lambda self, fitted, share: little)
    monkeypatch.setattr(ModelSearch, "adds", lambda self, fitted: True)
    found._restart_nearest()
    nearest = found.nearest(2).name
    assert nearest in spread
    both = {" + ".join(pair) for pair in pairs}
    assert both & set(spread) == (both if little else {nearest})


@pytest.mark.parametrize(("pair", "adds"), [(79.0, True), (95.0, False)])
def test_of_two_effects_each_must_add_something(pair, adds):
    """Counted beyond what noise leaves, here χ² of 5000."""
    found = CandidateSet(0.01, 0)
    sets = {
        "parameters": ((), 1000.0),
        "a": (("a",), 100.0),
        "b": (("b",), 990.0),
        "a + b": (("a", "b"), pair),
    }
    found.hypotheses = [
        SimpleNamespace(name=name, effects=effects, chi2=5000 + more, residuals=np.zeros(5000))
        for name, (effects, more) in sets.items()
    ]
    assert found.adds(found.hypotheses[-1]) is adds
    assert all(found.adds(h) for h in found.hypotheses[:-1])  # of one nothing is asked


@pytest.mark.parametrize("adds", [True, False])
def test_two_of_which_one_is_idle_are_not_fitted_from_everywhere(adds, spring, monkeypatch, caplog):
    simulator, observation = spring
    found = new_search(simulator, observation, max_effects=2)
    known = {effect.name: effect for effect in simulator.effects}
    monkeypatch.setattr(ModelSearch, "adds", lambda self, fitted: adds)
    monkeypatch.setattr(ModelSearch, "is_adequate", lambda self, fitted: False)
    monkeypatch.setattr("errorscreen.discovery.search.refinement.PART", np.inf)
    found._refit([known[name] for name in LEAVES_LITTLE], found.base, [found.base], everywhere=True)
    assert sum("other starts" in line for line in caplog.messages) == adds
