"""A unit behind a transformer and a line, recorded at their far end."""

from dataclasses import replace

import numpy as np
import pytest

from errorscreen.events import Playback
from errorscreen.exceptions import InputError
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.plant.connection import Connection

TIME = np.arange(0.0, 4.0, 0.005)
CONNECTION = Connection(0.01, 0.12, tap=1.03, shunt=0.05, auxiliary_p=0.04, auxiliary_q=0.02)


def dip(**signals):
    voltage = np.where((TIME > 1.0) & (TIME < 1.15), 0.75, 1.02)
    given = {"V": voltage, "angle": 0.05 * np.sin(TIME - 1.0) * (TIME > 1.0)}
    return Playback(TIME, "dip", 1.0, {**given, **signals}, {"V": 1.02, "P": 0.7, "Q": 0.1})


@pytest.fixture(scope="module")
def machine():
    return unit([Record(PARTS["GENROU"], {}), Record(PARTS["SEXS"], {})])


def response(plant):
    return plant.simulate(plant.parameters.nominal).require_ok().values[0]


@pytest.mark.parametrize("connection", [CONNECTION, replace(CONNECTION, conductance=0.03, turn=0.05)])
def test_a_unit_at_rest_gives_the_recorded_power(machine, connection):
    event = Playback(
        TIME, "rest", 1.0, {"V": 1.02 + 0 * TIME, "angle": 0 * TIME}, {"V": 1.02, "P": 0.7, "Q": 0.1}
    )
    P, Q = response(PlantSimulator(machine, event, connection=connection))
    assert np.abs(P - 0.7).max() < 1e-9
    assert np.abs(Q - 0.1).max() < 1e-9


def test_the_terminal_that_follows_drives_the_unit_to_the_same_current(machine):
    # the voltage of the terminal follows from V, P and Q of the point; imposed there, it must give the same current
    event = dip()
    P, Q = response(PlantSimulator(machine, event, connection=CONNECTION, step=0.005))
    V = event.signals["V"]
    inner = V * np.exp(1j * event.signals["angle"]) / CONNECTION.tap
    power = (P + CONNECTION.auxiliary_p) + 1j * (Q + CONNECTION.auxiliary_q - CONNECTION.shunt * V**2)
    current = np.conj(power / inner)
    terminal = inner + CONNECTION.impedance * current
    expected = terminal * np.conj(current)
    direct = Playback(
        TIME,
        "terminal",
        1.0,
        {"V": np.abs(terminal), "angle": np.unwrap(np.angle(terminal)) - np.angle(terminal[0])},
        {"V": abs(terminal[0]), "P": expected[0].real, "Q": expected[0].imag},
    )
    found = response(PlantSimulator(machine, direct, step=0.005))
    # between samples the two voltages are interpolated differently where they jump
    smooth = (TIME < 0.99) | (TIME > 1.5)
    assert np.abs(found[0] - expected.real)[smooth].max() < 5e-3
    assert np.sqrt(np.mean((found[0] - expected.real)[smooth] ** 2)) < 2e-3
    assert np.sqrt(np.mean((found[1] - expected.imag)[smooth] ** 2)) < 2e-3


def test_nothing_in_between_is_the_plain_playback(machine):
    event = dip()
    plain, connected = (PlantSimulator(machine, event, connection=c) for c in (None, Connection()))
    np.testing.assert_allclose(response(connected), response(plain), atol=1e-9)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"reactance": 12.0}, "Convert percent"),
        ({"tap": 0.0}, "tap is 0"),
        ({"resistance": -0.1}, "resistance is -0.1"),
        ({"shunt": np.nan}, "shunt is nan"),
    ],
)
def test_what_cannot_be_a_connection_is_refused(options, words):
    with pytest.raises(InputError, match=words):
        Connection(**options)


def test_one_point_is_recorded(machine):
    with pytest.raises(InputError, match="both given"):
        PlantSimulator(machine, dip(), connection=CONNECTION, grid_impedance=0.1j)
