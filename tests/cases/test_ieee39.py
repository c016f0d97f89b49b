"""The case study: equilibrium, visibility of all parameters, limits, and the classical variant against ANDES."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from errorscreen.cases import ieee39_events, load_ieee39
from errorscreen.cases.ieee39 import PLANTS
from errorscreen.cases.ieee39_data import MACHINES, ieee39_network
from errorscreen.engine import Engine
from errorscreen.events import BusFault, GridEvent
from errorscreen.models import DEVICES, FixedMachine
from errorscreen.simulators import PowerSystemSimulator
from errorscreen.testing import check_simulator
from tests.plants import random_rows
from tests.power.andes_reference import EPSILON, andes, prepare
from tests.power.grid_reference import trajectory

SYSTEM = load_ieee39()
EVENTS = ieee39_events()
#: rms error of the default step over the range of the response, at most; twice the step misses all but one
STEP_ERROR = {
    "fault at bus 3": 5e-4,
    "fault at bus 3, 150 ms": 2.5e-4,
    "fault at bus 3, impedance": 5e-5,
    "fault at bus 16": 1e-4,
    "fault at bus 26": 1e-4,
    "fault at bus 4, 120 ms": 1.5e-4,
    "fault at bus 3, low load": 5e-4,
    "line 2-3 out": 1e-7,
    "loads 3 and 4 up": 5e-8,
}


def inside(*quantities):
    """Quantities inside the plants at the nominal parameters during the default event."""
    simulator = load_ieee39(channels=dict.fromkeys(quantities, 2))
    simulator._engine = Engine(replace(SYSTEM._engine.model, outputs=quantities))
    simulator._grid = SYSTEM._grid
    simulator.observed, simulator._reducers = SYSTEM.observed, {}
    return dict(zip(quantities, simulator.baseline(), strict=True))


def test_contract():
    check_simulator(SYSTEM)


def test_parameters_are_those_of_the_three_devices():
    assert sorted(SYSTEM.parameters.names) == sorted(
        n for _, d, *_ in PLANTS for n in DEVICES[d].candidates.names
    )
    assert np.allclose(SYSTEM.parameters.bounds, SYSTEM.parameters.nominal[:, None] * [0.7, 1.3])


def test_every_parameter_vector_rests_at_its_own_equilibrium():
    theta = np.vstack([SYSTEM.parameters.nominal, random_rows(SYSTEM, 40)])
    for level in (0.9, 1.0):
        y = SYSTEM.simulate(theta, GridEvent(SYSTEM.event.time, level=level)).require_ok().values
        assert np.abs(y - y[:1, :, :1]).max() < 1e-9
    assert y[0, :, 0] == pytest.approx([1.0487, 2.3909], abs=5e-5)  # the load flow, as printed for the system


def test_all_parameters_are_visible():
    nominal = SYSTEM.parameters.nominal
    y = SYSTEM.simulate(np.vstack([nominal, nominal + np.diag(0.1 * nominal)])).require_ok().values
    rms = np.sqrt(((y[1:] - y[0]) ** 2).mean(axis=-1))
    assert np.all(rms.min(axis=0) > 1e-3 * rms.max(axis=0))


def test_limits_and_ride_through_bind():
    Iq, Ip, w, Qcmd = inside("pv_plant.Iq_cmd", "pv_plant.Ip_cmd", "pv_plant.w", "dfig_plant.Qcmd").values()
    assert w.max() == 1.0
    assert w[[0, -1]].max() == 0.0
    assert np.hypot(Iq, Ip).max() == pytest.approx(1.1)
    assert Qcmd.max() == 0.436


@pytest.mark.parametrize("name", STEP_ERROR)
def test_events_simulate_and_the_default_step_is_fine_enough(name):
    theta = random_rows(SYSTEM, 16)
    coarse, fine = (
        load_ieee39(step=step).simulate(theta, EVENTS[name]).require_ok().values for step in (0.0025, 0.0005)
    )
    reach = np.ptp(fine, axis=-1).max(axis=0)
    assert np.all(reach > 0.01)
    assert np.all(np.abs(coarse - fine).max(axis=(0, 2)) < 5e-3 * reach)
    assert np.all(np.sqrt(((coarse - fine) ** 2).mean(axis=-1)).max(axis=0) < STEP_ERROR[name] * reach)


def test_every_event_has_a_bound_for_its_step_error():
    assert set(STEP_ERROR) == set(EVENTS)


@pytest.mark.parametrize(("name", "bound"), [("fault at bus 26", 1e-5), ("fault at bus 3", 1e-3)])
def test_trajectory_agrees_with_an_independent_form(name, bound):
    """All 39 buses, ten machines and plants for an adaptive solver; what is left are corners between two steps."""
    simulator = load_ieee39(step=5e-4)
    theta = random_rows(simulator, 1)[0]
    found = simulator.simulate(theta, EVENTS[name]).require_ok().values[0]
    expected = trajectory(simulator, theta, EVENTS[name])
    error = np.nanmax(np.abs(found - expected), axis=1)
    assert np.all(error < bound * np.ptp(found, axis=1))


def classical(event, D, network=None):
    """All ten units as classical machines."""
    machines = [FixedMachine(bus, H, Xd1, D=D * 2 * H) for _, bus, H, _, Xd1, *_ in MACHINES]
    channels = {f"V{i}": i for i in (2, 16, 38)}
    return PowerSystemSimulator(network or ieee39_network(), [], machines, channels=channels, event=event)


def test_classical_machines_keep_their_energy():
    r"""Without damping, losses and loads, kinetic energy plus half the reactive power is constant.

    The grid is then one of reactances between electromotive forces of constant size, whose reactive power is
    :math:`\sum_{ij} B_{ij} E_i E_j \cos\delta_{ij}`, and half its derivative in an angle is the active power there.
    """
    network = ieee39_network()
    lossless = replace(
        network,
        loads=(),
        branches=tuple(replace(b, r=0.0) for b in network.branches),
        generators=tuple(replace(g, p=0.0) for g in network.generators),
    )
    event = BusFault(np.arange(401) * 0.01, "fault", 1.0, bus=3, duration=0.1, impedance=0.01)
    simulator = classical(event, 0.0, lossless)
    quantities = ("omega", "Er", "Ei", "Vr", "Vi")
    simulator.channels = tuple(f"machine_{m.bus}.{q}" for m in simulator.machines for q in quantities)
    simulator._engine = Engine(replace(simulator._engine.model, outputs=simulator.channels))
    y = simulator.simulate(np.zeros((1, 0))).require_ok().values[0]
    omega, Er, Ei, Vr, Vi = y.reshape(len(simulator.machines), 5, -1)[:, :, 120:].transpose(1, 0, 2)
    Tj, Xd1 = np.array([[2 * m.H, m.Xd1] for m in simulator.machines]).T[:, :, None]
    kinetic = np.pi * 60.0 * (Tj * (omega - 1) ** 2).sum(axis=0)
    reactive = ((Ei * (Ei - Vi) + Er * (Er - Vr)) / Xd1).sum(axis=0)
    assert np.ptp(kinetic) > 0.01
    assert np.ptp(kinetic + 0.5 * reactive) < 1e-6 * np.ptp(kinetic)


@andes
def test_classical_variant_agrees_with_andes():
    event = BusFault(np.arange(501) * 0.01, "fault", 1.0, bus=3, duration=0.1, impedance=0.02j)
    simulator = classical(event, D=0.2)
    found = simulator.simulate(np.zeros((1, 0))).require_ok().values[0]
    time, expected = andes_gencls(event, D=0.2, buses=(2, 16, 38))
    away = np.min(np.abs(event.time[:, None] - [1.0, 1.1]), axis=1) > 0.005  # left and right values there
    there = np.array([np.interp(event.time[away], time, V) for V in expected])
    assert np.ptp(found) > 0.1
    assert np.abs(found[:, away] - there).max() < 2e-5


def andes_gencls(event, D, buses, h=0.001):
    """Time and voltages that ANDES finds for the fault with GENCLS at every generator."""
    import andes

    prepare()
    network = ieee39_network()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        system = andes.System(no_output=True, default_config=True)
        base = {"Sn": network.base_mva, "Vn": 345.0}
        for bus in network.buses:
            system.add("Bus", {"idx": bus.number, "Vn": 345.0})
        for g in network.generators:
            model = "Slack" if g.bus == network.slack else "PV"
            system.add(model, {"idx": f"g{g.bus}", "bus": g.bus, "p0": g.p, "v0": g.v, **base})
        for i, load in enumerate(network.loads):
            system.add("PQ", {"idx": f"l{i}", "bus": load.bus, "p0": load.p, "q0": load.q, "Vn": 345.0})
        for i, b in enumerate(network.branches):
            ends = {"bus1": b.from_bus, "bus2": b.to_bus, "Vn1": 345.0, "Vn2": 345.0, "Sn": network.base_mva}
            values = {"r": b.r - EPSILON, "x": b.x - EPSILON, "b": b.b, "tap": b.tap, "phi": b.shift}
            system.add("Line", {"idx": f"b{i}", **ends, **values})
        for _, bus, H, _, Xd1, *_ in MACHINES:
            system.add(
                "GENCLS",
                {"bus": bus, "gen": f"g{bus}", "M": 2 * H, "D": D * 2 * H, "xd1": Xd1, "fn": 60.0, **base},
            )
        x = event.impedance.imag
        times = {"tf": event.start, "tc": event.start + event.duration}
        system.add("Fault", {"bus": event.bus, "xf": x, "rf": 0.0, **times})
        system.setup()
        system.PFlow.config.tol = 1e-12
        assert system.PFlow.run()
        config = system.TDS.config
        config.tf, config.tstep, config.fixt, config.shrinkt, config.tol, config.no_tqdm = (
            5.0,
            h,
            1,
            0,
            1e-8,
            1,
        )
        assert system.TDS.run()
    columns = [network.index(bus) for bus in buses]
    voltages = system.dae.ts.y[:, system.Bus.v.a[columns]]
    return np.array(system.dae.ts.t), voltages.T
