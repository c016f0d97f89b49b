"""Makes the recordings of the tutorials on DYR files: ``python examples/dyr/make_recordings.py``.

Each unit is simulated with one number other than in its file, with a tenth of the step of the fit, and noise is added.
"""

from pathlib import Path

import numpy as np
import pandas as pd

import errorscreen as es
from errorscreen.engine.vmath import smooth_step
from errorscreen.events import Playback
from errorscreen.simulators import PlantSimulator

HERE = Path(__file__).parent
#: samples a second, and how many steps of the simulation between them
RATE, FINE = 100, 25
START, STOP = 1.0, 7.0
#: file: base in MVA, what is true, and powers before the event in pu
UNITS = {
    "unit": (150.0, {"GENROU.H": 3.8}, {"V": 1.02, "P": 0.75, "Q": 0.15}),
    "plant": (90.0, {"REPCA1.Ki": 1.5}, {"V": 1.01, "P": 0.80, "Q": 0.05}),
}
#: standard deviations of the noise: V and powers in pu, angle in rad
NOISE = {"V": 2e-4, "angle": 2e-4, "P": 1e-3, "Q": 1e-3}


def voltage(time):
    """A fault at 1 s: the voltage sags and recovers, then the angle swings; it settles a little lower than before."""
    after = np.clip(time - START, 0, None)
    clear = np.clip(after - 0.12, 0, None)
    low = smooth_step(after / 0.04) - smooth_step(clear / 0.04)
    swing = np.exp(-after / 1.5)
    sway = swing * (1 + np.cos(2 * np.pi * 0.9 * after))
    V = -0.45 * low - smooth_step(clear / 0.04) * (0.003 + 0.02 * sway)
    return V, 0.25 * swing * np.sin(2 * np.pi * 0.9 * after) - 0.05 * low


def main():
    """Write a table of V, angle, P and Q for each file."""
    rng = np.random.default_rng(11)
    time = np.arange(0, STOP, 1 / (RATE * FINE))
    for name, (base, truth, start) in UNITS.items():
        V, angle = voltage(time)
        event = Playback(time, name, START, {"V": start["V"] + V, "angle": angle}, start)
        model = es.read_dyr(HERE / f"{name}.dyr").unit()
        unit = PlantSimulator(model, event, step=1 / (RATE * FINE), effects=())
        theta = unit.parameters.nominal
        for parameter, value in truth.items():
            theta[unit.parameters.index(parameter)] = value
        P, Q = unit.simulate(theta).require_ok(name).values[0]
        columns = {"V": start["V"] + V, "angle": angle, "P": P, "Q": Q}
        noisy = {
            key: x[::FINE] + NOISE[key] * rng.standard_normal(len(x[::FINE])) for key, x in columns.items()
        }
        table = pd.DataFrame({
            "time_s": time[::FINE], "V_pu": noisy["V"], "angle_rad": noisy["angle"],
            "P_MW": base * noisy["P"], "Q_Mvar": base * noisy["Q"],
        })  # fmt: skip
        table.round(5).to_csv(HERE / f"{name}.csv", index=False)


if __name__ == "__main__":
    main()
