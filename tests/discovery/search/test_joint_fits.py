"""Joint fits of all effects from the nominal parameters, where no signature has led to what is missing."""

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery import CauseFinder
from errorscreen.discovery.fits.candidates import candidates
from errorscreen.discovery.fits.hypotheses import fit_hypothesis
from errorscreen.discovery.search import model_search
from errorscreen.discovery.search.joint_fits import fits_from_nominal
from errorscreen.discovery.starts.signatures import SignatureSearch
from tests.discovery.search.test_event_specific import named, observed
from tests.plants import dip, plant

HIDDEN = "velocity.cubic(position)"


def searches_of(model, observations, effects, base):
    points = [(base.u, base.jacobian)]
    return [
        SignatureSearch(model, observations, e, points, 8, np.random.SeedSequence(i)).run(1)
        for i, e in enumerate(effects)
    ]


def seeds(searches):
    return [np.random.SeedSequence([1, i]) for i in range(len(searches))]


def test_what_no_signature_promises_is_found(spring, monkeypatch, caplog):
    """The right effect is not among those whose joint fits are begun first."""
    first = []
    plain = model_search.fits_from_signatures

    def others(base, searches, *args):
        first.extend(s.effect.name for s in searches if s.effect.name != HIDDEN)
        return plain(base, [s for s in searches if s.effect.name != HIDDEN], *args)

    monkeypatch.setattr(model_search, "fits_from_signatures", others)
    model, recording = spring
    effects = ["offset_position", "lag_position", "force.lag", HIDDEN]
    found = CauseFinder(model, effects, n_fits=1, random_state=0).fit(recording)
    assert first
    assert any("from the nominal parameters" in line for line in caplog.messages)
    assert found.verdict_.kind == "effect"
    assert found.causes_[0].name == HIDDEN


def test_fits_begin_at_nominal_parameters_and_all_over_the_effects_own(spring):
    model, observation = spring
    effect = next(e for e in model.effects if e.name == HIDDEN)
    base = fit_hypothesis((), FitProblem(model, observation), np.zeros(2))
    (search,) = searches_of(model, [observation], [effect], base)
    begun = search.nominal_starts(5, 0)
    assert begun.shape == (5, 3)
    assert np.array_equal(begun[:, :2], np.zeros((5, 2)))
    best = search.starts()[0, 2]
    assert begun[0, 2] == best  # what promises most is one of them
    lower, upper = search.problem.scaled_bounds
    assert np.all((begun[:, 2] >= lower[2]) & (begun[:, 2] <= upper[2]))
    assert min(begun[1:, 2]) < 0 < max(begun[1:, 2])
    assert np.array_equal(begun, search.nominal_starts(5, 0))


def test_the_right_effect_gets_furthest(spring):
    model, observation = spring
    base = fit_hypothesis((), FitProblem(model, observation), np.zeros(2))
    effects = [e for e in candidates(model, [observation]) if e.minima == 1]
    searches = searches_of(model, [observation], effects, base)
    fits = fits_from_nominal(searches, 3, seeds(searches))
    assert len(fits) == 3
    assert [e.name for e in min(fits, key=lambda fit: fit.objective).effects] == [HIDDEN]


@pytest.mark.parametrize("where", ["here", "there"])
def test_only_the_best_recording_of_an_effect_goes_on(where):
    events = [named(dip(stop=6.0), "here"), named(dip(depth=0.2, stop=6.0), "there")]
    machine = plant("synchronous_machine", events[0])
    truth = machine.extend(f"oscillation@{where}")
    theta = [*machine.parameters.nominal, 0.06, 1.3, 0.4]
    observations = [observed(truth, theta, e, i) for i, e in enumerate(events)]
    problem = FitProblem(machine, observations)
    base = fit_hypothesis((), problem, np.zeros(len(problem.names)))
    effects = [e for e in candidates(machine, observations) if e.original == "oscillation"]
    assert len(effects) == 2
    searches = searches_of(machine, observations, effects, base)
    (fit,) = fits_from_nominal(searches, 3, seeds(searches))
    assert [e.recording for e in fit.effects] == [where]
