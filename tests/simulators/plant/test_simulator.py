import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from errorscreen.data.observations import Observation
from errorscreen.events import Event, Playback
from errorscreen.exceptions import InputError
from errorscreen.models import DEVICES
from errorscreen.models.machines.round_rotor import GENROU
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.plant import injection_noise
from tests.plants import DEVICE_NAMES, OPERATING_POINT, dip, flat, plant, random_rows


def test_unknown_names_are_answered_with_the_nearest():
    with pytest.raises(InputError, match=r"unknown device 'pv_plnt' \(did you mean 'pv_plant'"):
        plant("pv_plnt")
    with pytest.raises(InputError, match="unknown constant 'V_LVV'"):
        plant("pv_plant", constants={"V_LVV": 0.8})
    with pytest.raises(InputError, match="unknown engine 'gpu'"):
        plant("pv_plant", engine="gpu")
    with pytest.raises(InputError, match="unknown channel 'U'"):
        plant("pv_plant", channels=["U"])
    with pytest.raises(InputError, match="unknown parameter 'Xd'"):
        plant("pv_plant", parameters=DEVICES["synchronous_machine"].candidates)


@pytest.mark.parametrize("step", [0.0, -0.1])
def test_the_step_must_be_positive(step):
    with pytest.raises(InputError, match="allowed|Allowed: a positive"):
        plant("pv_plant", step=step)


def test_a_step_must_not_ask_for_more_memory_than_there_is():
    with pytest.raises(InputError, match=r"step: .* s in steps of 1e-09 s are .* steps. Allowed: at most"):
        plant("pv_plant", step=1e-9).baseline()


def test_the_event_must_be_a_playback_with_the_signals_it_needs():
    simulator = plant("synchronous_machine")
    with pytest.raises(InputError, match="cannot be driven by a Event"):
        simulator.simulate(simulator.parameters.nominal, Event(dip().time))
    without = Playback(dip().time, signals={"V": dip().signals["V"]}, initial=OPERATING_POINT)
    with pytest.raises(InputError, match="Allowed: V, angle for this device"):
        simulator.simulate(simulator.parameters.nominal, without)


def test_theta_is_checked():
    simulator = plant("pv_plant")
    with pytest.raises(InputError, match=r"theta has shape \(3,\)"):
        simulator.simulate([1.0, 2.0, 3.0])
    theta = simulator.parameters.nominal.copy()
    theta[0] = np.nan
    with pytest.raises(InputError, match=r"theta\[0, 0\] \(Tg\) is nan"):
        simulator.simulate(theta)


@pytest.mark.parametrize("device", DEVICE_NAMES)
def test_subset_of_parameters_is_the_full_model_with_the_rest_typical(device):
    full = plant(device)
    names = full.parameters.names[::-2]
    part = plant(device, parameters=full.parameters.subset(names))
    theta = random_rows(part, 5)
    assert np.array_equal(
        part.simulate(theta).values, full.simulate(full.parameters.embed(theta, names)).values, equal_nan=True
    )


@pytest.mark.parametrize("device", DEVICE_NAMES)
def test_copies_and_pickles_simulate_the_same(device):
    simulator = plant(device).extend("lag_P")
    theta = random_rows(simulator, 5)
    expected = simulator.simulate(theta).values
    for twin in (
        copy.deepcopy(simulator),
        pickle.loads(pickle.dumps(simulator)),
    ):  # joblib's workers get it so
        assert np.array_equal(twin.simulate(theta).values, expected, equal_nan=True)


def test_absurd_parameters_get_a_status_and_never_raise():
    simulator = plant("synchronous_machine")
    theta = np.tile(simulator.parameters.nominal, (6, 1))
    for row, (name, value) in enumerate(
        [("Tj", 1e-9), ("Xd1", 0.0), ("Td10", 0.0), ("Tj", -0.01), ("D", 1e12)], start=1
    ):
        theta[row, simulator.parameters.index(name)] = value
    responses = simulator.simulate(theta)
    assert responses.ok[0]
    assert not responses.ok[[1, 3, 4, 5]].any()
    assert np.isnan(responses.values[~responses.ok]).all()
    assert "reduce the step" in responses.failures()


def test_other_events_can_be_simulated_with_the_same_simulator():
    simulator = plant("pv_plant")
    deeper = dip(depth=0.7, duration=0.3)
    y = simulator.simulate(simulator.parameters.nominal, deeper)
    assert np.array_equal(y.values, plant("pv_plant", deeper).simulate(simulator.parameters.nominal).values)
    assert not np.array_equal(y.values, simulator.simulate(simulator.parameters.nominal).values)


def test_baseline_is_the_response_at_the_nominal_parameters():
    simulator = plant("dfig_plant")
    assert np.array_equal(simulator.baseline(), simulator.simulate(simulator.parameters.nominal).values[0])


def test_channels_can_be_chosen():
    both = plant("pv_plant")
    only = plant("pv_plant", channels=["Q"])
    theta = both.parameters.nominal
    assert np.array_equal(only.simulate(theta).values[:, 0], both.simulate(theta).values[:, 1])
    assert PlantSimulator("pv_plant", dip(), channels=("Q", "P")).channels == ("Q", "P")


def test_noise_of_injected_signals_leaves_the_device_as_predicted(monkeypatch):
    """Slow errors of the responses to many noisy injections against those that the observation predicts."""
    monkeypatch.setattr(injection_noise, "_MOST_JUMPS", 0)  # noise alone
    sigma = {"V": 1e-3, "angle": 1e-3}
    event = replace(dip(stop=4.0), noise=sigma)
    simulator = plant("synchronous_machine", event)
    nominal = simulator.parameters.nominal
    y = simulator.baseline()
    empty = Observation(event, y, np.full(2, 1e-6), simulator.channels, simulator.units)
    seen = simulator.with_uncertainty(replace(empty, noise=np.full(2, 2e-3)), nominal)
    rng = np.random.default_rng(0)
    draws = []
    for _ in range(300):
        noisy = {k: v + sigma[k] * rng.standard_normal(len(v)) for k, v in event.signals.items()}
        draws.append(simulator.simulate(nominal, replace(event, signals=noisy)).values[0] - y)
    draws = np.array(draws)
    blocks = np.array(draws)[:, :, 60:].reshape(len(draws), 2, -1, 12).mean(axis=-1)  # of 0.2 s
    modes = seen.modes[:, :, 60:].reshape(len(seen.modes), 2, -1, 12).mean(axis=-1)
    predicted = np.sqrt((modes**2).sum(axis=0))
    found = np.sqrt(np.maximum(blocks.var(axis=0) - draws[:, :, :50].var(axis=(0, 2))[:, None] / 12, 0.0))
    late = predicted.shape[1] // 2  # slow errors need time to grow
    ratio = predicted[0, late:].mean() / found[0, late:].mean()
    assert 0.7 < ratio < 1.4
    assert found[0, late:].mean() > found[0, :2].mean()


def test_more_noise_passes_at_another_operating_point():
    """A recorded Q that is wrong by an offset hides current, and what the noise of V makes of Q grows with it."""
    sigma = 1e-3
    event = replace(dip(stop=3.0), noise={"V": sigma})
    simulator = plant("pv_plant", event).extend("offset_Q")
    nominal = simulator.parameters.nominal
    theta = nominal.copy()
    theta[simulator.parameters.index("offset_Q.b")] = -0.3  # the plant gives 0.45 pu instead of 0.15
    rng = np.random.default_rng(0)
    moved = [
        replace(event, signals={**event.signals, "V": v})
        for v in event.signals["V"] + sigma * rng.standard_normal((80, 180))
    ]
    counted, passed = (
        np.std([simulator.simulate(values, e).values[0][:, 5:55] for e in moved], axis=(0, 2))
        for values in (nominal, theta)
    )
    y = simulator.simulate(theta).values[0]
    observation = Observation(event, y, counted, simulator.channels, simulator.units)
    seen = simulator.with_uncertainty(observation, theta)
    predicted = np.sqrt(counted**2 + np.mean(seen.extra[:, 5:55] ** 2, axis=1))
    assert passed[1] > 2 * counted[1]
    np.testing.assert_allclose(predicted, passed, rtol=0.15)
    # what passes at the nominal values is in the noise already
    at_nominal = simulator.with_uncertainty(observation, nominal).extra[:, 5:55]
    assert np.all(np.sqrt(np.mean(at_nominal**2, axis=1)) < 0.1 * counted)


def test_a_refined_simulator_differs_only_by_its_step():
    base = plant("pv_plant", step=0.004)
    fine = base.refined(4)
    assert (fine.step, base.step) == (0.001, 0.004)
    assert np.array_equal(fine.baseline(), plant("pv_plant", step=0.001).baseline())
    assert fine.parameters is base.parameters
    assert base.with_step_of(fine).step == 0.001


def test_states_can_be_seen():
    """At the equilibrium before the event, and power balance of the rotor after it."""
    event = dip(stop=4.0)
    simulator = plant("synchronous_machine", event)
    theta = simulator.parameters.nominal
    states = simulator.trajectories(theta, event)
    assert set(states) == set(simulator.device.states)
    before = event.time < event.start
    assert all(np.ptp(values[before]) < 1e-9 for values in states.values())
    assert states["omega"][0] == pytest.approx(1.0)
    # Tj dω/dt = Pm − P − D (ω − 1), away from the edges of the dip, where P jumps
    P = simulator.baseline()[simulator.channels.index("P")]
    values = dict(zip(simulator.parameters.names, theta, strict=True))
    slope = np.gradient(states["omega"], event.time)
    expected = (P[0] - P - values["D"] * (states["omega"] - 1.0)) / values["Tj"]
    later = (event.time > 2.0) & (event.time < 3.9)  # the last slope is one-sided
    assert np.abs(slope - expected)[later].max() < 0.005 * np.abs(expected[later]).max()


def test_a_common_skew_makes_every_channel_late():
    event = dip(depth=0.3)
    base = plant("pv_plant", event)
    theta = base.parameters.nominal
    together = base.extend("skew").simulate([*theta, 0.04]).values
    each = base.extend("skew_P").extend("skew_Q").simulate([*theta, 0.04, 0.04]).values
    assert np.array_equal(together, each)
    assert np.abs(together - base.simulate(theta).values).max() > 0.01


def test_a_machine_of_a_model_file_may_lack_three_parts():
    """Exciter, stabiliser and governor."""
    standard = plant(unit([Record(GENROU, {})]), flat(), effects=())
    assert (standard.usual_effects, plant("synchronous_machine", flat()).usual_effects) == (3, 2)
