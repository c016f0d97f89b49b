"""Records of a DYR file: which model they name, which value is which, and what is wrong with them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from typing import NamedTuple

from errorscreen._runtime.display import listed
from errorscreen.exceptions import InputError, unknown_name
from errorscreen.models.dyr_text import Span, Token, number, tokens, written
from errorscreen.models.part import Field, Part
from errorscreen.models.standard import PARTS
from errorscreen.models.unit import Record

Bus = int | str
#: fields in front of the values: bus, name, identifier; those of the library form are behind them
HEADER, LIBRARY = 3, ("NAME", "IC", "IT", "NI", "NC", "NS", "NV")
#: slots by the code IC of the library form
_SLOTS = {
    "1": "machine", "2": "compensator", "3": "stabiliser", "4": "exciter", "5": "governor", "9": "under_excitation",
    "10": "over_excitation", "101": "converter", "102": "electrical_control", "103": "drive_train",
    "104": "pitch_control", "105": "aerodynamics", "107": "plant_control", "108": "torque_control",
}  # fmt: skip


class DyrValue(NamedTuple):
    """A value of a record.

    Parameters
    ----------
    field : Field or None
        Constant of the standard model; None if the model is unknown or the record has too many values.
    value : float
        NaN if the text is no number, 0 for an identifier.
    token : Token
        Its text, line and column.
    """

    field: Field | None
    value: float
    token: Token


@dataclass(frozen=True, eq=False)
class DyrRecord:
    """A record of a DYR file. Its values are read when they are asked for, so that one record can be wrong alone.

    Parameters
    ----------
    bus : int or str
        Number, or extended name.
    id : str
    model : str
        Name in the file in capital letters; that of the model in the library form.
    part : Part or None
        Standard model of the name; None if it is unknown.
    line : int
        Where the record begins.
    file : str
    """

    bus: Bus
    id: str
    model: str
    part: Part | None
    line: int
    file: str
    _text: str = field(repr=False)
    _span: Span = field(repr=False)
    _library: bool = False

    @property
    def where(self) -> str:
        """File, line and unit, for messages."""
        return f"{self.file}:{self.line}, {self.model} of unit {self.bus} {self.id!r}"

    @property
    def voltage_source(self) -> bool:
        """Whether this is GENCLS with H = 0, which stands for the network behind a bus and is no unit."""
        if self.part is None or self.part.name != "GENCLS":
            return False
        return numbers_of(self.values).get("H") == 0

    @property
    def values(self) -> tuple[DyrValue, ...]:
        """All values with their places; read anew each time, because a large file holds millions."""
        fields = self.part.fields if self.part else ()
        found = islice(tokens(self._text, self._span.lines), HEADER + len(LIBRARY) * self._library, None)
        return tuple(_value(fields[k] if k < len(fields) else None, token) for k, token in enumerate(found))

    def checked(self) -> Record:
        """Record for a unit; `InputError` if it cannot be used."""
        values = self.values
        for error in self.problems(values):
            raise error
        assert self.part is not None, "an unknown model is a problem"
        return Record(self.part, numbers_of(values), self.where)

    def problems(self, values: Sequence[DyrValue]) -> Iterator[InputError]:
        """Everything that is wrong with the record itself."""
        illegible = self.illegible(values)
        yield from illegible
        if self.part and not illegible:
            yield from self.part.wrong(numbers_of(values), partial(self._place, values))

    def illegible(self, values: Sequence[DyrValue], replaced: Iterable[str] = ()) -> list[InputError]:
        """What makes it unclear what the record says; new values for constants are not looked at."""
        return [*self._form(values)] or [*self._unreadable(values, replaced)]

    def changed(self, new: Mapping[str, float]) -> dict[Token, str]:
        """New texts of constants by the names of `Part.fields`; `InputError` if the record then cannot be used."""
        values, texts = self.values, {}
        for error in self.illegible(values, new):
            raise error
        for one in values:
            if one.field and one.field.name in new:
                value = new[one.field.name]
                if one.field.unit == "id" or (one.field.integer and value != round(value)):
                    allowed = "a whole number" if one.field.unit != "id" else "no change, it is an identifier"
                    problem = f"{one.field.symbol} shall become {value:g}"
                    raise InputError(problem, where=self._at(one.token), allowed=allowed)
                texts[one.token] = written(value, whole=one.field.integer)
        if self.part:
            for error in self.part.wrong({**numbers_of(values), **new}, partial(self._place, values)):
                raise error
        return texts

    @property
    def end_of_line(self) -> int:
        """Position in the text at which the last line of the record ends."""
        found = self._text.find("\n", max(self._span.lines[-1][2], self._span.behind[1]))
        end = len(self._text) if found < 0 else found
        return end - self._text[:end].endswith("\r")

    def sibling(self, part: Part, values: Mapping[str, float]) -> str:
        """Text of another record of the same unit; `InputError` if it could not be used."""
        for error in part.wrong(values, lambda name: f"{part.name} of unit {self.bus} {self.id!r}"):
            raise error
        bus, _, id = (
            f"'{token.text}'" if token.quoted else token.text
            for token in islice(tokens(self._text, self._span.lines), HEADER)
        )
        numbers = (written(values[one.name], whole=one.integer) for one in part.fields)
        return f"{bus} '{part.name}' {id}  {' '.join(numbers)} /"

    def _place(self, values: Sequence[DyrValue], name: str) -> str:
        """Place of a constant, or of the record (``""``)."""
        for one in values:
            if one.field and one.field.name == name:
                return self._at(one.token)
        return self.where

    def _at(self, token: Token) -> str:
        return f"{self.file}:{token.line}, column {token.column}, {self.model} of unit {self.bus} {self.id!r}"

    def _form(self, values: Sequence[DyrValue]) -> Iterator[InputError]:
        """What makes it unclear which value is which."""
        if not self._span.ended:
            yield InputError(
                "no '/' ends the record",
                where=self.where,
                remedy="Put ' /' behind its last value, and check that no line is missing",
            )
        for k, one in enumerate(values, start=1):
            if one.token.lone_quote:
                yield InputError(
                    f"the quote {one.token.text} has no partner",
                    where=self._at(one.token),
                    allowed="text between two quotes on one line",
                )
            elif not one.token.text and not one.token.quoted:
                named = f", {one.field.symbol}," if one.field else ""
                yield InputError(
                    f"value {k}{named} is empty",
                    where=self._at(one.token),
                    allowed=f"a number ({one.field.description})" if one.field else "a number",
                    remedy="Give the number: what PSS/E takes for an empty field is not public",
                )
        if self.part is None:
            yield unknown_name(
                self.model,
                self._likely_models(),
                kind="model",
                where=self.where,
                remedy=f"Where the model plays no role, leave it out: unit(..., leave_out=[{self.model!r}])",
            )
        elif len(values) != len(self.part.fields):
            yield self._miscounted(self.part, values)
        elif self._library:
            yield from self._misannounced(self.part)

    def _likely_models(self) -> list[str]:
        """Names of all known models, in the library form of those of its kind."""
        parts = known_parts()
        codes = [token.text for token in self._head[1:2]] if self._library else []
        slot = _SLOTS.get("".join(codes), "")
        return [name for name, part in parts.items() if part.slot == slot] or [*parts]

    @property
    def _head(self) -> list[Token]:
        """Header of the library form."""
        return [*islice(tokens(self._text, self._span.lines), HEADER, HEADER + len(LIBRARY))]

    def _miscounted(self, part: Part, values: Sequence[DyrValue]) -> InputError:
        names, found = [one.symbol for one in part.fields], len(values)
        texts = [one.token.text for one in values[len(names) :]]
        remedy = f"Values behind {names[-1]}: {listed(texts)}" if texts else ""
        if any("*" in one.token.text for one in values):
            remedy = "Write each value of a repetition out: 0.0 0.0 for 2*0.0"
        elif not texts:
            remedy = f"If the first ones are in order, these are missing: {', '.join(names[found:])}"
        return InputError(
            f"the record has {found} values",
            where=self.where,
            allowed=f"the {len(names)} values of {part.name}: {', '.join(names)}",
            remedy=remedy,
        )

    def _misannounced(self, part: Part) -> Iterator[InputError]:
        head = self._head
        counts = [number(token.text) for token in head[1:]]
        if counts[2] + counts[3] != len(part.fields):
            found = ", ".join(
                f"{name} {token.text!r}" for name, token in zip(LIBRARY[3:5], head[3:5], strict=True)
            )
            yield InputError(
                f"the header of the library form says {found}",
                where=self._at(head[3]),
                allowed=f"NI + NC = {len(part.fields)}, the number of values of {part.name}",
            )

    def _unreadable(self, values: Sequence[DyrValue], replaced: Iterable[str]) -> Iterator[InputError]:
        """Values that are no number, except those that are replaced."""
        for one in values:
            if one.field is None or one.field.name in replaced:
                continue
            whole = one.field.integer
            if math.isnan(one.value) or (whole and one.value != round(one.value)):
                yield InputError(
                    f"{one.field.symbol} is {one.token.text!r}{' in quotes' if one.token.quoted else ''}",
                    where=self._at(one.token),
                    allowed=f"a {'whole' if whole else 'finite'} number ({one.field.description})",
                    remedy="Write each value of a repetition out" if "*" in one.token.text else None,
                )


def numbers_of(values: Iterable[DyrValue]) -> dict[str, float]:
    """Values by the names of `Part.fields`."""
    return {one.field.name: one.value for one in values if one.field}


def _value(constant: Field | None, token: Token) -> DyrValue:
    if constant and constant.unit == "id":
        return DyrValue(constant, 0.0, token)
    return DyrValue(constant, math.nan if token.quoted else number(token.text), token)


class Stray(NamedTuple):
    """A record of which bus, model or identifier cannot be read, with what is known of its bus."""

    line: int
    bus: Bus | None
    error: InputError


def known_parts() -> dict[str, Part]:
    """Standard models by each of their names in capital letters."""
    parts = [part for name in PARTS if (part := PARTS.usable(name)) is not None]
    return {name.upper(): part for part in parts for name in (*part.aliases, part.name)}


def record_of(file: str, text: str, span: Span, parts: Mapping[str, Part]) -> DyrRecord | Stray:
    """Record of a stretch of text, by its first fields."""
    line = span.lines[0][0]
    where = f"{file}:{line}"
    fields = tokens(text, span.lines)
    head = list(islice(fields, HEADER))
    bus: Bus | None = None
    try:
        bus = _bus_of(head, where)
        model = _name_of(head[1] if len(head) > 1 else None, "model", bus, where).upper()
        id = _name_of(head[2] if len(head) > 2 else None, "identifier", bus, where).upper()
        library = model == "USRMDL"
        if library:
            form = list(islice(fields, len(LIBRARY)))
            if len(form) < len(LIBRARY):
                raise InputError(
                    "the header of the library form is incomplete",
                    where=where,
                    allowed=f"bus 'USRMDL' id {' '.join(LIBRARY)} values /",
                )
            model = _name_of(form[0], "library model", bus, where).upper()
        part = parts.get(model)
        if part is not None and len(id) > 2:
            raise InputError(
                f"the identifier of {model} at bus {bus} is {id!r}",
                where=where,
                allowed="one or two characters",
                remedy="Put the identifier of the unit behind the name of the model",
            )
    except InputError as error:
        return Stray(line, bus, error)
    return DyrRecord(bus, id, model, part, line, file, text, span, library)


def bus_named(value: object) -> Bus:
    """Bus from its number or its extended name."""
    text = " ".join(str(value).split()).upper()
    return int(text) if re.fullmatch(r"[0-9]{1,9}", text) else text


def _bus_of(head: list[Token], where: str) -> Bus:
    """Bus of a record; an extended name stands in quotes in front of the name of the model."""
    first = head[0]
    named = first.quoted and len(head) > 1 and (head[1].quoted or math.isnan(number(head[1].text)))
    bus = bus_named(first.text)
    if isinstance(bus, int) or (named and bus):
        return bus
    value = number(first.text)
    if first.quoted or math.isnan(value):
        text = first.text if len(first.text) <= 20 else f"{first.text[:20]}..."
        raise InputError(
            f"the record begins with {text!r}",
            where=where,
            allowed="the number of a bus: 101 'GENROU' 1 values /",
            remedy="Comments begin with // and records end with /",
        )
    raise InputError(
        f"the bus is {first.text}", where=where, allowed="a whole number without sign, at most nine digits"
    )


def _name_of(token: Token | None, kind: str, bus: Bus, where: str) -> str:
    text = token.text.strip() if token else ""
    if token and token.lone_quote:
        raise InputError(
            f"the quote {text} has no partner",
            where=f"{where}, column {token.column}, bus {bus}",
            allowed="text between two quotes on one line",
        )
    if not text or (kind != "identifier" and not math.isnan(number(text))):
        raise InputError(
            f"the {kind} is {text}" if text else f"the record has no {kind}",
            where=f"{where}, bus {bus}",
            allowed="bus 'MODEL' id values /, such as 101 'GENROU' 1 values /",
        )
    return text
