"""Diagrams show what is there, what is observed and what happens, and no text hides another."""

import io
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from errorscreen.cases import ieee39_events, load_ieee39
from errorscreen.cases.ieee39_data import POSITIONS
from errorscreen.events import BusFault, Event, GridEvent, LineTrip, LoadStep
from errorscreen.exceptions import InputError
from errorscreen.plotting import plot_system
from errorscreen.plotting.system_diagram import EVENT, OBSERVED, TESTED, _is_transformer
from errorscreen.power.elements import Branch, Bus
from errorscreen.power.network import Network
from tests.simulators.grid.test_simulator import TIME, system

CASE = load_ieee39()
SMALL = system()
CORNERS = {1: (0, 0), 2: (0, 1), 3: (1, 1.5), 4: (2, 1), 5: (2, 0)}


def texts(figure):
    return {text.get_text(): text for text in figure.axes[0].texts}


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def polygons(figure, colour):
    """Heads of arrows and flashes of one colour, as arrays of corners."""
    found = [p for p in figure.axes[0].patches if hasattr(p, "get_xy")]
    return [p.get_xy() for p in found if to_hex(p.get_facecolor()) == colour]


def lines(figure, colour):
    return [line for line in figure.axes[0].lines if line.get_color() == colour]


def circles(figure, colour):
    found = [p for p in figure.axes[0].patches if hasattr(p, "get_radius")]
    return [p for p in found if to_hex(p.get_facecolor()) == colour and p.get_radius() > 0.1]


class TwoThings(GridEvent):
    """A kind of event that the package does not know."""

    def changes(self, network):
        after = network.with_line_out(1, 5)
        return ((1.0, after.with_fault(3)), (1.1, after))


@pytest.mark.parametrize("name", ieee39_events())
@pytest.mark.parametrize("positions", [POSITIONS, None], ids=["given", "computed"])
def test_no_text_of_the_case_study_overlaps(name, positions):
    figure = plot_system(CASE, ieee39_events()[name], positions=positions)
    frame = figure.bbox
    renderer = FigureCanvasAgg(figure).get_renderer()
    boxes = [text.get_window_extent(renderer) for text in figure.axes[0].texts]
    boxes.append(figure.legends[0].get_window_extent(renderer))
    bars = [line.get_window_extent(renderer) for line in figure.axes[0].lines if line.get_linewidth() == 3.5]
    symbols = [patch.get_window_extent(renderer) for patch in figure.axes[0].patches]
    assert len(bars) == 39
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in [*boxes[:k], *bars, *symbols])
        assert frame.x0 <= box.x0 < box.x1 <= frame.x1
        assert frame.y0 <= box.y0 < box.y1 <= frame.y1


def test_everything_of_the_case_study_is_there():
    figure = plot_system(CASE, positions=POSITIONS)
    assert isinstance(figure, Figure)
    devices = {"synchronous_machine", "dfig_plant", "pv_plant"}
    assert set(texts(figure)) == {str(k) for k in range(1, 40)} | devices | {"U", "P"}
    assert {name for name, text in texts(figure).items() if text.get_color() == TESTED} == devices
    assert (len(circles(figure, TESTED)), len(circles(figure, "#ffffff"))) == (3, 7)
    assert len(polygons(figure, "#111111")) == 19  # loads
    coils = [p for p in figure.axes[0].patches if hasattr(p, "get_radius") and p.get_radius() < 0.1]
    assert len(coils) == 2 * 12
    assert legend(figure) == ["machine", "unit under test", "load", "observed: U, P", "fault at bus 3"]
    figure.savefig(io.BytesIO(), format="svg")


def test_lines_of_the_case_study_do_not_cross():
    figure = plot_system(CASE, positions=POSITIONS)
    paths = [np.transpose(line.get_data()) for line in figure.axes[0].lines if len(line.get_xdata()) == 4]
    assert len(paths) == 46
    for k, path in enumerate(paths):
        for other in paths[:k]:
            assert not any(cross(a, b, c, d) for a, b in pairwise(path) for c, d in pairwise(other))


def cross(a, b, c, d):
    """Whether two segments have a point inside both of them in common."""
    try:
        s, t = np.linalg.solve(np.transpose([b - a, c - d]), c - a)
    except np.linalg.LinAlgError:
        return False
    return 0 < s < 1 and 0 < t < 1


def test_observed_bus_and_the_end_at_which_power_arrives():
    figure = plot_system(SMALL, positions=CORNERS)
    bar, line = sorted(lines(figure, OBSERVED), key=lambda line: len(line.get_xdata()))
    assert np.mean(np.transpose(bar.get_data()), axis=0) == pytest.approx(place(figure, 3))
    (head,) = polygons(figure, OBSERVED)
    ends = np.transpose(line.get_data())[[0, -1]]
    assert head[0] == pytest.approx(ends[1])  # the branch is declared from 2 to 3
    (other,) = polygons(plot_system(system(channels={"P": (3, 2)}), positions=CORNERS), OBSERVED)
    assert other[0] == pytest.approx(ends[0])


def place(figure, bus):
    """Centre of a bar, of a figure drawn with CORNERS."""
    bars = np.array(
        [line.get_xydata().mean(axis=0) for line in figure.axes[0].lines if line.get_linewidth() == 3.5]
    )
    return bars[bus - 1]


@pytest.mark.parametrize("impedance", [0.0, 0.05j])
@pytest.mark.parametrize("bus", [1, 4])
def test_a_fault_is_marked_at_its_bus(bus, impedance):
    figure = plot_system(SMALL, BusFault(TIME, "short", 0.5, bus=bus, impedance=impedance), positions=CORNERS)
    (flash,) = polygons(figure, EVENT)
    near = [np.linalg.norm(flash[0] - place(figure, k)) for k in CORNERS]
    assert np.argmin(near) == bus - 1
    assert legend(figure)[-1] == "short"


def test_a_tripped_line_is_dashed():
    figure = plot_system(SMALL, LineTrip(TIME, "trip", 0.5, ends=(4, 2)), positions=CORNERS)
    (line,) = lines(figure, EVENT)
    assert line.get_linestyle() == "--"
    ends = np.transpose(line.get_data())[[0, -1]]
    expected = np.array([place(figure, 2), place(figure, 4)])
    assert np.abs(ends - expected).max() < 0.3
    assert not polygons(figure, EVENT)


@pytest.mark.parametrize(("buses", "count"), [((5,), 1), (None, 2)])
def test_changed_loads_are_marked(buses, count):
    figure = plot_system(SMALL, LoadStep(TIME, "step", 0.5, factor=1.2, buses=buses))
    assert len(polygons(figure, EVENT)) == count


def test_an_event_of_any_kind_shows_where_it_is_and_nothing_where_nothing_happens():
    figure = plot_system(SMALL, TwoThings(TIME, "two things"))
    assert (len(polygons(figure, EVENT)), len(lines(figure, EVENT))) == (1, 1)
    quiet = plot_system(SMALL, GridEvent(TIME, "rest"))
    assert not polygons(quiet, EVENT)
    assert not lines(quiet, EVENT)
    assert "rest" not in legend(quiet)


def test_a_branch_out_of_service_is_dotted():
    simulator = system(GridEvent(TIME))
    simulator.network = simulator.network.with_line_out(1, 5)
    styles = [line.get_linestyle() for line in plot_system(simulator).axes[0].lines]
    assert styles.count(":") == 1


def test_the_same_diagram_every_time():
    files = [io.BytesIO(), io.BytesIO()]
    for file in files:
        plot_system(SMALL).savefig(file, format="png")
    assert files[0].getvalue() == files[1].getvalue()


@pytest.mark.parametrize(
    ("change", "expected"),
    [({}, False), ({"tap": 1.05}, True), ({"shift": 0.1}, True), ({"to_bus": 3}, True), ({"b": 0.0}, True)],
)
def test_what_counts_as_a_transformer(change, expected):
    line = Branch(1, 2, 0.01, 0.1, 0.2)
    branch = replace(line, circuit="2", **change)
    buses = (Bus(1, kv=110.0), Bus(2, kv=110.0), Bus(3, kv=20.0))
    network = Network(buses, (line, branch, Branch(1, 3, 0.0, 0.1, circuit="3")), slack=1)
    assert _is_transformer(network, branch) is expected


def test_without_any_charging_a_plain_branch_is_a_line():
    assert not any(_is_transformer(SMALL.network, branch) for branch in SMALL.network.branches)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plot_system(SMALL.network), "a Network does not simulate a grid"),
        (lambda: plot_system(SMALL, Event(TIME)), "a Event does not happen in a grid"),
        (lambda: plot_system(SMALL, positions={1: (0, 0)}), "no position for bus 2, 3, 4, 5"),
        (lambda: plot_system(SMALL, BusFault(TIME, "f", bus=9)), "unknown bus '9'"),
    ],
)
def test_what_does_not_fit_is_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()
