"""Text of DYR files: reading it safely, cutting it into records and fields, and changing numbers in place.

A record is ``bus 'MODEL' id values /``, with blanks or commas between the fields, over any number of lines. The first
``/`` outside of quotes ends it; the text behind is a comment. So is a line that begins with ``//``, ``/*`` or ``@``.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from errorscreen._runtime.files import check_file
from errorscreen.exceptions import InputError

#: bytes of the largest file that is read; a model file of a continent has some 20 MB
LARGEST = 200 * 1024**2
#: content of the files that are read
_CONTENT = {"DYR": "dynamic data", "RAW": "power flow data"}
#: lines that a difference shows around a change
CONTEXT = 3

_QUOTED = r"""'(?:[^'\r\n]|'')*'|"(?:[^"\r\n]|"")*\""""
LINE = re.compile(r"([^\r\n]*)(?:\r\n|\r|\n|\Z)")
_WHOLE_LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+")
_CODE = re.compile(rf"""(?:[^/'"]+|{_QUOTED}|['"])*""")
_FIELD = re.compile(rf"""({_QUOTED})|(,)|([^\s,'"]+|['"])""")
_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[EeDd][+-]?\d+)?", re.ASCII)
#: bus, model and identifier at the start of a line: a new record, although the one before may lack its ``/``
_BEGINNING = re.compile(
    r"""[\s,]*(?:\d{1,9}|'[^'\r\n]*'|"[^"\r\n]*")
    (?:[\s,]*(?P<quote>['"])\s*[A-Za-z]\w\w+\s*(?P=quote)
     | [\s,]+(?!nan\b|inf\b|infinity\b)[A-Za-z]\w\w+(?=[\s,'"]|$))""",
    re.ASCII | re.VERBOSE | re.IGNORECASE,
)
#: identifier and first value behind bus and model
_GOING_ON = re.compile(r"""[\s,]*(?:'[^'\r\n]*'|"[^"\r\n]*"|[^\s,'"/]+)[\s,]*[+-]?\.?\d""")
_BLANKS = re.compile(" *")
_CONTROLS = re.compile(rb"[\x00-\x08\x0e-\x19\x1b-\x1f]")
_RAW = re.compile(
    r"""^[ \t]*(?:[01]?[ \t]*,[ \t]*\d+(?:\.\d*)?[ \t]*,[ \t]*[23]\d\b
    | (?:0[ \t]*/[ \t]*)?(?:END\ OF|BEGIN)\ [A-Z ]+\ DATA\b)""",
    re.MULTILINE | re.VERBOSE | re.IGNORECASE,
)
_DYD = re.compile(
    r"""^[ \t]*(?:models\b | [A-Za-z]\w*[ \t]+\d+[ \t]+"[^"\r\n]*"[ \t]+[\d.]+[ \t]+"[^"\r\n]*"[ \t]*:)""",
    re.MULTILINE | re.VERBOSE | re.IGNORECASE,
)


class Token(NamedTuple):
    """A field: its text without quotes, its place in the text, and its line and column, which count from one.

    An empty field has no text and is not quoted.
    """

    text: str
    quoted: bool
    start: int
    end: int
    line: int
    column: int

    @property
    def lone_quote(self) -> bool:
        """Whether this is a quote without a partner on its line."""
        return not self.quoted and self.text in ("'", '"')


class Span(NamedTuple):
    """Lines of a record: number, start and end of each without comments.

    `ended` tells whether a ``/`` ends it, `behind` where the comment behind that is.
    """

    lines: tuple[tuple[int, int, int], ...]
    ended: bool
    behind: tuple[int, int] = (0, 0)


def read_text(path: Path, kind: str = "DYR") -> tuple[str, str]:
    """Text of a file and its encoding; `InputError` if it is no readable text file of usual size.

    The kind, ``"DYR"`` or ``"RAW"``, is for messages.
    """
    where = f"file {path}"
    check_file(path, where, LARGEST, f"a {kind} file", f"Give the path of the {kind} file")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"cannot be read: {error.strerror or error}", where=where, allowed="a readable file"
        ) from error
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(
            "is text in UTF-16", where=where, allowed="UTF-8 or Latin-1", remedy="Save it as UTF-8"
        )
    if found := _CONTROLS.search(data):
        raise InputError(
            f"is no text: byte {found.start() + 1} is 0x{found[0][0]:02x}",
            where=where,
            allowed=f"a {kind} file, which is plain text",
            remedy=f"Save the {_CONTENT[kind]} of the case as a {kind} file; files such as SAV and SNP are not read",
        )
    for encoding in ("utf-8-sig" if data[:3] == b"\xef\xbb\xbf" else "utf-8", "latin-1"):
        try:
            return data.decode(encoding), encoding
        except UnicodeDecodeError:
            continue
    raise AssertionError("Latin-1 decodes anything")


def other_format(text: str) -> str:
    """Name of another format that a text without DYR records is of; empty if it is none of those known."""
    if _DYD.search(text):
        return "DYD"
    return "RAW" if _RAW.search(text) else ""


def spans(text: str) -> Iterator[Span]:
    """Cut a text into records."""
    lines: list[tuple[int, int, int]] = []
    for number, found in enumerate(LINE.finditer(text), start=1):
        start, end = found.span(1)
        body = found[1].replace("\x1a", " ").strip()  # a control-Z ends old files
        if not body or body[0] == "@" or body[:2] in ("//", "/*") or (body[0] == "/" and not lines):
            continue
        if lines and _BEGINNING.match(text, start, end) and not _names_a_library_model(text, lines):
            yield Span(tuple(lines), ended=False)
            lines = []
        code = end_of_code(text, start, end)
        lines.append((number, start, code))
        if code < end:
            yield Span(tuple(lines), ended=True, behind=(code + 1, end))
            lines = []
    if lines:
        yield Span(tuple(lines), ended=False)


def torn_comments(text: str) -> Iterator[int]:
    r"""Lines with a ``/*`` whose ``*/`` stands on a later line.

    Examples
    --------
    >>> [*torn_comments("/* one line */\n/* two\nlines */\n/* no end")]
    [2]
    """
    opened = 0
    if "/*" not in text or "*/" not in text:
        return
    for number, found in enumerate(LINE.finditer(text), start=1):
        begin, end = found[1].rfind("/*"), found[1].rfind("*/")
        if opened and end >= 0:
            yield opened
            opened = 0
        if begin >= 0:
            opened = number if end < begin else 0


def end_of_code(text: str, start: int, end: int) -> int:
    """End of a line without its comment."""
    slash = text.find("/", start, end)
    if slash < 0:
        return end
    if text.find("'", start, slash) < 0 and text.find('"', start, slash) < 0:
        return slash
    found = _CODE.match(text, start, end)
    return found.end() if found else end


def _names_a_library_model(text: str, lines: list[tuple[int, int, int]]) -> bool:
    """Whether an open record waits for its identifier and the name of a library model."""
    head = list(islice(tokens(text, lines), 3))
    return len(head) == 2 and head[1].text.strip().upper() == "USRMDL"


def holds_record(text: str, start: int, end: int) -> bool:
    """Whether a comment behind a record looks like another record."""
    found = _BEGINNING.match(text, start, end)
    return bool(found and found["quote"] and _GOING_ON.match(text, found.end(), end))


def tokens(text: str, lines: Sequence[tuple[int, int, int]]) -> Iterator[Token]:
    """Fields of a record."""
    after_comma = True
    for line, start, end in lines:
        for found in _FIELD.finditer(text, start, end):
            first, last = found.span()
            place = (first, last, line, first - start + 1)
            if found[2]:
                if after_comma:
                    yield Token("", False, *place)
                after_comma = True
                continue
            after_comma = False
            if quoted := found[1]:
                yield Token(quoted[1:-1].replace(quoted[0] * 2, quoted[0]), True, *place)
            elif word := found[3].strip("\x1a"):
                yield Token(word, False, *place)


@lru_cache(maxsize=65536)
def number(text: str) -> float:
    """Value of a number with an exponent E or D; NaN if the text is none, or too large."""
    if not _NUMBER.fullmatch(text):
        return math.nan
    value = float(text.replace("D", "E").replace("d", "e"))
    return value if math.isfinite(value) else math.nan


def written(value: float, *, whole: bool = False) -> str:
    """Short text of a number that reads as the same value, up to one part in a million.

    Examples
    --------
    >>> [written(value) for value in (12, 1.234567, 1.0000005e-7)], written(2.0, whole=True)
    (['12.0', '1.234567', '1.0E-07'], '2')
    """
    if whole:
        return f"{value:.0f}"
    text = f"{value:.6g}"
    if abs(float(text) - value) > 1e-6 * abs(value):
        text = f"{value:.7g}"
    digits, _, exponent = text.partition("e")
    digits = digits if "." in digits else f"{digits}.0"
    return f"{digits}E{exponent}" if exponent else digits


def replaced(text: str, changes: Mapping[Token, str]) -> str:
    """Text with other numbers in some fields; the columns behind stay where they are if the new number fits."""
    pieces, done = [], 0
    for token in sorted(changes, key=lambda one: one.start):
        new, end, width = changes[token], token.end, token.end - token.start
        found = _BLANKS.match(text, end)
        blanks = found.end() - end if found else 0
        if len(new) > width:
            end += min(len(new) - width, max(0, blanks - 1))
        elif blanks and text[end + blanks : end + blanks + 1] not in ("", "\r", "\n"):
            new = new.ljust(width)
        pieces += [text[done : token.start], new]
        done = end
    return "".join([*pieces, text[done:]])


def difference(old: str, new: str, names: tuple[str, str]) -> str:
    """Difference of two texts in the unified format.

    `difflib` takes minutes for a file with hundreds of thousands of lines; what is alike at both ends is left out here.
    Lines of texts with the same number of lines face each other.
    """
    before, after = _WHOLE_LINE.findall(old), _WHOLE_LINE.findall(new)
    if len(before) == len(after):
        changed = [k for k, pair in enumerate(zip(before, after, strict=True)) if pair[0] != pair[1]]
        blocks = [(k, k + 1, k, k + 1) for k in changed]
    else:
        fewest = min(len(before), len(after))
        head = next((k for k in range(fewest) if before[k] != after[k]), fewest)
        tail = next((k for k in range(fewest - head) if before[-1 - k] != after[-1 - k]), fewest - head)
        middle = before[head : len(before) - tail], after[head : len(after) - tail]
        found = difflib.SequenceMatcher(None, *middle, autojunk=False).get_opcodes()
        blocks = [(head + a, head + b, head + c, head + d) for kind, a, b, c, d in found if kind != "equal"]
    out = [f"--- {names[0]}\n", f"+++ {names[1]}\n"] if blocks else []
    while blocks:
        hunk = [blocks.pop(0)]
        while blocks and blocks[0][0] <= hunk[-1][1] + 2 * CONTEXT:
            a, b, c, d = blocks.pop(0)
            if a == hunk[-1][1] and c == hunk[-1][3]:  # neighbours
                a, _, c, _ = hunk.pop()
            hunk.append((a, b, c, d))
        done = low = max(0, hunk[0][0] - CONTEXT)
        shift, grown = hunk[0][2] - hunk[0][0], hunk[-1][3] - hunk[-1][1]
        high = min(len(before), hunk[-1][1] + CONTEXT)
        out.append(f"@@ -{low + 1},{high - low} +{low + shift + 1},{high - low + grown - shift} @@\n")
        for a, b, c, d in hunk:
            out += [_marked(" ", line) for line in before[done:a]]
            out += [_marked("-", line) for line in before[a:b]]
            out += [_marked("+", line) for line in after[c:d]]
            done = b
        out += [_marked(" ", line) for line in before[done:high]]
    return "".join(out)


def _marked(mark: str, line: str) -> str:
    return f"{mark}{line}" if line[-1:] in ("\n", "\r") else f"{mark}{line}\n\\ No newline at end of file\n"
