"""Single-line diagram of a simulated grid with its units under test, observed quantities and event."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from errorscreen.data.panels import COLOURS
from errorscreen.events import GridEvent
from errorscreen.exceptions import InputError
from errorscreen.plotting.layout import bus_positions
from errorscreen.plotting.single_line import STUB, Bar, Clutter, Point, around, bars
from errorscreen.power.elements import Branch
from errorscreen.power.network import Network
from errorscreen.simulators import PowerSystemSimulator

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EVENT, OBSERVED, TESTED = COLOURS[0], COLOURS[1], COLOURS[2]
LINE, SYMBOL = "#444444", "#111111"
#: inches: radius of a machine and of half a transformer, way to a machine's centre, length of a load and its width
_MACHINE, _COIL, _LEAD, _LOAD, _ARROW = 0.12, 0.065, 0.34, 0.3, 0.2
#: inches: margin, strip of the legend, least width
_MARGIN, _LEGEND, _WIDTH = 0.75, 0.3, 6.5
#: flash with its tip at the origin, in inches
_FLASH = 0.1 * np.array([(0, 0), (1.6, 1.1), (1.0, 1.3), (2.4, 2.7), (0.7, 1.9), (1.3, 1.6)])


def plot_system(
    simulator: PowerSystemSimulator,
    event: GridEvent | None = None,
    *,
    positions: Mapping[int, Sequence[float]] | None = None,
) -> Figure:
    """Single-line diagram of a grid with its units under test, observed quantities and event.

    Bars are buses, two circles a transformer, circles machines, arrows loads; shunts are not drawn. A branch counts as
    a transformer by its ratio, its shift or the nominal voltages of its ends, or if it has no charging and others of
    the grid have. A branch that the event opens is dashed; one out of service before the event is dotted.

    Parameters
    ----------
    simulator : PowerSystemSimulator
    event : GridEvent, optional
        The simulator's own where not given. Any kind will do: its place follows from the networks that it leads to.
    positions : mapping of int to (float, float), optional
        Position of each bus, x to the right and y upwards, in any unit, for example
        `errorscreen.cases.ieee39_data.POSITIONS`; computed from the network where not given.

    Returns
    -------
    matplotlib.figure.Figure
        As large as the grid needs.

    Raises
    ------
    InputError
        If the simulator or the event is not of a grid, or a bus has no usable position.

    Examples
    --------
    >>> from errorscreen.cases import load_ieee39
    >>> from errorscreen.cases.ieee39_data import POSITIONS
    >>> figure = plot_system(load_ieee39(), positions=POSITIONS)
    >>> [text.get_text() for text in figure.legends[0].get_texts()][-1]
    'fault at bus 3'
    """
    if not isinstance(simulator, PowerSystemSimulator):
        problem = f"a {type(simulator).__name__} does not simulate a grid"
        raise InputError(problem, allowed="a PowerSystemSimulator")
    shown = simulator.event if event is None else event
    if not isinstance(shown, GridEvent):
        problem = f"a {type(shown).__name__} does not happen in a grid"
        raise InputError(problem, allowed="BusFault, LineTrip, LoadStep, GridEvent")
    network = simulator.network
    places = _places(network, shown)
    points = bus_positions(network, positions)
    canvas = _Canvas(points)
    machines = {g.bus: ("machine", g.bus) for g in network.generators}
    loads = {load.bus: ("load", load.bus) for load in network.loads}
    attached = [(bus, key, 2.6 * _MACHINE) for bus, key in machines.items()]
    grid = bars(network, points, attached + [(bus, key, _ARROW) for bus, key in loads.items()])
    observed = {name: where for name, where in simulator.observed.items() if isinstance(where, tuple)}
    for k, branch in enumerate(network.branches):
        canvas.branch(
            grid, k, branch, _is_transformer(network, branch), k in places.tripped, observed.values()
        )
    for bus, key in loads.items():
        canvas.load(grid[bus], key, EVENT if bus in places.loads else SYMBOL)
    devices = {unit.bus: unit.model.name for unit in simulator.units_under_test}
    for bus, key in machines.items():
        canvas.machine(grid[bus], key, bus in devices)
    _annotate(canvas, simulator, grid, places, devices)
    canvas.legend(_legend(simulator, shown, places))
    return canvas.figure


@dataclass(frozen=True)
class _Places:
    """Places of an event: buses with a fault, indices of opened branches, buses with changed loads."""

    faults: frozenset[int]
    tripped: frozenset[int]
    loads: frozenset[int]


def _places(network: Network, event: GridEvent) -> _Places:
    faults: set[int] = set()
    tripped: set[int] = set()
    loads: set[int] = set()
    for _, after in event.changes(network):
        faults |= after.grounded - network.grounded
        faults |= {shunt.bus for shunt in set(after.shunts) - set(network.shunts)}
        pairs = zip(network.branches, after.branches, strict=True)
        tripped |= {k for k, (old, new) in enumerate(pairs) if old.in_service and not new.in_service}
        loads |= {load.bus for load in set(after.loads) ^ set(network.loads)}
    return _Places(frozenset(faults), frozenset(tripped), frozenset(loads))


def _is_transformer(network: Network, branch: Branch) -> bool:
    kv = {network.buses[network.index(end)].kv for end in branch.ends}
    without_charging = branch.b == 0 and any(other.b for other in network.branches)
    return branch.tap != 1 or branch.shift != 0 or len(kv) > 1 or without_charging


def _annotate(
    canvas: _Canvas,
    simulator: PowerSystemSimulator,
    grid: Mapping[int, Bar],
    places: _Places,
    devices: Mapping[int, str],
) -> None:
    """Draw bars, flashes and texts, which come last because they need free space."""
    observed = {where for where in simulator.observed.values() if not isinstance(where, tuple)}
    for bus, bar in grid.items():
        canvas.bar(bar, OBSERVED if bus in observed else SYMBOL)
    for bus in sorted(places.faults):
        canvas.flash(grid[bus])
    for bus, name in devices.items():
        bar, key = grid[bus], ("machine", bus)
        canvas.text(name, bar.point(key, _LEAD), np.full(2, _MACHINE), TESTED, weight="bold")
    for bus, bar in grid.items():
        ends = [bar.end(1), bar.end(-1)]
        canvas.text(str(bus), bar.centre, bar.extent, SYMBOL, first=ends, along=bar.along)
    for name, where in simulator.observed.items():
        if isinstance(where, tuple):
            sent = [k for k, b in enumerate(simulator.network.branches) if set(b.ends) == set(where)]
            canvas.text(name, grid[where[1]].point(sent[0], STUB), np.full(2, 0.05), OBSERVED, weight="bold")
        else:
            bar = grid[where]
            canvas.text(name, bar.centre, bar.extent, OBSERVED, weight="bold")


def _legend(simulator: PowerSystemSimulator, event: GridEvent, places: _Places) -> list[Any]:
    from matplotlib.lines import Line2D

    circle: dict[str, Any] = {"marker": "o", "ls": "none", "ms": 10, "mec": SYMBOL}
    handles = [Line2D([], [], mfc="white", label="machine", **circle)]
    if simulator.units_under_test:
        handles.append(Line2D([], [], mfc=TESTED, label="unit under test", **circle))
    if simulator.network.loads:
        handles.append(Line2D([], [], marker="v", ls="none", ms=7, color=SYMBOL, label="load"))
    names = ", ".join(simulator.observed)
    handles.append(Line2D([], [], color=OBSERVED, lw=2.5, label=f"observed: {names}"))
    style: dict[str, Any] = {"color": EVENT, "label": event.name}
    if places.faults:
        handles.append(Line2D([], [], marker=_flash_marker(), ms=14, ls="none", **style))
    elif places.tripped:
        handles.append(Line2D([], [], ls="--", lw=1.5, **style))
    elif places.loads:
        handles.append(Line2D([], [], marker="v", ls="none", ms=7, **style))
    return handles


def _flash_marker() -> Any:
    from matplotlib.path import Path

    outline = _FLASH - _FLASH.mean(axis=0)
    return Path(np.vstack([outline, outline[:1]]), closed=True)


class _Canvas:
    """Axes in inches, with a record of all drawn shapes."""

    def __init__(self, points: Point) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        low, high = points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN
        wider = max(0.0, _WIDTH - (high[0] - low[0])) / 2
        low[0], high[0] = low[0] - wider, high[0] + wider
        self.clutter = Clutter(low, high)
        self.figure = Figure(figsize=(high[0] - low[0], high[1] - low[1] + _LEGEND))
        # without one renderer for all texts, each that is measured takes an image of the whole figure
        self._renderer = FigureCanvasAgg(self.figure).get_renderer()
        self.axes: Axes = self.figure.add_axes((0, 0, 1, 1))
        self.axes.set_axis_off()
        self.axes.set_xlim(low[0], high[0])
        self.axes.set_ylim(low[1] - _LEGEND, high[1])

    def line(self, points: Sequence[Point], **style: Any) -> None:
        """Draw a line that texts avoid."""
        self.axes.plot(*np.array(points).T, solid_capstyle="butt", **style)
        self.clutter.add_line(points)

    def polygon(self, points: Point, colour: str) -> None:
        """Draw a filled polygon that texts avoid."""
        self.axes.fill(*points.T, color=colour, lw=0, zorder=5)
        self.clutter.add_box(0.5 * (points.min(axis=0) + points.max(axis=0)), 0.5 * np.ptp(points, axis=0))

    def circle(self, centre: Point, radius: float, face: str, colour: str = SYMBOL) -> None:
        """Draw a circle that texts avoid."""
        from matplotlib.patches import Circle

        self.axes.add_patch(Circle(tuple(centre), radius, fc=face, ec=colour, lw=1.0, zorder=4))
        self.clutter.add_box(centre, np.full(2, radius))

    def head(self, tip: Point, direction: Point, colour: str) -> None:
        """Draw the head of an arrow."""
        back, aside = 0.13 * direction, 0.05 * np.array([-direction[1], direction[0]])
        self.polygon(np.array([tip, tip - back + aside, tip - back - aside]), colour)

    def branch(
        self, grid: Mapping[int, Bar], k: int, branch: Branch, transformer: bool, tripped: bool, observed: Any
    ) -> None:
        """Draw a line or a transformer, with an arrow where observed power arrives."""
        ends = grid[branch.from_bus], grid[branch.to_bus]
        seen = [where for where in observed if set(where) == set(branch.ends)]
        colour = EVENT if tripped else OBSERVED if seen else LINE
        style = "--" if tripped else "-" if branch.in_service else ":"
        path = [ends[0].point(k), *(bar.point(k, STUB) for bar in ends), ends[1].point(k)]
        self.line(path, color=colour, lw=2.0 if seen or tripped else 1.0, ls=style, zorder=2)
        if transformer:
            middle, way = 0.5 * (path[1] + path[2]), path[2] - path[1]
            for sign in (-0.6, 0.6):
                self.circle(middle + sign * _COIL * way / np.linalg.norm(way), _COIL, "white", colour)
        for where in seen:
            bar = grid[where[1]]
            self.head(bar.point(k), -bar.outward(k), OBSERVED)

    def load(self, bar: Bar, key: Hashable, colour: str) -> None:
        """Draw the arrow of a load."""
        self.line([bar.point(key), bar.point(key, _LOAD)], color=colour, lw=1.2, zorder=2)
        self.head(bar.point(key, _LOAD), bar.outward(key), colour)

    def machine(self, bar: Bar, key: Hashable, tested: bool) -> None:
        """Draw a machine; a unit under test is filled."""
        centre = bar.point(key, _LEAD)
        self.line([bar.point(key), centre], color=LINE, lw=1.0, zorder=2)
        self.circle(centre, _MACHINE, TESTED if tested else "white")
        wave = np.linspace(-np.pi, np.pi, 25)
        x, y = centre[0] + 0.6 * _MACHINE * wave / np.pi, centre[1] + 0.3 * _MACHINE * np.sin(wave)
        self.axes.plot(x, y, color="white" if tested else SYMBOL, lw=1.2, zorder=5)

    def bar(self, bar: Bar, colour: str) -> None:
        """Draw a bus."""
        self.line([bar.end(-1), bar.end(1)], color=colour, lw=3.5, zorder=3)
        self.clutter.add_box(bar.centre, bar.extent + 0.03)

    def flash(self, bar: Bar) -> None:
        """Draw a fault with its tip at the bus, on the side with most room."""
        size = _FLASH.max(axis=0)
        corners = [np.array(corner) for corner in ((1, 1), (-1, 1), (1, -1), (-1, -1))]
        tips = [bar.end(int(np.sign(bar.along @ corner))) for corner in corners]
        offsets = [0.05 * corner + 0.5 * size * corner for corner in corners]
        centres = [tip + offset for tip, offset in zip(tips, offsets, strict=True)]
        chosen = self.clutter.settle(centres, 0.5 * size)
        k = next(k for k, centre in enumerate(centres) if centre is chosen)
        self.polygon(tips[k] + 0.02 * corners[k] + _FLASH * corners[k], EVENT)

    def text(
        self,
        text: str,
        centre: Point,
        inner: Point,
        colour: str,
        *,
        first: Sequence[Point] = (),
        along: Point | None = None,
        **style: Any,
    ) -> None:
        """Write a text beside a box where it hides least; the ends of a bar come first."""
        style |= {"ha": "center", "va": "center", "fontsize": 8, "zorder": 6}
        label = self.axes.text(0, 0, text, color=colour, **style)
        size = label.get_window_extent(self._renderer)
        half = 0.5 * np.array([size.width, size.height]) / self.figure.dpi
        beside = [] if along is None else [
            end + np.sign((end - centre) @ along) * along * (half + 0.04) for end in first
        ]  # fmt: skip
        label.set_position(tuple(self.clutter.settle([*beside, *around(centre, inner, half)], half)))

    def legend(self, handles: list[Any]) -> None:
        """Explain the symbols below the diagram."""
        self.figure.legend(handles=handles, loc="lower center", ncols=len(handles), frameon=False, fontsize=9)
