"""Geometry of a single-line diagram in inches: bars of buses, and the ports of branches, machines and loads.

A bar stands across most of the branches of its bus. Each branch leaves it at a right angle with a short stub. Sides and
order follow the other ends of the branches, so branches of one bus do not cross beside it.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from errorscreen.power.network import Network

Point = NDArray[np.float64]
Box = tuple[float, float, float, float]
#: inches: width of a branch on a bar, least half length of a bar, length of a stub
_GAP, _HALF, STUB = 0.15, 0.2, 0.12
#: rounds in which the two ends of each branch align
_ROUNDS = 6
#: inches between samples of a line; cost of a text for each square inch of overlap and each inch beyond the edge, in
#: hidden samples
_SAMPLE, _AREA_COST, _EDGE_COST = 0.04, 1e4, 1e4
#: directions from a box in which a text may stand: beside, above and below, at the corners, between
_SPOTS = np.array([
    (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1),
    (0.5, 1), (-0.5, 1), (0.5, -1), (-0.5, -1), (1, 0.5), (-1, 0.5), (1, -0.5), (-1, -0.5),
])  # fmt: skip


@dataclass
class Port:
    """Port of a bar: side (1 or -1), order on that side, coordinate along the bar, and width."""

    side: int
    slope: float = 0.0
    t: float = 0.0
    width: float = _GAP


@dataclass
class Bar:
    """A bus: centre, unit vectors along and across it, half its length, and its ports."""

    centre: Point
    along: Point
    half: float = _HALF
    ports: dict[Hashable, Port] = field(default_factory=dict)

    @property
    def across(self) -> Point:
        """Unit vector towards side 1."""
        return self.along[::-1]

    @property
    def extent(self) -> Point:
        """Half width and half height."""
        return self.half * self.along

    def end(self, sign: int) -> Point:
        """One end of the bar."""
        return self.centre + sign * self.extent

    def outward(self, key: Hashable) -> Point:
        """Direction of a port."""
        return self.ports[key].side * self.across

    def point(self, key: Hashable, reach: float = 0.0) -> Point:
        """Point at a distance from the bar in the direction of a port."""
        return self.centre + self.ports[key].t * self.along + reach * self.outward(key)

    def free_side(self) -> int:
        """Side with more room."""
        return 1 if sum(port.side * port.width for port in self.ports.values()) < 0 else -1

    def add_branch(self, key: Hashable, towards: Point) -> None:
        """Add a port on the side of the other end of a branch."""
        way = towards - self.centre
        x, y = float(self.along @ way), float(self.across @ way)
        side = self.free_side() if abs(y) < 1e-6 * abs(x) else int(np.sign(y))
        self.ports[key] = Port(side, x / max(abs(y), 1e-6 * abs(x)), x)

    def arrange(self) -> None:
        """Move each port to its wanted coordinate as nearly as order and widths allow (isotonic regression)."""
        for sign in (1, -1):
            side = sorted((p for p in self.ports.values() if p.side == sign), key=lambda p: p.slope)
            if not side:
                continue
            widths = np.array([p.width for p in side])
            shift = np.cumsum(widths) - 0.5 * widths
            self.half = max(self.half, 0.5 * widths.sum())
            wanted = isotonic_regression(np.array([p.t for p in side]) - shift).x
            places = np.clip(wanted, -self.half, self.half - widths.sum()) + shift
            for port, place in zip(side, places, strict=True):
                port.t = float(place)


def bars(
    network: Network, positions: Point, attached: Iterable[tuple[int, Hashable, float]]
) -> dict[int, Bar]:
    """Bars of all buses by number; keys of ports are indices of branches and those of `attached` (bus, key, width)."""
    at = dict(zip((bus.number for bus in network.buses), positions, strict=True))
    ways: dict[int, list[Point]] = {bus: [] for bus in at}
    for branch in network.branches:
        way = at[branch.to_bus] - at[branch.from_bus]
        for bus in branch.ends:
            ways[bus].append(np.abs(way) / np.linalg.norm(way))
    found = {}
    for bus, centre in at.items():
        x, y = np.sum(ways[bus], axis=0) if ways[bus] else (0.0, 1.0)
        found[bus] = Bar(centre, np.array([1.0, 0.0]) if y >= x else np.array([0.0, 1.0]))
    for k, branch in enumerate(network.branches):
        found[branch.from_bus].add_branch(k, at[branch.to_bus])
        found[branch.to_bus].add_branch(k, at[branch.from_bus])
    for bus, key, width in attached:
        found[bus].ports[key] = Port(found[bus].free_side(), width=width)
    for _ in range(_ROUNDS):  # both ends at the same height make a straight line
        for bus, bar in found.items():
            for k, branch in enumerate(network.branches):
                if bus in branch.ends:
                    other = found[branch.from_bus + branch.to_bus - bus]
                    bar.ports[k].t = float(bar.along @ (other.point(k) - bar.centre))
            bar.arrange()
    return found


class Clutter:
    """Lines and boxes that are drawn between two corners, so that texts hide little of them."""

    def __init__(self, low: Point, high: Point) -> None:
        self._low, self._high = low, high
        self._points: list[Point] = []
        self._boxes: list[Box] = []

    def add_line(self, points: Iterable[Point]) -> None:
        """Add a line through some points."""
        path = np.array(list(points))
        for a, b in pairwise(path):
            n = 2 + int(np.linalg.norm(b - a) / _SAMPLE)
            self._points.append(a + np.linspace(0, 1, n)[:, None] * (b - a))

    def add_box(self, centre: Point, half: Point) -> None:
        """Add a box."""
        self._boxes.append((*(centre - half), *(centre + half)))

    def settle(self, candidates: Iterable[Point], half: Point) -> Point:
        """Add a box of half size `half` at the candidate centre where it hides least, and return that centre."""
        centres = list(candidates)
        points = np.concatenate([np.zeros((0, 2)), *self._points])
        boxes = np.array(self._boxes).reshape(-1, 4)
        costs = [self._cost(c - half, c + half, points, boxes) + 1e-3 * k for k, c in enumerate(centres)]
        best = centres[int(np.argmin(costs))]
        self.add_box(best, half)
        return best

    def _cost(self, low: Point, high: Point, points: Point, boxes: NDArray[np.float64]) -> float:
        hidden = np.sum(np.all((points > low) & (points < high), axis=1))
        shared = np.minimum(high, boxes[:, 2:]) - np.maximum(low, boxes[:, :2])
        beyond = np.maximum([self._low - low, high - self._high], 0).sum()
        return float(hidden + _AREA_COST * np.prod(np.maximum(shared, 0), axis=1).sum() + _EDGE_COST * beyond)


def around(centre: Point, inner: Point, half: Point) -> Iterator[Point]:
    """Centres for a box of half size `half` beside one of half size `inner`: near ones first."""
    for distance in (0.03, 0.1, 0.2, 0.35):
        for spot in _SPOTS:
            yield centre + (inner + half + distance) * spot
