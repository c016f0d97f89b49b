"""Records of a unit in a DYR file: whether they fit together, and what is said of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from errorscreen.exceptions import InputError
from errorscreen.models.dyr_record import Bus, DyrRecord
from errorscreen.models.notes import notes_of
from errorscreen.models.part import Part
from errorscreen.models.unit import family_of, in_slots


class Known(NamedTuple):
    """A record of a known model, with its place."""

    part: Part
    where: str
    record: DyrRecord


def understood(records: Iterable[DyrRecord]) -> list[Known]:
    """Records of known models."""
    return [Known(one.part, one.where, one) for one in records if one.part]


def misplaced(records: Sequence[DyrRecord]) -> Iterator[InputError]:
    """Records of a unit that do not fit together."""
    known = understood(records)
    try:
        slots = in_slots(known)
        if len(known) == len(records):  # else the unknown one may be the machine
            family_of(slots)
    except InputError as error:
        yield error


def doubtful(group: Sequence[tuple[DyrRecord, list[float]]]) -> Iterator[DyrRecord]:
    """Records of one model with a value out of its range, or a broken rule: of thousands, only these are looked at."""
    part, values = group[0][0].part, np.array([values for _, values in group])
    bad = np.zeros(len(group), dtype=bool)
    if part is not None:
        for one, column in zip(part.fields, values.T, strict=True):
            bad |= np.isin(column, [value for value in np.unique(column) if not one.accepts(value)])
        for wrong in part.broken({one.name: values[:, k] for k, one in enumerate(part.fields)}).values():
            bad |= wrong
    return (group[k][0] for k in np.flatnonzero(bad).tolist())


def is_source(records: Sequence[DyrRecord]) -> bool:
    """Whether the records are a voltage source, which stands for the network and is no unit."""
    return len(records) == 1 and records[0].voltage_source


def told_of(records: Sequence[DyrRecord], bus: Bus) -> list[str]:
    """What the models of a unit take otherwise than their records say; nothing where one cannot be used."""
    if is_source(records):
        return []
    try:
        slots = in_slots([one.checked() for one in records])
    except InputError:
        return []
    return [note.text for note in notes_of(slots, bus)]
