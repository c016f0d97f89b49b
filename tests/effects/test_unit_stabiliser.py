"""The stabiliser that the search adds to a unit of standard models: two equal lead-lags."""

import numpy as np
import pytest
from scipy.signal import lsim

from errorscreen.effects import effects_of
from errorscreen.effects.stabiliser import (
    STABILISER,
    STABILISER_INPUT,
    UNIT_STABILISER,
    stabiliser,
    stabiliser_field,
    stabiliser_input,
)
from errorscreen.models import DEVICES
from errorscreen.models.exciters.sexs import SEXS
from errorscreen.models.machines.round_rotor import GENROU
from errorscreen.models.stabilisers.ieeest import IEEEST
from errorscreen.models.unit import Record, unit
from tests.plants import dip, flat, plant, random_rows

MACHINE = Record(GENROU, {"D": 1.0})
EXCITER = Record(SEXS, {"K": 50.0, "TA_TB": 0.2, "TB": 5.0, "TE": 0.05})
VALUES = {"K": 8.0, "TW": 10.0, "T1_T2": 4.0, "T2": 0.04, "Vmax": 0.06}


@pytest.fixture(scope="module")
def plants():
    """The same unit by both engines, and with IEEEST, driven by a dip."""
    event, effects = dip(stop=4.0), (STABILISER_INPUT,)
    device = unit([MACHINE, EXCITER])
    lead_lag = {"T1": 0.16, "T2": 0.04, "T3": 0.16, "T4": 0.04}
    stabilised = Record(
        IEEEST, {**lead_lag, "T5": 10.0, "T6": 10.0, "KS": 8.0, "LSMAX": 0.06, "LSMIN": -0.06}
    )
    return {
        "compiled": plant(device, event, effects=effects),
        "numpy": plant(device, event, effects=effects, engine="numpy"),
        "bare": plant(unit([MACHINE]), event, effects=(UNIT_STABILISER,)),
        "IEEEST": plant(unit([MACHINE, EXCITER, stabilised]), event, effects=()),
    }


def test_it_acts_at_the_summing_point_where_there_is_one():
    assert STABILISER_INPUT in effects_of("", *unit([MACHINE, EXCITER]).tags)
    assert UNIT_STABILISER in effects_of("", *unit([MACHINE]).tags)
    tags = unit([MACHINE, EXCITER, Record(IEEEST, {})]).tags
    assert all(effect.name != "stabiliser" for effect in effects_of("", *tags))


def test_the_case_study_keeps_its_own():
    for device in DEVICES.values():
        found = [e for e in effects_of(device.name, *device.tags) if e.name == "stabiliser"]
        assert found == ([STABILISER] if device.name == "synchronous_machine" else [])
    assert STABILISER.equations is stabiliser
    assert STABILISER.states == ("w", "x")


@pytest.mark.parametrize("name", ["compiled", "numpy", "bare"])
def test_strength_zero_is_an_exact_identity(plants, name):
    base = plants[name]
    extended = base.extend("stabiliser")
    theta = random_rows(extended, 9, seed=1)
    theta[:, : len(base.parameters)] = base.parameters.nominal
    theta[::3, len(base.parameters)] = 0.0
    plain = base.simulate(theta[:, : len(base.parameters)]).values
    mixed = extended.simulate(theta).values
    assert np.array_equal(mixed[::3], plain[::3])
    assert np.array_equal(extended.simulate(theta[::3]).values, plain[::3])
    assert np.abs(mixed[1::3] - plain[1::3]).max() > 1e-3


def test_engines_agree(plants):
    compiled, reference = (plants[engine].extend("stabiliser") for engine in ("compiled", "numpy"))
    theta = random_rows(compiled, 5, seed=2)
    assert np.array_equal(compiled.simulate(theta).values, reference.simulate(theta).values, equal_nan=True)


@pytest.mark.parametrize("name", ["compiled", "bare"])
def test_the_equilibrium_stays(plants, name):
    extended = plants[name].extend("stabiliser")
    theta = np.tile(extended.parameters.nominal, (3, 1))
    theta[:, len(plants[name].parameters)] = [0.0, 10.0, 40.0]
    values = extended.simulate(theta, flat()).require_ok().values
    assert np.abs(values - np.array([0.7, 0.15])[:, None]).max() < 1e-9


@pytest.mark.parametrize(("equations", "limit"), [(stabiliser_input, (1e9,)), (stabiliser_field, ())])
def test_equations_are_those_of_the_block_diagram(equations, limit):
    K, TW, ratio, T2, h = 3.0, 5.0, 4.0, 0.05, 1e-3
    time = np.arange(0, 10, h)
    speed = 0.004 * np.sin(8 * time) * np.exp(-time / 4) + 0.001 * np.clip(time, 0, 1)

    def answer(state, omega):
        return np.array(equations(0.3, omega, *state, K, TW, ratio, T2, *limit))

    state, found = np.zeros(3), []
    between = 1.0 + 0.5 * (speed + np.append(speed[1:], speed[-1]))
    for k, omega in enumerate(1.0 + speed):
        signal, *slopes = answer(state, omega)
        found.append(signal - 0.3)
        state = state + h * answer(state + 0.5 * h * np.array(slopes), between[k])[1:]
    lead, lag = np.polymul([ratio * T2, 1.0], [ratio * T2, 1.0]), np.polymul([T2, 1.0], [T2, 1.0])
    _, expected, _ = lsim((K * np.polymul(lead, [TW, 0.0]), np.polymul(lag, [TW, 1.0])), speed, time)
    assert np.abs(expected).max() > 3e-2
    assert np.abs(np.array(found) - expected).max() < 2e-5


def test_the_signal_is_limited():
    state = {"value": 0.0, "w": 0.0, "x": 0.0, "z": 0.0, "K": 10.0, "TW": 10.0, "T1_T2": 4.0, "T2": 0.04}
    assert stabiliser_input(**state, omega=1.01, Vmax=0.05)[0] == 0.05
    assert stabiliser_input(**state, omega=0.99, Vmax=0.05)[0] == -0.05
    assert stabiliser_field(**state, omega=1.1)[0] == 2.0


def test_it_is_the_standard_model_with_equal_lead_lags(plants):
    extended, stabilised = plants["compiled"].extend("stabiliser"), plants["IEEEST"]
    theta = extended.parameters.nominal.copy()
    theta[-len(VALUES) :] = [VALUES[one.name] for one in STABILISER_INPUT.parameters]
    expected = stabilised.simulate(stabilised.parameters.nominal).values[0]
    without = plants["compiled"].simulate(plants["compiled"].parameters.nominal).values[0]
    error = np.abs(extended.simulate(theta).values[0] - expected).max()
    assert np.abs(without - expected).max() > 1e-2
    assert error < 1e-4 * np.abs(without - expected).max()
