"""Positions of buses: given ones keep their shape, computed ones keep the distances of the graph."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist

from errorscreen.exceptions import InputError
from errorscreen.plotting.layout import _classical_scaling, _stress, bus_positions
from errorscreen.power.elements import Branch, Bus
from errorscreen.power.network import Network
from tests.power.grids import networks


def grid(*ends):
    buses = sorted({bus for pair in ends for bus in pair})
    return Network(tuple(map(Bus, buses)), tuple(Branch(a, b, 0, 0.1) for a, b in ends), slack=buses[0])


@given(st.floats(1e-3, 1e3), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_given_positions_are_of_any_unit_and_origin(scale, x, y):
    square = {1: (0, 0), 2: (1, 0), 3: (1, 2), 4: (0, 2)}
    network = grid((1, 2), (2, 3), (3, 4))
    moved = {bus: (x + scale * a, y + scale * b) for bus, (a, b) in square.items()}
    expected = bus_positions(network, square)
    assert np.allclose(bus_positions(network, moved), expected, atol=1e-8)
    assert expected == pytest.approx(np.array(list(square.values())) * expected.max() / 2)


def test_a_chain_is_straight_horizontal_and_evenly_spaced():
    points = bus_positions(grid((1, 2), (2, 3), (3, 4), (4, 5)), None)
    steps = np.abs(np.diff(points, axis=0))
    assert steps[:, 0] == pytest.approx(steps[0, 0], rel=1e-2)
    assert steps[0, 0] > 0.8
    assert steps[:, 1].max() < 0.05


def test_a_ring_is_round():
    ring = bus_positions(grid((1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 1)), None)
    radius = np.linalg.norm(ring - ring.mean(axis=0), axis=1)
    assert radius == pytest.approx(radius[0], rel=1e-2)


@pytest.mark.parametrize("leaves", [2, 7])
def test_buses_that_the_spectrum_cannot_tell_apart_part(leaves):
    star = bus_positions(grid(*((1, k) for k in range(2, leaves + 2))), None)
    assert pdist(star).min() > 0.3


@settings(max_examples=25)
@given(networks)
def test_computed_layout_is_repeatable_and_keeps_buses_apart(network):
    points = bus_positions(network, None)
    assert np.array_equal(points, bus_positions(network, None))
    assert points.min() == 0
    assert points.max() <= 30 + 1e-9
    assert pdist(points).min() > 0.1


def test_majorisation_improves_on_its_start():
    hops = np.abs(np.subtract.outer(np.arange(8), np.arange(8)))
    distance = np.minimum(hops, 8 - hops).astype(float)  # a ring of eight
    network = grid(*((k, k % 8 + 1) for k in range(1, 9)))
    points = bus_positions(network, None)
    points *= (distance[np.triu_indices(8, 1)] / pdist(points)).mean()
    start = _classical_scaling(distance)
    assert _stress(points, distance) < 0.999 * _stress(start, distance)


def test_a_single_bus_has_a_place():
    network = Network((Bus(7),), (), slack=7)
    assert np.array_equal(bus_positions(network, None), [[0, 0]])
    assert np.array_equal(bus_positions(network, {7: (3, 4)}), [[0, 0]])


@pytest.mark.parametrize(
    ("positions", "message"),
    [
        ({1: (0, 0)}, r"positions: no position for bus 2, 3\. .*computed"),
        ({1: (0, 0), 2: (1, 0), 3: (1,)}, r"position of bus 3 is \(1,\)"),
        ({1: (0, 0), 2: (1, 0), 3: "left"}, "position of bus 3 is 'left'"),
        ({1: (0, 0), 2: (1, np.nan), 3: (1, 1)}, "position of bus 2"),
        ({1: (0, 0), 2: (1, 0), 3: (0, 0)}, "buses 1 and 3 are at the same place"),
    ],
)
def test_positions_that_cannot_be_used(positions, message):
    with pytest.raises(InputError, match=message):
        bus_positions(grid((1, 2), (2, 3)), positions)
