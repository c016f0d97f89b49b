"""States of a grid during an event: their tables, and the state that holds in each step."""

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

#: states that a new one is compared with, and states that are reduced together, with all their matrices in memory
_COMPARED, _TOGETHER = 4, 64
#: largest distance of an instant from a step, in steps
_NEARLY = 1e-6


def events_by_row(
    event: GridEvent, effects: Sequence[Effect], theta: NDArray[np.float64], parameters: ParameterSpace
) -> Iterator[tuple[NDArray[np.bool_], GridEvent]]:
    """Rows of parameters with the same true event, and that event, from effects of the kind ``"event"``."""
    names = [effect.local(p.name) for effect in effects for p in effect.parameters]
    columns = theta[:, [parameters.index(name) for name in names]]
    kinds, which = distinct_rows(columns)
    # sorted, so that equal states of the grid follow each other
    for number in np.lexsort(kinds.T[::-1]):
        own = dict(zip(names, kinds[number].tolist(), strict=True))
        true_event: Any = event
        for effect in effects:
            true_event = effect.equations(true_event, *(own[effect.local(p.name)] for p in effect.parameters))
        yield which == number, true_event


def tables_in_time(
    event: GridEvent,
    network: Network,
    tables: Callable[[Sequence[Network]], NDArray[np.float64]],
    h: float,
    steps: int,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Tables of the grid's states (n_states, n_tables), that before the event first, and the state of each step."""
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
    true_events: Iterable[tuple[NDArray[np.bool_], GridEvent]],
    network: Network,
    tables: Callable[[Sequence[Network]], NDArray[np.float64]],
    before: NDArray[np.float64],
    instants: int,
    n: int,
    h: float,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    """Tables and segments of n simulations with the events of `events_by_row`, and which are possible (n,).

    A step in which the grid changes has the mean of both tables, weighted by time, so that an estimated instant acts
    smoothly. An event is not possible where open branches leave an island.
    """
    # states are reduced together; a fault that only lasts longer has the same ones
    parts, plans, possible = [before[None]], [], np.ones(n, dtype=bool)
    recent: list[tuple[int, Network]] = [(0, network)]
    waiting: list[Network] = []
    count = 1
    for rows, event in true_events:
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
    """Tables and segment; `values` (n_times + 1, n_tables) are the tables before, and from each of `times` on."""
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
    """Steps at the beginning, a multiple of `every`, that need no integration, because the grid is in equilibrium.

    The last of them before the change is integrated, because the value at the change is the one after it. 0 where the
    grid never changes, so that a run without any event still shows whether it stays in equilibrium.
    """
    changed = segment > 0
    return max(0, (int(changed.argmax()) // every - 1) * every) if changed.any() else 0
