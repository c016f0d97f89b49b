"""States of a grid in the course of an event: their tables, and which of them holds in each step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.effects.base import Effect
from errorscreen.events import GridEvent
from errorscreen.exceptions import InputError
from errorscreen.parameters import ParameterSpace, distinct_rows
from errorscreen.power.network import Network

#: states of the grid that a new one is compared with, and how many are reduced together: matrices of all are in memory
_COMPARED, _TOGETHER = 4, 64
#: share of a step by which an instant may miss it
_NEARLY = 1e-6


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
    kinds, which = distinct_rows(columns)
    # sorted, so that those that lead to the same states of the grid follow each other
    for number in np.lexsort(kinds.T[::-1]):
        own = dict(zip(names, kinds[number].tolist(), strict=True))
        happened: Any = event
        for effect in effects:
            happened = effect.equations(happened, *(own[effect.local(p.name)] for p in effect.parameters))
        yield which == number, happened


def tables_in_time(
    event: GridEvent,
    network: Network,
    tables: Callable[[Sequence[Network]], NDArray[np.float64]],
    h: float,
    steps: int,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Tables of each state of the grid on record, that before the event first, and which holds in each step.

    Parameters
    ----------
    event : GridEvent
    network : Network
        Before the event.
    tables : callable
        Tables of states of the grid, shape (n_states, n_tables).
    h : float
        Step in seconds.
    steps : int

    Returns
    -------
    tables : ndarray of shape (n_states, n_tables)
    segment : ndarray of shape (steps + 1,)
        Row of `tables` that holds throughout each step, see `Engine.integrate`.

    Raises
    ------
    InputError
        If an instant at which the grid changes is no multiple of the step, or the grid has no unique solution then.
    """
    changes = event.changes(network)
    values = tables([network, *(changed for _, changed in changes)])
    if not np.isfinite(values[0]).all():
        raise InputError("the grid has no unique solution before the event", where=event.name)
    for (instant, _), after in zip(changes, values[1:], strict=True):
        position = (instant - event.time[0]) / h
        if abs(round(position) - position) > _NEARLY:
            raise InputError(
                f"the grid changes at {instant:g} s",
                where=event.name,
                allowed=f"multiples of {h:g} s after {event.time[0]:g} s",
                remedy="Move the instant, or choose another step",
            )
        if not np.isfinite(after).all():
            raise InputError(f"the grid has no unique solution after {instant:g} s", where=event.name)
    return _placed(event, [instant for instant, _ in changes], values, h, steps)


def courses(
    happened: Iterable[tuple[NDArray[np.bool_], GridEvent]],
    network: Network,
    tables: Callable[[Sequence[Network]], NDArray[np.float64]],
    before: NDArray[np.float64],
    instants: int,
    n: int,
    h: float,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    """Tables in the course of what happened in each of n simulations.

    Instants need not fall on a step: the step in which the grid changes has the mean of both tables, weighted by time,
    because an instant that is estimated must act smoothly.

    Parameters
    ----------
    happened : iterable of (ndarray of shape (n,), GridEvent)
        See `what_happened`.
    network, tables, h
        See `tables_in_time`.
    before : ndarray of shape (n_tables,)
        Table of the grid before the event.
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
    # states are reduced together; a fault that only lasts longer leads to the same ones again
    parts, plans, possible = [before[None]], [], np.ones(n, dtype=bool)
    recent: list[tuple[int, Network]] = [(0, network)]
    waiting: list[Network] = []
    count = 1
    for rows, event in happened:
        try:
            changes = event.changes(network)
        except InputError:
            possible[rows] = False
            continue
        numbers = []
        for _, changed in changes:
            number = next((k for k, state in recent if state == changed), count)
            if number == count:
                waiting.append(changed)
                recent, count = [recent[0], (count, changed), *recent[1:_COMPARED]], count + 1
            numbers.append(number)
        plans.append((rows, event, [instant for instant, _ in changes], numbers))
        if len(waiting) >= _TOGETHER:
            parts.append(tables(waiting))
            waiting = []
    values = np.concatenate([*parts, tables(waiting)] if waiting else parts)
    out, segments, first = [before[None]], np.zeros((n, instants), dtype=np.int64), 1
    for rows, event, times, numbers in plans:
        own, segment = _placed(event, times, values[[0, *numbers]], h, instants - 1)
        possible[rows] = np.isfinite(own).all()
        segments[rows] = np.where(segment > 0, segment + first - 1, 0)
        out.append(own[1:])
        first += len(own) - 1
    return np.concatenate(out), segments, possible


def _placed(
    event: GridEvent, times: Sequence[float], values: NDArray[np.float64], h: float, steps: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Tables with those of steps within which the grid changes, and which of them holds in each step.

    Parameters
    ----------
    event : GridEvent
    times : sequence of float
        Instants at which the grid changes.
    values : ndarray of shape (n_times + 1, n_tables)
        Tables before, and from each instant on.
    h, steps
        See `tables_in_time`.
    """
    segment, tables = np.zeros(steps + 1, dtype=np.int64), [values[0]]
    for instant, after in zip(times, values[1:], strict=True):
        position = (instant - event.time[0]) / h
        first = round(position)
        if abs(first - position) > _NEARLY:
            first = int(np.floor(position))
            share = position - first
            if 0 <= first <= steps:
                segment[first] = len(tables)
            tables.append(share * tables[-1] + (1 - share) * after)
            first += 1
        segment[max(first, 0) :] = len(tables)
        tables.append(after)
    return np.array(tables), segment


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
