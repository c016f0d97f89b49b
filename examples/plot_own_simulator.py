"""
A simulator of your own
=======================

Everything above the simulators knows them by one contract. A simulator that keeps it, be it a formula, an ODE or a call
of another program, can be screened and calibrated like the built-in devices.

The model here is a load whose power recovers after a voltage step (Karlsson and Hill, "Modelling and identification of
nonlinear dynamic loads in power systems", IEEE Transactions on Power Systems 9, 1994):

.. math::

    T_p \\dot x = (V/V_0)^{\\alpha_s} - (V/V_0)^{\\alpha_t} - x, \\qquad P = P_0\\,[x + (V/V_0)^{\\alpha_t}]
"""

import numpy as np

from errorscreen.calibration import MAPCalibrator
from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.discovery import judge
from errorscreen.events import Playback
from errorscreen.parameters import Parameter, ParameterSpace
from errorscreen.plotting import plot_responses
from errorscreen.screening import SensitivityScreener
from errorscreen.simulators import Responses, Simulator, Status
from errorscreen.testing import check_simulator


# %%
# The contract: `parameters`, `channels`, `units` and `event`; `simulate` for a batch of parameter vectors, in which a
# failed row gets a status and NaN; and `observe`, which brings a recording onto the simulator's channels and time grid.
class RecoveringLoad(Simulator):
    channels, units = ("P",), ("pu",)
    parameters = ParameterSpace(
        [
            Parameter("alpha_s", 0.5, 0.0, 1.5, description="steady-state voltage exponent"),
            Parameter("alpha_t", 2.0, 1.0, 3.0, description="transient voltage exponent"),
            Parameter("Tp", 6.0, 2.0, 20.0, unit="s", description="time constant of the recovery"),
        ]
    )

    def __init__(self, recording):
        self.event = recording if isinstance(recording, Playback) else self.observe(recording).event

    def simulate(self, theta, event=None):
        theta = self.parameters.validate(theta)
        event = self.event if event is None else event
        # contiguous, because NumPy may round powers of strided arrays differently, and a row's result must not depend
        # on how it lies in the batch
        alpha_s, alpha_t, Tp = np.array(theta.T, order="C")
        x = np.zeros(len(theta))
        values = np.empty((len(theta), 1, len(event.time)))
        for k, ratio in enumerate(event.signals["V"] / event.initial["V"]):
            values[:, 0, k] = event.initial["P"] * (x + ratio**alpha_t)
            # exact for a voltage that is constant over the step
            x = x + (1 - np.exp(-event.dt / Tp)) * (ratio**alpha_s - ratio**alpha_t - x)
        good = Tp > 0
        values[~good] = np.nan
        return Responses(values, np.where(good, Status.OK, Status.DIVERGED), event.time, self.channels)

    def observe(self, recording):
        if isinstance(recording, Observation):
            return recording
        source = recording.resample()
        voltage, power = source.channel("V"), source.channel("P")
        initial = source.initial(["V", "P"])
        event = Playback(source.time, source.name, source.event_time, {"V": voltage.values}, initial)
        noise = np.array([power.noise])
        return Observation(event, power.values[None], noise, self.channels, self.units, source.assumptions)


# %%
# A recording of a substation after a tap of its transformer moved, made with other parameters and noise. Consumed power
# is negative.
rng = np.random.default_rng(1)
time = np.arange(0, 50, 0.05)
voltage = np.where(time < 10, 1.0, 0.95)
substation = RecoveringLoad(Playback(time, "tap", 10.0, {"V": voltage}, {"V": 1.0, "P": -0.8}))
power = substation.simulate([0.2, 2.4, 9.0]).values[0, 0]
recorded = {
    "V": voltage + 1e-4 * rng.standard_normal(len(time)),
    "P": power + 1e-3 * rng.standard_normal(len(time)),
}
recording = Recording.from_arrays(time, recorded, base_mva=50, f_nominal=50, name="tap")
load = RecoveringLoad(recording)

# %%
# `check_simulator` proves the contract, or says what to mend.
check_simulator(load)

# %%
# From here on it is a simulator like any other.
measured = load.observe(recording)
before = load.baseline()
print("most sensitive first:", *SensitivityScreener(load).fit(recording).ranked_names_)
calibrator = MAPCalibrator(load, prior_scale=1.0, random_state=0).fit(recording)
print(calibrator.to_frame().round(3).to_string())
print(judge([measured], [before], calibrator).text)
figure = plot_responses(measured, {"before": before, "after": calibrator.predict(measured)})
