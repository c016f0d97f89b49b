"""
Adding an effect that the model lacks
=====================================

The machine model has a constant field voltage. A voltage regulator is an effect that can be added to it. The extended
simulator is a simulator like any other, with more parameters.
"""

from dataclasses import replace

import numpy as np

from errorscreen.calibration import MAPCalibrator
from errorscreen.cases.demo import demo_recordings
from errorscreen.discovery import noise_limit
from errorscreen.plotting import plot_responses
from errorscreen.simulators import PlantSimulator

recording, held_out, _ = demo_recordings(random_state=1)
plant = PlantSimulator("synchronous_machine", recording)
for effect in plant.effects:
    print(
        f"{effect.name:10} at {effect.port:10} {effect.title}; looks like {', or '.join(effect.confused_with)}"
    )
extended = plant.extend("exciter", K={"nominal": 60.0})
print(extended, "with", *extended.parameters.names[len(plant.parameters) :])

# %%
# The first parameter of an effect is its strength. At strength 0 the effect is an identity, bit for bit. A difference
# in the response is always due to the effect.
off = extended.parameters.embed([0.0], ["exciter.K"])
assert np.array_equal(extended.simulate(off).values, plant.simulate(plant.parameters.nominal).values)

# %%
# Its signature: the change of the response to this event.
recordings = (recording, held_out[1])
measured = [plant.observe(recording) for recording in recordings]
signature = replace(measured[0], values=extended.baseline())
figure = plot_responses(signature, {"without exciter": plant.baseline(), "with exciter": extended.baseline()})

# %%
# Now the measured machine has an exciter, other parameters and noise. Two recordings are fitted together, because along
# a valley of one recording Xd, T'd0, gain and TB make up for each other. Without the effect no values of the eight
# parameters explain the recordings. With it they do.
rng = np.random.default_rng(0)
truth = extended.parameters.embed([0.36, 10.5, 90.0], ["Xd1", "Tj", "exciter.K"])
for k, observation in enumerate(measured):
    values = extended.simulate(truth, observation.event).values[0]
    noise = observation.noise[:, None] * rng.standard_normal(values.shape)
    measured[k] = replace(observation, values=values + noise)
before = [plant.baseline(observation.event) for observation in measured]
print(f"noise alone explains χ²/N up to {noise_limit(measured, before):.3f}")
fits = {}
for label, model in {"without exciter": plant, "with exciter": extended}.items():
    fits[label] = MAPCalibrator(model, random_state=0).fit(measured)
    print(f"{label}: χ²/N = {fits[label].chi2_per_sample_:.3f}")
table = fits["with exciter"].to_frame()[["unit", "nominal", "value", "low", "high"]]
print(table.assign(truth=truth[0]).round(3).to_string())
figure = plot_responses(measured[0], {label: fit.predict(measured[0]) for label, fit in fits.items()})
