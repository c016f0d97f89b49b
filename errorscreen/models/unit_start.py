"""Start of a unit of standard models: its equilibrium, and why there is none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from errorscreen.models.part import Conflict, Limit, Part, Values, in_words

#: how far beyond a limit a unit may start, relative to the limit or 1 pu: recorded starts are that inexact
SLACK = 0.02


class Explained(NamedTuple):
    """Start of a unit: states, references, what it starts from, and rows whose constants allow it."""

    states: Values
    setpoints: Values
    conflicts: list[Conflict]
    limits: list[Limit]
    fits: NDArray[np.bool_]


@dataclass(frozen=True)
class UnitStart:
    """Equilibrium of a unit: each part from the quantities of those before it; see `Device.initialise`.

    The references of a plant controller follow from the control behind it, so that parts of a converter unit start in
    the opposite order, and stages that read what is not known yet are left out.
    """

    parts: tuple[Part, ...]

    def __call__(self, values: Values) -> tuple[Values, Values, NDArray[np.bool_]]:
        """States, references, and rows that start within all limits and whose constants keep all rules."""
        start = self.explain(values)
        fits = start.fits
        for limit in start.limits:
            low, high = _slack(limit)
            fits = fits & (limit.value >= low) & (limit.value <= high)
        return start.states, start.setpoints, fits

    @np.errstate(all="ignore")  # an absurd parameter shows in `fits`
    def explain(self, values: Values) -> Explained:
        """States, references, conflicts, limits with the start between them, and rows that keep all rules."""
        known = {
            **values,
            "Vr": values["V"] * np.cos(values["angle"]),
            "Vi": values["V"] * np.sin(values["angle"]),
        }
        states: Values = {}
        setpoints: Values = {}
        limits: list[Limit] = []
        conflicts: list[Conflict] = []
        fits = np.ones_like(values["V"], dtype=bool)
        for part in self.parts:
            local = part.local(known)
            for wrong in part.broken(local).values():
                fits = fits & ~wrong
            start = part.start(local)
            states |= {part.qualified(name): value for name, value in start.states.items()}
            setpoints |= {
                part.qualified(name): value + 0.0 * values["V"] for name, value in start.setpoints.items()
            }
            limits += [limit._replace(quantity=f"{part.name}: {limit.quantity}") for limit in start.limits]
            conflicts += [one._replace(text=f"{part.name}: {one.text}") for one in start.conflicts]
            for one in start.conflicts:
                fits = fits & ~one.found
            known |= states | setpoints
            if "Pm0" in known:  # the same at rest, also where a recorded Pm is not known yet
                known.setdefault("Pm", known["Pm0"])
            for function in part.stages:
                call = part.call(function)
                if known.keys() >= {*call.reads}:
                    written = function(*(known[name] for name in call.reads))
                    known |= dict(zip(call.writes, written, strict=True))
        return Explained(states, setpoints, conflicts, limits, fits)

    def problems(self, values: Values, row: int = 0) -> list[str]:
        """Why a row cannot start: which record, which number, which limit, and what would fit."""
        sentences = []
        for part in self.parts:
            local = part.local(values)
            for rule, wrong in part.broken(local).items():
                if np.broadcast_to(wrong, values["V"].shape)[row]:
                    symbols = {one.name: one.symbol for one in part.fields if one.name in rule}
                    found = ", ".join(f"{symbols[name]} = {_at(local[name], row):.4g}" for name in symbols)
                    sentences.append(f"{part.name}: {found}, where {in_words(rule, symbols)} must hold")
        sentences = sentences or [
            one.text.format(**{name: _at(value, row) for name, value in one.values.items()})
            for one in self.explain(values).conflicts
            if np.broadcast_to(one.found, values["V"].shape)[row]
        ]
        return sentences or [told for told, refused in self._outside(values, row) if refused]

    def moved_limits(self, values: Values, row: int = 0) -> list[str]:
        """Limits that are moved to the start of a row, because it lies beyond them by as much as recordings err."""
        return [
            f"{told}; the limit is moved to the start"
            for told, refused in self._outside(values, row)
            if not refused
        ]

    def _outside(self, values: Values, row: int) -> Iterator[tuple[str, bool]]:
        """Quantities that start outside their limits, in words, and whether by more than recordings err."""
        for limit in self.explain(values).limits:
            low, high = _slack(limit)
            value, lower, upper = (_at(one, row) for one in (limit.value, limit.lower, limit.upper))
            refused = not _at(low, row) <= value <= _at(high, row)
            if value > upper:
                name, sign, end = limit.names[1], "above", upper
            elif value < lower:
                name, sign, end = limit.names[0], "below", lower
            else:
                continue
            fits = "at least" if sign == "above" else "at most"
            yield (
                f"{limit.quantity} starts at {value:.4g} pu, {sign} {name} = {end:.4g}: with {name} of {fits} "
                f"{value:.4g}, or other values of V, P and Q before the event, it would fit",
                refused,
            )


def _at(values: NDArray[np.float64] | float, row: int) -> float:
    array = np.asarray(values, dtype=float)
    return float(array[row] if array.ndim else array)


def _slack(limit: Limit) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = np.asarray(limit.lower, dtype=float), np.asarray(limit.upper, dtype=float)
    return low - SLACK * np.maximum(1.0, np.abs(low)), high + SLACK * np.maximum(1.0, np.abs(high))
