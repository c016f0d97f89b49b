"""
An error in time and frequency
==============================

The network reads images of the energy of an error over time and frequency. They are also worth a look.
"""

from errorscreen.calibration import MAPCalibrator
from errorscreen.cases.demo import demo_recordings
from errorscreen.features import CWTTransformer
from errorscreen.plotting import plot_error_images
from errorscreen.simulators import PlantSimulator

recording, _, _ = demo_recordings(random_state=1)
plant = PlantSimulator("synchronous_machine", recording)
measured = plant.observe(recording)
calibrator = MAPCalibrator(plant, random_state=0).fit(measured)
errors = {
    "before": measured.values - plant.baseline(measured.event),
    "after": measured.values - calibrator.predict(measured),
}

# %%
# One row for each channel, one column for each model. Colours are decibels below the largest energy of the channel.
# Before calibration the fault shows at all frequencies in Q. After the fault both channels swing out of step with the
# measurement, at one to two hertz. After calibration no error within 40 dB of that is left. The veiled parts are
# distorted by the ends of the record.
cwt = CWTTransformer(sampling_period=measured.event.dt, f_max=15.0, energy="linear")
images = cwt.fit_transform([errors["before"], errors["after"]])
figure = plot_error_images(
    dict(zip(errors, images, strict=True)),
    cwt.frequencies_,
    measured.time[0] + cwt.times_,
    measured.channels,
    event_time=measured.event.start,
    cone=cwt.cone_of_influence_,
)

# %%
# The rows are equivalent frequencies, spaced evenly on a logarithmic scale. The columns conserve the energy.
print(f"(models, channels, frequencies, columns): {images.shape}")
print(
    f"{cwt.frequencies_[0]:.2f} to {cwt.frequencies_[-1]:.1f} Hz, {cwt.times_[0]:.3f} to {cwt.times_[-1]:.3f} s"
)
