"""Text of a file: refused paths, encodings, and formats that are no text."""

from __future__ import annotations

import codecs
from pathlib import Path

from errorscreen._runtime import files
from errorscreen.exceptions import InputError

#: First bytes of formats that are no text, with what to do.
_OTHER_FORMATS = {
    b"PK\x03\x04": ("a spreadsheet or another zip archive", "State format = 'excel'"),
    b"\xd0\xcf\x11\xe0": ("a spreadsheet of an old version", "Save the sheet as .xlsx or CSV"),
    b"MATLAB 5.0 MAT-file": ("a MATLAB file", "State format = 'matlab'"),
    b"MATLAB 7.3 MAT-file": ("a MATLAB file", "State format = 'matlab'"),
    b"\x89HDF": ("an HDF5 file", "Export its numbers as CSV"),
    b"PAR1": ("a Parquet file", "State format = 'parquet'"),
    b"--- file type": ("a COMTRADE file", "State format = 'comtrade'"),
    b"\x1f\x8b": ("compressed by gzip", "Unpack it"),
    b"BZh91AY&SY": ("compressed by bzip2", "Unpack it"),
    b"\xfd7zXZ\0": ("compressed by xz", "Unpack it"),
    b"\x28\xb5\x2f\xfd": ("compressed by Zstandard", "Unpack it"),
    b"#1\ndouble ": ("a file of tables of Modelica", "Cut the table to a file of its own, and give header"),
    b"#1\r\ndouble ": ("a file of tables of Modelica", "Cut the table to a file of its own, and give header"),
}
#: endings of formats that are no text and whose form is not published, with what to do
_BY_ENDING = {
    ".psout": (
        "output of PSCAD 5 in its binary form",
        "Convert it to .inf and .out files in the PSOUT Reader",
    ),
    ".chf": ("channels of PSLF in its binary form", "Export the channels as CSV"),
    ".out": (
        "in binary form, as channel output of PSS/E",
        "In the Python of PSS/E: dyntools.CHNF('run.out').xlsout(), and give the workbook",
    ),
}
_BY_ENDING[".outx"] = _BY_ENDING[".out"]
#: bytes that tell UTF-16 without a mark
_HEAD = 2000
#: larger files are not read, because a table takes a multiple of its file in memory
_LARGEST = 2**31


def check_file(path: Path) -> None:
    """Refuse a path that is no ordinary file, or too large; see `errorscreen._runtime.files.check_file`."""
    files.check_file(path, f"file {path}", _LARGEST, "a file of readings")


def check_size(size: int, where: str) -> None:
    """Refuse more bytes than a recording may have, of a file or of what it unpacks to."""
    files.check_size(size, _LARGEST, where)


def decoded(path: Path, encoding: str) -> str:
    """Text of a file.

    Parameters
    ----------
    path : Path
    encoding : str
        UTF-16 without a mark is recognised where this is ``"utf-8-sig"``.

    Raises
    ------
    InputError
        If it is no text in this encoding; a file of another known format is called so.
    """
    check_file(path)
    where = f"file {path}"
    try:
        content = path.read_bytes()
        return content.decode(_utf_16(content) or encoding if encoding == "utf-8-sig" else encoding)
    except LookupError as error:
        problem = f"encoding {encoding!r} is unknown"
        raise InputError(problem, where=where, allowed="utf-8, latin-1, ...") from error
    except UnicodeDecodeError as error:
        refuse_other_format(content[:_HEAD], path)
        raise InputError(
            f"byte {error.start} is not {encoding} text",
            where=where,
            remedy="Give encoding='latin-1' or 'utf-16', or save the file as UTF-8",
        ) from error
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", where=where) from error


def refuse_other_format(head: bytes, path: Path) -> None:
    """Refuse a file whose first bytes, or whose neighbour, show that it is of another format."""
    for mark, (kind, remedy) in _OTHER_FORMATS.items():
        if head.startswith(mark):
            raise InputError(f"is {kind}", where=f"file {path}", allowed="a text file", remedy=remedy)
    if path.suffix.lower() == ".dat" and any(
        path.with_suffix(ending).exists() for ending in (".cfg", ".CFG", ".Cfg")
    ):
        raise InputError(
            "holds the data of a COMTRADE record",
            where=f"file {path}",
            remedy="Give the .cfg file beside it as path",
        )


def refuse_by_ending(path: Path) -> None:
    """Refuse a file that is no text, and whose ending is that of a format of a simulation program."""
    if path.suffix.lower() in _BY_ENDING:
        kind, remedy = _BY_ENDING[path.suffix.lower()]
        raise InputError(
            f"is {kind}", where=f"file {path}", allowed="a format that is published", remedy=remedy
        )


def _utf_16(content: bytes) -> str | None:
    """UTF-16 with a mark, or recognised by the zero bytes of Latin letters and digits."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    head = content[:_HEAD]
    for encoding, zeros, letters in (
        ("utf-16-le", head[1::2], head[::2]),
        ("utf-16-be", head[::2], head[1::2]),
    ):
        if len(head) > 8 and zeros.count(0) > 0.9 * len(zeros) and letters.count(0) == 0:
            return encoding
    return None


def is_text(head: bytes) -> bool:
    """Whether a file that begins with these bytes may hold text: zero bytes occur only in UTF-16 and UTF-32."""
    marks = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, codecs.BOM_UTF32_BE)
    return b"\0" not in head or head.startswith(marks) or _utf_16(head) is not None
