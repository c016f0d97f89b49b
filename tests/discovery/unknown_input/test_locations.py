from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.discovery import CauseFinder
from errorscreen.discovery.fits.hypotheses import Hypothesis, JointFit, parameters_only
from errorscreen.discovery.unknown_input.locations import probabilities_of, rank_input_locations, waveform
from errorscreen.effects.latent_input import KNOTS, latent
from tests.plants import dip, plant


def test_the_waveform_is_what_the_effect_injects():
    event = dip(stop=5.0)
    knots = np.random.default_rng(0).uniform(-0.4, 0.4, KNOTS)
    rate = KNOTS**2 / (event.time[-1] - event.start)
    still = (0.0, 0.0, 1.0)  # no pulse
    added, _ = latent(0.0, event.time, event.start, rate, 1.0, *still, *knots)
    assert np.abs(added - waveform(knots, event.time, event.start)).max() < 1e-12
    base = plant("pv_plant", event)
    found = base.extend("latent_Ip_cmd").simulate([*base.parameters.nominal, 1.0, *still, *knots]).values[0]
    change = found - base.baseline()
    assert np.array_equal(change[:, event.time <= 1.0], np.zeros((2, int(np.sum(event.time <= 1.0)))))
    assert np.abs(change).max() > 0.02


def test_knots_lie_closer_together_after_the_event():
    time = np.linspace(0.0, 5.0, 5001)
    at = [time[np.argmax(waveform(np.eye(KNOTS)[i], time, 1.0))] for i in range(KNOTS)]
    assert np.all(np.diff(np.diff(at)) > 0)
    assert at[0] > 1.0
    assert np.isclose(at[-1], 5.0)


def test_each_recording_has_a_signal_of_its_own():
    """What reacts to the voltage enters with another waveform in each event; one for all misleads."""
    hidden = draw_plant_scenario(np.random.SeedSequence(83, spawn_key=(12,)).spawn(2)[0], 40.0)
    assert hidden.hidden == ("square_voltage",)
    finder = CauseFinder(hidden.simulator, max_effects=0, random_state=0).fit(list(hidden.recordings))
    first, second = finder.input_locations_[:2]
    assert first.place == hidden.place
    assert first.probability > 0.9
    assert first.explained > 0.9
    assert first.chi2_per_sample < second.chi2_per_sample
    name, correlation = first.follows[0]
    assert name in ("V", "Vf", "Q")  # as recorded, or as the controller filters it
    assert abs(correlation) > 0.5
    assert f"it moves against {name}, correlation -0." in first.text
    assert f"it moves with {name}" in replace(first, follows=((name, 0.9),)).text
    assert "moves" not in replace(first, follows=((name, 0.2),)).text
    opposed = replace(first, place=f"equation of {name}", follows=((name, -0.95),))
    assert opposed.text.endswith("correlation -0.95, as friction or damping does")


def test_what_no_signal_explains_has_no_place():
    hidden = draw_plant_scenario(1, 40.0, kind="nothing", device="pv_plant")
    tone = np.sin(2 * np.pi * 25.0 * hidden.recordings[0].time)
    recordings = [replace(o, values=o.values + 20 * np.outer(o.noise, tone)) for o in hidden.recordings]
    base = parameters_only(FitProblem(hidden.simulator, recordings), hidden.theta, "converged")
    assert base.chi2_per_sample > 50
    places, count = rank_input_locations(base)
    assert places == []
    assert count > 0


def test_what_the_best_signal_leaves_makes_evidence_say_less():
    event = dip(stop=5.0)
    values = np.zeros((2, len(event.time)))
    observation = Observation(event, values, np.ones(2), ("P", "Q"), ("pu", "pu"))
    white = np.random.default_rng(0).standard_normal(int(observation.mask.sum()))
    smooth = 5.0 * np.sin(np.linspace(0.0, 20.0, len(white)))

    def first(residuals, evidence, more):
        """Probability of the first of two places, beside one of lower evidence that leaves more."""
        chi2, n = residuals @ residuals, len(residuals)
        places = [
            SimpleNamespace(evidence=0.0, excess=chi2 - n, observations=[observation], residuals=residuals),
            SimpleNamespace(evidence=-evidence, excess=chi2 - n + more, inflation=1.0, residuals=residuals),
        ]
        places[0].inflation = Hypothesis.inflation.fget(places[0])
        return probabilities_of(places)[0]

    n = len(white)
    assert first(white, 30.0, 100.0 * n) > 0.9999
    assert first(np.zeros(n), 30.0, 100.0 * n) > 0.9999
    left = smooth @ smooth - n  # ten per cent more of it is no evidence, however many samples there are
    assert first(smooth, 1e6, 0.1 * left) == pytest.approx(3.63 / 4.63)
    assert first(smooth, 0.0, 0.1 * left) == pytest.approx(1.21 / 2.21)
    # where both leave only noise, the simpler signal says little, and no more where it leaves much
    assert first(np.zeros(n), 30.0, 0.0) == pytest.approx(0.75)
    assert first(np.zeros(n), -30.0, 0.0) == pytest.approx(0.25)
    assert first(np.zeros(n), 0.5, 0.0) == pytest.approx(1.0 / (1.0 + np.exp(-0.5)))
    assert first(white, -1e6, 100.0 * n) > 0.999


def test_a_signal_is_also_sought_from_the_nominal_parameters(monkeypatch):
    hidden = draw_plant_scenario(1, 40.0, kind="outside", device="synchronous_machine")
    begun = []

    class Seen(JointFit):
        def __init__(self, effects, problem, starts):
            begun.append(np.array(starts))
            super().__init__(effects, problem, starts)

    monkeypatch.setattr("errorscreen.discovery.unknown_input.locations.JointFit", Seen)
    problem = FitProblem(hidden.simulator, list(hidden.recordings))
    rank_input_locations(parameters_only(problem, hidden.theta, "converged"))
    assert len(begun) == 2  # ports
    for fitted, nominal in begun:
        assert fitted[: len(problem.names)].any()
        assert not nominal.any()
