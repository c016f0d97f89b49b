"""Models with something hidden in their recordings."""

import logging
from contextlib import contextmanager

import numpy as np
import pytest

from errorscreen.calibration.problem import FitProblem
from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.discovery.fits.hypotheses import JointFit
from errorscreen.events import Event, InputSignal
from errorscreen.parameters import Parameter
from errorscreen.simulators import CallableSimulator, ODESimulator
from tests.plants import dip, plant
from tests.simulators.models import oscillator, push

NOISE = 0.01
PLANT_NOISE = np.array([2e-3, 2e-3])


def store_rhs(t, x, u, p, dx):
    dx[0] = p[0] * u[0] - p[1] * x[0]


class Lines(logging.Handler):
    """Handler that hands each line of the log to a function, whose errors pass."""

    def __init__(self, take):
        super().__init__(logging.INFO)
        self.emit = lambda record: take(record.getMessage())


@contextmanager
def logged(take=None):
    """Lines of the package's log while a block runs, also given to a function."""
    lines = []
    logger, handler = (
        logging.getLogger("errorscreen"),
        Lines(lambda line: (lines.append(line), take and take(line))),
    )
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield lines
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


def recorded(truth, event, output):
    y = truth[0] + NOISE * np.random.default_rng(4).standard_normal(truth.shape[1])
    return Recording.from_signals(
        event.time, {**event.signals, output: y}, noise={output: NOISE}, name=event.name
    )


@pytest.fixture(scope="module")
def spring():
    """An oscillator whose spring softens, and the linear model of it."""
    event = push()
    truth = oscillator(event, step=0.005).extend("velocity.cubic(position)").simulate([0.45, 4.4, 0.6], event)
    observation = oscillator(event).observe(recorded(truth.values[0], event, "position"))
    return oscillator(event), observation


@pytest.fixture(scope="module")
def relay():
    """A leaking store whose supply is cut again and again."""
    time = np.arange(0, 40, 0.1)
    event = InputSignal(time, "supply", 0.0, {"supply": np.repeat([1.6, 0.4, 1.9, 1.2], 100)})
    parameters = [Parameter("a", 0.5, 0.25, 0.75), Parameter("b", 0.25, 0.12, 0.37)]
    model = ODESimulator(
        store_rhs,
        ["level"],
        parameters,
        event,
        inputs=["supply"],
        outputs=["level"],
        interpolation="hold",
        step=0.025,
    )
    effect = next(e for e in model.effects if e.name == "supply.relay_above(level)")
    truth = model.extend(effect).simulate([0.55, 0.22, 0.8, 2.1, 1.1], event)
    return model, effect, model.observe(recorded(truth.values[0], event, "level"))


@pytest.fixture
def stuck_relay(relay):
    """A relay fitted from where its threshold, and so all else, ends in a local minimum."""
    model, effect, observation = relay
    problem = FitProblem(model.extend(effect), observation)
    start = (np.array([0.55, 0.22, 0.5, 2.6, 4.0]) - problem.space.nominal) / problem.space.scales
    return problem, JointFit((effect,), problem, start).run(30).hypothesis()


def observed(simulator, theta, seed=0):
    """Observation of a simulator at some parameters, with noise."""
    y = simulator.simulate(theta).require_ok().values[0]
    noisy = y + PLANT_NOISE[:, None] * np.random.default_rng(seed).standard_normal(y.shape)
    return Observation(simulator.event, noisy, PLANT_NOISE, simulator.channels, simulator.units)


@pytest.fixture(scope="module")
def hidden():
    """A machine with deviating parameters and an exciter, and what was recorded of it."""
    base = plant("synchronous_machine", dip(stop=5.0))
    theta = base.parameters.nominal * np.random.default_rng(1).uniform(0.85, 1.15, 8)
    values = np.array([120.0, 0.2, 6.0, 0.1])
    return base, theta, values, observed(base.extend("exciter"), np.concatenate([theta, values]))


@pytest.fixture(scope="module")
def crease():
    """A function whose error has a crease along a = b, and where a search from nominal values stalls on it."""
    time = np.arange(0, 10, 0.1)
    event = Event(time, "crease", start=1.0)

    def valley(theta, event):
        a, b = theta.T
        on = np.where(event.time < event.start, 0.0, 1.0)
        return np.stack([np.outer(3 + 5 * np.abs(a - b), on), np.outer(a, on)], axis=1)

    space = [Parameter(name, 0.0, -2.0, 2.0, scale=1.0) for name in "ab"]
    model = CallableSimulator(valley, space, event, outputs=["u", "v"], vectorized=True)
    noise = 0.05 * np.random.default_rng(0).standard_normal((2, 100))
    signals = {"u": noise[0], "v": 0.5 * (time >= 1.0) + noise[1]}
    recording = Recording.from_signals(time, signals, noise={"u": 0.05, "v": 0.05}, name="crease")
    return model, model.observe(recording)
