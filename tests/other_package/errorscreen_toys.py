"""A package that adds a device, two effects, a reader, a screener and a calibrator by its entry points."""

import json
from pathlib import Path

import numpy as np

from errorscreen.calibration import BaseCalibrator, FitProblem
from errorscreen.data import Recording
from errorscreen.data.readers.base import Reader
from errorscreen.effects.base import Effect, strength
from errorscreen.engine import stage
from errorscreen.models import Device
from errorscreen.models.device import relative_parameters
from errorscreen.screening import BaseScreener


@stage("V", "extra")
def terminal(Vr, Vi):
    V = np.sqrt(Vr * Vr + Vi * Vi)
    return V, 0.0 * V


@stage("P", "Q", "d_x")
def power(V, extra, x, P0, Q0, k, T):
    return P0 * (1.0 + k * (x - 1.0)) + extra, Q0 * V, (V - x) / T


def initialise(v):
    one = np.ones_like(v["k"])
    return {"x": v["V"] * one}, {"P0": v["P"] * one, "Q0": v["Q"] * one}, v["V"] > 0.0 * one


TOY_PLANT = Device(
    name="toy_plant",
    title="Toy plant",
    candidates=relative_parameters(
        "toy_plant", "k | k |  | 1.0 | > 0 | power per voltage\nT | T | s | 0.3 | > 0 | time constant", 0.5
    ),
    constants=(),
    states=("x",),
    setpoints=("P0", "Q0"),
    stages=(terminal, power),
    initialise=initialise,
    ports={"extra": "additional active power in pu"},
    needs_angle=False,
    source="a toy",
)


def boost(value, V, s):
    return (value + s * (V - 1.0),)


TOY_BOOST = Effect(
    name="boost",
    title="Boost",
    port="extra",
    devices=("toy_plant",),
    equations=boost,
    parameters=(strength("s", 0.3, 1.0, "pu", "boost", "s", "power per voltage; 0: none", -1.0),),
    description="Power follows the voltage at once.",
    source="a toy",
)


def shift(value, V, V0, s):
    return (value + s * (V - V0),)


TOY_SHIFT = Effect(
    name="shift",
    title="Shift of mechanical power",
    port="Pm",
    devices=("synchronous_machine",),
    equations=shift,
    parameters=(strength("s", 0.1, 0.5, "pu", "shift", "s", "power per voltage; 0: none"),),
    derived=("V0",),
    initialise=lambda values, h: {"V0": values["V"] * np.ones_like(values["s"])},
    description="Mechanical power follows the voltage.",
    source="a toy",
)


def read(path, columns, *, base_mva, f_nominal, name=None, event_time=None, **options):
    arrays = json.loads(Path(path).read_text().removeprefix("TOY"))
    values = {channel: arrays[column.column] for channel, column in columns.items()}
    return Recording.from_arrays(
        arrays["time"],
        values,
        base_mva=base_mva,
        f_nominal=f_nominal,
        name=name or "toy",
        event_time=event_time,
    )


TOY_READER = Reader(lambda head: head.startswith(b"TOY"), read)


class ToyScreener(BaseScreener):
    """The last parameter is always to blame."""

    def __init__(self, simulator):
        self.simulator = simulator

    def fit(self, X, y=None):
        names = self.simulator.parameters.names
        self._store(np.arange(len(names), dtype=float), names)
        return self


class ToyCalibrator(BaseCalibrator):
    """The better of the nominal values and 100 random ones."""

    def __init__(self, simulator, names=None, *, random_state=None):
        self.simulator = simulator
        self.names = names
        self.random_state = random_state

    def fit(self, X, y=None):
        problem = FitProblem(self.simulator, X, self.names)
        low, high = problem.space.bounds.T
        theta = np.random.default_rng(self.random_state).uniform(low, high, (100, len(low)))
        theta[0] = problem.space.nominal
        self._store(problem, theta[np.argmin(problem.objective(theta))])
        return self
