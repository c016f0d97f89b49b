import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from errorscreen.cases.ieee39_data import ieee39_network
from errorscreen.exceptions import InputError
from errorscreen.power.elements import Branch, Bus, Generator, Load
from errorscreen.power.load_flow import TOLERANCE, solve_load_flow
from errorscreen.power.network import Network
from tests.power.andes_reference import andes, case, solve
from tests.power.grids import networks, random_network

SEEDS = st.integers(0, 2**32 - 1)


def two_buses(**generator):
    """Slack, a reactance of 0.1 pu, and a load of 1 + j0.5 at a generator."""
    return Network(
        (Bus(1), Bus(2)),
        (Branch(1, 2, 0.0, 0.1),),
        slack=1,
        loads=(Load(2, 1.0, 0.5),),
        generators=(Generator(1, v=1.0), Generator(2, **generator)),
    )


def test_two_buses_by_hand():
    """P = V1 V2 sin(theta) / X fixes the angle, Q = (V1^2 - V1 V2 cos(theta)) / X what the slack delivers."""
    flow = solve_load_flow(two_buses(v=1.0))
    theta = np.arcsin(0.1)
    assert flow.angle[1] == pytest.approx(-theta, abs=1e-12)
    assert flow.generation[1] == pytest.approx(1 + 1j * (1 - np.cos(theta)) / 0.1, abs=1e-10)
    assert flow.generation[2] == pytest.approx(0.5j + 1j * (1 - np.cos(theta)) / 0.1, abs=1e-10)


@given(networks)
def test_balance(network):
    flow = solve_load_flow(network)
    assert flow.mismatch < TOLERANCE
    assert flow.iterations < 8
    shunt = sum(complex(s.g, -s.b) * flow.magnitude[network.index(s.bus)] ** 2 for s in network.shunts)
    losses = flow.branch_flows.sum() + shunt
    assert flow.injection.sum() == pytest.approx(losses, abs=1e-10)
    generated = np.zeros(len(network.buses), dtype=complex)
    for bus, power in flow.generation.items():
        generated[network.index(bus)] = power
    balance = generated - network.demand() - flow.injection
    assert np.abs(balance).max() < 1e-9
    for g in network.generators:
        assert flow.magnitude[network.index(g.bus)] == pytest.approx(g.v, rel=1e-12)
    assert flow.angle[network.index(network.slack)] == 0


@given(networks, st.floats(10, 1000))
def test_the_base_does_not_matter(network, base):
    assert np.allclose(
        solve_load_flow(network.with_base(base)).voltage, solve_load_flow(network).voltage, atol=1e-9
    )


@given(networks, SEEDS)
def test_the_order_does_not_matter(network, seed):
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(network.buses))
    shuffled = replace(
        network,
        buses=tuple(network.buses[i] for i in order),
        branches=tuple(rng.permutation(np.array(network.branches, dtype=object))),
        loads=network.loads[::-1],
    )
    assert np.allclose(solve_load_flow(shuffled).voltage, solve_load_flow(network).voltage[order], atol=1e-9)


@given(SEEDS)
def test_injections_give_back_the_voltages(seed):
    """Voltages are chosen, the power they need is computed, the load flow has to find them again."""
    network = random_network(seed, generators=False)
    rng = np.random.default_rng(seed)
    n = len(network.buses)
    V = rng.uniform(0.97, 1.03, n) * np.exp(1j * rng.uniform(-0.1, 0.1, n))
    V[0] = abs(V[0])
    S = V * (network.admittance() @ V).conj()
    numbers = [bus.number for bus in network.buses]
    sources = [Generator(number, p=s.real, q=s.imag) for number, s in zip(numbers, S, strict=True)]
    sources[0] = Generator(network.slack, v=float(V[0].real))
    network = replace(network, loads=(), generators=tuple(sources))
    flow = solve_load_flow(network, start=V * np.exp(0.05j))
    assert np.abs(flow.voltage - V).max() < 1e-8


def test_start_at_the_solution_needs_no_step_and_any_reference_angle_will_do():
    flow = solve_load_flow(ieee39_network())
    again = solve_load_flow(ieee39_network(), start=flow.voltage * np.exp(1j))
    assert again.iterations == 0
    assert np.allclose(again.voltage, flow.voltage, atol=1e-14)


def test_branch_out_of_service_has_no_flow():
    network = ieee39_network().with_line_out(2, 3)
    flow = solve_load_flow(network)
    k = [b.ends for b in network.branches].index((2, 3))
    assert np.all(flow.branch_flows[k] == 0)
    assert np.abs(flow.branch_flows).min(axis=1).argmin() == k


@pytest.mark.parametrize(("q_max", "held"), [(10.0, ()), (0.3, (2,))])
def test_reactive_limit(q_max, held):
    network = two_buses(v=1.0, q_max=q_max, q_min=-10)
    flow = solve_load_flow(network, reactive_limits=True)
    assert flow.at_limit == held
    assert flow.network == network
    if held:
        assert flow.generation[2].imag == pytest.approx(q_max, abs=1e-10)
        assert flow.magnitude[1] < 1
    else:
        assert flow.voltage == pytest.approx(solve_load_flow(network).voltage)


@pytest.mark.parametrize("seed", range(8))
def test_reactive_limits_end_where_every_generator_has_a_reason(seed):
    """Each holds its voltage within its limits, sags at the upper limit or is pushed up at the lower one."""
    rng = np.random.default_rng(seed)
    free = solve_load_flow(ieee39_network())
    limits = {bus: q.imag + rng.uniform(-0.5, 0.5, 2) for bus, q in free.generation.items()}
    generators = [
        replace(g, q_min=min(limits[g.bus]), q_max=max(limits[g.bus])) for g in ieee39_network().generators
    ]
    network = replace(ieee39_network(), generators=tuple(generators))
    flow = solve_load_flow(network, reactive_limits=True)
    assert flow.at_limit
    for g in generators:
        q, V = flow.generation[g.bus].imag, flow.magnitude[network.index(g.bus)]
        if g.bus == network.slack or g.bus not in flow.at_limit:
            assert pytest.approx(g.v, rel=1e-12) == V
            assert g.bus == network.slack or g.q_min - 1e-9 <= q <= g.q_max + 1e-9
        elif q == pytest.approx(g.q_max, abs=1e-9):
            assert g.v >= V
        else:
            assert q == pytest.approx(g.q_min, abs=1e-9)
            assert g.v <= V


@pytest.mark.parametrize("q", [0.2, 2.0])
def test_a_fixed_reactive_power_as_both_limits(q):
    flow = solve_load_flow(two_buses(v=1.0, q_min=q, q_max=q), reactive_limits=True)
    assert flow.generation[2].imag == pytest.approx(q, abs=1e-10)
    assert (flow.magnitude[1] > 1) == (q > 1)


def test_no_solution_names_the_worst_bus():
    with pytest.raises(
        InputError, match=r"load flow: no solution in \d+ Newton steps; the closest .* at bus 2\."
    ):
        solve_load_flow(two_buses(p=-9.0, q=0.0))  # more than V^2 / 2X can never arrive
    with pytest.raises(InputError, match="Check loads, generation and branch data near this bus") as error:
        solve_load_flow(ieee39_network().with_load_scaled(1.3))
    assert float(re.search(r"mismatch of (\S+) pu", str(error.value))[1]) < 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda n: solve_load_flow(replace(n, slack=1)), "no generator holds the voltage of the slack bus 1"),
        (lambda n: solve_load_flow(n.with_fault(3)), "the buses 3 have a bolted fault"),
        (lambda n: solve_load_flow(n, start=[1.0]), "start has another shape.* each of the 39 buses"),
        (lambda n: solve_load_flow(n, start=np.zeros(39)), "values that are zero or not finite"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(InputError, match=message):
        make(ieee39_network())


@andes
@pytest.mark.parametrize("name", ["ieee39/ieee39.raw", "ieee39/ieee39_full.xlsx", "ieee14/ieee14.raw"])
def test_solution_of_cases_that_come_with_andes(name):
    network, V = case(name)
    assert np.abs(solve_load_flow(network).voltage - V).max() < 1e-8


@andes
def test_solution_and_matrix_agree_with_andes_on_our_data():
    V, Y = solve(ieee39_network())
    assert np.abs(solve_load_flow(ieee39_network()).voltage - V).max() < 1e-8
    assert np.abs(ieee39_network().admittance() - Y).max() < 1e-12 * np.abs(Y).max()


@andes
@pytest.mark.parametrize("seed", range(3))
def test_transformers_with_shift_agree_with_andes(seed):
    network = random_network(seed, n=8)
    V, Y = solve(network)
    assert np.abs(solve_load_flow(network).voltage - V).max() < 1e-8
    assert np.abs(network.admittance() - Y).max() < 1e-12 * np.abs(Y).max()
