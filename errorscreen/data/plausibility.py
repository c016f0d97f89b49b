r"""Readings that a wrong unit, base, sign or nominal frequency would explain.

With the angle :math:`\theta` and the frequency f of one voltage, and the nominal frequency :math:`f_n`

.. math:: \theta(t) - \theta(0) = 2\pi \int_0^t (f - f_n)\,\mathrm dt = F(t)                          \qquad (1)

A wrong sign, or degrees taken for radians, give other factors between both sides.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from errorscreen.data.signals import within
from errorscreen.data.timestamps import SECONDS, units_of_step
from errorscreen.exceptions import DataWarning

_Array = NDArray[np.float64]
#: In pu: plausible voltages before an event.
PLAUSIBLE_V = (0.5, 1.5)
#: relative distance of a voltage before the event from 1 pu times a factor
_NEAR = 0.06
#: part of the level by which a magnitude may be below zero
_NEGATIVE = 0.01
#: samples in a nominal period: what recordings of plants have
_SAMPLING = (1e-3, 100.0)
#: relative distance of the frequency before the event from the nominal one
_OFF_NOMINAL = 0.05
#: Hz by which an angle may turn before an event: the frequency of a grid is nearer to the nominal one
_TURNS = 1.0
#: rms of the difference of both sides of (1), relative to that of F, at which they agree
_AGREES = 0.1
#: rad that F must move at least
_MOVES = 0.02
#: Zeros of one channel are lost frames in so few rows, where the readings beside them are so many usual distances from
#: zero, and agree within this part of the level, as those of the other channels do throughout.
_LOST_ROWS, _FROM_ZERO, _STAYS = 10, 10.0, 0.2


class Doubt(str):
    """An assumption about a recording that a wrong unit, base or sign would explain."""


def doubt(text: str, where: str) -> Doubt:
    """Warn of a doubt and return it."""
    # from the same place for every caller, so that Python shows it once in a run
    warnings.warn(f"{where}: {text}", DataWarning, stacklevel=2)
    return Doubt(text)


class _Factor(NamedTuple):
    value: float
    meaning: str
    remedy: str


#: factors on a voltage that other ways of measuring give
VOLTAGE_FACTORS = (
    _Factor(1 / np.sqrt(3), "1/√3: measured from line to neutral?", "line_neutral = true"),
    _Factor(np.sqrt(2), "√2: a peak value?", "scale = 0.70711"),
    _Factor(np.sqrt(2 / 3), "√(2/3): a peak value from line to neutral?", "scale = 1.22474"),
    _Factor(np.sqrt(3), "√3: a base from line to neutral?", "base_kv from line to line"),
)


def warn_implausible(
    time: _Array,
    values: Mapping[str, _Array],
    initial: Mapping[str, float],
    quiet: tuple[float, float],
    f_nominal: float,
    where: str,
) -> list[str]:
    """Doubts about a recording, which are warned of as well, and what speaks for the readings.

    Parameters
    ----------
    time : ndarray of shape (L,)
        Seconds.
    values : mapping of str to ndarray of shape (L,)
        Channels in the units of `errorscreen.data.channels.Channel`.
    initial : mapping of str to float
        Values before the event.
    quiet : (float, float)
        First and last instant of the quiet part in seconds.
    f_nominal : float
        Hz.
    where : str
        For the warnings.
    """
    doubts = [*_sampling(time, f_nominal), *_lost_frames(time, values)]
    if "V" in initial:
        doubts += _voltage(initial["V"])
    if "V" in values:
        doubts += _negative(time, values["V"])
    if "f" in initial:
        doubts += _frequency(initial["f"], f_nominal)
    notes: list[str] = []
    if not doubts and {"angle", "f"} <= values.keys():
        slope, found = _angle_and_frequency(time, values["angle"], values["f"], f_nominal)
        doubts += found
        if slope is not None:
            notes.append(f"Angle and frequency agree: their slope is {slope:.3f}.")
    if "angle" in values and not doubts and not notes:
        doubts += _turning(time, values["angle"], quiet)
    return [*notes, *(doubt(text, where) for text in doubts)]


def _sampling(time: _Array, f_nominal: float) -> Iterator[str]:
    dt = float(np.median(np.diff(time)))
    if _SAMPLING[0] <= f_nominal * dt <= _SAMPLING[1]:
        return
    fitting = units_of_step(dt)
    remedy = " or ".join(f"time_unit = {name!r} ({SECONDS[name] * dt:.3g} s)" for name in fitting)
    yield f"Samples are {dt:.3g} s apart: check time_unit{f', for example {remedy}' if fitting else ''}."


def _lost_frames(time: _Array, values: Mapping[str, _Array]) -> Iterator[str]:
    """Zeros between other readings, as concentrators write them for a lost frame: in all channels, or in one."""
    watched = {name: v for name, v in values.items() if name in ("V", "P", "Q", "f")}
    zero = np.zeros(len(time), dtype=bool)
    if "f" in watched:
        zero = watched["f"] == 0.0
    elif "V" in watched and len(watched) > 1:
        zero = np.all([v == 0.0 for v in watched.values()], axis=0)
    if zero.any() and not zero.all() and not zero[-1]:  # a unit that trips stays at zero
        names = "f" if "f" in watched else ", ".join(watched)
        yield _zeros(names, time, zero)
        return
    electric = {name: v for name, v in watched.items() if name != "f"}
    for name in electric:
        lost = _dropped(name, electric)
        if lost.any():
            yield _zeros(
                f"{name}, but not in {', '.join(other for other in electric if other != name)}", time, lost
            )


def _zeros(names: str, time: _Array, zero: NDArray[np.bool_]) -> str:
    return (
        f"{int(zero.sum())} rows, the first at {time[np.argmax(zero)]:g} s, hold exactly 0 in {names}: lost frames? "
        "Give quality, the column with the status of each row, or missing = ['0']."
    )


def _dropped(name: str, values: Mapping[str, _Array]) -> NDArray[np.bool_]:
    """Rows in which a channel is exactly 0 between two like readings, while the others stay as they are."""
    x, lost = values[name], np.zeros(len(values[name]), dtype=bool)
    edges = np.flatnonzero(np.diff(x == 0.0))
    edges = edges[1:] if x[0] == 0.0 else edges
    if not len(edges):
        return lost
    levels = {key: float(np.nanmedian(np.abs(v))) for key, v in values.items()}
    power = max(levels.get("P", 0.0), levels.get("Q", 0.0))
    stays = {key: _STAYS * (levels[key] if key == "V" else power) for key in values}
    usual = np.abs(np.diff(x[np.isfinite(x)]))
    far = max(0.5 * levels[name], _FROM_ZERO * float(np.median(usual))) if len(usual) else np.inf
    for before, last in zip(edges[::2], edges[1::2], strict=False):
        ends = [before, last + 1]
        if last - before > _LOST_ROWS or np.abs(x[ends]).min() <= far:
            continue
        rest = {key: v[before : last + 2] for key, v in values.items() if key != name} | {name: x[ends]}
        if len(rest) > 1 and all(np.ptp(v) <= stays[key] for key, v in rest.items()):
            lost[before + 1 : last + 1] = True
    return lost


def _voltage(V: float) -> Iterator[str]:
    for factor in VOLTAGE_FACTORS:
        if abs(V / factor.value - 1.0) <= _NEAR:
            yield f"V before the event is {V:.3g} pu, near {factor.meaning} Then set {factor.remedy}."
            return
    if not PLAUSIBLE_V[0] <= V <= PLAUSIBLE_V[1]:
        yield f"V before the event is {V:.3g} pu: check its unit and base_kv."


def _negative(time: _Array, V: _Array) -> Iterator[str]:
    """A magnitude below zero by more than the accuracy of an instrument."""
    level = float(np.nanmedian(np.abs(V)))
    below = np.less(V, -_NEGATIVE * level)
    if below.any() and not (below | np.isnan(V)).all():
        yield (
            f"V is negative in {int(below.sum())} readings, the first at {time[np.argmax(below)]:g} s: a magnitude is "
            "not. Is it a part of a phasor, or a wave?"
        )


def _frequency(f: float, f_nominal: float) -> Iterator[str]:
    if abs(f / f_nominal - 1.0) <= _OFF_NOMINAL:
        return
    units = {
        "mHz": f * 1e-3,
        "pu": f * f_nominal,
        "rad/s": f / (2 * np.pi),
        "Hz deviation": f + f_nominal,
        "mHz deviation": f * 1e-3 + f_nominal,
        "pu deviation": (f + 1.0) * f_nominal,
    }
    fitting = [name for name, value in units.items() if abs(value / f_nominal - 1.0) <= _OFF_NOMINAL]
    other = [value for value in (50.0, 60.0) if abs(f / value - 1.0) <= _OFF_NOMINAL]
    remedy = f"f_nominal = {other[0]:g}?" if other else "check f_nominal and the unit of f."
    if fitting and not other:
        remedy = f"unit = {' or '.join(map(repr, fitting))} of column f?"
    yield f"f before the event is {f:.5g} Hz, f_nominal {f_nominal:g} Hz: {remedy}"


def _turning(time: _Array, angle: _Array, quiet: tuple[float, float]) -> Iterator[str]:
    """An angle that turns too fast before the event, which the frequency of a grid does not."""
    part = within(time, quiet) & np.isfinite(angle)
    if part.sum() < 3:
        return
    hertz = float(np.polyfit(time[part] - time[part][0], angle[part], 1)[0]) / (2 * np.pi)
    if abs(hertz) > _TURNS:
        yield (
            f"Before the event the angle turns at {hertz:.3g} Hz against the nominal frequency: in degrees "
            "(unit = 'deg'), or another f_nominal?"
        )


def _angle_and_frequency(
    time: _Array, angle: _Array, f: _Array, f_nominal: float
) -> tuple[float | None, list[str]]:
    """Slope of (1) where it holds, and what it says about sign and unit of the angle and the unit of the frequency."""
    known = np.isfinite(angle) & np.isfinite(f)
    if known.sum() < 10:
        return None, []
    t, theta, deviation = time[known], angle[known] - angle[known].mean(), f[known] - f_nominal
    steps = 0.5 * (deviation[1:] + deviation[:-1]) * np.diff(t)
    moved = 2 * np.pi * np.concatenate([[0.0], np.cumsum(steps)])
    moved -= moved.mean()

    def apart(a: _Array, b: _Array) -> float:
        size = float(np.std(b))
        return float(np.std(a - b)) / size if size >= _MOVES else np.inf

    if apart(theta, moved) <= _AGREES:
        return float(theta @ moved / (moved @ moved)), []
    readings = {
        "with the other sign of the angle (scale = -1)": (-theta, moved),
        "with the angle in degrees (unit = 'deg')": (np.deg2rad(theta), moved),
        "with the angle in degrees and of the other sign": (-np.deg2rad(theta), moved),
        "with the frequency in mHz (unit = 'mHz' or 'mHz deviation')": (theta, 1e-3 * moved),
        "with the frequency in pu (unit = 'pu' or 'pu deviation')": (theta, f_nominal * moved),
    }
    fitting = [name for name, (a, b) in readings.items() if apart(a, b) <= _AGREES]
    return None, [
        f"The angle does not follow from the frequency, but {name} it does." for name in fitting[:1]
    ]
