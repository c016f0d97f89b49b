"""Uncertainty of a response from what is injected."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.discovery.judge.residual_test import residual_test
from errorscreen.events import Playback
from errorscreen.simulators.plant import injection_noise
from tests.plants import OPERATING_POINT, dip, plant


def on_the_edge():
    """A plant that stops just before a dip ends, and its uncertainty if its voltage has noise."""
    event = dip(depth=0.3, duration=0.5)
    event = replace(event, noise={"V": 2e-2})
    simulator = plant("pv_plant", event).extend("cessation")
    theta = simulator.parameters.nominal.copy()
    changes = {"s": 1.0, "Vth": 0.701, "Tth": 0.45, "Tc": 1.0, "Tramp": 0.5}
    theta[[simulator.parameters.index(f"cessation.{name}") for name in changes]] = list(changes.values())
    response = simulator.simulate(theta).values[0]
    noise = np.full(2, 1e-3)
    observation = Observation(event, response, noise, simulator.channels, simulator.units)
    return simulator, theta, simulator.with_uncertainty(observation, theta)


def test_a_response_in_which_something_else_happens_is_no_uncertainty(monkeypatch):
    _, _, observation = on_the_edge()
    response, after = observation.values, observation.time > 1.6  # a plant that stops stays away for a second
    assert response[0, after].min() < 0.01
    assert np.abs(observation.modes[..., after]).max(initial=0.0) < 0.1  # the return shifts a little
    assert observation.extra[:, after].max() < 0.1
    monkeypatch.setattr(injection_noise, "_ANOTHER", np.inf)
    _, _, explains_anything = on_the_edge()
    assert np.abs(explains_anything.modes[..., after]).max() > 0.3


def test_noise_was_estimated_without_the_effects_that_are_tried_later():
    """A lag hides the noise of the voltage; what has been counted without it is not counted again."""
    event = replace(dip(), noise={"V": 5e-3})
    old = plant("pv_plant", event)
    values = old.baseline()
    observation = Observation(event, values, np.full(2, 1e-3), old.channels, old.units)
    extended = old.extend("lag_P")
    off = extended.parameters.nominal
    off[extended.parameters.index("lag_P.T")] = 0.0
    before = observation.time < 0.9
    expected = old.with_uncertainty(observation, old.parameters.nominal).extra[0, before]
    found = extended.with_uncertainty(observation, off, off).extra[0, before]
    twice = extended.with_uncertainty(observation, off).extra[
        0, before
    ]  # as if it had been estimated behind the lag
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert twice.mean() > 1.5 * max(expected.mean(), 1e-6)


def lagged(T):
    """A PV plant whose recorded active power lags, and parameters with which that is as long as said."""
    simulator = plant("pv_plant", replace(dip(), noise={"V": 5e-3})).extend("lag_P")
    theta = simulator.parameters.nominal
    theta[simulator.parameters.index("lag_P.T")] = T
    return simulator, theta


def seen(simulator, noise):
    return Observation(
        simulator.event, simulator.baseline(), np.full(2, noise), simulator.channels, simulator.units
    )


def test_behind_a_filter_less_noise_is_expected_but_never_none():
    simulator, filtered = lagged(0.2)
    _, off = lagged(0.0)
    observation = seen(simulator, 2e-2)
    found = simulator.with_uncertainty(observation, filtered, off)
    same = simulator.with_uncertainty(observation, off, off)
    np.testing.assert_array_equal(same.noise, observation.noise)
    assert found.noise[0] < 0.99 * observation.noise[0]
    assert found.noise[1] == observation.noise[1]  # the reactive power is not filtered
    little = seen(simulator, 1e-4)  # less than passes: what was estimated cannot be right
    assert simulator.with_uncertainty(little, filtered, off).noise[0] == pytest.approx(1e-5)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5])
def test_between_two_samples_as_much_less_noise_passes_as_of_white_noise(share):
    """What follows the voltage at once, read between two samples, has 2 f (1 - f) of its variance less."""
    event = replace(dip(), noise={"V": 5e-3})

    def read(event, share=0.0, **options):
        V = event.signals["V"]
        return ((1 - share) * V + share * np.r_[V[0], V[:-1]])[None]

    def skewed(event, **options):
        return read(event, share)

    observation = Observation(event, read(event), np.array([2e-2]), ("P",), ("pu",))
    found = injection_noise.with_uncertainty(observation, skewed, event.dt, read)
    less = observation.noise[0] ** 2 - found.noise[0] ** 2
    assert less == pytest.approx(2 * share * (1 - share) * 5e-3**2, rel=1e-9, abs=1e-15)


def test_the_noise_that_a_clock_skew_leaves_of_a_plant_is_that_of_other_draws():
    simulator = plant("pv_plant", replace(dip(), noise={"V": 5e-3})).extend("skew_P")
    off = simulator.parameters.nominal
    off[simulator.parameters.index("skew_P.d")] = 0.0
    skewed = off.copy()
    skewed[simulator.parameters.index("skew_P.d")] = 1.5 * simulator.event.dt
    observation = seen(simulator, 2e-2)
    found = simulator.with_uncertainty(observation, skewed, off)
    event, before = simulator.event, observation.time < 0.9
    rng, variance = np.random.default_rng(0), []
    for theta in (off, skewed):
        drawn = []
        for _ in range(30):
            noisy = event.signals["V"] + 5e-3 * rng.standard_normal(len(event.time))
            response = simulator.simulate(theta, replace(event, signals={**event.signals, "V": noisy}))
            drawn.append(np.var(response.values[0, 0, before]))
        variance.append(np.mean(drawn))
    left = variance[0] - (observation.noise[0] ** 2 - found.noise[0] ** 2)
    assert left == pytest.approx(variance[1], rel=0.3)  # the plant's is not quite white
    assert left < 0.6 * variance[0]


def test_the_energy_of_passed_noise_is_that_of_other_draws_and_the_same_at_every_call(monkeypatch):
    monkeypatch.setattr(injection_noise, "_MOST_JUMPS", 0)  # noise alone
    simulator, off = lagged(0.0)
    observation = simulator.with_uncertainty(seen(simulator, 5e-3), off, off)
    rows = np.stack([off, lagged(0.2)[1]])
    energies = simulator.propagated_noise(observation, rows)
    np.testing.assert_array_equal(simulator.propagated_noise(observation, rows), energies)
    assert energies.shape == (injection_noise.NOISE_DRAWS, 2, 2)
    rng, event = np.random.default_rng(99), observation.event
    other = []
    for _ in range(20):
        noisy = event.signals["V"] + 5e-3 * rng.standard_normal(len(event.time))
        drawn = replace(event, signals={**event.signals, "V": noisy})
        change = simulator.simulate(off, drawn).values[0] - simulator.simulate(off, event).values[0]
        other.append(np.nansum(observation.deviations(observation.values + change) ** 2, axis=1))
    np.testing.assert_allclose(injection_noise.typical(energies)[0], np.mean(other, axis=0), rtol=0.15)
    assert energies[:, 1, 0].max() < 0.5 * energies[:, 0, 0].min()  # the filter takes most of it


def test_a_draw_with_which_something_else_happens_does_not_count():
    simulator, theta, observation = on_the_edge()
    rows = np.stack([theta, simulator.parameters.nominal])
    energies = simulator.propagated_noise(observation, rows)
    assert np.isnan(energies[:, 0]).any()  # the plant stops, or does not, as the noise will have it
    calm = replace(observation, event=replace(observation.event, noise={"V": 1e-3}))
    assert np.isfinite(simulator.propagated_noise(calm, rows)[:, 1]).all()
    assert np.isnan(injection_noise.typical(np.full((3, 1, 2), np.nan))).all()


def jumping(share, rate=60):
    """A machine whose voltage jumps at a share of the interval between two samples, sampled without noise."""
    fine = 16
    time = np.arange(0, 5.0, 1 / (rate * fine))
    first, last = 1.0 + share / rate, 1.1 + share / rate
    dipped = (time > first) & (time < last)
    V, angle = np.where(dipped, 0.7, 1.0), np.where(dipped, -0.1, 0.0) + np.where(time > last, 0.05, 0.0)
    event = Playback(time, "jumps", 1.0, {"V": V, "angle": angle}, OPERATING_POINT)
    response = plant("synchronous_machine", event, step=1 / (rate * fine)).baseline()[:, ::fine]
    sampled = {name: signal[::fine] for name, signal in event.signals.items()}
    noise = {"V": 1e-4, "angle": 1e-4}
    return Playback(time[::fine], "jumps", 1.0, sampled, OPERATING_POINT, noise), response


@pytest.mark.parametrize("share", [0.1, 0.2, 0.9])
def test_a_jump_may_have_been_at_any_instant_between_its_samples(share, monkeypatch):
    """With the true parameters, what is left is no more than what is counted as uncertain; else it is much more."""
    event, response = jumping(share)

    def chi2():
        simulator = plant("synchronous_machine", event)
        raw = Observation(event, response, np.full(2, 3e-4), simulator.channels, simulator.units)
        known = simulator.with_uncertainty(raw, simulator.parameters.nominal)
        return float(np.mean(known.deviations(simulator.baseline()) ** 2))

    with_jumps = chi2()
    monkeypatch.setattr(injection_noise, "_MOST_JUMPS", 0)
    assert with_jumps < 0.5
    assert chi2() > 10 * with_jumps


def test_jumps_are_told_from_what_changes_over_many_samples():
    event, _ = jumping(0.5)
    inputs = injection_noise.input_noise(event)
    assert sorted(injection_noise._jumps(event, inputs)) == [(60, 61), (66, 67)]
    slow = np.convolve(event.signals["V"], np.ones(6) / 6, mode="same")
    smooth = replace(event, signals={"V": slow, "angle": 0.0 * slow})
    inside = [
        jump for jump in injection_noise._jumps(smooth, inputs) if 10 < jump[0] < 280
    ]  # ends of the filter
    assert inside == []
    assert injection_noise._jumps(event, {}) == []


def test_held_readings_are_uncertain_by_what_the_channel_did_while_they_were_held():
    event, response = jumping(0.5)
    part = event.time < 0.9
    known = Observation(event, response, np.full(2, 1e-3), ("P", "Q"), ("pu", "pu"))
    assert not injection_noise._late(known, part).any()
    held = replace(known, event=replace(event, age=0.2))
    late = injection_noise._late(held, part)
    jump = int(np.argmax(np.abs(np.diff(response[0]))))
    size = np.ptp(response[0, jump - 12 : jump + 13])
    assert late[0, jump] == pytest.approx(size / np.sqrt(12), rel=0.05)
    assert not late[:, :40].any()  # more than 0.2 s before


def long_record(seed):
    """Recording of a machine for 40 s whose voltage, angle and powers all hold noise, and its true response."""
    event, rng = dip(stop=40.0, dt=1 / 30), np.random.default_rng(seed)
    P, Q = plant("synchronous_machine", event).baseline()
    channels, noise = {**event.signals, "P": P, "Q": Q}, {"V": 5e-4, "angle": 2e-3, "P": 1e-3, "Q": 1e-3}
    noisy = {name: x + noise[name] * rng.standard_normal(len(x)) for name, x in channels.items()}
    options = {"base_mva": 100.0, "f_nominal": 60.0, "event_time": event.start}
    return Recording.from_arrays(event.time, noisy, **options)


def test_noise_that_makes_a_machine_swing_is_noise_in_a_long_record():
    """Noise of the angle becomes swings of the power. The true parameters leave them, and nothing else."""
    seen_ones, left = [], []
    for seed in range(4):
        simulator = plant("synchronous_machine", long_record(seed))
        observation = simulator.observe(long_record(seed))
        z = observation.deviations(simulator.baseline(observation.event))
        seen_ones.append(observation)
        left.append(z[observation.mask])
    assert residual_test(seen_ones, np.concatenate(left)).p_value > 0.05


def test_what_noise_does_later_follows_from_what_it_did_before(monkeypatch):
    recording = long_record(0)
    simulator = plant("synchronous_machine", recording)
    sparse = simulator.observe(recording)
    monkeypatch.setattr(injection_noise, "_APART", 1)  # every block of noise is simulated
    dense = simulator.observe(recording)
    deviations = [np.sqrt(np.einsum("krl,krl->rl", o.modes, o.modes)) for o in (sparse, dense)]
    np.testing.assert_allclose(*deviations, atol=0.05 * np.min(sparse.noise))
