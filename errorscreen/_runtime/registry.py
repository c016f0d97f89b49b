"""Registries: the devices, effects, readers, screeners, calibrators and limits that a name can stand for."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from errorscreen.exceptions import InputError, unknown_name

#: groups of entry points, behind ``errorscreen.``
_ROOMS = ("devices", "parts", "effects", "readers", "screeners", "calibrators", "profiles")
T = TypeVar("T")
_log = logging.getLogger(__name__)


class Registry(Mapping[str, T], Generic[T]):
    """Objects by name in the order of registration, then those of other packages by alphabet.
    Another package adds one by an entry point of the group, which is imported when its name is looked up. With
    `classes`, subclasses of `base` are registered instead of its instances; `kind` is the noun of messages.
    """

    def __init__(
        self, kind: str, group: str, base: type, items: Mapping[str, T], *, classes: bool = False
    ) -> None:
        self.kind, self.group, self.base, self.classes = kind, group, base, classes
        self._items: dict[str, T] = {}
        self._others: dict[str, EntryPoint] | None = None
        for name, item in items.items():
            self.register(name, item)

    def register(self, name: str, item: T) -> None:
        """Add an object under a name of its own, in this process only; `InputError` if the name or class is wrong."""
        where = f"{self.kind} {name!r}"
        if name in self._items or name in (self._others or ()):
            raise InputError(
                "the name is taken", where=where, allowed=f"a name of its own for each {self.kind}"
            )
        self._items[name] = self._checked(item, where)

    def find(self, name: str, where: str | None = None) -> T:
        """Object of a name; `InputError` (with the place `where`) if it is unknown or its entry point does not load."""
        if name in self._items:
            return self._items[name]
        if name not in self:
            raise unknown_name(name, self, kind=self.kind, where=where)
        return self._load(self._entry_points()[name])

    def usable(self, name: str) -> T | None:
        """Return the object of a name; None, and a line in the log, if its entry point does not load."""
        try:
            return self.find(name)
        except InputError as error:
            _log.warning("%s", error)
            return None

    def __getitem__(self, name: str) -> T:
        return self.find(name)

    def get(self, name: str, default: Any = None) -> Any:
        """Return the object of a name, or the default where the name is unknown."""
        return self.find(name) if name in self else default

    def __contains__(self, name: object) -> bool:
        return name in self._items or name in self._entry_points()

    def __iter__(self) -> Iterator[str]:
        return iter((*self._items, *self._entry_points()))

    def __len__(self) -> int:
        return len(self._items) + len(self._entry_points())

    def _entry_points(self) -> dict[str, EntryPoint]:
        """Entry points of other packages by name, in alphabetical order."""
        if self._others is None:
            found: dict[str, EntryPoint] = {}
            for point in sorted(_installed().select(group=self.group)):
                if point.name in self._items or point.name in found:
                    raise InputError(
                        f"the name {point.name!r} is taken",
                        where=_place(point),
                        allowed=f"a name of its own for each {self.kind}",
                        remedy="Rename the entry point, or uninstall the package",
                    )
                found[point.name] = point
            self._others = found
        return self._others

    def _load(self, point: EntryPoint) -> T:
        try:
            item = point.load()
        except Exception as error:
            raise InputError(
                f"{point.value} does not load: {type(error).__name__}: {error}",
                where=_place(point),
                remedy="Update or uninstall the package",
            ) from error
        return self._checked(item, _place(point))

    def _checked(self, item: T, where: str) -> T:
        own: type = item if self.classes and isinstance(item, type) else type(item)
        if isinstance(item, type) != self.classes or not issubclass(own, self.base):
            allowed = f"{'a subclass' if self.classes else 'an object'} of {self.base.__qualname__}"
            raise InputError(f"{item!r:.80} cannot be registered", where=where, allowed=allowed)
        return item


def other_packages() -> list[str]:
    """Names and versions of the packages that add to a registry, because results depend on them."""
    groups = [_installed().select(group=f"errorscreen.{room}") for room in _ROOMS]
    return sorted({f"{p.dist.name} {p.dist.version}" for points in groups for p in points if p.dist})


@cache
def _installed() -> Any:
    """Entry points of all installed packages; reading them takes tens of milliseconds."""
    return entry_points()


def _place(point: EntryPoint) -> str:
    package = point.dist.name if point.dist else "unknown"
    return f"package {package}, entry point {point.name!r} of {point.group}"
