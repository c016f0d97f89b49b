"""What a file of unknown layout holds: layout, time stamps, channels or waveforms, and bases, as guesses."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errorscreen._runtime.display import listed
from errorscreen.data.guesses import (
    ChannelGuess,
    Guess,
    guess_base_kv,
    guess_base_mva,
    guess_channels,
    guess_frequency,
    guess_level,
    guess_stamps,
    guess_waveforms,
)
from errorscreen.data.headers import known_unit
from errorscreen.data.readers import recognised
from errorscreen.data.readers.comtrade import read_comtrade_table
from errorscreen.data.readers.csv import read_headers, read_table
from errorscreen.data.readers.head import COMMENTS, DELIMITERS, WHITESPACE, Layout, is_number
from errorscreen.data.readers.text import decoded
from errorscreen.data.table import Table
from errorscreen.data.timestamps import format_of_time, read_time
from errorscreen.data.units import KA, KV, MVA
from errorscreen.data.waveforms import Waveforms, trios
from errorscreen.exceptions import InputError

_Array = NDArray[np.float64]
#: lines that the layout is guessed from
_LINES = 200


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
    """

    keys: dict[str, Guess]
    channels: dict[str, ChannelGuess] = field(default_factory=dict)
    waveforms: Guess | None = None
    open: list[str] = field(default_factory=list)


def guess_file(path: Path) -> FileGuess:
    """Look into a file.

    Raises
    ------
    InputError
        If it cannot be read, or holds no time stamps.
    """
    kind = recognised(path)
    if kind == "comtrade":
        found = _of_record(path)
    elif kind == "csv":
        found = _of_text(path)
    else:
        raise InputError(
            f"is of the format {kind}, whose channels are not guessed yet",
            where=f"file {path}",
            allowed="text of columns, and COMTRADE",
            remedy="Write the case file yourself: errorscreen keys recording tells its keys",
        )
    found.keys = {"format": Guess(kind, "by the content of the file"), **found.keys}
    return found


def _of_record(path: Path) -> FileGuess:
    table, time, record, notes = read_comtrade_table(path)
    step = float(np.median(np.diff(time)))
    known = [(one.name, one.phase, one.unit) for one in record.channels]
    waves = None
    if step < 1 / 300:
        try:
            waves = trios(known, f"file {path}")
        except InputError as error:
            notes.append(f"{error.what[0].upper()}{error.what[1:]}.")
    f_nominal = record.frequency or None
    if waves is not None:
        found = _of_waves(table, time, waves, guess_frequency({}, f_nominal, step), "")
        found.open += notes[1:]
        return found
    channels, left = guess_channels(table, [name for name, *_ in known], ".", f_nominal)
    keys = _bases(channels, guess_frequency(channels, f_nominal, step))
    return FileGuess(keys, channels, open=[*notes[1:], *left])


def _of_text(path: Path) -> FileGuess:
    keys = _layout(path)
    layout = Layout(**{key: guess.value for key, guess in keys.items()})
    names = read_headers(path, layout)
    once = [name for name in names if name and names.count(name) == 1]
    table = read_table(path, layout, once)
    keys |= guess_stamps(table, once, layout.decimal)
    header = keys["time"].value
    stamps = {header} if isinstance(header, str) else {*header}
    given = {key: keys[key].value for key in ("time_unit", "time_format", "time_base") if key in keys}
    form = format_of_time(
        header, given.get("time_unit", "s"), given.get("time_format"), given.get("time_base"), table.source
    )
    time, _ = read_time(table, form, [], layout.decimal)
    steps = np.diff(time)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    rest = [name for name in once if name not in stamps]
    waves, assumed = guess_waveforms(table, rest, step, layout.decimal)
    if waves:
        try:
            spec = trios(waves, table.source)
        except InputError:
            spec = None
        if spec is not None:
            units = {name: unit for name, _, unit in waves}
            table = Table(
                {name: table.numbers(name, decimal=layout.decimal) for name in units},
                table.rows,
                table.source,
                units=units,
            )
            found = _of_waves(table, time, spec, guess_frequency({}, None, step), "by size" * assumed)
            found.keys = keys | found.keys
            return found
    keys |= _quality(path, layout, rest)
    channels, left = guess_channels(table, rest, layout.decimal, None)
    if not channels:
        left.append(f"No column is recognised as V, angle, f, P or Q among {listed(map(repr, rest))}.")
    twice = sorted({name for name in names if name and names.count(name) > 1})
    left += [f"Column {name!r} occurs several times and was left out." for name in twice]
    return FileGuess({**keys, **_bases(channels, guess_frequency(channels, None, step))}, channels, open=left)


def _quality(path: Path, layout: Layout, names: Sequence[str]) -> dict[str, Guess]:
    """Key ``quality`` where a column with the status of each row says different things."""
    for name in names:
        if re.search(r"(^|\W)(stat|status|quality|flags?|valid)($|\W)", name, re.IGNORECASE):
            kinds = Counter(map(str, read_table(path, layout, [name], [name]).column(name)))
            usual, count = kinds.most_common(1)[0]
            if len(kinds) > 1 and 2 * count > kinds.total() and usual:
                others = listed(map(repr, sorted(kinds.keys() - {usual})))
                reason = (
                    f"most rows hold {usual!r}, {kinds.total() - count} rows hold {others} and become gaps"
                )
                return {"quality": Guess({"column": name, "good": [usual]}, reason, check=True)}
    return {}


def _of_waves(table: Table, time: _Array, spec: Waveforms, f_nominal: Guess, unit_reason: str) -> FileGuess:
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
    if unit_reason:
        fields["voltage_unit"] = table.units[spec.voltage[0]]
        if spec.current:
            fields["current_unit"] = table.units[spec.current[0]]
    reason = "three voltages and three currents of the phases, point on wave"
    if unit_reason:
        reason += f"; their units {unit_reason}"
    base_kv, _ = guess_level(kv, "the voltage from line to line is")
    keys = {
        "f_nominal": f_nominal,
        "base_mva": guess_base_mva(P if P == P else 0.0, 0.0, "MW"),
        "base_kv": base_kv,
    }
    open_ = [] if spec.current else ["There are no three currents, so P and Q do not follow."]
    channels = {}
    if P < 0:
        why = "P before the event is negative: the currents are positive into the plant"
        for name, unit in (("P", "MW"), ("Q", "Mvar")):
            channels[name] = ChannelGuess(
                {"column": name, "unit": unit, "sign": "load"}, why, np.array([P]), True
            )
    return FileGuess(keys, channels, Guess(fields, reason, check=bool(unit_reason)), open_)


def _bases(channels: dict[str, ChannelGuess], f_nominal: Guess) -> dict[str, Guess]:
    """Bases from the levels of V, P and Q; the sign of P and Q, and V from line to neutral, go into `channels`."""
    keys = {"f_nominal": f_nominal}
    P, Q = (
        channels[name].level * MVA.get(channels[name].fields["unit"], 1.0) if name in channels else 0.0
        for name in "PQ"
    )
    of_P = channels["P"].fields["unit"] if "P" in channels else "pu"
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


def _layout(path: Path) -> dict[str, Guess]:
    """Keys of `Layout` that differ from the defaults."""
    keys: dict[str, Guess] = {}
    try:
        text = decoded(path, "utf-8-sig")
    except InputError as error:
        if not error.what.endswith("text"):
            raise
        text = decoded(path, "latin-1")
        keys["encoding"] = Guess("latin-1", "the file is not UTF-8")
    lines = text[: text.find("\0")].splitlines() if "\0" in text else _first_lines(text)
    told = [k for k, one in enumerate(lines) if one.strip() and not one.lstrip().startswith(COMMENTS)]
    rows = [k for k in told if not re.fullmatch(r"sep=.\s*", lines[k], re.IGNORECASE)]
    tail = [lines[k] for k in rows[len(rows) // 2 :]]
    if not tail:
        return keys
    delimiter = _delimiter(tail)
    cells = {k: _cells(lines[k], delimiter) for k in rows}
    of_tail = [cell for one in tail for cell in _cells(one, delimiter)]
    decimal = "."
    if delimiter != "," and any(re.fullmatch(r"[+-]?\d*,\d+([eE][+-]?\d+)?", cell) for cell in of_tail):
        decimal = ","
        keys["decimal"] = Guess(",", "as the numbers in the file have it")
    width = len(_cells(tail[-1], delimiter))
    begin = next((k for k in rows if len(cells[k]) == width), rows[0])
    numeric = [any(is_number(cell, decimal) for cell in cells[k]) for k in rows if k >= begin]
    n_heads = numeric.index(True) if True in numeric else len(numeric)
    if begin != rows[0]:
        keys["skip_rows"] = Guess(begin, "lines above the table")
    heads = [k for k in rows if k >= begin][:n_heads]
    if len(heads) > 1 and all(known_unit("", cell) for cell in cells[heads[-1]] if cell):
        heads = heads[:-1]  # a row of units, which the reader knows
    if len(heads) > 1:
        keys["header_rows"] = Guess(len(heads), "rows of texts above the numbers")
    above = [lines[k] for k in range(begin) if lines[k].lstrip().startswith(COMMENTS)]
    named = bool(above) and len(_cells(above[-1].lstrip("#!/ "), delimiter)) == width > 1
    if not heads and not named:
        names = ["time", *(f"column {k}" for k in range(2, width + 1))]
        keys["header"] = Guess(
            names, "the file has no headers; replace them by what the columns hold", check=True
        )
    if delimiter == WHITESPACE:
        keys["delimiter"] = Guess(WHITESPACE, "fields are separated by blanks")
    return keys


def _first_lines(text: str) -> list[str]:
    end = 0
    for _ in range(_LINES):
        end = text.find("\n", end) + 1
        if not end:
            return text.splitlines()
    return text[:end].splitlines()


def _delimiter(lines: Sequence[str]) -> str:
    """Delimiter that gives all lines equal numbers of fields; the comma last, because it may be a decimal mark."""
    for one in (";", "\t", "|", ","):
        counts = {line.count(one) for line in lines}
        if len(counts) == 1 and counts != {0}:
            return one
    return max(DELIMITERS, key=lines[-1].count) if any(d in lines[-1] for d in DELIMITERS) else WHITESPACE


def _cells(line: str, delimiter: str) -> list[str]:
    parts = line.split() if delimiter == WHITESPACE else line.split(delimiter)
    return [cell.strip().strip('"') for cell in parts]
