"""Converters behind a transformer and a line, against references that solve for the terminal in other ways."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from errorscreen.events import Playback
from errorscreen.exceptions import InputError
from errorscreen.models.renewables.regc_a import behind
from errorscreen.models.renewables.regfm_a import behind as behind_grid_forming
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record, unit
from errorscreen.simulators import PlantSimulator, Unit
from errorscreen.simulators.plant.connection import Connection

TIME = np.arange(0.0, 2.0, 0.005)
CONNECTION = Connection(0.01, 0.12, tap=1.03, shunt=0.05, auxiliary_p=0.04, auxiliary_q=0.02)
START = {"V": 1.02, "P": 0.7, "Q": 0.1}


def voltage(t, depth):
    """Recorded voltage: a smooth dip to 1.02 - depth, while the angle moves."""
    dip = np.sin(np.pi * (t - 0.5)) ** 4 * ((t > 0.5) & (t < 1.5))
    return (1.02 - depth * dip) * np.exp(0.2j * np.sin(2 * (t - 0.5)) ** 2 * (t > 0.5))


def event(depth):
    V = voltage(TIME, depth)
    return Playback(TIME, "dip", 0.5, {"V": np.abs(V), "angle": np.angle(V)}, START)


def converter(name, **values):
    return unit([Record(PARTS[name], values)])


def simulated(device, depth, connection=CONNECTION, **options):
    plant = PlantSimulator(device, event(depth), connection=connection, step=0.0025, **options)
    return plant.simulate(plant.parameters.nominal).require_ok().values[0]


def at_point(V, current):
    """Power at the point from the current of the unit, written out with phasors."""
    power = V / CONNECTION.tap * np.conj(current) + 0.05j * np.abs(V) ** 2 - (0.04 + 0.02j)
    return np.array([power.real, power.imag])


def terminal_at_start():
    power = 0.74 + 1j * (0.12 - 0.05 * 1.02**2)
    inner = 1.02 / 1.03
    V = inner + (0.01 + 0.12j) * np.conj(power / inner)
    return V, np.conj(power / inner)


def ramp(x, zero, one):
    return np.clip((x - zero) / (one - zero), 0.0, 1.0)


@pytest.mark.parametrize(
    ("depth", "engine"), [(0.35, "compiled"), (0.75, "compiled"), (-0.3, "compiled"), (0.35, "numpy")]
)
def test_source_of_current(depth, engine):
    # without commands and without limit of the active current only (4) and (5) act, whose current depends on V alone
    found = simulated(converter("REGCA1", Lvplsw=0.0), depth, engine=engine)
    V0, I0 = terminal_at_start()
    aligned = I0 * np.exp(-1j * np.angle(V0))
    Ip, Iq = aligned.real, -aligned.imag
    E = voltage(TIME, depth) / CONNECTION.tap
    V = E.copy()
    for _ in range(4000):  # slow, but it can only end at a solution
        size = np.abs(V)
        active = Ip * ramp(size, 0.4, 0.8)
        reactive = np.maximum(Iq - 0.7 * np.maximum(size - 1.2, 0.0), -1.3)
        current = (active - 1j * reactive) * V / size
        V = 0.8 * V + 0.2 * (E + CONNECTION.impedance * current)
    assert np.abs(V - E - CONNECTION.impedance * current).max() < 1e-12
    np.testing.assert_allclose(found, at_point(E * CONNECTION.tap, current), atol=1e-9)


def test_source_of_current_at_any_voltage():
    # draws with all limits, the limit of the active current with and without its filter
    rng, n = np.random.default_rng(0), 50_000
    E = rng.uniform(0.2, 1.3, n) * np.exp(1j * rng.uniform(-3, 3, n))
    Z = rng.uniform(0, 0.03, n) + 1j * rng.uniform(0, 0.15, n)
    Ip, Iq, Vf = rng.uniform(0, 1.2, n), rng.uniform(-1, 1, n), rng.uniform(0.2, 1.2, n)
    T = np.where(rng.random(n) < 0.5, 0.0, 0.02)
    one = np.ones(n)
    current = np.empty(n, dtype=complex)
    current.real, current.imag = behind(
        E.real, E.imag, Z.real, Z.imag, Ip, Iq, Vf, one, 0.9 * one, 0.4 * one, 1.22 * one, 1.15 * one, 0.4 * one,
        0.8 * one, -1.3 * one, 0.7 * one, T, 0.001 * one,
    )  # fmt: skip
    V = E + Z * current
    size = np.abs(V)
    measured = np.where(T == 0.0, size, Vf)
    ceiling = np.where(measured >= 0.9, np.inf, 1.22 * ramp(measured, 0.4, 0.9))
    active = ramp(size, 0.4, 0.8) * np.minimum(Ip, ceiling)
    reactive = np.maximum(Iq - 0.7 * np.maximum(size - 1.15, 0.0), -1.3)
    np.testing.assert_allclose(current, (active - 1j * reactive) * V / size, atol=1e-9)


def test_source_of_voltage():
    X, T = 0.2, 0.02
    V0, I0 = terminal_at_start()
    aligned = I0 * np.exp(-1j * np.angle(V0))  # the commands do not move
    found = simulated(converter("REGCB1"), 0.3)

    def terminal(t, E):
        """Terminal voltage and current by Newton's method on the angle and magnitude of V."""
        source, theta = voltage(np.array([t]), 0.3)[0] / CONNECTION.tap, np.angle(V0)
        for _ in range(60):  # the frame of the converter turns with V
            Y = 1 / (1j * X)
            V = (source + CONNECTION.impedance * E * np.exp(1j * theta) * Y) / (1 + CONNECTION.impedance * Y)
            theta = np.angle(V)
        return V, (E * np.exp(1j * theta) - V) / (1j * X)

    def derivative(t, x):
        E = x[0] + 1j * x[1]
        V, _ = terminal(t, E)
        wanted = x[2] + 1j * X * aligned
        return [(wanted.real - x[0]) / T, (wanted.imag - x[1]) / T, (abs(V) - x[2]) / T]

    start = abs(V0) + 1j * X * aligned
    solved = solve_ivp(
        derivative, (0, TIME[-1]), [start.real, start.imag, abs(V0)], t_eval=TIME, rtol=1e-9, atol=1e-10
    )
    current = np.array([terminal(t, x[0] + 1j * x[1])[1] for t, x in zip(TIME, solved.y.T, strict=True)])
    np.testing.assert_allclose(found, at_point(voltage(TIME, 0.3), current), atol=2e-6)


@pytest.mark.parametrize("Imax", [2.0, 0.9])
def test_grid_forming(Imax):
    values = {"VFlag": 1.0, "mp": 0.02, "mq": 0.05, "kpv": 0.3, "kiv": 5.0, "Pmax": 9.0, "Pmin": -9.0, "Qmax": 9.0,
              "Qmin": -9.0, "Emax": 9.0, "Emin": -9.0, "Imax": Imax}  # fmt: skip
    found = simulated(converter("REGFMA1", **values), 0.2)
    X = 0.2
    V0, I0 = terminal_at_start()
    V0, I0 = V0 * np.exp(-1j * np.angle(V0)), I0 * np.exp(-1j * np.angle(V0))
    turned = np.exp(-1j * np.angle(terminal_at_start()[0]))
    S0 = V0 * np.conj(I0)

    def terminal(t, E):
        source, V = voltage(np.array([t]), 0.2)[0] / CONNECTION.tap * turned, V0
        for _ in range(300):
            current = (E - V) / (1j * X)
            current *= min(1.0, Imax / abs(current))
            V = 0.7 * V + 0.3 * (source + CONNECTION.impedance * current)
        return V, current

    def derivative(t, x):
        delta, P, Q, V, integral = x
        error = abs(V0) - 0.05 * (Q - S0.imag) - V
        at, current = terminal(t, (integral + 0.3 * error) * np.exp(1j * delta))
        S = at * np.conj(current)
        return [
            2 * np.pi * 60 * 0.02 * (S0.real - P), (S.real - P) / 0.02, (S.imag - Q) / 0.02, (abs(at) - V) / 0.02,
            5.0 * error,
        ]  # fmt: skip

    E0 = V0 + 1j * X * I0
    start = [np.angle(E0), S0.real, S0.imag, abs(V0), abs(E0)]
    solved = solve_ivp(derivative, (0, TIME[-1]), start, t_eval=TIME, rtol=1e-7, atol=1e-8, max_step=0.01)
    current = []
    for t, (delta, _, Q, V, integral) in zip(TIME, solved.y.T, strict=True):
        error = abs(V0) - 0.05 * (Q - S0.imag) - V
        current.append(terminal(t, (integral + 0.3 * error) * np.exp(1j * delta))[1])
    expected = at_point(voltage(TIME, 0.2), np.array(current) / turned)
    assert np.abs(current).max() == pytest.approx(Imax, abs=1e-6) or Imax == 2.0
    np.testing.assert_allclose(found, expected, atol=2e-5)


def test_limit_of_the_current_of_a_grid_forming_converter():
    rng = np.random.default_rng(1)
    n = 2000
    E, V = rng.uniform(0.2, 1.2, (2, n)) * np.exp(1j * rng.uniform(-1, 1, (2, n)))
    Z = rng.uniform(0, 0.05, n) + 1j * rng.uniform(0, 0.2, n)
    zero, one = np.zeros(n), np.ones(n)
    current = np.empty(n, dtype=complex)
    current.real, current.imag = behind_grid_forming(
        V.real, V.imag, Z.real, Z.imag, np.angle(E), zero, zero, zero, zero, zero, np.abs(E), zero, -9 * one, 9 * one,
        -9 * one, 9 * one, 1.1 * one, zero, zero, zero, zero, zero, zero, zero, 0.2 * one,
    )  # fmt: skip
    free = (E - V - Z * current) / 0.2j
    np.testing.assert_allclose(current, free * np.minimum(1.0, 1.1 / np.abs(free)), atol=1e-9)


def test_distributed_resources():
    """Driven by the terminal voltage that their own current gives, without a connection, they answer alike."""
    V = voltage(TIME, 0.25)
    found = simulated(converter("DERA1"), 0.25)
    inner = V / CONNECTION.tap
    current = np.conj((found[0] + 1j * found[1] + 0.04 + 0.02j - 0.05j * np.abs(V) ** 2) / inner)
    terminal = inner + CONNECTION.impedance * current
    power = terminal * np.conj(current)
    start = {"V": np.abs(terminal[0]), "P": power[0].real, "Q": power[0].imag}
    at_terminal = Playback(TIME, "dip", 0.5, {"V": np.abs(terminal), "angle": np.angle(terminal)}, start)
    plant = PlantSimulator(converter("DERA1"), at_terminal, step=0.0025)
    expected = plant.simulate(plant.parameters.nominal).require_ok().values[0]
    assert np.ptp(expected[1]) > 0.1
    np.testing.assert_allclose([power.real, power.imag], expected, atol=1e-4)


@pytest.mark.parametrize("names", [("REGCA1", "REECB1"), ("REGCB1",), ("REGFMA1",), ("DERA1",)])
def test_nothing_between_gives_the_same_bits_and_a_unit_at_rest_stays(names):
    device = unit([Record(PARTS[name], {}) for name in names])
    plain, connected = (simulated(device, 0.3, connection) for connection in (None, Connection()))
    np.testing.assert_array_equal(connected, plain)
    P, Q = simulated(device, 0.0)[:, TIME <= 0.5]
    assert np.abs(P - START["P"]).max() < 1e-9
    assert np.abs(Q - START["Q"]).max() < 1e-9


def test_a_grid_impedance_gives_the_recorded_voltage_back():
    # driven by the voltage behind the impedance that its own response gives, a converter sees the recorded voltage
    device = converter("REGCB1")
    power = simulated(device, 0.3, None)
    signals = {**event(0.3).signals, "P": power[0], "Q": power[1]}
    recorded = Playback(TIME, "dip", 0.5, signals, START)
    plant = PlantSimulator(device, recorded, grid_impedance=0.01 + 0.1j, step=0.0025)
    found = plant.simulate(plant.parameters.nominal).require_ok().values[0]
    np.testing.assert_allclose(found, power, atol=1e-5)


def test_a_converter_without_this_stage_and_a_simulated_grid_are_refused():
    with pytest.raises(InputError, match="cannot be connected to a grid"):
        Unit(2, converter("REGCA1"), 100.0)
    with pytest.raises(InputError, match="cannot be connected to a grid"):
        PlantSimulator(replace(converter("DERA1"), grid=None), event(0.1), connection=CONNECTION)
