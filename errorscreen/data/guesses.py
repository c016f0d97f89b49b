"""Guesses about a table: time stamps, channels with their units, nominal frequency and bases; each with its reason."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from errorscreen.data.dates import fitting_formats, no_date, parse_dates
from errorscreen.data.headers import LONGEST_HEADER, known_unit, role_and_unit
from errorscreen.data.plausibility import PLAUSIBLE_V
from errorscreen.data.readers.head import is_number
from errorscreen.data.table import Table
from errorscreen.data.timestamps import SECONDS, TIME_UNITS, units_of_step
from errorscreen.data.units import UNITS
from errorscreen.exceptions import InputError

_Array = NDArray[np.float64]
#: first stamps by which dates as numbers are known: days of spreadsheets, days of MATLAB (1971 to 2080), and ticks
_ERAS = (("d", 2e4, 1e5), ("d", 7.2e5, 7.6e5), ("ticks", 5e17, 8e17))
#: s between samples beyond which nobody records a disturbance who could do better
_SLOWEST = 0.11
#: s that a recording of a disturbance lasts at least
_SHORTEST = 0.5
#: fractions in one second, as concentrators count them
_TIME_BASES = (1e3, 1e4, 1e5, 1e6, 2.0**24, 1e7, 1e9)
#: usual nominal voltages in kV, line to line
LEVELS = (
    0.4, 0.48, 0.69, 1, 3.3, 4.16, 6, 6.3, 6.6, 10, 10.5, 11, 12.47, 13.2, 13.8, 15, 15.75, 16, 16.5, 18, 20, 21, 22,
    24, 25, 27, 30, 33, 34.5, 45, 63, 66, 69, 90, 110, 115, 132, 138, 150, 161, 220, 230, 275, 287, 330, 345, 380,
    400, 500, 735, 765,
)  # fmt: skip
#: relative distance from a level, and from a level divided by √3, at which a voltage still belongs to it
_NEAR, _NEAR_NEUTRAL = 0.07, 0.03
#: pu around 1 that a voltage in service is in
_NEAR_ONE = 0.1
#: relative difference of V in pu that does not matter
_SAME = 0.02
#: relative distance of another level that is as usual for a machine in service, and of the rating of a transformer
_ALSO, _NEAR_RATED = 0.05, 0.1
#: words in headers that stand for a channel; the angle comes first, because "voltage angle" is one
_WORDS = {
    "angle": {"abus", "ang", "angle", "phi", "phiu", "phiu1", "theta", "uphase", "winkel"},
    "f": {"f", "fbus", "freq", "frequency", "frequenz", "fehz", "hz"},
    "P": {"p", "pg", "pe", "pgen", "pelec", "psum", "pgenpu", "mw", "active", "wirkleistung"},
    "Q": {"q", "qg", "qe", "qgen", "qelec", "qsum", "qgenpu", "mvar", "reactive", "blindleistung"},
    "V": {
        "v", "u", "u1", "v1", "vbus", "vt", "ut", "vm", "um", "upu", "vmag", "umag", "volt", "voltage", "vterm",
        "eterm", "kv", "vrms", "urms", "spannung", "klemmenspannung", "ustatorpu", "uterminalpu",
    },
}  # fmt: skip
#: units that only one channel has
_BY_UNIT = {"V": "V", "kV": "V", "deg": "angle", "rad": "angle", "Hz": "f", "mHz": "f"} | {
    unit: "PQ"["var" in unit.casefold()] for unit in UNITS["P"] if unit not in ("pu", "VA", "kVA", "MVA")
}
#: words in headers of the excitation, whose V and A are not those of the terminal
_EXCITATION = {"field", "exciter", "excitation", "efd", "vfd", "ufd", "ifd", "erregung", "erreger"}
_NEUTRAL = re.compile(r"(?<![a-z0-9])(ln|l-n|phn|ph-n|line[ _-]to[ _-]neutral)(?![a-z0-9])", re.IGNORECASE)
#: words in headers of a frequency less the nominal one
_DEVIATION = {"dev", "deviation", "delta", "df", "dfreq", "abweichung"}
#: words in headers that may stand for the angle or the frequency of the terminal, or for those of the rotor
_OF_ROTOR = {"delta", "omega", "omegapu", "speed", "theta", "rotor", "polradwinkel"}
#: pu that a voltage begins in, and that a current begins below
PU, MOST_PU = (0.8, 1.2), 5.0
_UNIT_BEHIND = re.compile(r"(\s+in\s+\S+|\s*[\[(].*[\])])$")


@dataclass(frozen=True)
class Guess:
    """Value of a key with its reason; `check` where the file does not tell it."""

    value: Any
    reason: str
    check: bool = False


@dataclass(frozen=True)
class ChannelGuess:
    """Source of a channel: fields of `errorscreen.data.Column`, and the numbers in the file."""

    fields: Mapping[str, Any]
    reason: str
    numbers: _Array
    check: bool = False

    @property
    def level(self) -> float:
        """Median of the first tenth."""
        known = self.numbers[np.isfinite(self.numbers)]
        return float(np.median(known[: max(3, len(known) // 10)])) if len(known) else np.nan


def guess_stamps(table: Table, names: Sequence[str], decimal: str) -> dict[str, Guess]:
    """Keys ``time``, ``time_unit``, ``time_format`` and ``time_base`` of a table; `InputError` without time stamps."""
    plain = {name.strip().casefold(): name for name in names}
    if {"soc", "fracsec"} <= plain.keys():
        return _seconds_and_fractions(table, plain["soc"], plain["fracsec"], decimal)
    stated = [name for name in names if role_and_unit(name.split("|")[-1])[0] == "time"]
    worded = [name for name in names if re.search(r"time|date|zeit|datum|utc|tnow", name, re.IGNORECASE)]
    for name in dict.fromkeys((*stated, *worded, *names)):
        why = "its header" if name in (*stated, *worded) else "the first column that increases all the way"
        if found := _stamps_in(table, name, why, names, decimal):
            return found
    for name in (*stated, *worded):
        _refuse_cell(table, name, decimal)
    raise InputError(
        f"no column holds time stamps; the columns are {', '.join(map(repr, names))}",
        where=table.source,
        allowed="a column of increasing numbers or of dates",
        remedy="State time in [recording] of a case file of your own, or cut what stands above the table",
    )


def _refuse_cell(table: Table, name: str, decimal: str) -> None:
    """Raise the error of the cell that is no time stamp in a column of numbers or of dates, where it is one."""
    numbers = [is_number(str(one).strip(), decimal) for one in table.column(name)]
    if 2 * sum(numbers) > len(numbers):
        table.numbers(name, decimal=decimal)
        return
    texts = pd.Series(list(table.column(name))).astype("string").fillna("").str.strip()
    wrong = np.flatnonzero(parse_dates(texts, None).isna())
    if len(wrong) and texts.str.contains(r"\d:\d\d").mean() > 0.5:
        raise no_date(str(texts[int(wrong[0])]), None, table.place(int(wrong[0]), name))


def _seconds_and_fractions(table: Table, whole: str, parts: str, decimal: str) -> dict[str, Guess]:
    seconds, counted = (table.numbers(name, decimal=decimal) for name in (whole, parts))
    bases = [base for base in _TIME_BASES if base > np.nanmax(counted)] or [1e9]
    best = min(bases, key=lambda base: np.ptp(np.diff(seconds - seconds[0] + counted / base)))
    return {
        "time": Guess([whole, parts], "whole seconds and their fractions"),
        "time_base": Guess(best, "with it, samples have equal distances"),
    }


def _stamps_in(
    table: Table, name: str, why: str, names: Sequence[str], decimal: str
) -> dict[str, Guess] | None:
    """Keys of a column of time stamps; None where it holds none."""
    try:
        numbers = table.numbers(name, decimal=decimal)
    except InputError:
        return _dates_in(table, name, why, names)
    steps = np.diff(numbers)
    if (
        len(numbers) < 2
        or not np.isfinite(numbers).all()
        or (steps < 0).mean() > 0.05
        or not (steps > 0).any()
    ):
        return None
    found = {"time": Guess(name, why)}
    unit = role_and_unit(name.split("|")[-1])[1] or known_unit("time", table.units.get(name, ""))
    if unit in TIME_UNITS:
        found["time_unit"] = Guess(unit, "as the file says")
        return found
    step = float(np.median(steps[steps > 0]))
    fitting = units_of_step(step)
    shown = [one for one in fitting if _SHORTEST <= SECONDS[one] * np.ptp(numbers) <= SECONDS["d"]]
    fitting = shown or fitting
    sure = [one for one, low, high in _ERAS if one in fitting and low < numbers[0] < high]
    sure += [one for one in fitting if one == name.strip().casefold()]  # a column "Ticks"
    unit = [*sure, *fitting, "s"][0]
    reason = f"samples are then {step * SECONDS[unit]:.3g} s apart"
    if fitting:
        reason += ", which is usual"
    slow = [one for one in fitting if SECONDS[one] * step > _SLOWEST]
    rest = [one for one in fitting if one != unit and not sure and (unit in slow or one not in slow)]
    others = [f"{one} ({step * SECONDS[one]:.3g} s)" for one in rest]
    if others:
        reason += f", but so is {' and '.join(others)}"
    found["time_unit"] = Guess(unit, reason, check=not fitting or bool(others))
    return found


def _dates_in(table: Table, name: str, why: str, names: Sequence[str]) -> dict[str, Guess] | None:
    texts = pd.Series(list(table.column(name))).astype("string").str.strip()
    if parse_dates(texts, None).notna().all() and texts.str.contains(":").all():
        return {"time": Guess(name, why), "time_unit": Guess("iso", f"dates such as {texts[0]}")}
    after = [*names, None][names.index(name) + 1] if name in names else None
    columns = [name] if after is None or ":" in str(texts[0]) else [name, after]
    if len(columns) == 2:
        texts = texts + " " + pd.Series(list(table.column(columns[1]))).astype("string").str.strip()
    best: tuple[float, str] | None = None
    for pattern in fitting_formats(str(texts[0])):
        stamps = parse_dates(texts, pattern)
        if stamps.notna().all():  # day and month in the wrong order jump at midnight
            jump = float(stamps.diff().abs().max() / pd.Timedelta(seconds=1)) if len(stamps) > 1 else 0.0
            best = min(best or (jump, pattern), (jump, pattern), key=lambda one: one[0])
    if best is None:
        return None
    reason = f"stamps such as {texts[0]}; only the time since the first one counts"
    return {
        "time": Guess(columns if len(columns) == 2 else name, why),
        "time_format": Guess(best[1], reason),
    }


def guess_channels(
    table: Table, names: Sequence[str], decimal: str, f_nominal: float | None
) -> tuple[dict[str, ChannelGuess], list[str]]:
    """Channels of a table among some of its headers, and open points."""
    found: dict[str, list[tuple[int, str, str | None, str]]] = {}
    for name in names:
        last = name.split("|")[-1]
        role, unit = role_and_unit(last)
        unit = known_unit(role or "", unit or "") or known_unit(role or "", table.units.get(name, ""))
        if role is None and unit == "V" and re.search(r"[a-z]_V$", last, re.IGNORECASE):
            unit = None  # "BUS_V" names the voltage, and no unit
        words = _words_of(last)
        if words & _EXCITATION:
            continue
        if unit in ("Hz", "mHz") and words & _DEVIATION:
            unit = f"{unit} deviation"
        if role is None and "phase" in words and words & _WORDS["V"]:
            words = {"angle"}  # of a voltage, as Dynawo calls it
        if role in UNITS:
            found.setdefault(role, []).append((3, name, unit, "its header"))
        elif unit is not None and (by_unit := unit.removesuffix(" deviation")) in _BY_UNIT:
            found.setdefault(_BY_UNIT[by_unit], []).append((2, name, unit, "its unit"))
        elif role is None and (worded := next((r for r, known in _WORDS.items() if known & words), None)):
            found.setdefault(worded, []).append(
                (1, name, known_unit(worded, unit or ""), "a word in its header")
            )
    channels: dict[str, ChannelGuess] = {}
    open_: list[str] = []
    if not {"angle", "f"} & found.keys():
        of_rotor = [name for name in names if _words_of(name.split("|")[-1]) & _OF_ROTOR]
        open_ += [
            f"Column {name!r} was not used: it may be of the rotor. If it is the angle of the terminal's voltage or "
            "its frequency, name it as angle or f in [recording.columns]."
            for name in of_rotor
        ]
    for role in [role for role in ("f", "V", "angle", "P", "Q") if role in found]:
        best = max(score for score, *_ in found[role])
        fitting = [one for one in found[role] if one[0] == best]
        _, name, unit, reason = fitting[0]
        try:
            numbers = table.numbers(name, decimal=decimal)
        except InputError as error:
            open_.append(f"{role} would be column {name!r}, but {error.what}.")
            numbers = np.full(len(table.rows), np.nan)
        others = [other for _, other, *_ in fitting[1:]]
        if others:
            reason = f"the first of columns that may be {role}; others: {', '.join(map(repr, others))}"
        check = bool(others)
        if unit is None:
            unit, level, sure = _unit_by_level(role, numbers, channels, f_nominal)
            reason, check = f"{reason}; {level}", check or not sure
        if role == "angle" and re.search(r"delta|rotor", name, re.IGNORECASE):
            reason, check = f"{reason}; the angle of the voltage is meant, not that of the rotor", True
        channels[role] = ChannelGuess({"column": name, "unit": unit}, reason, numbers, check)
    return channels, open_


def _words_of(header: str) -> set[str]:
    """Words of a header without its unit, in small letters."""
    return {*re.split(r"[^a-z0-9]+", _UNIT_BEHIND.sub("", header[:LONGEST_HEADER]).casefold())}


def _unit_by_level(
    role: str, numbers: _Array, known: Mapping[str, ChannelGuess], f_nominal: float | None
) -> tuple[str, str, bool]:
    """Unit of a channel from its numbers, the reason, and whether it is beyond doubt."""
    level = abs(ChannelGuess({}, "", numbers).level)
    most = float(np.nanmax(np.abs(numbers), initial=0.0))
    if role == "V":
        unit = "pu" if level <= PLAUSIBLE_V[1] else "V" if level >= 1000 else "kV"
        return unit, f"{level:.4g} before the event is usual in {unit}", abs(level - 1.0) < _NEAR_ONE
    if role == "f":
        ranges = {"Hz": (45, 65), "mHz": (45e3, 65e3), "rad/s": (280, 410), "pu": (0.9, 1.1)}
        unit = next((u for u, (low, high) in ranges.items() if low <= level <= high), "Hz deviation")
        return unit, f"{level:.5g} before the event is usual in {unit}", unit in ("Hz", "mHz")
    if role == "angle":
        wraps = np.abs(np.diff(numbers[np.isfinite(numbers)]))
        if most > 2 * np.pi + 0.1 or (np.abs(wraps - 360) < 10).any():
            return (
                "deg",
                f"up to {most:.3g}, more than a turn in rad",
                (np.abs(wraps - 360) < 10).any().item(),
            )
        return "rad", f"up to {most:.3g}, within a turn in rad", bool((np.abs(wraps - 2 * np.pi) < 0.3).any())
    if role == "Q" and "P" in known:
        unit = {"W": "var", "kW": "kvar", "MW": "Mvar", "GW": "Mvar"}.get(known["P"].fields["unit"], "pu")
        return unit, "as that of P", not known["P"].check
    unit = "pu" if most <= 2.0 else "MW" if most <= 5e3 else "kW" if most <= 5e6 else "W"
    unit = unit.replace("W", "var") if role == "Q" else unit
    return unit, f"up to {most:.4g}, usual in {unit}", unit == "MW" and most > 20.0


def guess_frequency(channels: Mapping[str, ChannelGuess], stated: float | None, step: float) -> Guess:
    """Nominal frequency in Hz: of a column f, that which the record states, or by the distance of samples in s."""
    if "f" in channels:
        factor = {"Hz": 1.0, "mHz": 1e-3, "rad/s": 1 / (2 * np.pi)}.get(channels["f"].fields["unit"], np.nan)
        level = channels["f"].level * factor
        nearest = min((50.0, 60.0), key=lambda f: abs(f - level))
        if abs(level - nearest) < 2.5:
            return Guess(nearest, f"f is {level:.5g} Hz before the event")
    if stated:
        return Guess(stated, "line frequency of the record")
    rate = 1.0 / step
    if any(abs(rate / usual - 1.0) < 0.01 for usual in (12, 15, 30, 60, 120, 240)):
        return Guess(
            60.0, f"{rate:.3g} samples in a second are usual at 60 Hz; the file does not say", check=True
        )
    return Guess(50.0, "the file does not tell 50 or 60", check=True)


def guess_base_kv(V: ChannelGuess) -> tuple[Guess | None, dict[str, Any]]:
    """Base voltage in kV from the level of V in V or kV, and further fields of its column."""
    if V.fields["unit"] == "pu":
        return None, {}
    level = abs(V.level) * {"V": 1e-3, "kV": 1.0}[V.fields["unit"]]
    if _NEUTRAL.search(V.fields["column"]):
        return guess_level(np.sqrt(3) * level, "V from line to line is")[0], {"line_neutral": True}
    return guess_level(level, "V is", either=True)


def guess_level(kv: float, what: str, *, either: bool = False) -> tuple[Guess, dict[str, Any]]:
    """Nominal voltage nearest to one in kV, and whether that was from line to neutral, which it may be if `either`."""

    def nearest(value: float) -> tuple[float, float]:
        best = min(LEVELS, key=lambda one: abs(np.log(value / one)))
        return float(best), abs(value / best - 1.0)

    if not kv > 0:
        return Guess(1.0, f"{what} {kv:.4g} kV: no level to guess from", check=True), {}
    best, apart = nearest(kv)
    neutral, apart_neutral = nearest(np.sqrt(3) * kv)
    also = [f"{one:g}" for one in LEVELS if one != best and abs(kv / one - 1.0) < _ALSO]
    others = f", but {' and '.join(also)} kV {'is' if len(also) == 1 else 'are'} usual, too" if also else ""
    if either and apart <= _NEAR and apart_neutral < _NEAR_NEUTRAL:
        of_neutral = f"; or {neutral:g} kV, if V is from line to neutral (line_neutral = true)"
        if abs(np.sqrt(3) * best / neutral - 1.0) > _SAME:
            return Guess(
                best, f"{what} {kv:.4g} kV: the nearest usual level{others}{of_neutral}", check=True
            ), {}
    if apart > _NEAR and apart_neutral < _NEAR_NEUTRAL:
        return Guess(neutral, f"{what} {kv:.4g} kV: {neutral:g}/√3, the nearest usual level"), {
            "line_neutral": True
        }
    if apart > _NEAR:
        return Guess(float(f"{kv:.3g}"), f"{what} {kv:.4g} kV, near no usual level", check=True), {}
    reason = f"{what} {kv:.4g} kV before the event: the nearest usual level{others}"
    return Guess(best, reason, check=apart > 0.02 or bool(also)), {}


def rated_kv(level: Guess, rated: float) -> Guess:
    """Base voltage by the rated primary voltage of a transformer in kV or V, if it is near the level; else as it is."""
    for kv in (rated, 1e-3 * rated):
        if abs(kv / level.value - 1.0) < _NEAR_RATED:
            return Guess(kv, "rated primary voltage of the transformers, as the record states it")
    return level


def guess_base_mva(P: float, Q: float, unit: str | None) -> Guess:
    """Base in MVA from P and Q before the event in MW and Mvar; of pu, and without P, it stays open."""
    if unit is None:
        return Guess(100.0, "rating of the machine; P was not found, so nothing tells it", check=True)
    if unit == "pu":
        return Guess(
            100.0,
            "P and Q are in pu, here of this base, which scales nothing; if they are in pu of a system's base, state "
            "it as base of P and Q, and the machine's MVA here",
            check=True,
        )
    loaded = float(np.hypot(P, Q)) / 0.8
    rated = float(f"{loaded:.2g}") if loaded > 0 else 100.0
    return Guess(
        rated, "the file does not say; guessed as if the machine ran at 80 % of its rating", check=True
    )


def base_kv_of_pu() -> Guess:
    """Base in kV where voltages and currents are in pu."""
    return Guess(20.0, "of voltages and currents in pu it scales nothing, but is needed", check=True)
