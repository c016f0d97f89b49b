"""Headers of columns that belong together: three phases, magnitude and angle, real and imaginary part."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.complex_texts import is_complex
from errorscreen.data.headers import LONGEST_HEADER
from errorscreen.data.table import Table
from errorscreen.exceptions import InputError

_Array = NDArray[np.float64]
#: marks of three phases, or of the voltages between them
PHASES = (("a", "b", "c"), ("ab", "bc", "ca"), ("l1", "l2", "l3"), ("r", "s", "t"), ("r", "y", "b"))
_MARK = r"(?<![a-z0-9])(?:[vui]|ph|phase)?({})(?![a-z0-9])"
#: letter of a quantity in front of a phase or of the positive sequence
_LETTER = re.compile(
    rf"(?<![a-z0-9])([vui])_?(?:{'|'.join(mark for marks in PHASES for mark in marks)}|1|pos)(?![a-z0-9])",
    re.IGNORECASE,
)
#: words for the parts of a phasor
_WORDS = {
    "angle": {"ang", "angle", "phase", "phi", "deg", "rad"},
    "real": {"re", "real"},
    "imag": {"im", "imag", "imaginary"},
}
_KINDS = {"mag", "magnitude", "rms", *(word for words in _WORDS.values() for word in words)}
#: by which part of their level phases differ at least, and in how many readings
_DIFFER, _READINGS = 0.05, 3


def sisters(header: str, headers: Iterable[str]) -> list[str]:
    """Headers of all three phases of which one is given, in the order of the phases; empty if they are not there.

    Examples
    --------
    >>> sisters("VB_mag", ["VA_mag", "VB_mag", "VC_mag", "IA_mag"])
    ['VA_mag', 'VB_mag', 'VC_mag']
    >>> sisters("Va", ["Va", "Vb", "P"])
    []
    """
    present = {*headers}
    for marks in PHASES:
        for match in re.finditer(_MARK.format("|".join(marks)), header, re.IGNORECASE):
            begin, end = match.span(1)
            named = (mark.upper() if match[1][0].isupper() else mark for mark in marks)
            found = [f"{header[:begin]}{mark}{header[end:]}" for mark in named]
            if present.issuperset(found):
                return found
    return []


def differing_phase(
    table: Table, header: str, values: _Array, missing: Iterable[str | float], decimal: str
) -> str | None:
    """Say so where a column is one of three phases, and moves in another way than one of the others.

    Parameters
    ----------
    table : Table
        With the columns of the other phases, perhaps.
    header : str
    values : ndarray of shape (L,)
        Numbers of that column, NaN for gaps.
    missing, decimal
        As in `errorscreen.data.frames.build_recording`.
    """
    most, other = 0.0, ""
    for name in sisters(header, table.columns):
        if name == header:
            continue
        try:
            beside = table.numbers(name, missing=missing, decimal=decimal)
        except InputError:  # nothing is read from this column
            continue
        apart = _apart(values, beside)
        if apart > most:
            most, other = apart, name
    if not other:
        return None
    return (
        f"V is column {header!r}, one phase of three, and differs from {other!r} by up to {most:.0%} of its level: "
        "give phasors, magnitude and angle of all three, instead of V."
    )


def _apart(one: _Array, two: _Array) -> float:
    """Largest difference of two signals in parts of their first readings, 0 where it is that of noise."""
    known = np.isfinite(one) & np.isfinite(two)
    one, two = one[known], two[known]
    start = slice(0, max(_READINGS, len(one) // 10))
    if len(one) < 2 * _READINGS or not (np.median(one[start]) > 0 and np.median(two[start]) > 0):
        return 0.0
    apart = np.abs(one / np.median(one[start]) - two / np.median(two[start]))
    beyond = apart > max(_DIFFER, _READINGS * float(np.percentile(apart[start], 95)))
    return float(apart.max()) if beyond.sum() >= _READINGS else 0.0


def phasors_of(
    table: Table, headers: Sequence[str], units: Mapping[str, str | None]
) -> dict[str, Any] | None:
    """Fields of `errorscreen.data.phasors.Phasors` that headers name; None where there are no phasors of a voltage.

    Parameters
    ----------
    table : Table
    headers : sequence of str
    units : mapping of str to str or None
        Units of the columns as far as they are known: kV, V, kA, A, deg or rad.
    """
    found: dict[str, tuple[list[Any], str, bool]] = {}
    for quantity, letters, kinds in (
        ("voltage", ("v", "u"), ("V", "kV")),
        ("current", ("i",), ("A", "kA")),
    ):
        for header in headers:
            if _quantity(header, letters, units.get(header) in kinds):
                phasors = _phasors(table, header, headers)
                if phasors is not None:
                    found[quantity] = phasors
                    break
    if "voltage" not in found:
        return None
    voltage, form, between = found["voltage"]
    fields: dict[str, Any] = {"voltage": voltage}
    if "current" in found and found["current"][1] == form and len(found["current"][0]) == len(voltage):
        fields["current"] = found["current"][0]
    if form == "rectangular":
        fields["form"] = form
    if between:
        fields["line_to_line"] = True
    return fields


def _quantity(header: str, letters: Sequence[str], by_unit: bool) -> bool:
    """Whether a header is a magnitude, a real part or a complex number of a voltage, or of a current."""
    words = _words(header)
    if not words or words & (_WORDS["angle"] | _WORDS["imag"]):
        return False
    named = _LETTER.findall(header)  # behind the name of a station, which may begin with any letter
    first = named[-1].casefold() if named else re.sub(r"[^a-z]", "", header.casefold())[:1]
    return by_unit or first in letters


def _words(header: str) -> set[str]:
    name = re.sub(r"\s*[\[(].*[\])]$", "", header[:LONGEST_HEADER])
    return {*re.split(r"[^a-z0-9]+", name.casefold())} - {""}


def _phasors(table: Table, header: str, headers: Sequence[str]) -> tuple[list[Any], str, bool] | None:
    """Phasors of three phases, or of the positive sequence, their form, and whether they are between phases."""
    three = sisters(header, headers)
    one = re.search(r"(?<![a-z0-9])[vui]_?(1|pos)(?![0-9])", header, re.IGNORECASE)
    group = three or ([header] if one else [])
    if not group:
        return None
    between = bool(three) and re.search(_MARK.format("ab"), three[0], re.IGNORECASE) is not None
    if all(_is_complex(table, name) for name in group):
        return [*group], "text", between
    form = "rectangular" if _words(header) & _WORDS["real"] else "polar"
    seconds = [_second(name, headers, "imag" if form == "rectangular" else "angle") for name in group]
    if None in seconds:
        return None
    return [[a, b] for a, b in zip(group, seconds, strict=True)], form, between


def _is_complex(table: Table, name: str) -> bool:
    cells = table.columns[name]
    if isinstance(cells, np.ndarray):
        return cells.dtype.kind == "c"
    return any(is_complex(str(cell)) for cell in cells[:100])


def _second(header: str, headers: Sequence[str], kind: str) -> str | None:
    """Header of the angle, or of the imaginary part, that belongs to another header; None without exactly one."""
    stem = _words(header) - _KINDS
    fitting = [h for h in headers if h != header and _words(h) - _KINDS == stem and _words(h) & _WORDS[kind]]
    return fitting[0] if len(fitting) == 1 else None
