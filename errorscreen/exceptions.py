"""Errors and warnings; their messages say what was found, where, what is allowed and what to do."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Sequence
from numbers import Integral, Real
from typing import Any


class ErrorscreenError(Exception):
    """Base class of the package's errors; they pass from one process to another."""

    def __reduce__(self) -> tuple[Any, ...]:
        # Python would call the constructor with the text, and the constructors here take other arguments
        return _restored, (type(self), self.args, self.__dict__)


def _restored(kind: type[ErrorscreenError], args: tuple[Any, ...], state: dict[str, Any]) -> ErrorscreenError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class InputError(ErrorscreenError, ValueError):
    """An input of the user cannot be used.

    Parameters
    ----------
    what : str
        The problem, in one sentence without the final full stop.
    where : str, optional
        File, column, key or argument that holds it.
    allowed : str, optional
        Accepted values.
    remedy : str, optional
        Advice.

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
            text += f" {remedy}" if remedy.endswith("?") else f" {remedy.rstrip('.')}."
        super().__init__(text)


class SuspectReadingsError(ErrorscreenError):
    """Readings are suspect, and a wrong reading can look like any cause.

    Parameters
    ----------
    readings : sequence of str
        One sentence for each, with what would change it.

    Examples
    --------
    >>> print(SuspectReadingsError(["dip: V before the event is 20 pu: check its unit and base_kv."]))
    a reading is suspect, and the search for causes did not begin:
      - dip: V before the event is 20 pu: check its unit and base_kv.
    """

    def __init__(self, readings: Sequence[str]) -> None:
        self.readings = tuple(readings)
        many = "a reading is" if len(readings) == 1 else f"{len(readings)} readings are"
        lines = "".join(f"\n  - {text}" for text in readings)
        super().__init__(f"{many} suspect, and the search for causes did not begin:{lines}")


class SimulationError(ErrorscreenError, RuntimeError):
    """Too many simulations failed for a meaningful result."""


class MissingExtraError(ErrorscreenError, ImportError):
    """A package is missing that one of the extras of errorscreen installs.

    Examples
    --------
    >>> print(MissingExtraError("torch", extra="cnn"))
    torch is not installed. Install it with: pip install "errorscreen[cnn]"
    """

    def __init__(self, package: str, *, extra: str) -> None:
        super().__init__(f'{package} is not installed. Install it with: pip install "errorscreen[{extra}]"')


class DataWarning(UserWarning):
    """The data needed an assumption that the user should know of."""


class EngineWarning(UserWarning):
    """A user's functions cannot be compiled; as Python they take some hundred times as long."""


def unknown_name(
    name: str, known: Iterable[str], *, kind: str, where: str | None = None, remedy: str | None = None
) -> InputError:
    """Build the error for an unknown name, with the nearest matches.

    >>> print(unknown_name("Xd2", ["Xd", "Xd1", "H"], kind="parameter"))
    unknown parameter 'Xd2' (did you mean 'Xd', 'Xd1'?). Allowed: Xd, Xd1, H.
    """
    known = list(known)
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    hint = f" (did you mean {', '.join(repr(n) for n in near)}?)" if near else ""
    return InputError(f"unknown {kind} {name!r}{hint}", where=where, allowed=", ".join(known), remedy=remedy)


def check_integer(value: Any, name: str, *, low: int = 1, high: int | None = None) -> int:
    """Return `value` as int if it is an integer between `low` and `high`, and raise `InputError` otherwise.

    >>> check_integer(12, "k", high=10)
    Traceback (most recent call last):
    errorscreen.exceptions.InputError: k is 12. Allowed: an integer from 1 to 10.
    """
    good = isinstance(value, Integral) and not isinstance(value, bool)
    if not good or value < low or (high is not None and value > high):
        upper = "" if high is None else f" to {high}"
        raise InputError(f"{name} is {value!r}", allowed=f"an integer from {low}{upper or ' on'}")
    return int(value)


def check_real(
    value: Any,
    name: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    above: bool = False,
    where: str | None = None,
) -> float:
    """Return `value` as float if it is a finite number in [low, high], and raise `InputError` otherwise.

    With `above`, `low` itself is excluded. `name` and `where` are for the message.

    >>> check_real(0, "step", low=0, above=True)
    Traceback (most recent call last):
    errorscreen.exceptions.InputError: step is 0. Allowed: a number > 0.
    """
    good = isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    if not good or value > high or value < low or (above and value == low):
        limits = [f"{'>' if above else '>='} {low:g}"] if low > -math.inf else []
        limits += [f"<= {high:g}"] if high < math.inf else []
        allowed = " ".join(["a number", " and ".join(limits)]).strip()
        raise InputError(f"{name} is {value!r}", where=where, allowed=allowed)
    return float(value)
