"""States of a grid in the course of an event: their tables, and which of them holds in each step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.effects.base import Effect
from errorscreen.events import GridEvent
from errorscreen.exceptions import InputError
from errorscreen.parameters import ParameterSpace
from errorscreen.power.network import Network

#: states of the grid that are remembered while the courses of an event are made
_REMEMBERED = 4


def what_happened(
    event: GridEvent, effects: Sequence[Effect], theta: NDArray[np.float64], parameters: ParameterSpace
) -> Iterator[tuple[NDArray[np.bool_], GridEvent]]:
    """Rows of parameters that share what happened, and that event.

    Parameters
    ----------
    event : GridEvent
        On record.
    effects : sequence of Effect
        Of the kind ``"event"``.
    theta : ndarray of shape (n, m)
    parameters : ParameterSpace
        Those of the columns of `theta`.
    """
    names = [effect.local(p.name) for effect in effects for p in effect.parameters]
    columns = theta[:, [parameters.index(name) for name in names]]
    kinds, which = np.unique(columns, axis=0, return_inverse=True)
    for number, row in enumerate(kinds):
        own = dict(zip(names, row.tolist(), strict=True))
        happened: Any = event
        for effect in effects:
            happened = effect.equations(happened, *(own[effect.local(p.name)] for p in effect.parameters))
        yield which.ravel() == number, happened


def tables_in_time(
    event: GridEvent,
    network: Network,
    before: NDArray[np.float64],
    table: Callable[[Network], NDArray[np.float64]],
    h: float,
    steps: int,
    *,
    exact: bool,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Tables of each state of the grid, that before the event first, and which holds in each step.

    Where instants need not be exact, the step in which the grid changes has the mean of both tables, weighted by
    time: an instant that is estimated must act smoothly.

    Parameters
    ----------
    event : GridEvent
    network : Network
        Before the event.
    before : ndarray of shape (n_tables,)
        Its table.
    table : callable
        Table of one state of the grid.
    h : float
        Step in seconds.
    steps : int
    exact : bool
        Whether each change must fall on a step.

    Returns
    -------
    tables : ndarray of shape (n_states, n_tables)
    segment : ndarray of shape (steps + 1,)
        Row of `tables` that holds throughout each step, see `Engine.integrate`.

    Raises
    ------
    InputError
        If an instant that must be exact is no multiple of the step.
    """
    segment = np.zeros(steps + 1, dtype=np.int64)
    tables = [before]
    for instant, changed in event.changes(network):
        position = (instant - event.time[0]) / h
        first = round(position)
        if exact and abs(first - position) > 1e-6:
            raise InputError(
                f"the grid changes at {instant:g} s",
                where=event.name,
                allowed=f"multiples of {h:g} s after {event.time[0]:g} s",
                remedy="Move the instant, or choose another step",
            )
        last = tables[-1]
        after = before if changed is network else table(changed)
        if abs(first - position) > 1e-6:
            first = int(np.floor(position))
            share = position - first
            if 0 <= first <= steps:
                segment[first] = len(tables)
            tables.append(share * last + (1 - share) * after)
            first += 1
        segment[max(first, 0) :] = len(tables)
        tables.append(after)
    return np.array(tables), segment


def courses(
    happened: Iterable[tuple[NDArray[np.bool_], GridEvent]],
    network: Network,
    table: Callable[[Network], NDArray[np.float64]],
    before: NDArray[np.float64],
    instants: int,
    n: int,
    h: float,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    """Tables in the course of what happened in each of n simulations.

    Parameters
    ----------
    happened : iterable of (ndarray of shape (n,), GridEvent)
        See `what_happened`.
    network, table, before, h
        See `tables_in_time`.
    instants : int
        Steps, and one more.
    n : int

    Returns
    -------
    tables : ndarray of shape (n_states, n_tables)
        That before the event first, which is common to all.
    segment : ndarray of shape (n, instants)
        See `Engine.integrate`.
    possible : ndarray of shape (n,), bool
        Two branches opened can leave an island.
    """
    known: list[tuple[Network, NDArray[np.float64]]] = []

    def remembered(wanted: Network) -> NDArray[np.float64]:
        """Table of a grid; a fault that only lasts longer leads to the same grids again."""
        found = next((values for grid, values in known if grid == wanted), None)
        if found is None:
            found = table(wanted)
            known.insert(0, (wanted, found))
            del known[_REMEMBERED:]
        return found

    tables, segments, possible = [before], np.zeros((n, instants), dtype=np.int64), np.ones(n, dtype=bool)
    for rows, event in happened:
        try:
            own, segment = tables_in_time(event, network, before, remembered, h, instants - 1, exact=False)
        except InputError:
            possible[rows] = False
            continue
        segments[rows] = np.where(segment > 0, segment + len(tables) - 1, 0)
        tables += [*own[1:]]
    return np.array(tables), segments, possible


def steps_at_rest(segment: NDArray[np.int64], every: int) -> int:
    """Steps at the beginning that need no integration: the grid is in equilibrium until the event changes it.

    A multiple of `every`, the steps between two instants that are compared. The last of these instants before the
    change is left, because what is recorded at the change belongs to after it. 0 where the grid never changes, so that
    a run without any event still shows whether it stays where it is.

    Examples
    --------
    >>> steps_at_rest(np.array([0, 0, 0, 0, 1, 2]), every=2)
    2

    With a fault from the first instant on there is no rest, although nothing changes until it is cleared:

    >>> steps_at_rest(np.array([1, 1, 1, 1, 2, 2]), every=1)
    0
    """
    changed = segment > 0
    return max(0, (int(changed.argmax()) // every - 1) * every) if changed.any() else 0
