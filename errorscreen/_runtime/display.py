"""Short texts of objects for the prompt, and tables of the same facts for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from typing import Any
from unicodedata import category

#: Characters of a repr at most.
LONGEST = 199


def shortened(text: str, limit: int = LONGEST) -> str:
    """Cut a text that is too long."""
    return text if len(text) <= limit else text[: limit - 3] + "..."


def visible(text: str) -> str:
    r"""Escape control and format characters, which may stand in a file's names and would steer a terminal.

    >>> print(visible("Unit 1\x1b[2J\u202e: a line\nand the second"))
    Unit 1\x1b[2J\u202e: a line
    and the second
    """
    return "".join(c if c in "\n\t" or category(c) not in ("Cc", "Cf") else ascii(c)[1:-1] for c in text)


def listed(names: Iterable[str], limit: int = 8) -> str:
    """Join the first names of many."""
    names = list(names)
    more = f" and {len(names) - limit} more" if len(names) > limit else ""
    return ", ".join(names[:limit]) + more


def span(time: Any) -> str:
    """Describe a time axis (L,) in seconds."""
    return f"{len(time)} samples from {time[0]:g} to {time[-1]:g} s"


def aligned(rows: Iterable[Iterable[Any]]) -> str:
    """Write rows with their cells below each other; numbers have four digits."""
    cells = [[f"{c:.4g}" if isinstance(c, float) else str(c) for c in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ("  ".join(f"{c:<{w}}" for c, w in zip(row, widths, strict=True)) for row in cells)
    return "\n".join(line.rstrip() for line in lines)


def html_table(title: str, facts: Mapping[str, Any]) -> str:
    """Write facts as an HTML table."""
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td>{escape(str(value))}</td></tr>" for name, value in facts.items()
    )
    return f"<table><caption>{escape(title)}</caption>{rows}</table>"


class Displayed:
    """Mixin for a short repr and a notebook table, both from `_facts`."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.__repr__ = cls.__repr__  # type: ignore[method-assign]  # else a dataclass makes one of all fields

    def _facts(self) -> dict[str, Any]:
        """Name and value of each fact worth a glance."""
        raise NotImplementedError

    def __repr__(self) -> str:
        facts = ", ".join(f"{name}: {value}" for name, value in self._facts().items())
        return shortened(f"{type(self).__name__}({facts}", LONGEST - 1) + ")"

    def _repr_html_(self) -> str:
        return html_table(type(self).__name__, self._facts())
