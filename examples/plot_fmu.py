"""
A model from another tool
=========================

Most simulation tools export a functional mock-up unit (FMU). It is a black box: errorscreen screens and calibrates its
parameters and finds errors of the measurement, but cannot add anything inside it. Needs the extra ``fmu``.
"""

import tempfile
from pathlib import Path

import numpy as np
from pythonfmu.builder import FmuBuilder

from errorscreen.data.recordings import Recording
from errorscreen.discovery import CauseFinder
from errorscreen.parameters import Parameter
from errorscreen.plotting import plot_responses
from errorscreen.simulators import CallableSimulator
from errorscreen.simulators.external.fmu import FMU

# %%
# A small unit, a first-order lag, built from a few lines of Python. Yours comes from your tool.
SOURCE = """
from math import exp
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

class Lag(Fmi2Slave):
    def __init__(self, **options):
        super().__init__(**options)
        self.K, self.T, self.u, self.y = 1.0, 1.0, 0.0, 0.0
        for name in ("K", "T"):
            kind = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
            self.register_variable(Real(name, **kind))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, time, step):
        self.y += (1 - exp(-step / self.T)) * (self.K * self.u - self.y)
        return True
"""
folder = Path(tempfile.mkdtemp())
(folder / "lag.py").write_text(SOURCE, encoding="utf-8")
unit = FmuBuilder.build_FMU(folder / "lag.py", dest=folder)

# %%
# Two recordings of the real system: another gain and time constant, and a clock that is 0.3 s late.
rng, time, recordings = np.random.default_rng(3), np.arange(0, 8, 0.1), []
for name, height in (("up", 1.0), ("down", -0.6)):
    late = np.maximum(time - 1.3, 0)
    y = 1.3 * height * (1 - np.exp(-late / 0.7)) + rng.normal(0, 0.003, len(time))
    values = {"u": height * (time >= 1), "y": y}
    recordings.append(Recording.from_signals(time, values, name=name, noise={"y": 0.003}, event_time=1.0))

# %%
# The unit is a function of parameters and event. The simulator wraps it. Two faults of the measurement are suspected;
# without their names all that are known would be tried.
parameters = [Parameter("K", 1.0, 0.5, 2.0), Parameter("T", 1.0, 0.3, 3.0, "s")]
lag = FMU(unit, parameters=["K", "T"], outputs=["y"], inputs=["u"])
simulator = CallableSimulator(lag, parameters, recordings, outputs=["y"], inputs=["u"])
suspected = ["scale_y", "skew_y"]
finder = CauseFinder(
    simulator, suspected, max_effects=1, n_starts=1, library_size=16, n_draws=8, random_state=0
)
finder.fit(recordings)
print(finder.verdict_.text)
measured = simulator.observe(recordings[0])
shown = {"recalibrated": finder.recalibrated_simulator_, "clock corrected": finder.extended_simulator_}
figure = plot_responses(measured, {name: s.baseline(measured.event) for name, s in shown.items()})
