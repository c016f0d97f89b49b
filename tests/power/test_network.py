from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from errorscreen.cases.ieee39_data import ieee39_network
from errorscreen.exceptions import InputError
from errorscreen.power.elements import Branch, Bus, Generator, Load, Shunt
from errorscreen.power.network import Network
from tests.power.grids import networks


def three_buses(**changes):
    return Network(
        **{
            "buses": (Bus(1), Bus(2), Bus(30)),
            "branches": (
                Branch(1, 2, 0.01, 0.1),
                Branch(2, 30, 0.0, 0.2),
                Branch(2, 30, 0.0, 0.4, circuit="2"),
            ),
            "slack": 1,
            "loads": (Load(2, 0.5, 0.1), Load(30, 0.2)),
            **changes,
        }
    )


def test_admittance_by_hand():
    Y = three_buses().admittance()
    y = 1 / (0.01 + 0.1j)
    assert np.allclose(Y, [[y, -y, 0], [-y, y - 7.5j, 7.5j], [0, 7.5j, -7.5j]])


@given(networks)
def test_without_shunts_charging_and_ratios_the_rows_sum_to_zero(network):
    """A grid without connection to ground carries no current at equal voltages."""
    plain = tuple(replace(b, b=0.0, tap=1.0, shift=0.0) for b in network.branches)
    Y = replace(network, branches=plain, shunts=()).admittance()
    assert np.abs(Y.sum(axis=1)).max() < 1e-12 * np.abs(Y).max()
    assert np.array_equal(Y, Y.T)


@given(networks)
def test_a_load_as_impedance_draws_its_power_at_its_voltage(network):
    V = np.linspace(0.9, 1.1, len(network.buses)) * np.exp(1j * np.arange(len(network.buses)))
    difference = network.admittance(V) - network.admittance()
    assert np.allclose(V * (difference @ V).conj(), network.demand())


@given(networks)
def test_another_base_is_the_same_grid(network):
    V = np.linspace(0.9, 1.1, len(network.buses))
    other = network.with_base(1000.0)
    assert np.allclose(other.admittance(V) * 10, network.admittance(V))
    again = other.with_base(network.base_mva)
    assert np.allclose(again.admittance(V), network.admittance(V), rtol=1e-14)


def test_limits_of_generators_scale_with_the_base():
    generator = Generator(30, p=1.0, v=1.02, q=0.5, q_min=-2.0, q_max=3.0)
    other = three_buses(generators=(generator,)).with_base(50.0)
    assert other.generators == (Generator(30, p=2.0, v=1.02, q=1.0, q_min=-4.0, q_max=6.0),)


def test_line_out():
    network = three_buses()
    without = network.with_line_out(30, 2, "2")
    assert without.admittance()[1, 2] == pytest.approx(5j)
    assert network.admittance()[1, 2] == pytest.approx(7.5j)  # the original keeps its branch
    assert without.with_line_out(2, 30, "2") == without


def test_fault_through_an_impedance_is_a_shunt():
    network = three_buses()
    fault = network.with_fault(2, 0.01 + 0.02j)
    difference = fault.admittance() - network.admittance()
    assert difference[1, 1] == pytest.approx(1 / (0.01 + 0.02j))
    assert np.count_nonzero(np.round(difference, 12)) == 1
    assert network.with_fault(2).grounded == {2}


def test_load_scaled_at_some_buses_and_at_all():
    network = three_buses()
    assert np.allclose(network.with_load_scaled(2.0, [2]).demand(), [0, 1 + 0.2j, 0.2])
    assert np.allclose(network.with_load_scaled(0.5).demand(), 0.5 * network.demand())


def test_generation_scaled_at_some_buses_and_at_all():
    network = three_buses(generators=(Generator(1, p=1.0, v=1.0), Generator(30, p=0.5)))
    assert [g.p for g in network.with_generation_scaled(2.0, [30]).generators] == [1.0, 1.0]
    assert network.with_generation_scaled(0.5).generators == (
        Generator(1, p=0.5, v=1.0),
        Generator(30, p=0.25),
    )
    with pytest.raises(InputError, match="with_generation_scaled: unknown bus '2'.* Allowed: 1, 30"):
        network.with_generation_scaled(2.0, [2])


def test_an_island_message_is_short():
    with pytest.raises(
        InputError, match="the buses 1, 2, 3, 4, 5, 6, 7, 8 and 30 more with the slack bus 31"
    ):
        ieee39_network().with_line_out(6, 31)


def test_loads_and_shunts_at_one_bus_add_up():
    network = three_buses(loads=(Load(2, 0.5), Load(2, 0.25, 0.1)), shunts=(Shunt(2, b=0.1), Shunt(2, g=0.2)))
    assert network.demand()[1] == 0.75 + 0.1j
    assert (network.admittance() - three_buses().admittance())[1, 1] == pytest.approx(0.2 + 0.1j)


def test_a_change_is_the_grid_that_is_built_with_it():
    network = three_buses()
    network.admittance()  # what is known of it must not be taken for what is changed
    for changed in (
        network.with_fault(2, 0.01 + 0.02j),
        network.with_fault(2),
        network.with_branch_share(30, 2, 0.4, "2"),
        network.with_branch_share(30, 2, 0.4, "2").with_fault(1, 0.1j),
    ):
        built = three_buses(branches=changed.branches, shunts=changed.shunts, grounded=changed.grounded)
        assert changed == built
        assert hash(changed) == hash(built)
        np.testing.assert_allclose(changed.admittance(), built.admittance(), rtol=1e-13)
    assert network == three_buses()


def test_networks_are_values():
    assert three_buses() == three_buses()
    assert hash(three_buses()) == hash(three_buses())
    assert three_buses() != three_buses().with_fault(2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: three_buses(loads=(Load(3, 1.0),)),
            "load: unknown bus '3' .did you mean '30'.*Allowed: 1, 2, 30",
        ),
        (lambda: three_buses(generators=(Generator(7),)), "generator: unknown bus '7'"),
        (lambda: three_buses(shunts=(Shunt(7),)), "shunt: unknown bus '7'"),
        (lambda: three_buses(slack=5), "network: unknown bus '5'"),
        (lambda: three_buses(branches=(Branch(1, 9, 0, 0.1),)), "branch 1-9 .circuit 1.: unknown bus '9'"),
        (lambda: three_buses(buses=(Bus(1), Bus(2), Bus(30), Bus(2))), "bus 2 appears more than once"),
        (
            lambda: three_buses(branches=(Branch(1, 2, 0, 0.1), Branch(2, 1, 0, 0.1), Branch(2, 30, 0, 1))),
            "branch 1-2 .circuit 1. appears more than once. Give each its own circuit",
        ),
        (
            lambda: three_buses(generators=(Generator(1, v=1.0), Generator(1, p=1.0))),
            "a generator at bus 1 appears more than once. Add them up",
        ),
        (lambda: three_buses(base_mva=0), "network: base_mva is 0. Allowed: a number > 0"),
        (
            lambda: three_buses().with_line_out(1, 2),
            "no branch connects the buses 2, 30 with the slack bus 1. Allowed: one connected grid. Keep a branch",
        ),
        (
            lambda: three_buses().with_line_out(2, 30),
            "there are 2 branches between the buses 2 and 30. Allowed: circuit 1, 2",
        ),
        (
            lambda: three_buses().with_line_out(1, 30),
            "there are 0 branches between .* Allowed: from bus 1 to 2",
        ),
        (lambda: three_buses().with_line_out(2, 30, "3"), "0 branches .* with circuit '3'"),
        (lambda: three_buses().with_line_out(2, 31), "unknown bus '31'.*Allowed: 1, 2, 30"),
        (lambda: three_buses().with_fault(4), "unknown bus '4'"),
        (lambda: three_buses().with_fault(2, np.nan), "the fault impedance is nan. Allowed: a finite number"),
        (
            lambda: three_buses().with_load_scaled(1.1, [1]),
            "with_load_scaled: unknown bus '1'.* Allowed: 2, 30",
        ),
        (lambda: three_buses().with_load_scaled(np.nan), "the factor is nan"),
        (lambda: three_buses().admittance("1.0"), "load_voltages has another shape"),
        (lambda: three_buses().with_fault("2"), "the bus is '2'. Allowed: the number of a bus"),
        (lambda: three_buses().with_fault(2, "0.1j"), "the fault impedance is '0.1j'"),
        (lambda: three_buses().with_load_scaled(1.1, 2), "the buses are 2. Allowed: a list of bus numbers"),
        (lambda: three_buses().with_base(-1), "base_mva is -1"),
        (
            lambda: three_buses().admittance([1.0, 1.0]),
            "load_voltages has another shape.*one voltage in pu for each of the 3",
        ),
        (lambda: three_buses().admittance([1.0, 0.0, 1.0]), "values that are zero or not finite"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_a_line_whose_loss_leaves_an_island_is_refused_in_the_39_bus_system():
    with pytest.raises(InputError, match="the buses 19, 20, 33, 34 with the slack bus 31"):
        ieee39_network().with_line_out(16, 19)
