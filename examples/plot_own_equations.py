"""
Your own equations
==================

A drive turns a load: the model knows inertia and viscous friction. The recordings come from a machine whose bearing
also has dry friction, which the model lacks.
"""

import numpy as np

from errorscreen.data.recordings import Recording
from errorscreen.discovery import CauseFinder
from errorscreen.parameters import Parameter
from errorscreen.plotting import plot_responses
from errorscreen.simulators import ODESimulator


# %%
# The model: write the derivatives of the states x into dx. u holds the inputs, p the parameters, in the order below.
def drive(t, x, u, p, dx):
    dx[0] = x[1]
    dx[1] = p[0] * u[0] - p[1] * x[1]


# %%
# Three records, two to fit and one to judge on. Here a machine is imitated, with a small step and friction that really
# sticks; yours come from a table.
def machine(torque, h=0.001, gain=2.3, viscous=0.6, dry=0.5):
    angle, speed = np.zeros(len(torque)), 0.0
    for k in range(1, len(torque)):
        push = gain * torque[k - 1] - viscous * speed
        push -= np.clip(push, -dry, dry) if speed == 0 else dry * np.sign(speed)
        speed = speed + h * push if speed == 0 or (speed + h * push) * speed > 0 else 0.0
        angle[k] = angle[k - 1] + h * speed
    return angle


rng, time, records = np.random.default_rng(7), np.arange(0, 12, 0.02), []
for name in ("run 1", "run 2", "run 3"):
    torque = np.repeat(rng.uniform(-1.5, 1.5, 12), 1000)
    values = {"torque": torque[::20], "angle": machine(torque)[::20] + rng.normal(0, 0.005, 600)}
    records.append(Recording.from_signals(time, values, noise={"angle": 0.005}, name=name))

# %%
# The simulator, with names and units that reports will use; what it lacks; and what that is worth on the third run.
parameters = [Parameter("gain", 2.0, 1.0, 4.0), Parameter("viscous", 0.8, 0.2, 2.0, "1/s")]
states, inputs = {"angle": "rad", "speed": "rad/s"}, {"torque": "N m"}
options = {"outputs": ["angle"], "interpolation": "hold", "step": 0.005}
model = ODESimulator(drive, states, parameters, records[:2], inputs=inputs, **options)
finder = CauseFinder(model, random_state=0).fit(records[:2])
print(finder.verdict_.text)
for name, (value, low, high) in finder.causes_[0].values.items():
    print(f"{name} = {value:.3f} [{low:.3f}, {high:.3f}]")
print(f"gain on the third run: {finder.measure_gain(records[2]).gain:.4f}")
unseen = model.observe(records[2])
shown = {"recalibrated": finder.recalibrated_simulator_, "extended": finder.extended_simulator_}
figure = plot_responses(unseen, {name: s.baseline(unseen.event) for name, s in shown.items()})
