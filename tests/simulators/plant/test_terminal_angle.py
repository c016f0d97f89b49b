"""Playback without a recorded angle or frequency."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from errorscreen.data.recordings import Recording
from errorscreen.exceptions import InputError
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator
from errorscreen.simulators.plant.terminal_angle import angle_behind, noise_of_angle

TIME = np.arange(0.0, 3.0, 0.01)
H, X_MACHINE, X_GRID, F0 = 3.0, 0.25, 0.4, 60.0
MACHINE = unit([Record(PARTS["GENCLS"], {"H": H, "D": 0.0})])


def swing():
    """Terminal phasor and power of a classical machine against a source whose magnitude falls from 0.7 to 1 s."""
    start = 1.02 * np.exp(0.0j)
    current = np.conj((0.8 + 0.15j) / start)
    behind, source = start + 1j * X_MACHINE * current, start - 1j * X_GRID * current

    def at(t, delta):
        E, far = (
            abs(behind) * np.exp(1j * delta),
            source * (1.0 - 0.15 * np.interp(t, [0.7, 1.0], [0.0, 1.0])),
        )
        current = (E - far) / (1j * (X_MACHINE + X_GRID))
        V = E - 1j * X_MACHINE * current
        return V, V * np.conj(current)

    def slope(t, x):
        power = at(t, x[0])[1].real
        return [2 * np.pi * F0 * x[1], (0.8 / (1 + x[1]) - power) / (2 * H)]

    run = solve_ivp(
        slope, (0, TIME[-1]), [np.angle(behind), 0.0], t_eval=TIME, rtol=1e-9, atol=1e-12, max_step=0.01
    )
    return at(TIME, run.y[0])


@pytest.fixture(scope="module")
def truth():
    return swing()


def recording(truth, *names, noise=1e-5, **more):
    V, S = truth
    found = {"V": abs(V), "P": S.real, "Q": S.imag, "angle": np.unwrap(np.angle(V)), **more}
    found = {name: values for name, values in found.items() if name in ("V", "P", "Q", *names)}
    return Recording.from_arrays(
        TIME, found, base_mva=100.0, f_nominal=F0, event_time=0.7, noise=dict.fromkeys(found, noise)
    )


def plant(recorded, **options):
    return PlantSimulator(MACHINE, recorded, constants={"Xsource": X_MACHINE}, effects=(), **options)


def test_voltage_and_power_give_the_angle_against_the_source(truth):
    V, S = truth
    angle, size = angle_behind(abs(V), S.real, S.imag, X_GRID)
    true = np.unwrap(np.angle(V))
    assert abs((angle - angle[0]) - (true - true[0])).max() < 1e-9
    E = V - 1j * X_GRID * np.conj(S / V)
    assert abs(size - abs(E)).max() < 1e-12
    recorded = recording(truth)
    simulator = plant(recorded, angle_reactance=X_GRID)
    errors = simulator.baseline() - [S.real, S.imag]
    assert abs(errors).max() < 2e-4
    resting = plant(recorded, constant_frequency=True)
    assert abs(resting.baseline() - [S.real, S.imag]).max() > 0.05  # the angle matters here
    (note,) = [one for one in simulator.observe(recorded).assumptions if "constant angle behind" in one]
    assert f"{abs(E).min():.3f} to {abs(E).max():.3f} pu in all" in note


def test_noise_of_the_angle_follows_from_that_of_voltage_and_power():
    at, noise = np.array([1.02, 0.8, 0.15]), (2e-3, 5e-3, 4e-3)
    draws = at + np.random.default_rng(0).normal(size=(20000, 3)) * noise
    drawn = np.angle(draws[:, 0] ** 2 - X_GRID * draws[:, 2] + 1j * X_GRID * draws[:, 1]).std()
    assert noise_of_angle(tuple(at), noise, X_GRID) == pytest.approx(drawn, rel=0.03)


def test_noise_of_power_makes_the_response_uncertain(truth):
    simulator = plant(recording(truth), angle_reactance=X_GRID)
    event = simulator.observe(recording(truth, noise=1e-3)).event
    assert set(event.noise) == {"V", "angle"}


def test_recorded_frequency_gives_the_angle_and_goes_before_what_is_stated(truth):
    V, S = truth
    f = F0 + np.gradient(np.unwrap(np.angle(V)), TIME) / (2 * np.pi)
    for name, more in (("f", {"f": f}), ("angle", {})):
        found = plant(recording(truth, name, **more), angle_reactance=3 * X_GRID - 0.2).baseline()
        assert abs(found - [S.real, S.imag]).max() < 2e-3


def test_a_constant_frequency_is_an_angle_that_rests(truth):
    recorded = recording(truth, "angle", angle=0.0 * TIME)
    assert np.array_equal(
        plant(recording(truth), constant_frequency=True).baseline(), plant(recorded).baseline()
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "angle_reactance with recorded V, P and Q, or constant_frequency"),
        ({"constant_frequency": True, "angle_reactance": 0.2}, "both given"),
        ({"angle_reactance": -0.1}, "angle_reactance"),
        ({"angle_reactance": 12.0}, "angle_reactance"),
    ],
)
def test_what_gives_no_angle_is_refused(truth, options, words):
    with pytest.raises(InputError, match=words):
        plant(recording(truth), **options)


def test_an_angle_from_power_needs_both_powers(truth):
    V, S = truth
    recorded = Recording.from_arrays(
        TIME, {"V": abs(V), "P": S.real}, base_mva=100.0, f_nominal=F0, event_time=0.7, given={"Q": 0.15}
    )
    with pytest.raises(InputError, match="Q was not recorded, so the angle of the terminal is unknown"):
        plant(recorded, angle_reactance=X_GRID)


def test_a_device_that_does_not_depend_on_the_angle_takes_none(truth):
    with pytest.raises(InputError, match="does not depend on the angle"):
        PlantSimulator("pv_plant", recording(truth), angle_reactance=0.2)
