"""An interrupted search goes on where it stopped, and finds the same."""

import copy
import logging
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery import CauseFinder
from errorscreen.discovery.fits.candidates import candidates
from errorscreen.discovery.fits.hypotheses import PRIOR, fit_hypothesis
from errorscreen.discovery.search.journal import Journal, packed, unpacked
from errorscreen.exceptions import InputError

#: none of them is what is hidden, so that each part of a search has its turn
EFFECTS = ["offset_position", "lag_position", "force.lag", "velocity.forcing"]


def finder(model, checkpoint=None, **options):
    return CauseFinder(model, EFFECTS, n_fits=2, random_state=0, checkpoint=checkpoint, **options)


@contextmanager
def interrupted_at(text):
    """Ctrl-C as soon as a line with this text is logged."""

    class Interrupt(logging.Handler):
        def emit(self, record):
            if text in record.getMessage():
                raise KeyboardInterrupt

    logger, handler = logging.getLogger("errorscreen"), Interrupt()
    logger.addHandler(handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            yield
    finally:
        logger.removeHandler(handler)


def interrupted(*_):
    raise KeyboardInterrupt


def test_an_interrupted_search_finds_the_same(spring, tmp_path, monkeypatch):
    model, recording = spring
    whole = finder(model).fit(recording)
    for text in ("joint fits", "other starts", "unknown input at"):
        with interrupted_at(text):
            finder(model, tmp_path).fit(recording)
    with monkeypatch.context() as patch:
        # when places have been fitted
        patch.setattr("errorscreen.discovery.unknown_input.locations.with_fine_detail", interrupted)
        with pytest.raises(KeyboardInterrupt):
            finder(model, tmp_path).fit(recording)
    simulated = []
    original = FitProblem.residuals
    monkeypatch.setattr(
        FitProblem, "residuals", lambda self, values: simulated.append(len(values)) or original(self, values)
    )
    found = finder(model, tmp_path).fit(recording)
    assert [h.name for h in found.hypotheses_] == [h.name for h in whole.hypotheses_]
    for a, b in zip(found.hypotheses_, whole.hypotheses_, strict=True):
        assert a.theta == pytest.approx(b.theta, rel=1e-6)
        assert a.chi2 == pytest.approx(b.chi2, rel=1e-9)
        assert a.state == b.state
    assert found.verdict_ == whole.verdict_
    assert [(c.name, c.probability) for c in found.causes_] == [
        (c.name, c.probability) for c in whole.causes_
    ]
    assert found.n_simulations_ == whole.n_simulations_
    assert [(p.name, p.probability) for p in found.input_locations_] == [
        (p.name, pytest.approx(p.probability, rel=1e-6)) for p in whole.input_locations_
    ]
    assert len(found.input_locations_) > 1
    # what was finished is not simulated again: the rest is the first fit, and one linearisation of each
    assert sum(simulated) < 0.1 * whole.n_simulations_


def test_a_folder_of_another_search_is_refused(spring, tmp_path):
    model, recording = spring
    with interrupted_at("joint fits"):
        finder(model, tmp_path).fit(recording)
    with pytest.raises(InputError, match=r"belongs to another run: arguments differ"):
        finder(model, tmp_path, n_draws=16).fit(recording)
    with pytest.raises(InputError, match=r"belongs to another run: .*recordings differ"):
        finder(model, tmp_path).fit([recording, recording])


def test_an_extended_model_is_searched_like_any_other(spring, tmp_path):
    """What it has is not tried again, and belongs to no hypothesis, also when the search goes on."""
    model, recording = spring
    model = model.extend("velocity.coulomb(velocity)")
    whole = finder(model, max_effects=1).fit(recording)
    with interrupted_at("other starts"):
        finder(model, tmp_path, max_effects=1).fit(recording)
    again = finder(model, tmp_path, max_effects=1).fit(recording)
    assert [h.name for h in again.hypotheses_] == [h.name for h in whole.hypotheses_]
    assert [[e.name for e in h.effects] for h in again.hypotheses_] == [
        [e.name for e in h.effects] for h in whole.hypotheses_
    ]
    assert "velocity.coulomb(velocity)" not in [e.name for e in candidates(model, [recording])]
    with pytest.raises(InputError, match=r"'velocity.coulomb\(velocity\)' has been added before"):
        CauseFinder(model, ["velocity.coulomb(velocity)"]).fit(recording)


def test_a_search_without_a_seed_cannot_go_on(spring, tmp_path):
    model, recording = spring
    with pytest.raises(InputError, match=r"without random_state.*random_state=0"):
        CauseFinder(model, EFFECTS, checkpoint=tmp_path).fit(recording)
    assert not list(tmp_path.iterdir())


def test_an_effect_of_the_same_name_with_other_bounds_is_another(spring, tmp_path):
    model, recording = spring
    with interrupted_at("joint fits"):
        finder(model, tmp_path).fit(recording)
    other = copy.copy(model)
    other.effects = tuple(
        replace(e, parameters=tuple(replace(p, upper=2 * p.upper) for p in e.parameters))
        if e.name == "offset_position"
        else e
        for e in model.effects
    )
    with pytest.raises(InputError, match=r"belongs to another run: effects differ"):
        finder(other, tmp_path).fit(recording)


def test_without_a_folder_nothing_is_kept():
    journal = Journal()
    assert [int(journal.part(lambda n=n: {"n": np.array(n)})["n"]) for n in range(3)] == [0, 1, 2]


def test_a_stored_fit_keeps_what_its_search_knew_of_noise():
    """With noise of 20 dB in what is injected a fit does not end where χ² is lowest."""
    hidden = draw_plant_scenario(0, 20.0, kind="nothing", device="synchronous_machine")
    problem = FitProblem(hidden.simulator, list(hidden.recordings))
    fitted = fit_hypothesis((), problem, np.zeros(len(problem.names)))
    again = unpacked((), problem, packed(fitted))
    assert np.abs(fitted.slope).max() > 1.0
    np.testing.assert_array_equal(again.slope, fitted.slope)
    np.testing.assert_array_equal(again.u, fitted.u)
    assert (
        again.objective
        == fitted.objective
        < again.chi2 + again.propagated.sum() + again.u @ again.u / PRIOR**2
    )
    assert again.evidence == pytest.approx(fitted.evidence, rel=1e-9)
