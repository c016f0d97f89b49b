"""A reader: how files of one format become recordings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from errorscreen.data.recordings import Recording

#: options that say how a file is laid out; the others say how readings are used, and apply to all formats
LAYOUT_KEYS = frozenset(
    {
        *("time", "time_unit", "time_format", "time_base", "quality", "delimiter", "decimal", "encoding"),
        *("skip_rows", "header_rows", "header", "sheet", "long"),
    }
)


@dataclass(frozen=True)
class Reader:
    """Reader of a file format.

    Parameters
    ----------
    recognises : callable
        ``recognises(head) -> bool``: whether a file that begins with these bytes has the format.
    read : callable
        ``read(path, columns, **options) -> Recording``: `columns` maps channels to `errorscreen.data.Column`; the
        options are the other keys of [recording] in a case file, as far as they are given there, see `read_csv`.
    needs_columns : bool
        Else `columns` may be None, because the files say what their channels are.
    layout : frozenset of str, optional
        Those of `LAYOUT_KEYS` that apply; all where not given.
    headers : callable, optional
        ``headers(path, **layout) -> list``: headers of the columns, from which channels may be guessed.
    """

    recognises: Callable[[bytes], bool]
    read: Callable[..., Recording]
    needs_columns: bool = True
    layout: frozenset[str] | None = None
    headers: Callable[..., list[str]] | None = None
