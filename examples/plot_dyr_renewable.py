"""
A renewable plant from a DYR file
=================================

A photovoltaic plant of three records: converter (REGCA1), electrical control (REECA1) and plant control (REPCA1). After
a fault its reactive power ends at another level than the model says.
"""

import errorscreen as es
from errorscreen.calibration import fewest_parameters
from errorscreen.plotting import plot_responses

file = es.read_dyr("dyr/plant.dyr")
print(file.summary())
recording = es.read("dyr/plant.csv", base_mva=90.0, f_nominal=60.0)
plant = es.Plant(file.unit(), recording)
measured = plant.observe(recording)
fit = fewest_parameters(plant, recording)
print(fit.to_frame().round(3).to_string())
print(file.diff(201, 1, {name: fit.values_[name] for name in fit.names_}))
figure = plot_responses(
    measured, {"file": plant.baseline(measured.event), "corrected": fit.predict(measured)}
)
