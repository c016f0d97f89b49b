import numpy as np
import pytest

from errorscreen.calibration import MAPCalibrator
from errorscreen.cases.demo import demo_recordings
from errorscreen.discovery import channel_fits, judge, noise_limit, stage_errors
from errorscreen.discovery.diagnosis import STAGES, stage_limits
from errorscreen.recordings import Recording
from errorscreen.simulators import PlantSimulator


def setting(seed):
    recording, _, truth = demo_recordings(seed)
    simulator = PlantSimulator("synchronous_machine", recording)
    theta = [truth[name] for name in simulator.parameters.names]
    return simulator, simulator.observe(recording), theta


def calibrated(simulator, observation):
    return MAPCalibrator(simulator, n_starts=4, library_size=256, random_state=0).fit(observation)


def test_figures_of_a_channel_are_those_of_the_equations():
    simulator, observation, _ = setting(0)
    y = simulator.baseline()
    fit = channel_fits(observation, y)[0]
    error = y[0] - observation.values[0]
    level = observation.values[0][observation.time < observation.event.start].mean()
    assert np.isclose(fit.rms, np.sqrt(np.mean(error[observation.time >= 1.0 - 1e-9] ** 2)))
    assert np.isclose(fit.E, np.sum(error**2) / np.sum((observation.values[0] - level) ** 2))
    assert np.isclose(fit.chi2_per_sample, np.mean((error / observation.noise[0]) ** 2))
    assert (fit.channel, fit.unit, fit.recording) == ("P", "pu", "fault near the terminal")


def test_stages_share_out_the_energy():
    simulator, observation, _ = setting(1)
    stages = stage_errors(observation, simulator.baseline())
    for channel in observation.channels:
        mine = [s for s in stages if s.channel == channel]
        assert [s.stage for s in mine] == list(STAGES)
        assert np.isclose(sum(s.share for s in mine), 1)
        assert 0.8 < mine[0].rms_over_noise < 1.2  # before the event there is only noise
    limits = stage_limits(observation)
    assert abs(limits[2] - limits[1] - 0.14) < 0.03  # 0.12 s and half an edge


@pytest.mark.parametrize("seed", range(4))
def test_deviating_parameters_are_called_parameters(seed):
    simulator, observation, _ = setting(seed)
    verdict = judge([observation], [simulator.baseline()], calibrated(simulator, observation))
    assert verdict.kind == "parameters"
    assert "exclude the nominal value" in verdict.text


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
    assert "not parameters of this model" in verdict.text


def test_noise_limit_falls_with_the_number_of_values():
    _, observation, _ = setting(0)
    assert 1.0 < noise_limit([observation] * 4) < noise_limit([observation])


def test_a_record_that_ends_early_has_fewer_stages():
    recording, _, _ = demo_recordings(0)
    simulator = PlantSimulator("synchronous_machine", recording.window(0, 2.5))
    observation = simulator.observe(recording.window(0, 2.5))
    stages = [s for s in stage_errors(observation, simulator.baseline()) if s.channel == "P"]
    assert [s.stage for s in stages] == list(STAGES[:4])
    assert np.isclose(sum(s.share for s in stages), 1)
