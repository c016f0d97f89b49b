"""Readers of recordings, one file for each format."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from errorscreen._runtime.registry import Registry
from errorscreen.data.frames import Specs
from errorscreen.data.readers.base import LAYOUT_KEYS, Reader
from errorscreen.data.readers.comtrade import COMTRADE
from errorscreen.data.readers.csv import CSV
from errorscreen.data.readers.excel import EXCEL
from errorscreen.data.readers.matlab import MATLAB
from errorscreen.data.readers.parquet import PARQUET
from errorscreen.data.readers.pscad import PSCAD
from errorscreen.data.readers.text import check_file, refuse_by_ending, refuse_other_format
from errorscreen.data.recordings import Recording
from errorscreen.exceptions import InputError

#: Formats that recordings are read from. The last one is asked first: text files are what is left.
READERS: Registry[Reader] = Registry(
    "format",
    "errorscreen.readers",
    Reader,
    {"csv": CSV, "comtrade": COMTRADE, "pscad": PSCAD, "excel": EXCEL, "matlab": MATLAB, "parquet": PARQUET},
)
#: bytes that a format is recognised by
_HEAD = 4096


def read_recording(
    path: str | Path, columns: Specs | None, format: str | None = None, **options: Any
) -> Recording:
    """Read a recording from a file of any registered format.

    Parameters
    ----------
    path : path-like
    columns : mapping or None
        Source of each channel, see `from_frame`. None for formats that say what their channels are.
    format : str, optional
        Name in `READERS`; recognised by content where not given.
    **options
        Of the reader, see `read_csv`.

    Raises
    ------
    InputError
        If the format is unknown or not recognised, or the file cannot be used.
    """
    form = format or recognised(Path(path))
    reader = READERS[form]
    check_options(form, options, f"file {path}")
    if not columns and reader.needs_columns and not {"waveforms", "phasors"} & options.keys():
        raise InputError(
            "no column is mapped to a channel",
            where=f"file {path}",
            allowed="at least one",
            remedy="Give columns, or waveforms or phasors of three phases",
        )
    return reader.read(path, columns, **options)


def check_options(form: str, options: Iterable[str], where: str) -> None:
    """Refuse options that do not apply to a format."""
    layout = READERS[form].layout
    for key in options:
        if layout is not None and key in LAYOUT_KEYS - layout:
            raise InputError(
                f"{key} does not apply to the format {form!r}",
                where=where,
                allowed=", ".join(sorted(layout)) or "no key that says how the file is laid out",
                remedy="Leave it out",
            )


def recognised(path: Path) -> str:
    """Name of the format of a file; `InputError` if no reader recognises it."""
    check_file(path)
    with path.open("rb") as file:
        head = file.read(_HEAD)
    for name in reversed(list(READERS)):
        if (reader := READERS.usable(name)) is not None and reader.recognises(head):
            return name
    refuse_other_format(head, path)
    refuse_by_ending(path)
    raise InputError(
        "the format is not recognised",
        where=f"file {path}",
        allowed=", ".join(READERS),
        remedy="State it with format, or install a package that reads it",
    )
