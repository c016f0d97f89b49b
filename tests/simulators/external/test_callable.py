import numpy as np
import pytest

from errorscreen.calibration import MAPCalibrator
from errorscreen.calibration.problem import FitProblem
from errorscreen.data.recordings import Recording
from errorscreen.discovery import CauseFinder
from errorscreen.events import Event, InputSignal
from errorscreen.exceptions import InputError
from errorscreen.parameters import Parameter
from errorscreen.screening import SensitivityScreener
from errorscreen.simulators import CallableSimulator
from errorscreen.simulators.base import Status
from errorscreen.testing import check_effect, check_simulator

TIME = np.arange(0.0, 8.0, 0.05)
PARAMETERS = [Parameter("K", 1.0, 0.4, 2.0), Parameter("T", 1.0, 0.3, 3.0, "s")]


def program(theta, event):
    """First-order lag of a step at 1 s, as some other program would compute it."""
    t = np.maximum(event.time - 1.0, 0.0)
    return theta[0] * event.signals["u"][-1] * (1.0 - np.exp(-t / theta[1]))


def step(name="step", height=1.0):
    return InputSignal(TIME, name, 1.0, {"u": height * (TIME >= 1.0)})


def box(recordings=None, function=program, **options):
    return CallableSimulator(
        function,
        PARAMETERS,
        step() if recordings is None else recordings,
        outputs={"y": "m"},
        inputs=["u"],
        **options,
    )


def recorded(theta, event, noise=0.002, seed=0, change=lambda y: y):
    y = change(program(np.array(theta), event)) + noise * np.random.default_rng(seed).standard_normal(
        len(TIME)
    )
    values = {"u": event.signals["u"], "y": y}
    return Recording.from_signals(
        TIME, values, name=event.name, units={"y": "m"}, noise={"y": noise}, event_time=1.0
    )


def test_a_program_that_knows_whole_events_only_is_compared_with_part_of_one():
    def stubborn(theta, event):
        assert len(event.time) == len(TIME)
        return program(theta, event)

    simulator = box(function=stubborn)
    whole = FitProblem(simulator, recorded([1.2, 0.8], step()))
    part = whole.until(0.25)
    assert part.n_values == 20 + 35  # a second of quiet, and a quarter of seven seconds
    theta = [[1.0, 1.0], [1.5, 0.5]]
    assert np.array_equal(part.residuals(theta), whole.residuals(theta)[:, : part.n_values])


def batch(theta, event):
    return np.array([program(row, event)[None] for row in theta])


@pytest.mark.parametrize("options", [{}, {"n_jobs": 2}, {"function": batch, "vectorized": True}])
def test_boxes_keep_the_contract_and_agree(options):
    simulator = box(**options)
    check_simulator(simulator)
    theta = np.random.default_rng(0).uniform([0.4, 0.3], [2.0, 3.0], (7, 2))
    assert np.array_equal(simulator.simulate(theta).values, box().simulate(theta).values)


@pytest.mark.parametrize("effect", ["scale_y", "offset_y", "skew_y", "lag_y"])
def test_measurement_effects_keep_the_contract(effect):
    check_effect(box(), effect)


def test_screening_and_calibration_work():
    recording = recorded([1.4, 0.6], step())
    simulator = box(recording)
    assert set(SensitivityScreener(simulator).fit(recording).ranked_names_) == {"K", "T"}
    fitted = MAPCalibrator(simulator, prior_scale=10.0, random_state=0).fit(recording)
    assert np.allclose(fitted.theta_, [1.4, 0.6], atol=0.01)


def test_a_late_clock_is_named():
    recordings = [
        recorded([1.2, 0.8], step("up"), change=lambda y: np.interp(TIME - 0.3, TIME, y)),
        recorded([1.2, 0.8], step("down", -0.5), seed=1, change=lambda y: np.interp(TIME - 0.3, TIME, y)),
    ]
    finder = CauseFinder(box(recordings), random_state=0).fit(recordings)
    assert finder.verdict_.kind == "measurement"
    assert finder.causes_[0].name == "skew_y"
    assert finder.causes_[0].values["skew_y.d"][0] == pytest.approx(0.3, abs=0.02)


def test_what_cannot_be_added_is_said():
    # an oscillation that no measurement effect makes
    wobble = 0.1 * np.sin(2 * np.pi * 0.9 * TIME) * (TIME > 1.0)
    recordings = [
        recorded([1.2, 0.8], step("up"), change=lambda y: y + wobble),
        recorded([1.2, 0.8], step("down", -0.5), seed=1, change=lambda y: y + wobble),
    ]
    finder = CauseFinder(box(recordings), random_state=0).fit(recordings)
    assert finder.verdict_.kind == "unknown"
    assert finder.input_locations_ == []
    assert "has no ports" in finder.verdict_.text
    assert {e.kind for e in finder.simulator.effects} == {"measurement"}


def test_failures_are_data():
    def fragile(theta, event):
        if theta[0] > 1.5:
            raise RuntimeError("licence server is down")
        return program(theta, event)

    responses = box(function=fragile).simulate([[1.0, 1.0], [1.8, 1.0]])
    assert responses.status.tolist() == [Status.OK, Status.FAILED]
    assert "the program raised an error" in responses.failures()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"function": "notepad"}, "the function is a str"),
        ({"recordings": []}, "empty"),
        ({"recordings": TIME}, "not a recording"),
    ],
)
def test_absurd_boxes_are_refused(options, text):
    with pytest.raises(InputError, match=text):
        box(**options)


def test_a_wrong_shape_is_refused():
    with pytest.raises(InputError, match=r"returned shape \(3,\)"):
        box(function=lambda theta, event: [1.0, 2.0, 3.0])


def test_an_event_without_inputs_reaches_the_function():
    simulator = CallableSimulator(
        lambda theta, event: theta[0] * event.time, PARAMETERS[:1], Event(TIME), outputs=["y"]
    )
    assert np.array_equal(simulator.baseline()[0], TIME)
