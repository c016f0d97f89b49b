"""What the verdict says of deviating parameters, of missing effects, of noise, and of other events."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from errorscreen.calibration import MAPCalibrator
from errorscreen.cases.demo import Dip, demo_recordings
from errorscreen.data.recordings import Recording
from errorscreen.discovery import held_out_limit, judge
from errorscreen.events import Playback
from errorscreen.exceptions import InputError
from errorscreen.parameters import Parameter
from errorscreen.simulators import PlantSimulator
from tests.simulators.models import oscillator, push


def setting(seed):
    recording, _, truth = demo_recordings(seed)
    simulator = PlantSimulator("synchronous_machine", recording)
    theta = [truth[name] for name in simulator.parameters.names]
    return simulator, simulator.observe(recording), theta


def calibrated(simulator, observation):
    return MAPCalibrator(simulator, n_starts=4, library_size=256, random_state=0).fit(observation)


@pytest.mark.parametrize("seed", range(4))
def test_deviating_parameters_are_called_parameters(seed):
    simulator, observation, _ = setting(seed)
    verdict = judge([observation], [simulator.baseline()], calibrated(simulator, observation))
    assert verdict.kind == "parameters"
    assert "nominal value for: " in verdict.text
    assert "can look the same" in verdict.text


@pytest.mark.parametrize("seed", range(4))
def test_nothing_wrong_is_within_noise(seed):
    simulator, observation, theta = setting(seed)
    right = simulator.with_nominal(theta)
    verdict = judge([observation], [right.baseline()], calibrated(right, observation))
    assert verdict.kind == "within-noise"


@pytest.mark.parametrize("seed", range(3))
def test_a_hidden_exciter_is_not_called_parameters(seed):
    """The truth has an exciter; no values of the eight parameters reproduce it."""
    recording, _, truth = demo_recordings(seed)
    base = PlantSimulator("synchronous_machine", recording)
    observation = base.observe(recording)
    theta = [truth[name] for name in base.parameters.names]
    y = (
        PlantSimulator("synchronous_machine", recording, step=2.5e-4)
        .extend("exciter")
        .simulate([*theta, 150, 0.2, 8, 0.05])
    )
    rng = np.random.default_rng(seed)
    noisy = y.values[0] + 2e-3 * rng.standard_normal(y.values[0].shape)
    values = {k: recording.channels[k].values for k in ("V", "angle")} | {"P": noisy[0], "Q": noisy[1]}
    observation = base.observe(
        Recording.from_arrays(recording.time, values, base_mva=100, f_nominal=60, event_time=1.0)
    )
    verdict = judge([observation], [base.baseline()], calibrated(base, observation))
    assert verdict.kind == "unknown"
    assert "No values of these parameters" in verdict.text


def recorded(seed, distort, frequency=60.0, parameters=None):
    """The demo's first recording with something done to it; nominal values unless told otherwise."""
    recording, _, _ = demo_recordings(seed)
    event = PlantSimulator("synchronous_machine", recording).event
    truth = PlantSimulator("synchronous_machine", event, step=2.5e-4, constants={"f0": frequency})
    theta = truth.parameters.nominal if parameters is None else parameters
    P, Q = truth.simulate(theta).values[0]
    rng = np.random.default_rng(seed + 1000)
    values = {"V": event.signals["V"], "angle": event.signals["angle"], "P": P, "Q": Q}
    noisy = {k: v + 2e-3 * (k in "PQ") * rng.standard_normal(v.shape) for k, v in values.items()}
    return Recording.from_arrays(
        recording.time,
        distort(noisy, rng),
        base_mva=100,
        f_nominal=frequency,
        event_time=1.0,
        name=f"seed {seed}",
    )


def verdict_on(recording, held_out=()):
    simulator = PlantSimulator("synchronous_machine", recording)
    observation = simulator.observe(recording)
    fitted = calibrated(simulator, observation)
    return judge([observation], [simulator.baseline()], fitted, [simulator.observe(r) for r in held_out])


def test_the_nominal_frequency_is_that_of_the_recording():
    """A 50 Hz machine with nominal parameters: f0 of 60 Hz would be made up for by Tj and D."""
    fifty = recorded(0, lambda values, rng: values, frequency=50.0)
    assert PlantSimulator("synchronous_machine", fifty).constants["f0"] == 50.0
    assert verdict_on(fifty).kind == "within-noise"
    with pytest.raises(InputError, match="f0 is 60 Hz, but the recording's nominal frequency is 50 Hz"):
        PlantSimulator("synchronous_machine", fifty, constants={"f0": 60.0})


@pytest.mark.parametrize("seed", range(3))
def test_correlated_noise_is_not_called_a_missing_effect(seed):
    def distort(values, rng):
        for name in ("P", "Q"):
            noise = lfilter([np.sqrt(1 - 0.9**2)], [1, -0.9], rng.standard_normal(len(values[name]) + 200))[
                200:
            ]
            values[name] = values[name] + 4e-3 * noise
        return values

    assert verdict_on(recorded(seed, distort)).kind in ("within-noise", "parameters")


def test_what_moves_before_the_event_is_not_taken_for_noise():
    """An oscillation that is there all along hides errors below its size: nothing can be concluded."""

    def distort(values, rng):
        time = np.arange(len(values["P"])) / 120
        values["P"] = values["P"] + 0.05 * np.sin(2 * np.pi * 6 * time) * (time < 1.0)
        values["Q"] = values["Q"] + 0.05 * np.sin(2 * np.pi * 6 * time) * (time < 1.0)
        return values

    nominal = PlantSimulator("synchronous_machine", demo_recordings(0)[0]).parameters.nominal
    verdict = verdict_on(
        recorded(0, distort, parameters=nominal * np.array([1.2, 0.8, 0.8, 1.2, 0.8, 1.2, 0.8, 1.2]))
    )
    assert verdict.kind == "unknown"
    assert "nobody can conclude anything" in verdict.text


def test_parameters_that_fail_on_another_event_are_no_explanation():
    """A hidden lag in P, fitted on an event too weak to show it, is found out by a stronger one."""
    weak, strong = (hidden_lag(depth) for depth in (0.05, 0.55))
    simulator = PlantSimulator("synchronous_machine", weak)
    observation = simulator.observe(weak)
    fitted = calibrated(simulator, observation)
    before = [simulator.baseline()]
    alone = judge([observation], before, fitted)
    both = judge([observation], before, fitted, [simulator.observe(strong)])
    assert alone.kind == "parameters"
    assert "No recording was held out" in alone.text
    assert both.kind == "unknown"
    assert "not held-out ones: dip of 0.55" in both.text


def hidden_lag(depth):
    dip = Dip(f"dip of {depth}", depth, 0.12, 0.5 * depth, 0.9)
    time = np.arange(0, 6, 1 / 120)
    event = Playback(time, dip.name, 1.0, dip.signals(time, 1.0), {"V": 1.0, "P": 0.72, "Q": 0.12})
    truth = PlantSimulator("synchronous_machine", event, step=2.5e-4).extend("lag_P")
    theta = [*truth.parameters.nominal[:8] * 1.15, 0.02]
    P, Q = truth.simulate(theta).values[0]
    rng = np.random.default_rng(3)
    values = dict(event.signals) | {
        "P": P + 2e-3 * rng.standard_normal(720),
        "Q": Q + 2e-3 * rng.standard_normal(720),
    }
    return Recording.from_arrays(time, values, base_mva=100, f_nominal=60, event_time=1.0, name=dip.name)


def test_right_parameters_hold_on_held_out_events():
    for seed in range(3):
        recording, held_out, _ = demo_recordings(seed)
        simulator = PlantSimulator("synchronous_machine", recording)
        fitted = calibrated(simulator, simulator.observe(recording))
        for other in held_out:
            value, limit = held_out_limit(fitted, simulator.observe(other))
            assert 0.7 < value < limit < 2.5
        verdict = verdict_on(recording, held_out)
        assert verdict.kind == "parameters"
        assert "They also reproduce 2 held-out recordings" in verdict.text


def started(name, seed, position, noise=0.01):
    """Record of an oscillator that starts elsewhere."""
    event = push(name, seed)
    y = oscillator(event, initial={"position": position}).baseline()[0]
    measured = y + noise * np.random.default_rng(seed).standard_normal(len(y))
    values = {"force": event.signals["force"], "position": measured}
    return Recording.from_signals(event.time, values, name=name, noise={"position": noise})


def test_a_recording_that_is_judged_has_its_own_initial_state():
    recording, other = started("fitted", 1, 0.2), started("other", 2, 0.7)
    model = oscillator(recording, initial={"position": Parameter("x0", 0.0, -2.0, 2.0, scale=1.0)})
    observation, held_out = model.observe(recording), model.observe(other)
    calibrator = calibrated(model, observation)
    value, limit = held_out_limit(calibrator, held_out)
    assert 0.8 < value < limit < 1.6
    assert calibrator.score(other) > 100 * calibrator.score(started("another", 2, 0.7, noise=1.0))
    assert np.sqrt(np.mean((calibrator.predict(other) - held_out.values) ** 2)) < 0.013  # noise is 0.01
    verdict = judge([observation], [model.baseline()], calibrator, [held_out])
    assert verdict.kind == "parameters"
    right = model.with_nominal(calibrator.theta_)
    verdict = judge([observation], [right.baseline()], calibrated(right, observation), [held_out])
    assert verdict.kind == "within-noise"


def test_without_a_quiet_part_a_slightly_wrong_model_is_found_out():
    """Events that begin with the record: the noise is what was stated, and nothing blurs its level."""
    recording, other = started("fitted", 1, 0.0), started("other", 2, 0.0)
    model = oscillator(recording)
    observation, held_out = model.observe(recording), model.observe(other)
    wrong = 0.01 * np.sin(2 * np.pi * held_out.time / 3)
    held_out = replace(held_out, values=held_out.values + wrong)
    verdict = judge([observation], [model.baseline()], calibrated(model, observation), [held_out])
    assert verdict.kind == "unknown"
    assert "not with held-out ones: other" in verdict.text


def test_stated_noise_that_is_far_too_large_hides_everything():
    recording = started("record", 1, 0.0)
    loud = Recording.from_signals(
        recording.time,
        {name: channel.values for name, channel in recording.channels.items()},
        name="loud",
        noise={"position": 0.1},
    )
    model = oscillator(loud).with_nominal([0.6, 5.0])
    observation = model.observe(loud)
    verdict = judge([observation], [model.baseline()], calibrated(model, observation))
    assert verdict.kind == "unknown"
    assert "Give the noise of the channels" in verdict.text
