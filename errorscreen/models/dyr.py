"""Model files of PSS/E (DYR): units from their records, all problems at once, and numbers changed in place."""

from __future__ import annotations

import difflib
import os
import warnings
from collections.abc import Iterable, Mapping
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from errorscreen._runtime.display import Displayed, listed
from errorscreen._runtime.persistence import write_bytes_atomic
from errorscreen.exceptions import DataWarning, InputError, check_real, unknown_name
from errorscreen.models.device import Device
from errorscreen.models.dyr_record import Bus, DyrRecord, Stray, bus_named, known_parts, record_of
from errorscreen.models.dyr_text import (
    Token,
    difference,
    holds_record,
    other_format,
    read_text,
    replaced,
    spans,
    torn_comments,
)
from errorscreen.models.dyr_units import doubtful, is_source, misplaced, told_of, understood
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import in_slots, unit

if TYPE_CHECKING:
    import pandas as pd


class DyrFile(Displayed):
    """A model file.

    Parameters
    ----------
    path : path-like
    text, encoding : str

    Attributes
    ----------
    records : tuple of DyrRecord
        In the order of the file, also those of unknown models.

    Examples
    --------
    >>> text = '''101 'GENROU' 1  6.0 0.04 0.8 0.06 4.0 0.0 1.8 1.7 0.3 0.5 0.22 0.15 0.1 0.4 /
    ... 101 'TGOV1' 1  0.05 0.3 1.0 0.0 2.0 7.0 0.0 /'''
    >>> file = DyrFile("plant.dyr", text)
    >>> file.units, file.unit().name
    ([(101, '1')], 'GENROU+TGOV1')
    >>> print(file.changed(101, 1, {"TGOV1.R": 0.04}).splitlines()[1])
    101 'TGOV1' 1  0.04 0.3 1.0 0.0 2.0 7.0 0.0 /
    """

    def __init__(self, path: str | os.PathLike[str], text: str, encoding: str = "utf-8") -> None:
        self.path, self.text, self.encoding = Path(path), text, encoding
        parts, name = known_parts(), str(path)
        records: list[DyrRecord] = []
        self._strays = [*map(self._torn, torn_comments(text))]
        for span in spans(text):
            one = record_of(name, text, span, parts)
            if isinstance(one, DyrRecord):
                records.append(one)
            else:
                self._strays.append(one)
            if holds_record(text, *span.behind):
                line = span.lines[-1][0]
                error = InputError(
                    "another record follows on the line; text behind '/' is a comment",
                    where=f"{name}:{line}",
                    remedy="Put each record on a line of its own",
                )
                self._strays.append(Stray(line, one.bus, error))
        self.records = tuple(records)
        if not any(one.part for one in records):
            self._refuse_other_files()

    @property
    def units(self) -> list[tuple[Bus, str]]:
        """Bus and identifier of each unit, in the order of the file; voltage sources (GENCLS with H = 0) are none."""
        return [key for key, records in self._by_unit.items() if not is_source(records)]

    def unit(
        self,
        bus: Bus | None = None,
        id: str | int | None = None,
        *,
        leave_out: Iterable[str] = (),
        inputs: Iterable[str] = (),
    ) -> Device:
        """Device of a unit.

        Parameters
        ----------
        bus : int or str, optional
            Not needed if the file holds one unit.
        id : str or int, optional
            Not needed if the bus has one unit.
        leave_out : iterable of str
            Models of records that shall not count, for example of a protection that plays no role.
        inputs : iterable of str
            ``"Efd"``, ``"Pm"``: recorded channels that drive a machine instead of its exciter, stabiliser and
            compensator, or its governor.

        Raises
        ------
        InputError
            If there is no such unit, or one of its records cannot be used. Other units do not matter.
        """
        key = self.key(bus, id)
        self._refuse_strays(key[0], only=bus is None)
        records = self._by_unit[key]
        left_out = {name.strip().upper() for name in leave_out}
        for name in sorted(left_out - {one.model for one in records}):
            raise unknown_name(
                name, [one.model for one in records], kind="model", where=f"unit {key[0]} {key[1]!r}"
            )
        kept = [one for one in records if one.model not in left_out]
        return unit([one.checked() for one in kept], inputs=inputs, identifier=key[1], bus=key[0])

    def check(self) -> list[str]:
        """All problems of the file, each with its line."""
        found = [(stray.line, stray.error) for stray in self._strays]
        legible: dict[str, list[tuple[DyrRecord, list[float]]]] = {}
        for records in self._by_unit.values():
            if is_source(records):
                continue
            for one in records:
                values = one.values
                errors = one.illegible(values)
                found += [(one.line, error) for error in errors]
                if one.part and not errors:
                    legible.setdefault(one.part.name, []).append((one, [value.value for value in values]))
            found += [(records[0].line, error) for error in misplaced(records)]
        for group in legible.values():
            for one in doubtful(group):
                found += [(one.line, error) for error in one.problems(one.values)]
        return [str(error) for _, error in sorted(found, key=lambda one: one[0])]

    def table(self) -> pd.DataFrame:
        """All values, one row each; NaN where a value is no number."""
        import pandas as pd

        rows = [
            (
                one.bus,
                one.id,
                one.model,
                one.part.slot if one.part else "",
                value.field.symbol if value.field else "",
                value.value,
                value.field.unit if value.field else "",
                value.field.description if value.field else "",
                value.token.line,
            )
            for one in self.records
            for value in one.values
        ]
        columns = ["bus", "id", "model", "slot", "name", "value", "unit", "meaning", "line"]
        return pd.DataFrame(rows, columns=columns)

    def summary(self) -> str:
        """Units with their models, and what these take otherwise than the file says, in words."""
        lines = [f"{self.path}: {len(self.records)} records, {len(self._by_unit)} units"]
        for (bus, id), records in islice(self._by_unit.items(), 20):
            names = [one.model if one.part else f"{one.model} (unknown)" for one in records]
            lines.append(f"  {bus} {id!r}: {', '.join(names)}")
            lines += [f"    {text}" for text in told_of(records, bus)]
        if len(self._by_unit) > 20:
            lines.append(f"  and {len(self._by_unit) - 20} more")
        if self._strays:
            lines.append(f"{len(self._strays)} records cannot be assigned to a unit; check() tells why")
        return "\n".join(lines)

    def changed(self, bus: Bus | None, id: str | int | None, values: Mapping[str, float]) -> str:
        """Text of the file with other values of one unit; all else stays as it is, comments and blanks too.

        Parameters
        ----------
        bus, id : int, str or None
            As for `unit`.
        values : mapping of str to float
            By model and constant, ``"GENROU.Tpdo"`` or in the spelling of PSS/E, ``"GENROU.T'do"``.

        Raises
        ------
        InputError
            If a name is unknown, or a record could not be used with the new values.
        """
        key = self.key(bus, id)
        records, models = understood(self._by_unit[key]), {name.partition(".")[0] for name in values}
        # of two models in a slot one may be left out; the same model twice leaves open which one is meant
        in_slots(known for known in records if known.part.name in models)
        places = {
            f"{known.part.name}.{name}": (known.record, constant.name)
            for known in records
            for constant in known.part.fields
            for name in (constant.symbol, constant.name)
        }
        wanted: dict[DyrRecord, dict[str, float]] = {}
        for name, value in values.items():
            if name not in places:
                near = difflib.get_close_matches(name, places, n=12, cutoff=0.3)
                raise unknown_name(
                    name, near or list(places)[:12], kind="constant", where=f"unit {key[0]} {key[1]!r}"
                )
            record, constant_name = places[name]
            new = wanted.setdefault(record, {})
            if constant_name in new:
                raise InputError("the constant has two new values", where=name, allowed="one spelling of it")
            new[constant_name] = check_real(value, "the new value", where=name)
        edits: dict[Token, str] = {}
        for record, new in wanted.items():
            edits |= record.changed(new)
        return replaced(self.text, edits)

    def extended(
        self, bus: Bus | None, id: str | int | None, records: Iterable[tuple[str, Mapping[str, float]]]
    ) -> DyrFile:
        """File with further records of a unit behind its last one, each a model and its constants by name."""
        last = self._by_unit[self.key(bus, id)][-1]
        at, newline = last.end_of_line, "\r\n" if "\r\n" in self.text else "\n"
        new = "".join(newline + last.sibling(PARTS[model], values) for model, values in records)
        return DyrFile(self.path, self.text[:at] + new + self.text[at:], self.encoding)

    def write(
        self,
        path: str | os.PathLike[str],
        bus: Bus | None = None,
        id: str | int | None = None,
        values: Mapping[str, float] | None = None,
        *,
        overwrite: bool = False,
    ) -> Path:
        """Write the text of `changed` completely or not at all; over the file itself only with `overwrite`."""
        text = self.changed(bus, id, values) if values else self.text
        path = Path(path)
        if not overwrite and path.exists() and self.path.exists() and path.samefile(self.path):
            raise InputError(
                "is the file that was read",
                where=f"file {path}",
                remedy="Give another path, or overwrite=True",
            )
        return write_bytes_atomic(path, text.encode(self.encoding))

    def diff(self, bus: Bus | None, id: str | int | None, values: Mapping[str, float]) -> str:
        """Difference that `changed` makes, in the unified format."""
        return difference(
            self.text, self.changed(bus, id, values), (str(self.path), f"{self.path} (changed)")
        )

    @cached_property
    def _by_unit(self) -> dict[tuple[Bus, str], list[DyrRecord]]:
        found: dict[tuple[Bus, str], list[DyrRecord]] = {}
        for one in self.records:
            found.setdefault((one.bus, one.id), []).append(one)
        return found

    def key(self, bus: Bus | None = None, id: str | int | None = None) -> tuple[Bus, str]:
        """Bus and identifier of the one unit that is meant, as for `unit`."""
        where = f"file {self.path}"
        bus = None if bus is None else bus_named(bus)
        name = None if id is None else str(id).strip().upper()
        here = self.units if bus is None else [key for key in self._by_unit if key[0] == bus]
        if not here:
            raise InputError(
                "the file holds no unit" if bus is None else f"bus {bus!r} has no record",
                where=where,
                allowed=listed(dict.fromkeys(f"bus {one}" for one, _ in self._by_unit)),
            )
        found = [key for key in here if name in (None, key[1])]
        if len(found) == 1:
            return found[0]
        units = listed(f"bus {one} id {two!r}" for one, two in found or here)
        raise InputError(
            f"{len(found)} units are meant" if found else f"no unit has the id {name!r}",
            where=where,
            allowed=units,
            remedy="Give bus and id",
        )

    def _refuse_strays(self, bus: Bus, *, only: bool) -> None:
        for stray in self._strays:
            if only or stray.bus == bus:
                raise stray.error
        unclear = [stray for stray in self._strays if stray.bus is None]
        if unclear:
            warnings.warn(
                f"{len(unclear)} records may belong to any unit, and are left out. The first: {unclear[0].error}",
                DataWarning,
                stacklevel=3,
            )

    def _torn(self, line: int) -> Stray:
        error = InputError(
            "a comment /* goes on over several lines, of which only the first one counts as a comment",
            where=f"{self.path}:{line}",
            remedy="Begin each line of a comment with //",
        )
        return Stray(line, None, error)

    def _refuse_other_files(self) -> None:
        """Refuse a file without a known model if it is of another format, or has no record at all."""
        where, kind = f"file {self.path}", other_format(self.text)
        if kind == "DYD":
            raise InputError(
                "is a DYD file of PSLF",
                where=where,
                allowed="a DYR file of PSS/E",
                remedy="DYD is not read yet: export the dynamic data as DYR",
            )
        if kind == "RAW":
            raise InputError(
                "is a RAW file, which holds the network",
                where=where,
                allowed="a DYR file, which holds the dynamic models",
                remedy="Give the DYR file of the same case",
            )
        if not self.records:
            for stray in self._strays:
                raise stray.error
            raise InputError(
                "is empty" if not self.text.strip() else "holds comments but no record",
                where=where,
                allowed="records such as 101 'GENROU' 1 values /",
            )

    def _facts(self) -> dict[str, Any]:
        unknown = sum(one.part is None for one in self.records)
        return {
            "file": str(self.path),
            "records": len(self.records),
            "units": len(self._by_unit),
            **({"records of unknown models": unknown} if unknown else {}),
        }


def read_dyr(path: str | os.PathLike[str]) -> DyrFile:
    """Read a model file of PSS/E.

    Parameters
    ----------
    path : path-like
        A DYR file in UTF-8 or Latin-1.

    Returns
    -------
    DyrFile
        ``read_dyr(path).unit()`` is the device of its unit. A record that cannot be used matters only to its own unit.

    Raises
    ------
    InputError
        If the path is no readable DYR file.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(
            f"the path is of type {type(path).__name__}", where="read_dyr", allowed="the path of a file"
        )
    return DyrFile(path, *read_text(Path(path)))
