"""Units under an imposed voltage, and records of the reference data."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from errorscreen.engine.kernels import new_engine
from errorscreen.engine.stages import stage
from errorscreen.models.part import Part, Start
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import SHORTEST, Record, unit
from errorscreen.simulators import assembly

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


def needs(folder):
    """Path of a folder of the reference data; the test is skipped without it."""
    if not (DATA / folder).is_dir():
        pytest.skip(f"{DATA / folder} is missing")
    return DATA / folder


def table(path):
    """Columns of a CSV file."""
    with path.open() as file:
        header, *rows = csv.reader(file)
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))


def records(path, bus):
    """Records of a bus in a DYR file."""
    found = []
    for text in re.split(r"/\s*(?:\n|$)", path.read_text()):
        own, name, _, *values = [token.strip("' ") for token in re.findall(r"'[^']*'|[^\s,]+", text)] or [
            ""
        ] * 3
        if own == str(bus):
            part = PARTS[name]
            found.append(
                Record(part, dict(zip([f.name for f in part.fields], map(float, values), strict=True)))
            )
    return found


@stage("V", "omega", "P", "Q")
def imposed(Vr, Vi):
    """The parts of the voltage stand for electrical power and speed deviation too."""
    return np.sqrt(Vr * Vr + Vi * Vi), Vi + 1.0, 0.0 * Vi + Vr, 0.0 * Vi


#: a machine whose power and speed are the imposed signals
SIGNALS = Part(
    "SIGNALS",
    "machine",
    "imposed signals",
    (),
    (imposed,),
    ("V", "omega", "P", "Q", "Pm0", "Efd0"),
    setpoints=("Pm0", "Efd0"),
    start=lambda v: Start({}, {"Pm0": v["Vr"], "Efd0": 1.0}),
)


def run(device, u, start, record, *, h, kind="compiled", changes=None, f0=50.0):
    """Quantities (R, L) at every step while `u` (2 L - 1, 2) is imposed, from rest at its first row."""
    engine = new_engine(kind, assembly.assemble(device, ()), None)
    values = {p.name: p.nominal for p in device.candidates}
    values |= {**device.constant_values(), "f0": f0, "shortest": SHORTEST * h}
    values |= {"V": np.hypot(*u[0]), "angle": np.arctan2(u[0, 1], u[0, 0]), **start, **(changes or {})}
    values = {name: np.array([value]) for name, value in values.items()}
    states, setpoints, fits = device.initialise(values)
    assert fits.all()
    x, constants, _ = assembly.starting(engine.model, {**values, **states, **setpoints}, np.array([True]), 1)
    return engine.integrate(x, constants, u, h=h, record=record)[0]


def alone(part, **values):
    """Stabiliser behind imposed signals."""
    return unit([Record(SIGNALS, {}), Record(part, values)])


def rms(x):
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(x))))
