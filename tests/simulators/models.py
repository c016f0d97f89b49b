"""Small models of users, written as the tests' users would write them."""

import numpy as np

from errorscreen.events import InputSignal
from errorscreen.parameters import Parameter
from errorscreen.simulators import ODESimulator

TIME = np.arange(0.0, 10.0, 0.02)


def oscillator_rhs(t, x, u, p, dx):
    dx[0] = x[1]
    dx[1] = u[0] - p[0] * x[1] - p[1] * x[0]


def tanks_rhs(t, x, u, p, dx):
    upper = p[0] * max(x[0], 0.0) ** 0.5
    dx[0] = u[0] - upper
    dx[1] = upper - p[1] * max(x[1], 0.0) ** 0.5


def loop_rhs(t, x, u, p, dx):
    # u[0]: set-point, u[1]: what arrives at the valve
    dx[0] = p[0] * u[1] - p[1] * x[0]
    dx[1] = u[0] - x[0]


def loop_law(t, x, u, p, v):
    v[0] = p[2] * (u[0] - x[0]) + p[3] * x[1]


def push(name="push", seed=0, size=1.0, time=TIME):
    """Random steps."""
    rng = np.random.default_rng(seed)
    levels = size * rng.uniform(-2.0, 2.0, 20)
    return InputSignal(
        time, name, float(time[0]), {"force": np.repeat(levels, -(-len(time) // 20))[: len(time)]}
    )


def oscillator(recordings=None, **options):
    parameters = [Parameter("c", 0.4, 0.1, 2.0, "1/s"), Parameter("k", 4.0, 1.0, 9.0, "1/s²")]
    return ODESimulator(
        oscillator_rhs,
        {"position": "m", "velocity": "m/s"},
        parameters,
        push() if recordings is None else recordings,
        inputs={"force": "N/kg"},
        outputs=["position"],
        **options,
    )


def tanks(recordings=None, **options):
    event = push(time=np.arange(0.0, 40.0, 0.1))
    inflow = InputSignal(event.time, "inflow", 0.0, {"flow": 1.0 + 0.4 * event.signals["force"]})
    return ODESimulator(
        tanks_rhs,
        {"upper": "m", "lower": "m"},
        [Parameter("a", 0.8, 0.4, 1.6), Parameter("b", 0.7, 0.4, 1.6)],
        inflow if recordings is None else recordings,
        inputs={"flow": "m/s"},
        outputs=["lower"],
        initial={"upper": 1.0, "lower": 1.0},
        **options,
    )


def loop(recordings=None, **options):
    event = push(size=0.5)
    return ODESimulator(
        loop_rhs,
        {"level": "m", "integral": "m s"},
        [
            Parameter("b", 1.0, 0.5, 2.0),
            Parameter("a", 0.5, 0.2, 1.0),
            Parameter("kp", 2.0, 1.0, 4.0),
            Parameter("ki", 1.0, 0.5, 2.0),
        ],
        InputSignal(event.time, "set-point", 0.0, {"setpoint": event.signals["force"]})
        if recordings is None
        else recordings,
        inputs={"setpoint": "m"},
        signals={"valve": "m/s"},
        law=loop_law,
        outputs={"level": "m"},
        **options,
    )


MODELS = {"oscillator": oscillator, "tanks": tanks, "loop": loop}
