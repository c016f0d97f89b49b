"""The hydro governor at a unit without governor."""

import numpy as np
import pytest
from scipy.signal import lsim

from errorscreen.effects import effects_of
from errorscreen.effects.hydro_governor import HYDRO_GOVERNOR, hydro
from errorscreen.models import DEVICES
from errorscreen.models.governors.hygov import HYGOV
from errorscreen.models.machines.round_rotor import GENROU
from errorscreen.models.unit import Record, unit
from tests.plants import dip, flat, plant, random_rows

MACHINE = Record(GENROU, {"D": 1.0})


@pytest.fixture(scope="module")
def plants():
    """The same machine by both engines, and with HYGOV, driven by a dip."""
    event, effects = dip(stop=4.0), (HYDRO_GOVERNOR,)
    device = unit([MACHINE])
    governed = unit([MACHINE, Record(HYGOV, {"r": 0.4, "Tr": 5.0, "Tf": 0.0, "Tg": 0.3, "Dturb": 0.0})])
    return {
        "compiled": plant(device, event, effects=effects),
        "numpy": plant(device, event, effects=effects, engine="numpy"),
        "HYGOV": plant(governed, event, effects=()),
    }


def test_only_units_without_governor_may_lack_it():
    assert HYDRO_GOVERNOR in effects_of("", *unit([MACHINE]).tags)
    assert HYDRO_GOVERNOR not in effects_of("", *unit([MACHINE, Record(HYGOV, {})]).tags)
    assert all(HYDRO_GOVERNOR not in effects_of(device.name, *device.tags) for device in DEVICES.values())


@pytest.mark.parametrize("engine", ["compiled", "numpy"])
def test_strength_zero_is_an_exact_identity(plants, engine):
    base = plants[engine]
    extended = base.extend("hydro_governor")
    theta = random_rows(extended, 9, seed=1)
    theta[:, : len(base.parameters)] = base.parameters.nominal
    theta[::3, len(base.parameters)] = 0.0
    plain = base.simulate(theta[:, : len(base.parameters)]).values
    mixed = extended.simulate(theta).values
    assert np.array_equal(mixed[::3], plain[::3])
    assert np.array_equal(extended.simulate(theta[::3]).values, plain[::3])
    assert np.abs(mixed[1::3] - plain[1::3]).max() > 1e-3


def test_engines_agree(plants):
    compiled, reference = (plants[engine].extend("hydro_governor") for engine in ("compiled", "numpy"))
    theta = random_rows(compiled, 5, seed=2)
    assert np.array_equal(compiled.simulate(theta).values, reference.simulate(theta).values, equal_nan=True)


def test_the_equilibrium_stays(plants):
    extended = plants["compiled"].extend("hydro_governor")
    theta = np.tile(extended.parameters.nominal, (3, 1))
    theta[:, -len(HYDRO_GOVERNOR.parameters)] = [0.0, 2.0, 8.0]
    values = extended.simulate(theta, flat()).require_ok().values
    assert np.abs(values - np.array([0.7, 0.15])[:, None]).max() < 1e-9


def test_equations_are_those_of_the_block_diagram():
    """Small signals: temporary and permanent droop, gate and water as transfer functions."""
    K, TR, R, TG, TW, h = 2.5, 5.0, 0.05, 0.3, 1.2, 1e-3
    time = np.arange(0, 20, h)
    speed = 0.004 * np.sin(2 * time) * np.exp(-time / 4) + 0.001 * np.clip(time, 0, 1)

    def slopes(state, k):
        _, *slope = hydro(0.0, 1.0 + speed[k], 0.6, *state, K, TR, R, TG, TW, 0.0)
        return np.array(slope)

    state, found = np.zeros(3), []
    for k in range(len(time)):
        found.append(hydro(0.0, 1.0 + speed[k], 0.6, *state, K, TR, R, TG, TW, 0.0)[0])
        state = state + h * slopes(state + 0.5 * h * slopes(state, k), k)
    governor = (-K * np.array([TR, 1.0]), [TR * (1 + K * R), K * R])
    numerator = np.polymul(governor[0], [-TW, 1.0])
    denominator = np.polymul(np.polymul(governor[1], [TG, 1.0]), [TW / 2, 1.0])
    _, expected, _ = lsim((numerator, denominator), speed, time)
    assert np.abs(expected).max() > 3e-3
    assert np.abs(np.array(found) - expected).max() < 2e-5


def test_it_is_close_to_the_standard_model(plants):
    """HYGOV differs by its head, which is nonlinear: the water starting time counts at the flow of the start."""
    extended = plants["compiled"].extend("hydro_governor")
    gate = 0.7 / 1.2 + 0.08
    values = {"K": 2.5, "TR": 5.0, "R": 0.05, "TG": 0.3, "TW": 1.5 * gate, "db": 0.0}
    theta = extended.parameters.nominal.copy()
    theta[-len(values) :] = [values[one.name] for one in HYDRO_GOVERNOR.parameters]
    governed = plants["HYGOV"]
    expected = governed.simulate(governed.parameters.nominal).values[0]
    found = extended.simulate(theta).values[0]
    without = plants["compiled"].simulate(plants["compiled"].parameters.nominal).values[0]
    assert np.std(found - expected) < 0.15 * np.std(without - expected)
