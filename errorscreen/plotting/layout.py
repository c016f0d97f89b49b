r"""Positions of the buses of a diagram, given or computed from the network.

In the computed layout the distance of two buses is nearly proportional to the number of branches between them. It
minimises the stress

.. math:: \sum_{i<j} d_{ij}^{-2} (|x_i - x_j| - d_{ij})^2                                              & (Y1)

by majorisation (Gansner, Koren, North, "Graph drawing by stress majorization", Graph Drawing 2004), from the
coordinates of classical scaling (Torgerson, "Multidimensional scaling: I. Theory and method", Psychometrika 17, 1952,
401-419). Nothing in it is random.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import shortest_path
from scipy.spatial.distance import cdist, pdist

from errorscreen.exceptions import InputError
from errorscreen.power.network import Network

Points = NDArray[np.float64]
#: largest number of steps of the majorisation, and the relative gain of a step at which it ends
_STEPS, _GAIN = 300, 1e-5
#: inches from a bus to the nearest one, for all but the densest tenth; bounds of the longer side
_SPACING, _SHORTEST, _LONGEST = 0.8, 4.5, 30.0


def bus_positions(network: Network, given: Mapping[int, Sequence[float]] | None) -> Points:
    """Return positions of all buses in inches, in the order of the network, shape (n_buses, 2)."""
    points = _stress_layout(network) if given is None else _checked(network, given)
    points = points - points.min(axis=0)
    if len(points) == 1:
        return points
    apart = cdist(points, points) + np.diag(np.full(len(points), np.inf))
    longest = points.max() * _SPACING / np.quantile(apart.min(axis=1), 0.1)
    return points * (np.clip(longest, _SHORTEST, _LONGEST) / points.max())


def _checked(network: Network, given: Mapping[int, Sequence[float]]) -> Points:
    missing = [str(bus.number) for bus in network.buses if bus.number not in given]
    if missing:
        raise InputError(
            f"no position for bus {', '.join(missing)}",
            where="positions",
            allowed="(x, y) for each bus",
            remedy="Leave positions out to have them computed",
        )
    points = np.zeros((len(network.buses), 2))
    seen: dict[tuple[float, ...], int] = {}
    for i, bus in enumerate(network.buses):
        try:
            point = np.array(given[bus.number], dtype=float)
        except (TypeError, ValueError):
            point = np.array(np.nan)
        if point.shape != (2,) or not np.isfinite(point).all():
            problem = f"the position of bus {bus.number} is {given[bus.number]!r}"
            raise InputError(problem, where="positions", allowed="two finite numbers")
        other = seen.setdefault(tuple(point), bus.number)
        if other != bus.number:
            raise InputError(f"the buses {other} and {bus.number} are at the same place", where="positions")
        points[i] = point
    return points


def _stress_layout(network: Network) -> Points:
    """Minimise (Y1); the longest axis lies horizontally."""
    n = len(network.buses)
    if n == 1:
        return np.zeros((1, 2))
    joined = np.zeros((n, n))
    for branch in network.branches:
        joined[network.index(branch.from_bus), network.index(branch.to_bus)] = 1
    distance = shortest_path(joined, directed=False, unweighted=True)
    weight = 1 / (distance + np.eye(n)) ** 2 - np.eye(n)
    inverse = np.linalg.pinv(np.diag(weight.sum(axis=1)) - weight)
    points, stress = _classical_scaling(distance), np.inf
    for _ in range(_STEPS):
        apart = np.maximum(cdist(points, points), 1e-9) + np.eye(n)
        ratio = weight * distance / apart
        points = inverse @ (np.diag(ratio.sum(axis=1)) - ratio) @ points
        before, stress = stress, _stress(points, distance)
        if before - stress < _GAIN * stress:
            break
    return points @ np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T


def _stress(points: Points, distance: Points) -> float:
    wanted = distance[np.triu_indices(len(points), 1)]
    return float(np.sum((pdist(points) / wanted - 1) ** 2))


def _classical_scaling(distance: Points) -> Points:
    """Coordinates with the inner products nearest to those of the distances; signs are fixed."""
    centred = distance**2 - (distance**2).mean(axis=0)
    values, vectors = np.linalg.eigh(-0.5 * (centred - centred.mean(axis=1, keepdims=True)))
    vectors = vectors[:, -2:] * np.sign(vectors[np.abs(vectors[:, -2:]).argmax(axis=0), [-2, -1]])
    spread = 1e-3 * np.sin(np.arange(2 * len(distance))).reshape(-1, 2)  # separates buses that coincide
    return vectors * np.sqrt(np.maximum(values[-2:], 0)) + spread
