"""Loads under test: equilibrium, identity, the static law, and motors against a direct solution without a filter."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from errorscreen.data.observations import Observation
from errorscreen.discovery import CauseFinder
from errorscreen.events import BusFault, GridEvent, LineTrip, LoadStep
from errorscreen.exceptions import InputError
from errorscreen.models.machines.fixed import FixedMachine
from errorscreen.power.elements import Branch, Bus, Generator, Load
from errorscreen.power.network import Network
from errorscreen.simulators import LoadUnderTest, PowerSystemSimulator, Unit
from errorscreen.testing import check_effect, check_simulator
from tests.simulators.grid.test_simulator import FAULT, TIME, network

LOADS = (LoadUnderTest(3), LoadUnderTest(5))
CHANNELS = {"U": 3, "P": (2, 3), "other": (4, 3)}
EFFECTS = ("static_active", "static_reactive", "frequency_dependence", "motor", "latent_dP", "latent_dQ")


def grid(loads=LOADS, **options):
    """The ring of the other tests with machines in place of two plants."""
    machines = [
        FixedMachine(bus, H=H, Xd1=0.1, Xd=0.6, Xq=0.5, D=1.0) for bus, H in ((1, 5.0), (2, 3.0), (4, 2.0))
    ]
    plant = Unit(5, "pv_plant", 50.0, {"dV_LV": 0.1})
    return PowerSystemSimulator(
        network(), [plant], machines, loads=loads, channels=CHANNELS, **{"event": FAULT, **options}
    )


@pytest.fixture(scope="module")
def ring():
    return grid()


def test_loads_under_test_change_nothing_by_themselves(ring):
    check_simulator(ring, n=5)
    assert np.array_equal(ring.baseline(), grid(()).baseline())


@pytest.mark.parametrize("bus", [3, 5])  # at bus 5 there is also a plant
@pytest.mark.parametrize("effect", EFFECTS)
def test_effects_keep_their_contract(ring, bus, effect):
    check_effect(ring, f"load_{bus}.{effect}")


@pytest.mark.parametrize("effect", EFFECTS[:4])
def test_effects_leave_the_equilibrium_alone(ring, effect):
    extended = ring.extend(f"load_3.{effect}")
    low, high = extended.parameters.bounds.T
    theta = np.random.default_rng(0).uniform(low, high, (10, len(low)))
    theta[:, : len(ring.parameters)] = ring.parameters.nominal
    still = extended.simulate(theta, GridEvent(TIME)).require_ok().values
    assert np.abs(still - still[:1, :, :1]).max() < 1e-9


def test_engines_agree(ring):
    other = grid(engine="numpy")
    event = BusFault(TIME[:81], "fault", 0.5, bus=3, duration=0.1, impedance=0.05j)
    for effect in EFFECTS[:4]:
        one, two = (s.extend(f"load_3.{effect}").baseline(event) for s in (ring, other))
        assert np.array_equal(one, two)


@pytest.mark.parametrize("c", [0.0, 1.0])
def test_what_arrives_at_a_load_follows_the_static_law(ring, c):
    """Constant power and constant current, while voltage and frequency sink slowly behind a load step nearby."""
    event = LoadStep(np.arange(0, 6, 0.01), "step", 0.5, factor=1.5, buses=(5,))
    both = ring.extend("load_3.static_active")
    u, p, other = both.simulate([*ring.parameters.nominal, 1.0, c], event).require_ok().values[0]
    r = u / u[0]
    power = p + other
    late = event.time > 2
    law = power[0] * (c * r + (1 - c))
    assert r[-1] < 0.99
    assert np.abs(power - law)[late].max() < 2e-4
    impedance = ring.baseline(event)
    assert np.abs((impedance[1] + impedance[2]) - power[0] * (impedance[0] / u[0]) ** 2).max() < 1e-9


def test_frequency_dependence_damps_the_swings(ring):
    plain = ring.baseline()[1]
    damped = ring.extend("load_3.frequency_dependence", k={"nominal": 5.0}).baseline()[1]
    late = TIME > 1.5
    assert np.std(np.diff(damped[late])) < np.std(np.diff(plain[late]))


# a stiff source feeds a load over a reactance; motors draw 60 % of it
E_X, LINE_X, SHARE, INERTIA, CONSTANT = 0.02, 0.15, 0.6, 0.5, 0.7
RS, XS, XM, RR, XR, SLIP = 0.031, 0.1, 3.2, 0.018, 0.18, 0.012


def two_buses(event, **options):
    line = Network(
        (Bus(1), Bus(2)), (Branch(1, 2, 0.0, LINE_X),), slack=1, loads=(Load(2, 1.2, 0.4),),
        generators=(Generator(1, v=1.0),),
    )  # fmt: skip
    return PowerSystemSimulator(
        line, [], [FixedMachine(1, H=1e6, Xd1=E_X)], channels={"U": 2}, event=event,
        **options,
    )  # fmt: skip


def direct(event, V0):
    """Magnitude at the load, with the motors' current solved together with the grid."""
    drawn = 1.2 + 0.4j
    Y_load = np.conj(drawn) / abs(V0) ** 2
    E = V0 + 1j * (E_X + LINE_X) * Y_load * V0
    rotor = RR / SLIP + 1j * XR
    Y_motor = 1 / (RS + 1j * XS + 1j * XM * rotor / (1j * XM + rotor))
    scale = SHARE * drawn.real / (abs(V0) ** 2 * Y_motor.real)
    X1 = XS + XR * XM / (XR + XM)
    Z1, X0, T0 = RS + 1j * X1, XS + XM, (XR + XM) / (2 * np.pi * 60 * RR)
    flux = V0 - Z1 * Y_motor * V0
    torque = (flux * np.conj(Y_motor * V0)).real

    def voltage(t, flux):
        faulted = event.start <= t < event.start + event.duration
        Y = Y_load - scale * Y_motor + scale / Z1 + (1 / event.impedance if faulted else 0)
        source = E / (1j * (E_X + LINE_X)) + scale * flux / Z1
        return source / (1 / (1j * (E_X + LINE_X)) + Y)

    def slope(t, x):
        flux, slip = x[0] + 1j * x[1], x[2]
        current = (voltage(t, flux) - flux) / Z1
        d = -2j * np.pi * 60 * slip * flux - (flux - 1j * (X0 - X1) * current) / T0
        load = torque * (CONSTANT + (1 - CONSTANT) * ((1 - slip) / (1 - SLIP)) ** 2)
        return [d.real, d.imag, (load - (flux * np.conj(current)).real) / (2 * INERTIA)]

    times, x, out = event.time, np.array([flux.real, flux.imag, SLIP]), []
    edges = [times[0], event.start, event.start + event.duration, times[-1]]
    for begin, end in pairwise(edges):
        inside = times[(times >= begin - 1e-9) & (times < end - 1e-9)]
        found = solve_ivp(slope, (begin, end - 1e-9), x, t_eval=inside, rtol=1e-8, atol=1e-10)
        out += [abs(voltage(t + 1e-12, a + 1j * b)) for t, a, b in zip(inside, *found.y[:2], strict=True)]
        x = solve_ivp(slope, (begin, end - 1e-9), x, rtol=1e-8, atol=1e-10).y[:, -1]
    return np.array(out)


@pytest.mark.parametrize(("duration", "lowest"), [(0.1, 0.85), (0.2, 0.8)])
def test_motors_against_a_direct_solution(duration, lowest):
    """Slower recovery behind a longer fault; the filter of the voltage is all that differs."""
    event = BusFault(np.arange(0, 3, 0.005), "fault", 0.5, bus=2, duration=duration, impedance=0.08j)
    effect = {"m": {"nominal": SHARE}, "H": {"nominal": INERTIA}, "c": {"nominal": CONSTANT}}
    errors = []
    for T, step in ((0.01, 0.0025), (0.001, 0.00025)):
        simulator = two_buses(event, loads=[LoadUnderTest(2, {"T": T})], step=step).extend(
            "load_2.motor", **effect
        )
        u = simulator.simulate(simulator.parameters.nominal).require_ok().values[0, 0]
        flow = simulator._flow(event)
        expected = direct(event, complex(flow.voltage[1]))
        settled = np.abs(event.time[: len(expected)] - 0.5 - duration / 2) > duration / 2 + 0.05
        errors.append(np.abs(u[: len(expected)] - expected)[settled].max())
    behind = event.time > 0.5 + duration
    assert u[behind].min() < lowest < u[0]  # motors slowed down
    assert errors[0] < 0.02
    assert errors[1] < 0.15 * errors[0]  # a tenth of the time constant, a tenth of the error


def test_hidden_motors_are_found(ring):
    """Beside other mechanisms of loads and plants; the truth has a tenth of the step, other parameters, and noise."""
    fine = grid(step=0.00025).extend("load_3.motor", m={"nominal": 0.35}, H={"nominal": 0.5})
    rng, observations = np.random.default_rng(3), []
    theta = fine.parameters.nominal
    theta[: len(ring.parameters)] *= rng.uniform(0.9, 1.1, len(ring.parameters))
    for event in (FAULT, LineTrip(TIME, "trip", 0.5, ends=(2, 3))):
        y = fine.simulate(theta, event).require_ok().values[0]
        noise = 0.01 * (y - y[:, :1]).std(axis=1)
        y = y + noise[:, None] * rng.standard_normal(y.shape)
        observations.append(Observation(event, y, noise, ring.channels, ring.units))
    candidates = [f"load_3.{name}" for name in EFFECTS[:4]] + ["load_5.motor", "pv_plant.volt_var", "scale_U"]
    finder = CauseFinder(ring, candidates, max_effects=1, n_draws=32, random_state=0).fit(observations)
    assert finder.verdict_.kind == "effect"
    assert finder.causes_[0].name == "load_3.motor"


def test_bad_loads_are_refused():
    with pytest.raises(InputError, match=r"no load at bus 2.*\[3, 5\]"):
        grid([LoadUnderTest(2)])
    with pytest.raises(InputError, match="given twice"):
        grid([LoadUnderTest(3), LoadUnderTest(3)])
    with pytest.raises(InputError, match=r"load at bus 3: unknown constant 'Tx'"):
        LoadUnderTest(3, {"Tx": 1.0})
