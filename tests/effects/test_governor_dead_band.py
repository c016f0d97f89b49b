"""Dead band that the search adds to a governor whose record has none."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from errorscreen.events import Playback
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.assembly import library_of
from errorscreen.testing import check_effect

TIME = np.arange(0.0, 6.0, 0.01)
AFTER = np.clip(TIME - 1.0, 0.0, None)
CONSTANTS = {"R": 0.05, "T1": 0.3, "T2": 2.0, "T3": 7.0, "Dt": 0.5}


@pytest.fixture(scope="module")
def plant():
    """Machine with TGOV1, of which the speed and the mechanical power are recorded; the frequency falls."""
    records = [Record(PARTS["GENCLS"], {"H": 4.0, "D": 2.0}), Record(PARTS["TGOV1"], CONSTANTS)]
    angle = -0.4 * (AFTER - np.sin(2.0 * AFTER) / 2.0)
    event = Playback(
        TIME, "fall", 1.0, {"V": np.ones(len(TIME)), "angle": angle}, {"V": 1.0, "P": 0.6, "Q": 0.1}
    )
    return PlantSimulator(unit(records), event, channels=("P", "Q", "Pm", "speed"), step=0.005, n_threads=1)


def with_band(plant, d):
    extended = plant.extend("governor_dead_band")
    return extended.simulate([*plant.parameters.nominal, d]).require_ok().values[0]


def test_off_it_is_an_exact_identity_and_it_does_not_move_the_start(plant):
    check_effect(plant, "governor_dead_band")
    quiet = TIME < 1.0
    for values in (plant.baseline(), with_band(plant, 1e-3)):
        assert np.ptp(values[:, quiet], axis=1).max() < 1e-12


@pytest.mark.parametrize("d", [5e-4, 1e-3])
def test_the_mechanical_power_is_that_of_tgov1_behind_a_dead_band(plant, d):
    """Its equations written once more, with an adaptive integration at the simulated speed."""
    _, _, Pm, speed = with_band(plant, d)
    R, T1, T2, T3, Dt = CONSTANTS.values()

    def slope(t, state):
        w = np.interp(t, TIME, speed) - 1.0
        seen = np.sign(w) * max(abs(w) - d, 0.0)
        g, x = state
        return [(0.6 - seen / R - g) / T1, (g - x) / T3]

    solution = solve_ivp(slope, (0.0, TIME[-1]), [0.6, 0.6], t_eval=TIME, max_step=0.01, rtol=1e-8)
    g, x = solution.y
    expected = x + T2 / T3 * (g - x) - Dt * (speed - 1.0)
    assert np.abs(Pm - expected).max() < 2e-6
    assert np.abs(speed - 1.0).max() > 1.5 * d  # the band is left
    assert np.abs(Pm - plant.baseline()[2]).max() > 1e-3


def test_a_band_wider_than_the_event_leaves_the_damping_of_the_turbine_alone(plant):
    _, _, Pm, speed = with_band(plant, 0.01)
    assert np.abs(speed - 1.0).max() < 0.01
    assert np.abs(Pm - (0.6 - CONSTANTS["Dt"] * (speed - 1.0))).max() < 1e-12


def test_it_is_offered_only_to_governors_without_one():
    def offered(*records):
        device = unit([Record(PARTS["GENCLS"], {}), *records])
        return "governor_dead_band" in {effect.name for effect in library_of(device)}

    for name in ("TGOV1", "IEEEG1", "HYGOV", "GAST", "IEESGO"):
        assert offered(Record(PARTS[name], {}))
    assert offered(Record(PARTS["GGOV1"], {"DB": 0.0}))
    assert not offered(Record(PARTS["GGOV1"], {"DB": 6e-4}))
    assert not offered()
    assert "speed_reference" not in unit([Record(PARTS["GENCLS"], {})]).ports
