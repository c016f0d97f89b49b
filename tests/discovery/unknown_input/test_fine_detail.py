from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from errorscreen.bench.grid_scenarios import draw_grid_scenario
from errorscreen.bench.hidden_effects import switched
from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.fits.hypotheses import PRIOR, JointFit, parameters_only
from errorscreen.discovery.unknown_input import fine_detail
from errorscreen.discovery.unknown_input.fine_detail import Covariance, with_fine_detail
from errorscreen.discovery.unknown_input.locations import probabilities_of, rank_input_locations, waveform
from errorscreen.effects.latent_input import KNOTS, PULSE


@cache
def hidden():
    """A capacitor bank is switched in the plant: a step of the reactive current."""
    found = draw_plant_scenario(np.random.SeedSequence(509, spawn_key=(1,)).spawn(2)[0], 40.0, kind="outside")
    assert found.hidden == ("capacitor",)
    assert found.place == "Iq_cmd"
    return found


@cache
def fitted(port):
    """Unknown signal at a port, fitted from the true parameters."""
    scenario = hidden()
    simulator = scenario.simulator
    effect = next(e for e in simulator.effects if e.kind == "latent" and e.port == port)
    signals = [effect.during(o.event.name) for o in scenario.recordings]
    for signal in signals:
        simulator = simulator.extend(signal)
    knots = [n for n in simulator.parameters.names if n.rpartition(".")[2] not in ("on", *PULSE)]
    problem = FitProblem(simulator, list(scenario.recordings), knots)
    own = scenario.simulator.parameters
    start = np.zeros(len(knots))
    start[: len(own)] = (scenario.theta - own.nominal) / problem.space.scales[: len(own)]
    return JointFit(signals, problem, start).run(20).hypothesis()


def test_evidence_is_the_marginal_likelihood_of_a_gaussian_process(monkeypatch):
    hypothesis = fitted("Ip_cmd")
    pulses, _ = fine_detail._sensitivities(hypothesis)
    u, J, n = hypothesis.u, hypothesis.jacobian, len(hypothesis.residuals)
    ends = np.cumsum([len(g) for g in pulses])
    # where no bound is in the way, parameters are nothing but further noise
    monkeypatch.setattr(FitProblem, "scaled_bounds", np.full((2, len(u)), [[-1e6], [1e6]]))
    fit = fine_detail._DetailedFit(replace(hypothesis, slope=np.zeros(len(u))))
    r0 = hypothesis.residuals - J @ u
    for height in (1e-9, 1e-3, 0.1):
        covariance = np.eye(n) + PRIOR**2 * J @ J.T
        for g, end in zip(pulses, ends, strict=True):
            own = slice(end - len(g), end)
            covariance[own, own] += height**2 * g @ g.T
        expected = multivariate_normal(cov=covariance).logpdf(r0) + 0.5 * n * np.log(2 * np.pi)
        assert fit._linear(np.log(height)) == pytest.approx(expected, rel=1e-6)
        *_, v = fit._at(height)
        left = fit._solve(height, r0 + J @ v)
        assert np.allclose(left, np.linalg.solve(covariance, r0), rtol=1e-3, atol=1e-3)


def test_without_detail_evidence_is_that_of_the_fit(monkeypatch):
    hypothesis = fitted("Qref")
    monkeypatch.setattr(fine_detail._DetailedFit, "_height", lambda self: 0.0)
    found = with_fine_detail(hypothesis)
    # what a linear model promises is taken only where a simulation keeps it
    assert found.evidence >= hypothesis.evidence - 1e-6 * abs(hypothesis.evidence)
    assert found.evidence == pytest.approx(hypothesis.evidence, rel=1e-3)
    assert not found.pulses.any()


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.floats(-6.0, 3.0))
def test_a_covariance_is_that_of_white_heights(seed, exponent):
    rng = np.random.default_rng(seed)
    G, values, height = rng.standard_normal((12, 5)), rng.standard_normal((12, 3)), 10.0**exponent
    covariance = Covariance(G)
    K = np.eye(12) + height**2 * G @ G.T
    solved = np.linalg.solve(K, values)
    assert np.allclose(covariance.solve(height, values), solved, atol=1e-6)
    assert np.allclose(covariance.solve(height, values[:, 0]), solved[:, 0], atol=1e-6)
    assert np.allclose(covariance.product(height, covariance.products(values)), values.T @ solved, atol=1e-6)
    assert np.isclose(covariance.log_determinant(height), np.linalg.slogdet(K)[1])
    assert np.isclose(covariance.freedom(height), 12 - np.trace(np.linalg.inv(K)), atol=1e-6)
    heights = covariance.heights(height, solved[:, 0])
    assert np.allclose(values[:, 0] + G @ heights, solved[:, 0], atol=1e-6)


def test_the_height_is_the_best_one():
    fit = fine_detail._DetailedFit(fitted("Iq_cmd"))
    best = np.log(fit._height())
    assert fit._linear(best) > max(fit._linear(best + d) for d in (-1.0, -0.1, 0.1, 1.0))


def test_a_broad_pulse_is_the_sum_of_narrow_ones():
    hypothesis = fitted("Iq_cmd")
    simulator = hypothesis.simulator.with_nominal(hypothesis.theta)
    names = [hypothesis.effects[0].local(name) for name in PULSE]
    at = [simulator.parameters.index(name) for name in names]

    def response(height, centre, width):
        theta = simulator.parameters.nominal
        theta[at] = height, centre, width
        return simulator.simulate(theta, hypothesis.observations[0].event).values[0]

    still = response(0.0, 0.0, 1.0)
    width = 1 / 64
    parts = [
        response(h * 1e-3, c, width) - still
        for h, c in ((0.5, 0.25 - width), (1.0, 0.25), (0.5, 0.25 + width))
    ]
    whole = response(1e-3, 0.25, 2 * width) - still
    assert np.abs(whole).max() > 1e-5
    assert np.abs(whole - sum(parts)).max() < 1e-2 * np.abs(whole).max()
    event = hypothesis.observations[0].event
    begins = event.start + (0.25 - 2 * width) * (event.time[-1] - event.start)
    assert np.abs(whole[:, event.time < begins]).max() == 0.0


def test_a_recording_has_no_detail_of_another():
    hypothesis = fitted("Iq_cmd")
    simulator = hypothesis.simulator.with_nominal(hypothesis.theta)
    one = hypothesis.effects[0]
    theta = simulator.parameters.nominal
    for name, value in zip(PULSE, (0.01, 0.3, 0.01), strict=True):
        theta[simulator.parameters.index(one.local(name))] = value
    for observation in hypothesis.observations:
        change = np.abs(
            simulator.simulate(theta, observation.event).values[0] - simulator.baseline(observation.event)
        )
        assert (change.max() > 1e-6) == (observation.event.name == one.recording)
    pulses, count = fine_detail._sensitivities(hypothesis)
    assert [len(g) for g in pulses] == [int(o.mask.sum()) for o in hypothesis.observations]
    assert count == (pulses[0].shape[1] + 1) * len(pulses)


def test_recordings_of_the_same_name_have_the_same_detail():
    hypothesis = fitted("Iq_cmd")
    first = hypothesis.observations[0]
    n = int(first.mask.sum())
    twice = replace(
        hypothesis,
        observations=(first, first),
        residuals=np.tile(hypothesis.residuals[:n], 2),
        jacobian=np.tile(hypothesis.jacobian[:n], (2, 1)),
    )
    fit = fine_detail._DetailedFit(twice)
    assert [len(rows) for rows in fit._rows] == [2 * n]


def test_a_step_that_knots_do_not_follow_keeps_its_place():
    """Behind a controller or before it: signals that explain the same; at the active current none does."""
    found = {port: with_fine_detail(fitted(port)) for port in ("Iq_cmd", "Qref", "Ip_cmd")}
    right = found["Iq_cmd"]
    assert right.hypothesis.chi2_per_sample > 5.0
    assert right.height > 0.0
    assert right.chi2_per_sample == pytest.approx(1.0, abs=0.1)
    weights = dict(zip(found, probabilities_of(list(found.values())), strict=True))
    assert weights["Iq_cmd"] >= 0.2
    assert weights["Ip_cmd"] < 1e-3


def test_the_waveform_comes_nearer_to_what_is_hidden():
    scenario, found = hidden(), with_fine_detail(fitted("Iq_cmd"))
    event, effect = scenario.recordings[0].event, found.hypothesis.effects[0]
    truth, _ = switched(0.0, event.time, *scenario.values)
    parameters = found.hypothesis.simulator.parameters
    knots = found.hypothesis.theta[[parameters.index(effect.local(f"a{i}")) for i in range(KNOTS)]]

    def distance(signal):
        return np.sqrt(np.mean((signal - truth) ** 2))

    coarse = waveform(knots, event.time, event.start)
    assert distance(waveform(found.knots, event.time, event.start, found.pulses)) < 0.7 * distance(coarse)


def test_detail_of_a_signal_that_leaves_much_is_shown_as_far_as_it_is_more_than_that(monkeypatch):
    shown = {port: with_fine_detail(fitted(port)) for port in ("Iq_cmd", "Ip_cmd")}
    monkeypatch.setattr(fine_detail, "inflation_of", lambda *args: 1.0)
    ratios = {}
    for port, found in shown.items():
        bare = with_fine_detail(fitted(port))
        ratios[port] = np.linalg.norm(found.pulses) / np.linalg.norm(bare.pulses)
        assert found.evidence == bare.evidence
        assert (found.residuals == bare.residuals).all()
    assert ratios["Iq_cmd"] > 0.8  # the right place: what is left is noise
    assert ratios["Ip_cmd"] < 0.3


@cache
def gust():
    """The wind plant's power steps; a torque at the machine's shaft has an inertia to smooth its signal's edges."""
    return draw_grid_scenario(np.random.SeedSequence(408, spawn_key=(91,)).spawn(2)[0], 40.0)


def test_a_gust_in_a_wind_plant_is_not_taken_for_torque_at_a_shaft():
    scenario = gust()
    assert scenario.hidden == ("dfig_plant.gust",)
    base = parameters_only(
        FitProblem(scenario.simulator, list(scenario.recordings)), scenario.theta, "converged"
    )
    places, _ = rank_input_locations(base)
    assert (places[0].device, places[0].place) == ("dfig_plant", "Ip_cmd")
    assert places[0].probability > 0.9
    assert places[0].chi2_per_sample < 1.2
