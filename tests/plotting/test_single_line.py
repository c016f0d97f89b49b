"""Bars keep their ports apart and in order; texts go where there is room."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from errorscreen.plotting.layout import bus_positions
from errorscreen.plotting.single_line import Bar, Clutter, Port, around, bars
from errorscreen.power.elements import Branch, Bus
from errorscreen.power.network import Network
from tests.power.grids import networks


@given(st.lists(st.tuples(st.floats(-3, 3), st.floats(-2, 2), st.floats(0.05, 0.4)), min_size=1, max_size=9))
def test_ports_stay_on_the_bar_apart_and_in_order(wanted):
    bar = Bar(np.zeros(2), np.array([1.0, 0.0]))
    for k, (slope, t, width) in enumerate(wanted):
        bar.ports[k] = Port(1, slope, t, width)
    bar.arrange()
    ports = sorted(bar.ports.values(), key=lambda port: port.slope)
    for a, b in pairwise(ports):
        assert b.t - a.t >= 0.5 * (a.width + b.width) - 1e-9
    assert -bar.half - 1e-9 <= ports[0].t - 0.5 * ports[0].width
    assert ports[-1].t + 0.5 * ports[-1].width <= bar.half + 1e-9


def test_a_port_alone_is_where_it_wants_to_be():
    bar = Bar(np.zeros(2), np.array([0.0, 1.0]))
    bar.ports["load"] = Port(-1, t=0.1)
    bar.arrange()
    assert bar.point("load", 0.5) == pytest.approx([-0.5, 0.1])


@settings(max_examples=25)
@given(networks)
def test_branches_leave_towards_their_other_ends(network):
    points = bus_positions(network, None)
    found = bars(network, points, [(network.slack, "machine", 0.3)])
    for k, branch in enumerate(network.branches):
        for bus in branch.ends:
            way = found[branch.from_bus + branch.to_bus - bus].centre - found[bus].centre
            assert found[bus].outward(k) @ way >= -1e-5 * np.linalg.norm(way)
    assert "machine" in found[network.slack].ports


def test_facing_bars_are_joined_by_a_straight_line():
    network = Network(
        tuple(map(Bus, (1, 2, 3, 4))),
        (Branch(1, 2, 0, 0.1), Branch(1, 2, 0, 0.1, circuit="2"), Branch(1, 3, 0, 0.1), Branch(2, 4, 0, 0.1)),
        slack=1,
    )
    found = bars(network, np.array([[0.0, 2.0], [0.1, 0.0], [0.2, 4.0], [-0.1, -2.0]]), [])
    for k, branch in enumerate(network.branches):
        ends = [found[bus].point(k)[0] for bus in branch.ends]
        assert ends[0] == pytest.approx(ends[1], abs=1e-3)
    assert abs(found[1].point(0)[0] - found[1].point(1)[0]) == pytest.approx(0.15)


def test_a_machine_hangs_where_the_branch_is_not():
    network = Network((Bus(1), Bus(2)), (Branch(1, 2, 0, 0.1),), slack=1)
    found = bars(network, np.array([[0.0, 0.0], [0.0, 1.0]]), [(1, "machine", 0.3), (2, "machine", 0.3)])
    assert found[1].outward("machine") == pytest.approx([0, -1])
    assert found[2].outward("machine") == pytest.approx([0, 1])


def test_a_text_avoids_lines_boxes_and_the_edge():
    clutter = Clutter(np.zeros(2), np.array([4.0, 4.0]))
    half = np.array([0.2, 0.1])
    places = [np.array(p, dtype=float) for p in ((0.0, 2.0), (1.0, 1.0), (2.0, 2.0), (3.0, 3.0))]
    clutter.add_line([np.array([1.0, 0.0]), np.array([1.0, 2.0])])
    clutter.add_box(np.array([2.1, 2.1]), np.array([0.1, 0.1]))
    assert clutter.settle(places, half) is places[3]
    assert (
        clutter.settle(places, half) is places[1]
    )  # the last one is taken now, and a line is the least evil


def test_places_around_a_box_do_not_touch_it():
    inner, half = np.array([0.3, 0.05]), np.array([0.1, 0.1])
    for centre in around(np.array([1.0, 1.0]), inner, half):
        assert np.any(np.abs(centre - 1.0) > inner + half)
