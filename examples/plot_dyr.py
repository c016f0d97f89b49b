"""
From a DYR and a CSV to a corrected DYR
=======================================

The model of a steam unit is a DYR file. A recorded fault does not agree with it, because one of its numbers is wrong.
Which one?
"""

import tempfile
from pathlib import Path

import errorscreen as es
from errorscreen.calibration import fewest_parameters
from errorscreen.plotting import plot_responses

# %%
# Read both files. ``base_mva`` is the machine base, MBASE in the RAW file: the DYR file does not hold it.
file = es.read_dyr("dyr/unit.dyr")
print(file.summary())
print("problems:", file.check())
recording = es.read("dyr/unit.csv", base_mva=150.0, f_nominal=60.0)

# %%
# Play the recorded voltage back and compare P and Q. The model has a parameter for each number that may be wrong.
unit = es.Plant(file.unit(), recording)
print(*unit.parameters.names)
measured = unit.observe(recording)
before = unit.baseline(measured.event)

# %%
# The fewest numbers that have to change. All others keep the values of the file.
fit = fewest_parameters(unit, recording)
changes = {name: fit.values_[name] for name in fit.names_}
print(fit.to_frame().round(3).to_string())
print("misfit over noise:", round(fit.chi2_per_sample_, 2))
figure = plot_responses(measured, {"file": before, "corrected": fit.predict(measured)})

# %%
# The change in the file. Comments, blanks and all other numbers stay as they are.
print(file.diff(101, 1, changes))

# %%
# Write the corrected file and read it back.
with tempfile.TemporaryDirectory() as folder:
    corrected = file.write(Path(folder) / "calibrated.dyr", 101, 1, changes)
    table = es.read_dyr(corrected).table()
print(table.loc[table.name == "H", ["model", "name", "value", "unit", "meaning"]].to_string(index=False))

# %%
# ``errorscreen run dyr/case.toml`` does the same in one command. It also searches for causes other than numbers. Where
# one of those is named, it leaves the file alone.
