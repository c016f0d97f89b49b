r"""Symmetrical components of three phases, and V, angle, P and Q that follow from them.

With :math:`a = e^{j 2\pi/3}` and rms phasors of the phases, or of the voltages between them:

.. math::

    V_1 &= \tfrac13 (V_a + a V_b + a^2 V_c) = \tfrac{1}{3\sqrt3} e^{-j\pi/6} (V_{ab} + a V_{bc} + a^2 V_{ca})   & (1)\\
    V_2 &= \tfrac13 (V_a + a^2 V_b + a V_c), \qquad V_0 = \tfrac13 (V_a + V_b + V_c)                      & (2)\\
    P + jQ &= 3\, V_1 I_1^*                                                                              & (3)

Source: C. L. Fortescue, Method of symmetrical co-ordinates applied to the solution of polyphase networks, Trans. AIEE
37 (1918). One phase with the wrong sign in a balanced system gives :math:`|I_2| = |I_0| = 2 |I_1|`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.headers import spelled
from errorscreen.data.plausibility import doubt
from errorscreen.data.units import KA, KV, Bases, Column
from errorscreen.exceptions import InputError, unknown_name

_Array = NDArray[np.float64]
Phasor = NDArray[np.complex128]
#: columns that follow, with their units
OWN = {"V": "kV", "angle": "rad", "f": "Hz", "P": "MW", "Q": "Mvar", "V2": "kV", "V0": "kV"}
_TURN = np.exp(2j * np.pi / 3)
#: a negative sequence of this part of the positive one before an event is no usual unbalance
_UNBALANCED = 0.5
#: part of the record that counts as "before"
_START = 0.05
_T = TypeVar("_T")


def spec_of(kind: type[_T], found: _T | Mapping[str, Any], where: str) -> _T:
    """A description, given as a mapping of its fields or as an object.

    Raises
    ------
    InputError
        If it is neither, or a field is unknown, or the voltages or currents are no lists.
    """
    if not isinstance(found, kind):
        known: Mapping[str, Any] = kind.__dataclass_fields__  # type: ignore[attr-defined]
        if not isinstance(found, Mapping) or "voltage" not in found:
            raise InputError(
                "the voltages are not stated", where=where, allowed="fields such as voltage, current"
            )
        for key in found:
            if key not in known:
                raise unknown_name(key, known, kind="field", where=where)
        found = kind(**found)
    for name in ("voltage", "current"):
        if not isinstance(getattr(found, name), list | tuple):
            raise InputError(
                f"{name} is {getattr(found, name)!r}",
                where=where,
                allowed="a list, with one entry for a phase",
            )
    return found


def derived(name: str) -> str:
    """Header of a column that follows: not its name alone, which a column of the file may have, too."""
    return f"{name} of the phases"


def own_columns(names: Iterable[str]) -> dict[str, Column]:
    """Sources of the channels that follow."""
    return {name: Column(derived(name), unit=OWN[name]) for name in names}


def own_column(spec: Column, where: str) -> Column:
    """Source of a channel whose description names a column that follows, such as V2, or P with another sign.

    Raises
    ------
    InputError
        If another unit is stated than that in which it follows.
    """
    name = str(spec.column)
    if spec.unit not in (None, OWN[name]):
        raise InputError(
            f"the file has no column {name!r}; it follows from the phases in {OWN[name]}, but its unit is given as "
            f"{spec.unit!r}",
            where=where,
            allowed=OWN[name],
            remedy="Correct the unit, or leave it out",
        )
    return replace(spec, column=derived(name), unit=OWN[name])


def factor(
    units: Mapping[str, str],
    headers: Sequence[str],
    given: str | None,
    quantity: str,
    where: str,
    pu: Mapping[str, float] | None = None,
) -> float:
    """Factor to kV of a ``"voltage"``, or kA of a ``"current"``, by the given unit, or that of the file.

    `pu` holds that of each quantity in pu, where pu are allowed.
    """
    factors = dict(KV if quantity == "voltage" else KA)
    if pu is not None:
        factors["pu"] = pu.get(quantity, np.nan)
    stated = {given} if given else {spelled(units.get(header, "")) for header in headers}
    unit = stated.pop() if len(stated) == 1 else ""
    if unit not in factors:
        raise InputError(
            f"the unit of {', '.join(headers)} is {unit or 'not stated'!r}",
            where=where,
            allowed=f"{' or '.join(factors)}, the same for all",
            remedy=f"Give {quantity}_unit",
        )
    if np.isnan(factors[unit]):
        raise InputError(
            f"the {quantity} in pu cannot be converted",
            where=where,
            allowed="pu with base_kv",
            remedy="Give base_kv, the base voltage from line to line in kV",
        )
    return factors[unit]


def pu_factors(bases: Bases, line_to_line: bool) -> dict[str, float]:
    """Voltage of 1 pu in kV, and current of 1 pu in kA; nothing without a base voltage."""
    if bases.kv is None:
        return {}
    kv = bases.kv if line_to_line else bases.kv / np.sqrt(3)
    return {"voltage": kv, "current": bases.mva / (np.sqrt(3) * bases.kv)}


def sequences(phases: Sequence[Phasor], line_to_line: bool = False) -> tuple[Phasor, Phasor, Phasor]:
    """Positive, negative and zero sequence of three phasors of shape (L,), (1) and (2).

    Examples
    --------
    >>> one, two, zero = sequences([np.array([1.0 + 0j]), np.array([_TURN**2]), np.array([_TURN])])
    >>> bool(np.allclose([one, two, zero], [[1], [0], [0]]))
    True
    """
    a, b, c = phases
    one, two, zero = (
        (a + _TURN * b + _TURN**2 * c) / 3,
        (a + _TURN**2 * b + _TURN * c) / 3,
        (a + b + c) / 3,
    )
    if line_to_line:
        one, two = (
            part * np.exp(-1j * turn) / np.sqrt(3) for part, turn in ((one, np.pi / 6), (two, -np.pi / 6))
        )
    return one, two, zero


def check_voltages(voltages: Sequence[Phasor], names: Sequence[str], where: str) -> None:
    """Refuse voltages of another phase order, or of which one is reversed.

    Raises
    ------
    InputError
        If the negative sequence is large from the start on.
    """
    one, two, _ = _levels(voltages)
    if not two > _UNBALANCED * one:
        return
    swapped = [names[0], *names[:0:-1]]
    turned = _reversed(voltages, names)
    remedy = (
        f"Correct the sign of {turned!r} in the file: with the other one the voltages would be balanced"
        if turned is not None
        else f"Interchange two of the voltages: {swapped}"
        if one < _UNBALANCED * two
        else "Name the three voltages of one place, and begin before the event"
    )
    raise InputError(
        f"the negative sequence of the voltage is {two:.3g} kV, the positive one {one:.3g} kV",
        where=where,
        allowed="phases in the order of the positive sequence",
        remedy=remedy,
    )


def doubt_currents(currents: Sequence[Phasor], names: Sequence[str], notes: list[str], where: str) -> None:
    """Doubt currents of another phase order, or of which one is reversed."""
    one, two, _ = _levels(currents)
    if not two > one:
        return
    turned = _reversed(currents, names)
    why = (
        f"with the other sign of {turned!r} they would be balanced: one current transformer reversed?"
        if turned is not None
        else f"two phases interchanged, {[names[0], *names[:0:-1]]}?"
    )
    notes.append(doubt(f"The currents have a larger negative than positive sequence; {why}", where))


def _levels(phases: Sequence[Phasor]) -> tuple[float, float, float]:
    """Magnitudes of the three sequences at the start of the record, zero where nothing is known."""
    parts = sequences(phases)
    known = np.flatnonzero(np.isfinite(parts[0]))
    start = known[: max(2, int(_START * len(known)))]
    one, two, zero = (float(np.median(np.abs(part[start]))) if len(start) else 0.0 for part in parts)
    return one, two, zero


def _reversed(phases: Sequence[Phasor], names: Sequence[str]) -> str | None:
    """Name of the only phase without whose sign the phases would be balanced; None if there is none."""
    for k, name in enumerate(names):
        one, two, zero = _levels([-phase if i == k else phase for i, phase in enumerate(phases)])
        if max(two, zero) < _UNBALANCED * one:
            return name
    return None


def magnitudes(one: Phasor, two: Phasor | None = None, zero: Phasor | None = None) -> dict[str, _Array]:
    """V, and V2 and V0 where they are known, in kV from line to line, of phasors in kV of the phases."""
    parts = {"V": one, "V2": two, "V0": zero}
    return {name: np.sqrt(3) * np.abs(part) for name, part in parts.items() if part is not None}


def power(voltage: Phasor, current: Phasor) -> dict[str, _Array]:
    """P in MW and Q in Mvar by (3), positive in the direction of the current."""
    found = 3.0 * voltage * np.conj(current)
    return {"P": found.real, "Q": found.imag}
