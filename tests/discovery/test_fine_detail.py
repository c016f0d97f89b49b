from functools import cache

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from errorscreen.bench.grid_scenarios import draw_grid_scenario
from errorscreen.bench.plant_scenarios import draw_plant_scenario
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery import fine_detail
from errorscreen.discovery.fine_detail import detailed
from errorscreen.discovery.hypotheses import PRIOR, JointFit, parameters_only
from errorscreen.discovery.latent import rank_places
from errorscreen.effects.latent_input import PULSE


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
    far = np.full((2, len(u)), [[-1e6], [1e6]])
    monkeypatch.setattr(FitProblem, "scaled_bounds", far)
    for height in (0.0, 1e-3, 0.1):
        monkeypatch.setattr(fine_detail, "_HEIGHTS", np.array([height]))
        covariance = np.eye(n) + PRIOR**2 * J @ J.T
        for g, end in zip(pulses, ends, strict=True):
            own = slice(end - len(g), end)
            covariance[own, own] += height**2 * g @ g.T
        r0 = hypothesis.residuals - J @ u
        expected = multivariate_normal(cov=covariance).logpdf(r0) + 0.5 * n * np.log(2 * np.pi)
        expected += (
            0.5 * hypothesis.passed.sum()
        )  # noise that passes through the model is not left by the signal
        found = detailed(hypothesis)
        assert found.evidence == pytest.approx(expected, rel=1e-6)
        assert np.allclose(found.residuals, np.linalg.solve(covariance, r0), rtol=1e-4, atol=1e-4)


def test_without_detail_evidence_is_that_of_the_fit(monkeypatch):
    hypothesis = fitted("Qref")
    monkeypatch.setattr(fine_detail, "_HEIGHTS", np.array([0.0]))
    found = detailed(hypothesis)
    # the linear model goes on from where the fit has come to
    assert found.evidence >= hypothesis.evidence - 1e-6 * abs(hypothesis.evidence)
    assert found.evidence == pytest.approx(hypothesis.evidence, rel=0.3)


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
    pulses, count = fine_detail._sensitivities(hypothesis)
    assert [len(g) for g in pulses] == [int(o.mask.sum()) for o in hypothesis.observations]
    assert count == (pulses[0].shape[1] + 1) * len(pulses)


def test_a_step_keeps_its_place():
    """Signals between knots leave more at the right place than at the reference of the reactive power before it."""
    right, wrong, power = (fitted(port) for port in ("Iq_cmd", "Qref", "Ip_cmd"))
    assert min(right.chi2_per_sample, wrong.chi2_per_sample) > 5.0
    sharp = detailed(right)
    assert sharp.height > 0.0
    assert 0.5 < sharp.chi2_per_sample < 1.2
    assert detailed(power).chi2_per_sample > 100.0


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
    places, _ = rank_places(base)
    assert (places[0].device, places[0].place) == ("dfig_plant", "Ip_cmd")
    assert places[0].probability > 0.9
    assert places[0].chi2_per_sample < 1.2
