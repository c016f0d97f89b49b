"""One measured channel, and what recordings and observations share about their channels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errorscreen._runtime.display import Displayed, aligned
from errorscreen.exceptions import InputError, unknown_name

_Array = NDArray[np.float64]
#: Units of the channels whose meaning is fixed by their name.
ROLE_UNITS = {"V": "pu", "angle": "rad", "f": "Hz", "P": "pu", "Q": "pu"}


@dataclass(frozen=True, eq=False)
class Channel(Displayed):
    """One measured channel.

    Parameters
    ----------
    name : str
        ``"V"`` (magnitude, pu), ``"angle"`` (rad, unwrapped, in a frame that turns at the nominal frequency),
        ``"f"`` (Hz), ``"P"``, ``"Q"`` (pu on the recording's base, generation positive), or any other name.
    values : ndarray of shape (L,)
        NaN where nothing was measured.
    unit : str
    noise : float
        Standard deviation of the measurement noise, in `unit`; positive.
    age : float
        Seconds that a reading may be older than its time stamp, because the meter holds it.
    fixed : bool
        Whether the noise holds on any grid, because it was stated or there is no quiet part to estimate it from.
    """

    name: str
    values: NDArray[np.float64]
    unit: str
    noise: float
    age: float = 0.0
    fixed: bool = False

    def _facts(self) -> dict[str, Any]:
        readings = f"{np.isfinite(self.values).sum()} of {len(self.values)}"
        return {"name": self.name, "unit": self.unit, "readings": readings, "noise": f"{self.noise:.3g}"}


def channel_arrays(
    time: ArrayLike,
    values: Mapping[str, ArrayLike],
    noise: Mapping[str, float],
    given: Mapping[str, float],
    where: str,
    *,
    copy: bool = True,
) -> tuple[_Array, dict[str, _Array]]:
    """Copies of the time axis and the channels; noise must be of a channel, and a given value must not."""

    def own(numbers: ArrayLike) -> _Array:
        return np.array(numbers, dtype=float) if copy else np.asarray(numbers, dtype=float)

    t, arrays = own(time), {key: own(v) for key, v in values.items()}
    check_axes(t, arrays, where)
    for name in noise:
        if name not in arrays:
            raise unknown_name(name, arrays, kind="channel", where=f"{where}, noise")
    for name in given:
        if name in arrays:
            raise InputError(f"{name!r} is measured and given", where=where, allowed="one of them")
    return t, arrays


def check_axes(time: _Array, values: Mapping[str, _Array], where: str) -> None:
    """Raise `InputError` unless time increases strictly and each channel has its shape."""
    if time.ndim != 1 or len(time) < 2:
        raise InputError(f"the time axis has shape {time.shape}", where=where, allowed="two samples or more")
    if not (np.isfinite(time).all() and (np.diff(time) > 0).all()):
        raise InputError("the time axis is not finite and strictly increasing", where=where)
    if not values:
        raise InputError("there is no channel", where=where, allowed="at least one, for example 'P'")
    for name, array in values.items():
        if array.shape != time.shape:
            problem = f"channel {name!r} has shape {array.shape}"
            raise InputError(problem, where=where, allowed=f"{time.shape}")


def summary_of(
    title: str,
    facts: Mapping[str, Any],
    channels: Iterable[tuple[str, str, _Array, float]],
    assumptions: Iterable[str],
) -> str:
    """Text of facts, of channels (name, unit, values of shape (L,), noise) and of assumptions."""
    rows: list[tuple[Any, ...]] = [("channel", "unit", "lowest", "highest", "noise", "readings")]
    for name, unit, values, noise in channels:
        known = values[np.isfinite(values)]
        ends = (float(known.min()), float(known.max())) if len(known) else ("", "")
        rows.append((name, unit, *ends, float(noise), len(known)))
    shown = [(name, value) for name, value in facts.items() if name not in ("name", "channels")]
    notes = [f"- {sentence}" for sentence in assumptions]
    return "\n".join([title, aligned(shown), "", aligned(rows), "", *notes])
