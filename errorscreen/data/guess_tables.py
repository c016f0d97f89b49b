"""The table in a file of unknown layout, of any format but COMTRADE, and the time stamps in it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from errorscreen._runtime.display import listed
from errorscreen.data.guess_layout import guess_layout, text_of
from errorscreen.data.guesses import Guess, guess_stamps
from errorscreen.data.headers import known_unit
from errorscreen.data.pandas_tables import INDEX
from errorscreen.data.readers.csv import read_body
from errorscreen.data.readers.excel import sheets
from errorscreen.data.readers.head import Head, Layout
from errorscreen.data.readers.long import Long, spread
from errorscreen.data.readers.matlab import read_matlab_columns
from errorscreen.data.readers.parquet import read_parquet_table
from errorscreen.data.readers.pscad import read_pscad_table
from errorscreen.data.table import Table
from errorscreen.data.timestamps import TimeFormat, format_of_time, read_time
from errorscreen.exceptions import InputError

#: headers of columns with the tag, and with the value, of each reading
_TAG = re.compile(
    r"(^|[\W_])(tag|point|signal|channel|variable|item|messstelle|messpunkt|kanal)(name|id)?($|[\W_])",
    re.IGNORECASE,
)
_VALUE = re.compile(r"(^|[\W_])(value|val|reading|wert)($|[\W_])", re.IGNORECASE)
_STATUS = {"stat", "status", "quality", "qual", "flag", "flags", "valid", "validity"}
#: STAT of IEEE C37.118.2 in hexadecimal digits; the bits that say error, test mode and a clock that is not set
_STAT, _BAD_BITS = re.compile(r"(0x)?[0-9a-f]{4}", re.IGNORECASE), 0xE000


@dataclass
class Opened:
    """Table of a file.

    Parameters
    ----------
    table : Table
    names : list of str
        Headers among which channels are looked for.
    keys : dict of str to Guess
        Of [recording], on the layout and the time stamps.
    decimal : str
    open : list of str
        Sentences on columns that were left out.
    """

    table: Table
    names: list[str]
    keys: dict[str, Guess] = field(default_factory=dict)
    decimal: str = "."
    open: list[str] = field(default_factory=list)

    def form(self) -> TimeFormat:
        """Where time stamps stand and how they are written, by the keys."""
        given = {key: guess.value for key, guess in self.keys.items()}
        unit = given.get("time_unit") or known_unit("time", self.table.units.get("time", "")) or "s"
        return format_of_time(
            given.get("time", "time"),
            unit,
            given.get("time_format"),
            given.get("time_base"),
            self.table.source,
        )

    def time(self) -> tuple[NDArray[np.float64], set[str]]:
        """Time stamps in seconds, and their headers."""
        form = self.form()
        return read_time(self.table, form, [], self.decimal)[0], {*form.headers}


def _of_text(path: Path) -> Opened:
    text, keys = text_of(path)
    keys |= guess_layout(text, f"file {path}")
    return _of_lines(text, keys, Layout(**{key: guess.value for key, guess in keys.items()}), f"file {path}")


def _of_workbook(path: Path) -> Opened:
    """The first sheet with a table that has time stamps."""
    error: InputError | None = None
    for name, text, others in sheets(path):
        keys = guess_layout(text, f"file {path}", "\t")
        layout = Layout("\t", **{key: guess.value for key, guess in keys.items()})
        if others:
            reason = f"the first one with time stamps; others: {', '.join(map(repr, others))}"
            keys["sheet"] = Guess(name, reason, check=True)
        try:
            found = _of_lines(text, keys, layout, f"file {path}")
        except InputError as none:
            error = error or none
            continue
        found.table = replace(found.table, row_word="row")
        return found
    raise error or InputError("holds no sheet with cells", where=f"file {path}")


def _of_lines(text: str, keys: dict[str, Guess], layout: Layout, source: str) -> Opened:
    def read(names: Sequence[str] | None, texts: Sequence[str] = ()) -> Table:
        return read_body(Head.of_text(text, layout, source), layout, names, texts)

    times = Counter(filter(None, Head.of_text(text, layout, source).names))
    once = [name for name, count in times.items() if count == 1]
    twice = sorted(times.keys() - {*once})
    told = [f"Column {name!r} occurs several times and was left out." for name in twice]
    table = read(once)
    long = _long(table, once)
    found = Opened(table, once, keys, layout.decimal, told)
    of_stamps = once if long is None else [name for name in once if name not in (long.tag, long.value)]
    keys |= guess_stamps(table, of_stamps, layout.decimal)
    stamps = {*found.form().headers}
    keys |= _quality(lambda name: read([name], [name]), [name for name in of_stamps if name not in stamps])
    if long is not None:
        reason = "each row holds the reading of one tag"
        keys["long"] = Guess({"tag": long.tag, "value": long.value}, reason)
        tags = list(dict.fromkeys(map(str, read([long.tag], [long.tag]).column(long.tag))))
        found.names = [tag.strip() for tag in tags if tag.strip()]
        found.table = spread(
            table, long, found.names, found.form(), [], quality=None, missing=(), decimal=layout.decimal,
            on_backward="sort",
        )  # fmt: skip
    return found


def _long(table: Table, names: Sequence[str]) -> Long | None:
    """Columns with tags and values, by their headers, where tags are texts that occur again and again."""
    tags = [name for name in names if _TAG.search(name)]
    values = [name for name in names if _VALUE.search(name)]
    if len(tags) != 1 or len(values) != 1:
        return None
    kinds = Counter(map(str, table.column(tags[0])))
    return Long(tags[0], values[0]) if 2 * len(kinds) <= kinds.total() else None


def _quality(read: Callable[[str], Table], names: Sequence[str]) -> dict[str, Guess]:
    """Key ``quality`` where a column with the status of each row says that some are bad."""
    for name in names:
        if not _STATUS & {*_words(name)}:
            continue
        kinds = Counter(map(str, read(name).column(name)))
        if all(_STAT.fullmatch(one) for one in kinds):
            good = sorted(one for one in kinds if not int(one, 16) & _BAD_BITS)
            reason, check = "bits 15 to 13 of STAT (IEEE C37.118.2) are 0", False
        else:
            usual, count = kinds.most_common(1)[0]
            good = [usual] if usual and 2 * count > kinds.total() else []
            reason, check = f"most rows hold {usual!r}", True
        others = sorted(kinds.keys() - {*good})
        if good and others:
            rows = sum(kinds[one] for one in others)
            reason += f"; {rows} rows hold {listed(map(repr, others))} and become gaps"
            return {"quality": Guess({"column": name, "good": good}, reason, check=check)}
    return {}


def _words(header: str) -> list[str]:
    """Words of a header in lower case, also of ``UNIT2_STAT`` and ``StatusFlags``."""
    return [one.casefold() for one in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", header)]


def _of_pscad(path: Path) -> Opened:
    notes: list[str] = []
    table = read_pscad_table(path, notes)
    return Opened(table, [name for name in table.columns if name != "time"], open=notes)


def _of_matlab(path: Path) -> Opened:
    """The variables of that length which most of them have, among those with time stamps."""
    found = read_matlab_columns(path)
    lengths = Counter(len(cells) for cells in found.columns.values() if len(cells) > 1)
    error: InputError | None = None
    for length, _ in lengths.most_common():
        cells = {name: one for name, one in found.columns.items() if len(one) == length}
        table = Table(cells, range(1, length + 1), found.source, "sample")
        try:
            keys = guess_stamps(table, [*cells], ".")
        except InputError as none:
            error = error or none
            continue
        left = [f"Variable {name!r} is of another length." for name in found.columns if name not in cells]
        left += [f"Variable {name!r} is of the class {kind}." for name, kind in found.unread.items()]
        return Opened(table, [*cells], keys, open=[*found.notes, *left])
    raise error or InputError("holds no variable of several numbers", where=found.source)


def _of_parquet(path: Path) -> Opened:
    table = read_parquet_table(path)
    names = [name for name in table.columns if not name.startswith("__index_level_")]
    for name in [INDEX, *names]:
        if name in table.columns and isinstance(table.columns[name], pd.Series):
            keys = {"time": Guess(name, "its type is that of dates or durations")}
            return Opened(table, names, keys)
    return Opened(table, names, guess_stamps(table, names, "."))


#: functions by format
OPENERS: Mapping[str, Callable[[Path], Any]] = {
    "csv": _of_text,
    "pscad": _of_pscad,
    "excel": _of_workbook,
    "matlab": _of_matlab,
    "parquet": _of_parquet,
}
