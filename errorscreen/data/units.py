"""Units, bases and signs of recorded columns, and their conversion to the units of `Channel`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.channels import ROLE_UNITS
from errorscreen.exceptions import InputError, check_real, unknown_name

_Array = NDArray[np.float64]
#: Kilovolts, kiloamperes and megavolt-amperes in one unit.
KV, KA = {"V": 1e-3, "kV": 1.0}, {"A": 1e-3, "kA": 1.0}
MVA = {
    **{"W": 1e-6, "kW": 1e-3, "MW": 1.0, "GW": 1e3},
    **{"var": 1e-6, "kvar": 1e-3, "Mvar": 1.0, "VAr": 1e-6, "kVAr": 1e-3, "MVAr": 1.0},
    **{"VA": 1e-6, "kVA": 1e-3, "MVA": 1.0},
}
_FREQUENCY = ("Hz", "mHz", "pu", "rad/s", "Hz deviation", "mHz deviation", "pu deviation")
#: Allowed units by channel name.
UNITS: dict[str, tuple[str, ...]] = {
    "V": (*KV, "pu"),
    "angle": ("rad", "deg"),
    "f": _FREQUENCY,
    "P": (*MVA, "pu"),
    "Q": (*MVA, "pu"),
}


@dataclass(frozen=True)
class Column:
    """Source of a channel and meaning of its numbers.

    Parameters
    ----------
    column : str, optional
        Header of the column. Instead of it `real` and `imag`, or `value`.
    unit : str, optional
        V: ``V, kV, pu``; angle: ``rad, deg``; f: ``Hz, mHz, pu, rad/s, Hz deviation, mHz deviation, pu deviation``
        (from nominal); P and Q: ``W, kW, MW, GW``, the same with ``var`` or ``VA``, ``pu``. The unit of the channel
        (pu, rad, Hz) where not given. Any text for other channels, whose numbers stay as they are.
    base : float, optional
        1 pu, if it is not the recording's own base: MVA for P and Q, kV line to line for V.
    sign : {"generator", "load"}
        P and Q: positive when generated, or positive when consumed.
    scale : float
        Factor on the numbers in the file, for example of an instrument transformer.
    per_phase : bool
        P and Q in W, var or VA: of one of three equal phases, so the total is three times as much.
    line_neutral : bool
        V in V or kV: from line to neutral instead of line to line.
    real, imag : str, optional
        V: headers of the parts of the phasor; the angle becomes a channel of its own.
    value : float, optional
        A pre-event value that is stated and not measured; nothing is compared with it.

    Examples
    --------
    >>> Column("P_kW", unit="kW", sign="load", per_phase=True).scale
    1.0
    """

    column: str | None = None
    unit: str | None = None
    base: float | None = None
    sign: str = "generator"
    scale: float = 1.0
    per_phase: bool = False
    line_neutral: bool = False
    real: str | None = None
    imag: str | None = None
    value: float | None = None

    @property
    def headers(self) -> tuple[str, ...]:
        """Headers of the columns that are read."""
        return tuple(h for h in (self.column, self.real, self.imag) if h is not None)


@dataclass(frozen=True)
class Bases:
    """Bases that everything is converted to: MVA, kV line to line (or unknown) and Hz."""

    mva: float
    kv: float | None
    hz: float


def as_column(role: str, spec: Column | str | Mapping[str, Any], where: str) -> Column:
    """Check the description of a channel, given as a header, a mapping of fields or a `Column`."""
    if isinstance(spec, str):
        spec = Column(spec)
    elif not isinstance(spec, Column):
        known = [f.name for f in fields(Column)]
        for key in spec:
            if key not in known:
                raise unknown_name(key, known, kind="field", where=where)
        spec = Column(**spec)
    near = {name.casefold(): name for name in ROLE_UNITS} | {"u": "V"}
    if role not in ROLE_UNITS and role.casefold() in near:
        raise InputError(
            f"channel {role!r} looks like {near[role.casefold()]!r}, which is written differently",
            where=where,
            allowed=f"{', '.join(ROLE_UNITS)}, or a name that cannot be mistaken for them",
        )
    if role in UNITS and spec.unit is not None and spec.unit not in UNITS[role]:
        raise unknown_name(spec.unit, UNITS[role], kind="unit", where=where)
    _check_source(role, spec, where)
    _check_meaning(role, spec, where)
    return spec


def _check_source(role: str, spec: Column, where: str) -> None:
    phasor = spec.real is not None and spec.imag is not None
    half = (spec.real is None) != (spec.imag is None)
    if half or (spec.column is not None) + phasor + (spec.value is not None) != 1:
        raise InputError(
            f"its source is not clear ({', '.join(spec.headers) or 'none'})",
            where=where,
            allowed="one of column; real and imag together; value",
        )
    if phasor and role != "V":
        raise InputError(f"real and imag were given for {role!r}", where=where, allowed="only for V")
    check_real(spec.scale, "scale", where=where)
    if spec.scale == 0:
        raise InputError("scale is 0", where=where, allowed="any other number")
    if spec.base is not None:
        check_real(spec.base, "base", low=0, above=True, where=where)
    if spec.value is not None:
        check_real(spec.value, "value", where=where)


def _check_meaning(role: str, spec: Column, where: str) -> None:
    if spec.sign not in ("generator", "load"):
        raise unknown_name(str(spec.sign), ("generator", "load"), kind="sign", where=where)
    unit = spec.unit or ROLE_UNITS.get(role, "")
    power, physical = role in ("P", "Q"), unit != "pu"
    misfits = {
        "sign": (spec.sign == "load" and not power, "P and Q"),
        "per_phase": (spec.per_phase and not (power and physical), "P and Q in W, var or VA"),
        "line_neutral": (spec.line_neutral and not (role == "V" and physical), "V in V or kV"),
        "base": (spec.base is not None and (physical or role not in ("V", "P", "Q")), "V, P and Q in pu"),
    }
    for name, (wrong, allowed) in misfits.items():
        if wrong:
            raise InputError(f"{name} does not apply to {role!r} in {unit!r}", where=where, allowed=allowed)


def convert(role: str, numbers: _Array, spec: Column, bases: Bases, where: str) -> _Array:
    """Convert recorded numbers to the unit of the channel: pu, rad, Hz."""
    numbers = spec.scale * numbers
    unit = spec.unit or ROLE_UNITS.get(role, "")
    if role in ("P", "Q"):
        sign = -1.0 if spec.sign == "load" else 1.0
        mva = (spec.base or bases.mva) if unit == "pu" else MVA[unit] * (3.0 if spec.per_phase else 1.0)
        return sign * numbers * (mva / bases.mva)
    if role == "V":
        return numbers * _voltage_factor(unit, spec, bases, where)
    if role == "angle":
        return np.deg2rad(numbers) if unit == "deg" else numbers
    if role == "f":
        factors = {"Hz": 1.0, "mHz": 1e-3, "pu": bases.hz, "rad/s": 0.5 / np.pi}
        quantity, _, deviation = unit.partition(" ")
        return factors[quantity] * numbers + (bases.hz if deviation else 0.0)
    return numbers


def _voltage_factor(unit: str, spec: Column, bases: Bases, where: str) -> float:
    if unit == "pu" and spec.base is None:
        return 1.0
    if bases.kv is None:
        raise InputError(
            f"V in {unit!r}{'' if spec.base is None else ' of its own base'} cannot be converted to pu",
            where=where,
            remedy="Give base_kv, the base voltage from line to line in kV",
        )
    kv = (spec.base or bases.kv) if unit == "pu" else KV[unit]
    return kv * (float(np.sqrt(3.0)) if spec.line_neutral else 1.0) / bases.kv


def unwrap(angle: _Array, turn: float = 2 * np.pi) -> _Array:
    """Remove jumps by full turns from an angle, in rad where `turn` is not given; gaps stay gaps."""
    out = angle.copy()
    known = np.isfinite(out)
    out[known] = np.unwrap(out[known], period=turn)
    return out
