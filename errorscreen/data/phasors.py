r"""V, angle, f, P and Q from the rms phasors of a phasor measurement unit.

A synchrophasor of a signal with the nominal frequency :math:`f_n` is (IEEE Std C37.118.1-2011, 4.2)

.. math:: x(t) = \sqrt2\, |X(t)| \cos(2\pi f_n t + \varphi(t)), \qquad X(t) = |X(t)|\, e^{j\varphi(t)}  \qquad (1)

Its angle is in the frame of the nominal frequency already, so it is the channel ``angle`` as it is. The frequency is

.. math:: f(t) = f_n + \frac{1}{2\pi} \frac{\mathrm d\varphi_1}{\mathrm dt}                               \qquad (2)

by central differences over the neighbouring phasors of the positive sequence, with no delay. The positive sequence and
the powers follow by the equations of `errorscreen.data.sequences`. A phasor lacks a part only where the file does.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from errorscreen.data.complex_texts import complex_of, is_no_reading
from errorscreen.data.headers import spelled
from errorscreen.data.sequences import (
    Phasor,
    check_voltages,
    doubt_currents,
    factor,
    magnitudes,
    own_columns,
    power,
    pu_factors,
    sequences,
    spec_of,
)
from errorscreen.data.table import Table
from errorscreen.data.units import Bases, Column, unwrap
from errorscreen.data.waveforms import Waveforms, as_waveforms
from errorscreen.exceptions import InputError, unknown_name

_Array = NDArray[np.float64]
#: meaning of the two columns of a phasor
FORMS = ("polar", "rectangular")
#: names of the parts of a phasor in one column
_PARTS = ("real part", "imaginary part")
#: values of keys that are names
_CHOICES = {
    "form": FORMS,
    "magnitude": ("rms", "peak"),
    "angle_unit": ("deg", "rad", None),
    "sign": ("generator", "load"),
}


@dataclass(frozen=True)
class Phasors:
    """Rms phasors of three phases, or of the positive sequence.

    Parameters
    ----------
    voltage : tuple of str or of pairs of str
        Three phasors, in the order of the phases, from line to neutral; or one, of the positive sequence of the phases.
        Each is a pair of headers (see `form`), or the header of a column with texts such as ``230.1+12.3j``,
        ``(230.1, 12.3)``, ``230.1∠12.5`` or ``230.1@12.5`` (angle in degrees).
    current : tuple, optional
        As many phasors; without them there are no P and Q.
    form : {"polar", "rectangular"}
        The two columns are magnitude and angle, or real and imaginary part.
    angle_unit : {"deg", "rad"}, optional
        That of the file where not given.
    magnitude : {"rms", "peak"}
    sign : {"generator", "load"}
        Currents are positive out of the plant, or into it.
    line_to_line : bool
        The voltages are those between a and b, b and c, c and a; or the magnitude of the positive sequence is √3 times
        that of a phase.
    voltage_unit, current_unit : {"V", "kV", "pu"}, {"A", "kA", "pu"}, optional
        Those of the file where not given; pu of the bases of the recording.

    Examples
    --------
    >>> Phasors(voltage=(("V1 mag", "V1 ang"),), angle_unit="deg").headers
    ('V1 mag', 'V1 ang')
    """

    voltage: tuple[str | tuple[str, ...], ...]
    current: tuple[str | tuple[str, ...], ...] = ()
    form: str = "polar"
    angle_unit: str | None = None
    magnitude: str = "rms"
    sign: str = "generator"
    line_to_line: bool = False
    voltage_unit: str | None = None
    current_unit: str | None = None

    @property
    def headers(self) -> tuple[str, ...]:
        """Headers of the columns that are read."""
        return tuple(header for one in (*self.voltage, *self.current) for header in _headers(one))

    @property
    def columns(self) -> dict[str, Column]:
        """Sources of the channels that follow."""
        return own_columns(("V", "angle", "f", *("PQ" if self.current else "")))

    @property
    def follow(self) -> tuple[str, ...]:
        """Names of all columns that follow."""
        return (*self.columns, *(("V2", "V0") if len(self.voltage) == 3 else ()))

    def read(
        self, table: Table, missing: Iterable[str | float] = (), decimal: str = "."
    ) -> dict[str, _Array]:
        """Numbers of the columns; of texts with both parts of a phasor, these parts."""
        numbers: dict[str, _Array] = {}
        for one in (*self.voltage, *self.current):
            if isinstance(one, str):
                found = _complex_numbers(table, one, missing, decimal)
                numbers |= {
                    f"{one}, {part}": x for part, x in zip(_PARTS, (found.real, found.imag), strict=True)
                }
            else:
                numbers |= {h: table.numbers(h, missing=missing, decimal=decimal) for h in one}
        return numbers

    def derive(
        self,
        table: Table,
        time: _Array,
        numbers: Mapping[str, _Array],
        further: Iterable[str],
        f_nominal: float,
        notes: list[str],
        bases: Bases | None = None,
    ) -> tuple[_Array, dict[str, _Array], dict[str, _Array]]:
        """Time, columns that follow by their names, and further columns as they are.

        Parameters
        ----------
        table : Table
            Of the file, for its units and for messages.
        time : ndarray of shape (L,)
            Seconds, in any order.
        numbers : mapping of str to ndarray of shape (L,)
            What `read` gave, and further columns.
        further : iterable of str
            Headers of these.
        f_nominal : float
            Hz.
        notes : list of str
            Gets sentences on assumptions.
        bases : Bases, optional
            For numbers in pu.

        Raises
        ------
        InputError
            If a unit is not stated, a magnitude is negative, or the phases are in another order.
        """
        where = f"{table.source}, phasors"
        voltages, currents = (
            self._phasors(table, numbers, quantity, where, bases) for quantity in ("voltage", "current")
        )
        if len(voltages) == 3:
            check_voltages(voltages, _names(self.voltage), where)
            one, two, zero = sequences(voltages, self.line_to_line)
            found = magnitudes(one, two, zero)
        else:
            one = voltages[0] / (np.sqrt(3) if self.line_to_line else 1.0)
            found = magnitudes(one)
        angle = np.angle(one)
        found |= {"angle": angle, "f": _frequency(time, angle, f_nominal)}
        if currents:
            if len(currents) == 3:
                doubt_currents(currents, _names(self.current), notes, where)
            flowing = sequences(currents)[0] if len(currents) == 3 else currents[0]
            found |= power(one, flowing if self.sign == "generator" else -flowing)
        follow = "V, angle, P and Q" if currents else "V and angle"
        notes.append(
            f"{follow} are of the positive sequence of the phasors {', '.join(self.headers)}; their angles were taken "
            f"to be in the frame of {f_nominal:g} Hz, as those of synchrophasors are. f is the slope of the angle "
            "where no column is given for it."
        )
        return time, found, {header: numbers[header] for header in further}

    def _phasors(
        self, table: Table, numbers: Mapping[str, _Array], quantity: str, where: str, bases: Bases | None
    ) -> list[Phasor]:
        """Rms phasors in kV or kA."""
        sources = getattr(self, quantity)
        if not sources:
            return []
        unit, pu = getattr(self, f"{quantity}_unit"), None
        if bases is not None and self.magnitude == "rms":  # whether 1 pu is a peak value, nobody can tell
            pu = pu_factors(bases, self.line_to_line)
        scale = factor(table.units, _names(sources), unit, quantity, where, pu)
        if self.magnitude == "peak":
            scale /= np.sqrt(2)
        found: list[Phasor] = []
        for one in sources:
            names = [f"{one}, {part}" for part in _PARTS] if isinstance(one, str) else one
            first, second = (numbers[name] for name in names)
            if isinstance(one, str) or self.form == "rectangular":
                found.append(np.asarray(scale * (first + 1j * second), dtype=complex))
                continue
            if np.nanmin(first, initial=0.0) < 0:
                row = int(np.nanargmin(first))
                raise InputError(
                    f"a magnitude is {first[row]:.6g}",
                    where=table.place(row, one[0]),
                    allowed="0 or more",
                    remedy='Give form = "rectangular" for real and imaginary parts, or correct the cell',
                )
            angle = np.deg2rad(second) if self._angle_unit(table, one[1], where) == "deg" else second
            found.append(np.asarray(scale * first * np.exp(1j * angle), dtype=complex))
        return found

    def _angle_unit(self, table: Table, header: str, where: str) -> str:
        unit = self.angle_unit or spelled(table.units.get(header, ""))
        if unit not in ("deg", "rad"):
            raise InputError(
                f"the unit of {header} is {unit or 'not stated'!r}",
                where=where,
                allowed="deg or rad",
                remedy="Give angle_unit",
            )
        return unit


def as_phases(
    waveforms: Waveforms | Mapping[str, Any] | None, phasors: Phasors | Mapping[str, Any] | None, source: str
) -> Waveforms | Phasors | None:
    """Check descriptions of three phases, of which one at most may be given."""
    if waveforms is not None and phasors is not None:
        raise InputError(
            "waveforms and phasors are both given",
            where=source,
            allowed="waveforms for sampled waves; phasors for rms values with angles",
        )
    if waveforms is not None:
        return as_waveforms(waveforms, source)
    return None if phasors is None else as_phasors(phasors, source)


def as_phasors(found: Phasors | Mapping[str, Any], source: str) -> Phasors:
    """Check a description of phasors, given as a mapping of fields or as `Phasors`."""
    where = f"{source}, phasors"
    found = spec_of(Phasors, found, where)
    found = replace(found, voltage=_tuples(found.voltage), current=_tuples(found.current))
    counts = len(found.voltage), len(found.current)
    if counts[0] not in (1, 3) or counts[1] not in (0, counts[0]):
        raise InputError(
            f"there are {counts[0]} voltages and {counts[1]} currents",
            where=where,
            allowed="three of each, or one of each for the positive sequence",
            remedy='Give each phasor as [magnitude, angle], for example voltage = [["V1_mag", "V1_ang"]]',
        )
    for one in (*found.voltage, *found.current):
        if not isinstance(one, str) and len(one) != 2:
            raise InputError(
                f"a phasor has {len(one)} columns",
                where=where,
                allowed="two, or one with texts such as 230.1+12.3j",
            )
    if len({*found.headers}) < len(found.headers):
        raise InputError("a column is named twice", where=where, allowed="columns of its own for each phasor")
    for name, choices in _CHOICES.items():
        if getattr(found, name) not in choices:
            raise unknown_name(
                str(getattr(found, name)), [c for c in choices if c], kind=f"value of {name}", where=where
            )
    return found


def to_read(phases: Waveforms | Phasors | None, headers: Iterable[str], present: Iterable[str]) -> list[str]:
    """Headers of channels that are read from a file: those that it has, and those that do not follow from phases."""
    known = {*present}
    follow = () if phases is None else phases.follow
    return [h for h in dict.fromkeys(headers) if h in known or h not in follow]


def _tuples(found: Any) -> tuple[str | tuple[str, ...], ...]:
    return tuple(tuple(map(str, one)) if isinstance(one, list | tuple) else str(one) for one in found)


def _headers(one: str | tuple[str, ...]) -> tuple[str, ...]:
    return (one,) if isinstance(one, str) else one


def _names(sources: Sequence[str | tuple[str, ...]]) -> list[str]:
    """Headers that stand for phasors: of two columns the first."""
    return [_headers(one)[0] for one in sources]


def _frequency(time: _Array, angle: _Array, f_nominal: float) -> _Array:
    """Frequency (2) in Hz, NaN where the angle is unknown; stamps may be in any order, and occur several times."""
    found = np.full(len(time), np.nan)
    known = np.flatnonzero(np.isfinite(angle))
    stamps, first, back = np.unique(time[known], return_index=True, return_inverse=True)
    if len(stamps) > 1:
        slope = np.gradient(unwrap(angle[known][first]), stamps)
        found[known] = f_nominal + slope[back] / (2 * np.pi)
    return found


def _complex_numbers(table: Table, header: str, missing: Iterable[str | float], decimal: str) -> Phasor:
    """Phasors of a column, NaN for gaps; `InputError` for a cell with anything else."""
    cells = table.column(header)
    cells = pd.Series(cells if isinstance(cells, np.ndarray) else list(cells))
    if pd.api.types.is_complex_dtype(cells):
        return cells.to_numpy(dtype=complex)
    texts = cells.astype("string").fillna("")
    found = complex_of(texts, decimal)
    rest = np.flatnonzero(np.isnan(found) & ~is_no_reading(texts))
    others = Table(
        {header: [*texts.iloc[rest]]}, [table.rows[k] for k in rest.tolist()], table.source, table.row_word
    )
    numbers = others.numbers(
        header, missing=missing, decimal=decimal, remedy="Write phasors as 230.1+12.3j, or as 230.1@12.5"
    )
    lone = np.flatnonzero(np.isfinite(numbers))
    if len(lone):
        raise InputError(
            f"{numbers[lone[0]]:.6g} has no angle",
            where=others.place(int(lone[0]), header),
            allowed="phasors such as 230.1+12.3j, (230.1, 12.3), 230.1∠12.5 or 230.1@12.5",
            remedy="Give each phasor as two columns, [magnitude, angle]",
        )
    return found
