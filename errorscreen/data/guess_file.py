"""What a file of unknown layout holds: layout, time stamps, channels or waveforms, and bases, as guesses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.display import listed
from errorscreen.data.guess_numbers import guess_by_numbers
from errorscreen.data.guess_phasors import guess_phasors
from errorscreen.data.guess_psse import Machine, guess_psse
from errorscreen.data.guess_tables import OPENERS, Opened
from errorscreen.data.guess_waves import first_trios, guess_waveforms, phase_of
from errorscreen.data.guesses import (
    ChannelGuess,
    Guess,
    base_kv_of_pu,
    guess_base_kv,
    guess_base_mva,
    guess_channels,
    guess_frequency,
    guess_level,
    rated_kv,
)
from errorscreen.data.readers import recognised
from errorscreen.data.readers.comtrade import read_comtrade_table
from errorscreen.data.table import Table
from errorscreen.data.units import KA, KV, MVA
from errorscreen.data.waveforms import Waveforms
from errorscreen.exceptions import InputError

_Array = NDArray[np.float64]
#: range of a channel, relative to its largest reading, that readers refuse as one that never moves
_STILL = 1e-6
#: share of the instants up to which doubled stamps are steps: no disturbance has more
_FEW_STEPS = 0.05


@dataclass
class FileGuess:
    """Guesses about a file.

    Parameters
    ----------
    keys : dict of str to Guess
        Keys of [recording] but for columns and waveforms.
    channels : dict of str to ChannelGuess
    waveforms : Guess, optional
        Instead of channels.
    open : list of str
        Sentences on what the file left open.
    machine : Machine, optional
        Whose channels they are, where the file names machines.
    """

    keys: dict[str, Guess]
    channels: dict[str, ChannelGuess] = field(default_factory=dict)
    waveforms: Guess | None = None
    open: list[str] = field(default_factory=list)
    machine: Machine | None = None


def guess_file(path: Path, units: Sequence[tuple[object, str]] = ()) -> FileGuess:
    """Look into a file.

    Parameters
    ----------
    path : Path
    units : sequence of (bus, id)
        Units of a model file, one of which was recorded.

    Raises
    ------
    InputError
        If it cannot be read, or holds no time stamps.
    """
    kind = recognised(path)
    if kind == "comtrade":
        found = _of_record(path)
    elif kind in OPENERS:
        found = _of_table(OPENERS[kind](path), units)
    else:
        raise InputError(
            f"is of the format {kind}, whose channels are not guessed yet",
            where=f"file {path}",
            allowed=f"comtrade, {', '.join(OPENERS)}",
            remedy="Write the case file yourself: errorscreen keys recording tells its keys",
        )
    found.channels, told = _settle_still(found.channels)
    found.open += told
    found.keys = {"format": Guess(kind, "by the content of the file"), **found.keys}
    return found


def _of_record(path: Path) -> FileGuess:
    table, time, record, notes = read_comtrade_table(path)
    step = float(np.median(np.diff(time)))
    known = [(one.name, one.phase or phase_of(one.name), one.unit) for one in record.channels]
    waves, others = first_trios(known, f"file {path}") if step < 1 / 300 else (None, [])
    if step < 1 / 300 and waves is None:
        notes.append(
            "Three voltages of the phases A, B and C were not found. If the channels are sampled waves, name them as "
            "waveforms instead of columns: errorscreen keys recording.waveforms."
        )
    f_nominal = record.frequency if record.frequency > 0 else None
    if waves is not None:
        found = _of_waves(table, time, waves, guess_frequency({}, f_nominal, step), "")
        rated = next(one.rated for one in record.channels if one.name == waves.voltage[0])
        found.keys["base_kv"] = rated_kv(found.keys["base_kv"], rated)
        found.open += notes[1:]
        return _of_several(found, others)
    channels, left = guess_channels(table, [name for name, *_ in known], ".", f_nominal)
    keys = _bases(channels, guess_frequency(channels, f_nominal, step))
    return FileGuess(keys, channels, open=[*notes[1:], *left])


def _of_table(found: Opened, units: Sequence[tuple[object, str]]) -> FileGuess:
    table, keys, decimal = found.table, found.keys, found.decimal
    time, stamps = found.time()
    steps = np.diff(time)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    rest = [name for name in found.names if name not in stamps]
    keys |= _of_steps(time)
    waves, assumed, in_pu = guess_waveforms(table, rest, step, decimal)
    if waves:
        spec, others = first_trios(waves, table.source)
        if spec is not None:
            unit_of = {name: unit for name, _, unit in waves}
            table = Table(
                {name: table.numbers(name, decimal=decimal) for name in unit_of},
                table.rows,
                table.source,
                units=unit_of,
            )
            frequency = _frequency(table.numbers(spec.voltage[0]), time)
            guessed = _of_waves(table, time, spec, frequency, "by size" * assumed, in_pu)
            guessed.keys = keys | guessed.keys
            return _of_several(guessed, others)
    if (of_psse := guess_psse(table, rest, decimal, units)) is not None:
        machine, channels, told = of_psse
        keys |= _bases(channels, guess_frequency(channels, None, step))
        return FileGuess(keys, channels, open=[*told, *found.open], machine=machine)
    guess = guess_by_numbers if "header" in keys else guess_channels
    channels, left = guess(table, rest, decimal, None)
    left += found.open
    f_nominal = guess_frequency(channels, None, step)
    try:
        phasors = guess_phasors(table, rest, time, f_nominal.value, decimal)
    except InputError as error:
        phasors = None
        left.append(f"Phasors were not used: {error}")
    if phasors is not None:
        beside = {"f"} if phasors.power else {"f", "P", "Q"}
        channels = {
            role: one
            for role, one in channels.items()
            if role in beside and one.fields["column"] not in phasors.headers
        }
        return FileGuess({**keys, **_bases(channels, f_nominal), **phasors.keys}, channels, open=left)
    if not channels:
        left.append(f"No column is recognised as V, angle, f, P or Q among {listed(map(repr, rest))}.")
    return FileGuess({**keys, **_bases(channels, f_nominal)}, channels, open=left)


def _of_several(found: FileGuess, others: Sequence[str]) -> FileGuess:
    """Guess of waveforms, marked where there are others."""
    if others and found.waveforms is not None:
        reason = f"{found.waveforms.reason}; the first of several sets, others: {listed(map(repr, others))}"
        found.waveforms = replace(found.waveforms, reason=reason, check=True)
    return found


def _settle_still(channels: dict[str, ChannelGuess]) -> tuple[dict[str, ChannelGuess], list[str]]:
    """Channels without an f or angle that never moves; a P or Q that never moves is stated. And sentences on both."""
    kept, told = {}, []
    for role, one in channels.items():
        known = one.numbers[np.isfinite(one.numbers)]
        still = bool(len(known)) and np.ptp(known) <= _STILL * np.abs(known).max()
        if still and role in ("f", "angle"):
            told.append(
                f"Column {one.fields['column']!r} would be {role}, but it never moves, so it was left out."
            )
            continue
        if still and role in ("P", "Q"):
            told.append(f"Column {one.fields['column']!r} never moves, so {role} is stated and not compared.")
            fields = {key: value for key, value in one.fields.items() if key != "column"}
            one = replace(one, fields={"value": one.level, **fields}, reason=f"{one.reason}; it never moves")
        kept[role] = one
    return kept, told


def _of_steps(time: _Array) -> dict[str, Guess]:
    """Key ``on_duplicate`` where a program wrote several states at an instant.

    Most instants have one row then, and on a regular grid no sample lacks behind a repeated stamp.
    """
    steps = np.diff(time)
    twice, between = np.flatnonzero(steps == 0), steps[steps > 0]
    if not len(twice) or 2 * len(twice) > len(between):
        return {}
    usual = float(np.median(between))
    regular = np.mean(np.abs(between - usual) < 0.1 * usual) > 0.9
    if regular and (steps[np.minimum(twice + 1, len(steps) - 1)] > 1.5 * usual).any():
        return {}
    if len(twice) > _FEW_STEPS * len(between):
        reason = f"{len(twice)} rows repeat a time stamp, as simulation programs write their iterations"
        return {"on_duplicate": Guess("last", reason, check=True)}
    reason = f"{len(twice)} rows repeat a time stamp, as simulation programs write both sides of a step"
    return {"on_duplicate": Guess("keep-step", reason, check=True)}


def _frequency(wave: _Array, time: _Array) -> Guess:
    """Nominal frequency by the time that ten periods of a wave take."""
    at = np.flatnonzero((wave[:-1] < 0) & (wave[1:] >= 0))
    rising = time[at] - wave[at] * (time[at + 1] - time[at]) / (wave[at + 1] - wave[at])
    ten = rising[10:] - rising[:-10]
    level = 10.0 / float(np.median(ten)) if len(ten) else np.nan
    for nominal in (50.0, 60.0):
        if abs(level - nominal) < 2.5:
            return Guess(nominal, f"the wave repeats {level:.4g} times a second")
    return guess_frequency({}, None, float(np.median(np.diff(time))))


def _of_waves(
    table: Table, time: _Array, spec: Waveforms, f_nominal: Guess, unit_reason: str, in_pu: bool = False
) -> FileGuess:
    """Guess of waveforms; base and level follow from the first two periods."""
    first = time <= time[0] + 2.0 / f_nominal.value
    volts, amps = (
        [table.numbers(name)[first] * {**KV, **KA}[table.units[name]] for name in names]
        for names in (spec.voltage, spec.current)
    )
    squares = sum(float(np.nanmean(v * v)) for v in volts)
    kv = np.sqrt(squares / 3 if spec.line_to_line else squares)
    P = np.nan
    if amps and not spec.line_to_line:
        P = sum(float(np.nanmean(v * i)) for v, i in zip(volts, amps, strict=True))
    fields: dict[str, Any] = {"voltage": list(spec.voltage)}
    if spec.current:
        fields["current"] = list(spec.current)
    if spec.line_to_line:
        fields["line_to_line"] = True
    if unit_reason or in_pu:
        fields["voltage_unit"] = "pu" if in_pu else table.units[spec.voltage[0]]
        if spec.current:
            fields["current_unit"] = "pu" if in_pu else table.units[spec.current[0]]
    reason = "three voltages and three currents of the phases, point on wave"
    if unit_reason:
        reason += f"; their units {unit_reason}"
    base_kv = base_kv_of_pu() if in_pu else guess_level(kv, "the voltage from line to line is")[0]
    keys = {
        "f_nominal": f_nominal,
        "base_mva": guess_base_mva(P if P == P else 0.0, 0.0, "pu" if in_pu else "MW"),
        "base_kv": base_kv,
    }
    open_ = [] if spec.current else ["There are no three currents, so P and Q do not follow."]
    if P < 0:
        fields["sign"] = "load"
        reason += "; P before the event is negative, so the currents count as positive into the plant"
    return FileGuess(keys, waveforms=Guess(fields, reason, check=bool(unit_reason) or P < 0), open=open_)


def _bases(channels: dict[str, ChannelGuess], f_nominal: Guess) -> dict[str, Guess]:
    """Bases from the levels of V, P and Q; the sign of P and Q, and V from line to neutral, go into `channels`."""
    keys = {"f_nominal": f_nominal}
    P, Q = (
        one.level * one.fields.get("base", MVA.get(one.fields["unit"], 1.0)) if one is not None else 0.0
        for one in map(channels.get, "PQ")
    )
    of_P = None
    if "P" in channels:  # in pu of a base that is known, they tell as much as MW
        of_P = "MW" if "base" in channels["P"].fields else channels["P"].fields["unit"]
    keys["base_mva"] = guess_base_mva(P, Q if np.isfinite(Q) else 0.0, of_P)
    if "V" in channels:
        base, fields = guess_base_kv(channels["V"])
        if base is not None:
            keys["base_kv"] = base
        if fields:
            channels["V"] = _with(channels["V"], fields, "measured from line to neutral")
    if P < 0:
        why = "P before the event is negative, so it counts as positive when consumed"
        for name in [name for name in "PQ" if name in channels]:
            channels[name] = _with(channels[name], {"sign": "load"}, why)
    return keys


def _with(channel: ChannelGuess, fields: Mapping[str, Any], why: str) -> ChannelGuess:
    return ChannelGuess({**channel.fields, **fields}, f"{channel.reason}; {why}", channel.numbers, check=True)
