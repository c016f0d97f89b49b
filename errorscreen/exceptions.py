"""Errors and warnings: what is wrong, where, what is allowed, what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class ErrorscreenError(Exception):
    """Base class of every error that errorscreen raises on purpose."""


class InputError(ErrorscreenError, ValueError):
    """Something that the user gave cannot be used.

    Parameters
    ----------
    what : str
        What was found, in one sentence without the final full stop.
    where : str, optional
        File, column, key or argument that holds it.
    allowed : str, optional
        What would have been accepted.
    remedy : str, optional
        What to do about it.

    Examples
    --------
    >>> print(InputError("unit 'kVolt' is unknown", where="column 'V1'", allowed="V, kV, pu"))
    column 'V1': unit 'kVolt' is unknown. Allowed: V, kV, pu.
    """

    def __init__(
        self, what: str, *, where: str | None = None, allowed: str | None = None, remedy: str | None = None
    ) -> None:
        self.what, self.where, self.allowed, self.remedy = what, where, allowed, remedy
        text = f"{where}: {what}." if where else f"{what}."
        if allowed:
            text += f" Allowed: {allowed}."
        if remedy:
            text += f" {remedy.rstrip('.')}."
        super().__init__(text)


class SimulationError(ErrorscreenError, RuntimeError):
    """Too many simulations failed for the result to mean anything."""


class DataWarning(UserWarning):
    """The data were usable only after an assumption that the user should know of."""


def unknown_name(
    name: str, known: Iterable[str], *, kind: str, where: str | None = None, remedy: str | None = None
) -> InputError:
    """Build the error for a name that nothing carries, with the nearest matches.

    Examples
    --------
    >>> print(unknown_name("Xd2", ["Xd", "Xd1", "H"], kind="parameter"))
    unknown parameter 'Xd2' (did you mean 'Xd', 'Xd1'?). Allowed: Xd, Xd1, H.
    """
    known = list(known)
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    hint = f" (did you mean {', '.join(repr(n) for n in sorted(near))}?)" if near else ""
    return InputError(f"unknown {kind} {name!r}{hint}", where=where, allowed=", ".join(known), remedy=remedy)
