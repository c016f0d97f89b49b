from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.cases.ieee39_data import MACHINES, ieee39_network
from errorscreen.exceptions import InputError
from errorscreen.power.elements import Branch, Bus, Shunt
from errorscreen.power.load_flow import solve_load_flow
from errorscreen.power.network import Network
from errorscreen.power.reduction import Reducer
from tests.power.andes_reference import andes, solve
from tests.power.grids import kron_reduction, networks, random_network, reduce_network

UNITS = tuple(bus for _, bus, *_ in MACHINES)
FLOW = solve_load_flow(ieee39_network())
STATES = {
    "before": lambda n: n,
    "fault with impedance": lambda n: n.with_fault(3, 0.001 + 0.01j),
    "bolted fault": lambda n: n.with_fault(3),
    "bolted fault at a terminal": lambda n: n.with_fault(30),
    "line out": lambda n: n.with_line_out(3, 4),
    "observed line out": lambda n: n.with_line_out(2, 25),
    "load step": lambda n: n.with_load_scaled(1.3, [4, 8]),
}


def currents(seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(5, len(UNITS))) + 1j * rng.normal(size=(5, len(UNITS)))


def reduced(network, **options):
    options = {
        "load_voltages": FLOW.voltage,
        "observed": (2, 39, 3),
        "flows": ((25, 2), (2, 3), (30, 2)),
        **options,
    }
    return reduce_network(network, UNITS, **options)


def full_solution(network, injected, Y):
    """Voltages of all buses for currents at the units, shape (n, n_buses); grounded buses as rows V = 0."""
    Y = Y.copy()
    right = np.zeros((len(injected), len(Y)), dtype=complex)
    right[:, network.indices(UNITS)] = injected
    for bus in network.grounded:
        i = network.index(bus)
        Y[i], Y[i, i], right[:, i] = 0, 1, 0
    return np.linalg.solve(Y, right.T).T


@pytest.mark.parametrize("state", STATES)
def test_equals_the_full_network(state):
    network = STATES[state](ieee39_network())
    found = reduced(network)
    V = full_solution(network, currents(), network.admittance(FLOW.voltage))
    scale = np.abs(V).max()
    assert np.abs(currents() @ found.impedance.T - V[:, network.indices(UNITS)]).max() < 1e-12 * scale
    assert np.abs(currents() @ found.transfer.T - V[:, network.indices([2, 39, 3])]).max() < 1e-12 * scale
    flow = replace(FLOW, network=network, voltage=V[0]).branch_flows
    k = [b.ends for b in network.branches].index((2, 25))
    arriving = found.arriving_power(currents())
    assert arriving.shape == (5, 3)
    assert arriving[0, 0] == pytest.approx(-flow[k, 0], rel=1e-11, abs=1e-11 * scale)


def test_flows_are_counted_where_they_arrive():
    """What arrives at both ends of a branch is, with the sign changed, what enters it."""
    found = reduced(ieee39_network(), flows=((2, 3), (3, 2), (22, 35)))
    injected = np.linalg.solve(found.impedance, FLOW.voltage[ieee39_network().indices(UNITS)])
    ends = [b.ends for b in ieee39_network().branches]
    flow = FLOW.branch_flows
    line, transformer = ends.index((2, 3)), ends.index((22, 35))
    expected = [-flow[line, 1], -flow[line, 0], -flow[transformer, 1]]
    assert found.arriving_power(injected) == pytest.approx(np.array(expected), abs=1e-9)


def test_the_load_flow_is_the_state_before():
    """Norton currents from the load flow give back all its voltages and the flow on the line 25-2."""
    y = {bus: 1 / (1j * row[2]) for _, bus, _, *row in MACHINES}
    found = reduced(ieee39_network(), admittances=y)
    at = ieee39_network().indices(UNITS)
    V, S = FLOW.voltage[at], np.array([FLOW.generation[bus] for bus in UNITS])
    norton = (S / V).conj() + np.array([y[bus] for bus in UNITS]) * V
    assert found.impedance @ norton == pytest.approx(V, abs=1e-10)
    assert found.transfer @ norton == pytest.approx(FLOW.voltage[[1, 38, 2]], abs=1e-10)
    assert found.arriving_power(norton)[0].real == pytest.approx(2.3909, abs=5e-5)


def test_a_bolted_fault_is_the_limit_of_a_small_impedance():
    exact = reduced(ieee39_network().with_fault(3))
    sizes = [1e-3, 1e-5, 1e-7, 1e-9]
    near = [reduced(ieee39_network().with_fault(3, 1j * x)) for x in sizes]
    distance = np.array([np.abs(n.impedance - exact.impedance).max() for n in near])
    assert np.all(exact.transfer[2] == 0)
    assert distance[0] > 1e-4
    assert distance[1:] == pytest.approx(distance[0] * np.array([1e-2, 1e-4, 1e-6]), rel=0.2)


def test_a_tiny_fault_impedance_is_not_taken_for_a_singular_grid():
    exact, near = (reduced(ieee39_network().with_fault(3, z)).impedance for z in (0, 1e-18))
    assert np.allclose(near, exact, rtol=0, atol=1e-14)


def test_a_fault_at_a_terminal_leaves_its_unit_without_voltage():
    found = reduced(ieee39_network().with_fault(30))
    k = UNITS.index(30)
    assert np.all(found.impedance[k] == 0)
    assert np.all(found.impedance[:, k] == 0)


@pytest.mark.parametrize("state", ["before", "fault with impedance", "line out", "load step"])
def test_kron_reduction_is_the_inverse_of_the_impedance(state):
    network = STATES[state](ieee39_network())
    Y = kron_reduction(network.admittance(FLOW.voltage), network.indices(UNITS))
    assert np.allclose(np.linalg.inv(Y), reduced(network).impedance, rtol=0, atol=1e-12)


@given(networks)
def test_the_order_of_the_terminals_does_not_matter(network):
    buses = [bus.number for bus in network.buses]
    V = np.ones(len(buses))
    one = reduce_network(network, buses, load_voltages=V)
    other = reduce_network(network, buses[::-1], load_voltages=V)
    assert np.allclose(one.impedance, other.impedance[::-1, ::-1])


@given(networks, st.floats(10, 1000))
def test_impedances_scale_with_the_base(network, base):
    """In ohms, with kV squared taken as 1, nothing changes."""
    buses = [bus.number for bus in network.buses]
    one, other = (
        reduce_network(n, buses, load_voltages=np.ones(len(buses))).impedance / n.base_mva
        for n in (network, network.with_base(base))
    )
    assert np.allclose(one, other, rtol=1e-10, atol=0)


def test_parallel_circuits_add_up_and_two_units_may_share_a_bus():
    branches = (Branch(1, 2, 0.0, 0.2, circuit="a"), Branch(2, 1, 0.0, 0.2, circuit="b"))
    network = Network((Bus(1), Bus(2)), branches, slack=1)
    found = reduce_network(
        network, [1, 1], load_voltages=[1.0, 1.0], observed=[2], flows=[(1, 2)], admittances={2: 1.0}
    )
    assert np.allclose(found.impedance, 1 + 0.1j)
    assert np.allclose(found.arriving_power([0.25, 0.25]), 0.25)


PURE = Network((Bus(1), Bus(2), Bus(3)), (Branch(1, 2, 0.0, 0.1), Branch(2, 3, 0.0, 0.3)), slack=1)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: reduced(ieee39_network(), observed=(40,)), "unknown bus '40'"),
        (lambda: reduced(ieee39_network(), flows=((25, 40),)), "unknown bus '40'"),
        (lambda: reduced(ieee39_network(), flows=((25, 3),)), "flows: no branch connects the buses 25 and 3"),
        (lambda: reduced(ieee39_network(), admittances={41: 1.0}), "admittances: unknown bus '41'"),
        (
            lambda: reduced(ieee39_network(), load_voltages=[1.0]),
            "one voltage in pu for each of the 39 buses",
        ),
        (lambda: reduced(ieee39_network(), load_voltages=None), "load_voltages has another shape"),
        (lambda: reduce_network(PURE, 1, load_voltages=np.ones(3)), "the buses are 1. Allowed: a list"),
        (
            lambda: reduce_network(PURE, [1], load_voltages=np.ones(3)),
            "reduction: the admittance matrix is singular.* Include loads, line charging",
        ),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(InputError, match=message):
        make()


@andes
@pytest.mark.parametrize("state", ["before", "fault with impedance", "bolted fault", "line out", "load step"])
def test_equals_a_full_solution_with_the_matrix_of_andes(state):
    network = STATES[state](ieee39_network())
    Y = solve(replace(network, shunts=(), grounded=frozenset()))[1]
    Y += np.diag(network.demand().conj() / FLOW.magnitude**2)
    for shunt in network.shunts:
        Y[network.index(shunt.bus), network.index(shunt.bus)] += complex(shunt.g, shunt.b)
    V = full_solution(network, currents(), Y)
    scale = np.abs(V).max()
    assert (
        np.abs(currents() @ reduced(network).impedance.T - V[:, network.indices(UNITS)]).max() < 1e-12 * scale
    )


def reducer(network, **options):
    options = {
        "load_voltages": FLOW.voltage,
        "observed": (2, 39, 3),
        "flows": ((25, 2), (2, 3), (30, 2)),
    } | options
    return Reducer(network, UNITS, **options)


def arrays(found):
    return found.impedance, found.transfer, found.flow_currents, found.flow_voltages


@pytest.mark.parametrize("start", STATES)
def test_states_are_reduced_from_that_before_as_they_are_anew(start):
    network = STATES[start](ieee39_network())
    states = [change(network) for change in STATES.values()]
    less = network.with_branch_share(26, 25, 0.3)
    states += [less.with_fault(25, 0.02j), less.with_fault(25), less.with_fault(25).with_fault(30)]
    found = arrays(reducer(network)(states))
    for k, state in enumerate(states):
        for one, other in zip(found, arrays(reduced(state)), strict=True):
            np.testing.assert_allclose(one[k], other, rtol=1e-9, atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.floats(-9, 1), st.floats(-9, 1))
def test_any_change_of_any_grid_leads_to_what_it_is_anew(seed, impedance, share):
    """Faults through any impedance, and next to nothing or ten times as much of a branch left."""
    network = random_network(seed, n=24)
    branch = network.branches[seed % len(network.branches)]
    changed = network.with_branch_share(*branch.ends, 10.0**share, branch.circuit)
    changed = changed.with_fault(network.buses[seed % 24].number, 1j * 10.0**impedance)
    options = {
        "terminals": [network.buses[0].number],
        "load_voltages": np.ones(len(network.buses)),
        "admittances": {b.number: 0.1 - 1j for b in network.buses},
        "observed": [b.number for b in network.buses],
        "flows": [branch.ends],
    }
    found = Reducer(network, **options)([changed])
    for one, other in zip(arrays(found), arrays(reduce_network(changed, **options)), strict=True):
        np.testing.assert_allclose(one[0], other, rtol=1e-6, atol=1e-9)


def chain(n=8, **options):
    """Buses in a row, of which nothing but shunts fixes the voltage."""
    branches = tuple(Branch(k, k + 1, 0.0, 0.1) for k in range(1, n))
    return Network(tuple(Bus(k) for k in range(1, n + 1)), branches, slack=1, **options)


def test_a_state_without_a_unique_solution_is_nan_and_leaves_the_others():
    grid = chain(shunts=(Shunt(1, 0.0, 1.0),))
    # what fixes the voltage is taken away
    states = [replace(grid, shunts=(*grid.shunts, Shunt(1, 0.0, -1.0))), replace(grid, shunts=()), grid]
    options = {"terminals": [1], "load_voltages": np.ones(8)}
    found = Reducer(grid, **options)(states).impedance
    assert np.isnan(found[:2]).all()
    np.testing.assert_allclose(found[2], reduce_network(grid, **options).impedance)


@pytest.mark.parametrize("b", [1e-3, 1e-9, 1e-13])
@pytest.mark.parametrize("change", [lambda g: g.with_fault(4), lambda g: g.with_fault(4, 0.1j)])
def test_voltages_that_hardly_anything_fixes_before_lose_no_accuracy(b, change):
    grid = chain(shunts=(Shunt(3, 0.0, b),))
    options = {"terminals": [8], "load_voltages": np.ones(8)}
    expected = reduce_network(change(grid), **options).impedance
    np.testing.assert_allclose(Reducer(grid, **options)([change(grid)]).impedance[0], expected, rtol=1e-7)


def test_a_bolted_fault_may_be_all_that_fixes_the_voltages():
    grid = chain().with_fault(3)
    options = {"terminals": [8], "load_voltages": np.ones(8)}
    expected = reduce_network(grid, **options).impedance
    np.testing.assert_allclose(Reducer(grid, **options)([grid]).impedance[0], expected)


def test_a_state_has_the_buses_of_that_before():
    options = {"terminals": [1], "load_voltages": np.ones(8)}
    with pytest.raises(InputError, match="other buses"):
        Reducer(chain(shunts=(Shunt(1, 0.0, 1.0),)), **options)([chain(9, shunts=(Shunt(1, 0.0, 1.0),))])
