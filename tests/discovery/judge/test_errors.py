import numpy as np

from errorscreen.cases.demo import demo_recordings
from errorscreen.data.observations import Observation
from errorscreen.discovery import channel_fits, stage_errors
from errorscreen.discovery.judge.errors import STAGES, stage_limits
from errorscreen.events import Playback, SetPointStep
from errorscreen.simulators import PlantSimulator


def setting(seed):
    recording, _, _ = demo_recordings(seed)
    simulator = PlantSimulator("synchronous_machine", recording)
    return simulator, simulator.observe(recording)


def test_figures_of_a_channel_are_those_of_the_equations():
    simulator, observation = setting(0)
    y = simulator.baseline()
    fit = channel_fits(observation, y)[0]
    error = y[0] - observation.values[0]
    level = observation.values[0][observation.time < observation.event.start].mean()
    assert np.isclose(fit.rms, np.sqrt(np.mean(error[observation.time >= 1.0 - 1e-9] ** 2)))
    assert np.isclose(fit.E, np.sum(error**2) / np.sum((observation.values[0] - level) ** 2))
    assert np.isclose(fit.chi2_per_sample, np.mean(observation.deviations(y)[0] ** 2))
    assert (fit.channel, fit.unit, fit.recording) == ("P", "pu", "fault near the terminal")


def test_stages_share_out_the_energy():
    simulator, observation = setting(1)
    stages = stage_errors(observation, simulator.baseline())
    for channel in observation.channels:
        mine = [s for s in stages if s.channel == channel]
        assert [s.stage for s in mine] == list(STAGES)
        assert np.isclose(sum(s.share for s in mine), 1)
        assert 0.8 < mine[0].rms_over_noise < 1.2  # before the event there is only noise
    limits = stage_limits(observation)
    assert abs(limits[2] - limits[1] - 0.14) < 0.03  # 0.12 s and half an edge


def test_a_record_that_ends_early_has_fewer_stages():
    recording, _, _ = demo_recordings(0)
    simulator = PlantSimulator("synchronous_machine", recording.window(0, 2.5))
    observation = simulator.observe(recording.window(0, 2.5))
    stages = [s for s in stage_errors(observation, simulator.baseline()) if s.channel == "P"]
    assert [s.stage for s in stages] == list(STAGES[:4])
    assert np.isclose(sum(s.share for s in stages), 1)


def test_a_test_has_no_stage_that_is_called_fault():
    time = 0.02 * np.arange(400)
    power = np.where(time < 1.0, 0.8, 0.0)
    rejected = Playback(time, "a", 1.0, {"P": power, "Q": 0 * time}, {"V": 1.0, "P": 0.8, "Q": 0.0})
    voltage = {"V": np.ones(400)}
    stepped = Playback(time, "b", 1.0, voltage, {"V": 1.0}, steps=(SetPointStep("Vref", 1.0, 0.02),))
    for event, second in (
        (rejected, "rejection"),
        (stepped, "step"),
        (Playback(time, "c", 1.0, voltage, {"V": 1.0}), "fault"),
    ):
        seen = Observation(event, np.ones((1, 400)), np.array([0.01]), ("V",), ("pu",))
        stages = [error.stage for error in stage_errors(seen, seen.values + 0.01)]
        assert stages[1] == second
        assert ("fault" in stages) == (second == "fault")
