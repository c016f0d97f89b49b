"""The governor of a gas turbine at a unit without governor."""

import numpy as np
import pytest
from scipy.signal import lsim

from errorscreen.effects import effects_of
from errorscreen.effects.gas_governor import GAS_GOVERNOR, gas
from errorscreen.models import DEVICES
from errorscreen.models.governors.ggov1 import GGOV1
from errorscreen.models.machines.round_rotor import GENROU
from errorscreen.models.unit import Record, unit
from tests.plants import dip, flat, plant, random_rows

MACHINE = Record(GENROU, {"D": 1.0})


@pytest.fixture(scope="module")
def plants():
    """The same machine by both engines, driven by a dip."""
    device, options = unit([MACHINE]), {"effects": (GAS_GOVERNOR,)}
    return {
        engine: plant(device, dip(stop=4.0), engine=engine, **options) for engine in ("compiled", "numpy")
    }


def test_only_units_without_governor_may_lack_it():
    assert GAS_GOVERNOR in effects_of("", *unit([MACHINE]).tags)
    assert GAS_GOVERNOR not in effects_of("", *unit([MACHINE, Record(GGOV1, {})]).tags)
    assert all(GAS_GOVERNOR not in effects_of(device.name, *device.tags) for device in DEVICES.values())


def test_strength_zero_is_an_exact_identity(plants):
    base = plants["compiled"]
    extended = base.extend("gas_governor")
    theta = random_rows(extended, 9, seed=1)
    theta[:, : len(base.parameters)] = base.parameters.nominal
    theta[::3, len(base.parameters)] = 0.0
    plain = base.simulate(theta[:, : len(base.parameters)]).values
    mixed = extended.simulate(theta).values
    assert np.array_equal(mixed[::3], plain[::3])
    assert np.abs(mixed[1::3] - plain[1::3]).max() > 1e-3


def test_engines_agree(plants):
    compiled, reference = (plants[engine].extend("gas_governor") for engine in ("compiled", "numpy"))
    theta = random_rows(compiled, 5, seed=2)
    assert np.array_equal(compiled.simulate(theta).values, reference.simulate(theta).values, equal_nan=True)


def test_the_equilibrium_stays(plants):
    extended = plants["compiled"].extend("gas_governor")
    theta = np.tile(extended.parameters.nominal, (3, 1))
    theta[:, -len(GAS_GOVERNOR.parameters)] = [0.0, 5.0, 30.0]
    values = extended.simulate(theta, flat()).require_ok().values
    assert np.abs(values - np.array([0.7, 0.15])[:, None]).max() < 1e-9


def test_equations_are_those_of_the_block_diagram():
    """Small signals: droop, PI controller, valve and turbine as transfer functions of speed and power."""
    K, TI, R, TA, TB, TP, h = 12.0, 5.0, 0.04, 0.4, 0.3, 1.0, 1e-3
    time = np.arange(0, 20, h)
    speed = 0.004 * np.sin(2 * time) * np.exp(-time / 4) + 0.001 * np.clip(time, 0, 1)
    power = 0.05 * np.sin(3 * time) * np.exp(-time / 5)

    def found_at(state, k):
        return gas(0.0, 1.0 + speed[k], 0.6 + power[k], 0.6, 0.6, *state, K, TI, R, TA, TB, TP, 0.0)

    state, found = np.zeros(4), []
    for k in range(len(time)):
        found.append(found_at(state, k)[0])
        middle = state + 0.5 * h * np.array(found_at(state, k)[1:])
        state = state + h * np.array(found_at(middle, k)[1:])
    _, measured, _ = lsim(([1.0], [TP, 1.0]), power, time)
    denominator = np.polymul([TI, 0.0], np.polymul([TA, 1.0], [TB, 1.0]))
    _, expected, _ = lsim((K * np.array([TI, 1.0]), denominator), -speed - R * measured, time)
    assert np.abs(expected).max() > 1e-2
    assert np.abs(np.array(found) - expected).max() < 1e-4


def test_the_request_stays_within_the_limits_and_does_not_wind_up():
    states = [0.0, 0.9, 0.4, 0.4]
    _, _, d_z, d_v, _ = gas(0.0, 0.9, 0.8, 0.8, 0.8, *states, 20.0, 5.0, 0.04, 0.5, 0.3, 1.0, 0.0)
    assert d_v == pytest.approx((0.4 - 0.4) / 0.5)  # Pm0 + 0.4 is the most
    assert d_z < 0
