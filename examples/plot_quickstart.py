"""
Quickstart
==========

A recorded fault, and a machine model that does not reproduce it. The recordings are simulated with hidden parameters
and noise. `errorscreen.data.read_csv` reads your own.
"""

from errorscreen.calibration import MAPCalibrator
from errorscreen.cases.demo import demo_recordings
from errorscreen.discovery import channel_fits, judge
from errorscreen.learning.generation import generate_dataset
from errorscreen.plotting import plot_responses
from errorscreen.screening import ContributionScreener, contribution_pipeline
from errorscreen.simulators import PlantSimulator

recording, held_out, truth = demo_recordings(random_state=1)
plant = PlantSimulator("synchronous_machine", recording)
measured = plant.observe(recording)
before = plant.baseline(measured.event)

# %%
# Which parameters carry the error? A network learns the contribution of each parameter from simulated errors.
data = generate_dataset(plant, 300, random_state=0).valid()
images = {"cwttransformer__n_frequencies": 16, "cwttransformer__n_columns": 32}
pipeline = contribution_pipeline(measured.event.dt, random_state=0).set_params(**images)
screener = ContributionScreener(pipeline, data.names, noise=measured.noise, random_state=0)
screener.fit(data.errors, data.contributions)
print("most suspicious first:", *screener.rank_names([measured.values - before])[0])

# %%
# Calibration of all parameters, with intervals beside the hidden truth, and the verdict.
calibrator = MAPCalibrator(plant, random_state=0).fit(measured)
print(calibrator.to_frame().assign(truth=truth.values()).round(3).to_string())
print(judge([measured], [before], calibrator).text)
figure = plot_responses(measured, {"before": before, "after": calibrator.predict(measured)})

# %%
# Events that were not used have the last word: E of equation (23), before and after.
for other in map(plant.observe, held_out):
    fits = [channel_fits(other, y) for y in (plant.baseline(other.event), calibrator.predict(other))]
    for old, new in zip(*fits, strict=True):
        print(f"{old.recording}, {old.channel}: {old.E:.2g} -> {new.E:.2g}")
