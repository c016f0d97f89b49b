"""Errors of a case file in the words of this package: file, key, found, allowed."""

from __future__ import annotations

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from errorscreen.cases.keys import nested, sections
from errorscreen.exceptions import InputError, unknown_name

#: what pydantic's kinds of error allow
_ALLOWED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "string_type": "text in quotes",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "finite_number": "a finite number",
    "greater_than": "a number > {gt:g}",
    "greater_than_equal": "a number >= {ge:g}",
    "less_than": "a number < {lt:g}",
    "less_than_equal": "a number <= {le:g}",
    "too_short": "at least {min_length} entry",
}
Location = tuple[int | str, ...]


def placed(error: InputError, source: str, key: str = "") -> InputError:
    """The same error with the file, and the key that is at fault, in front."""
    where = ", ".join(part for part in (source, key or error.where) if part)
    return InputError(error.what, where=where, allowed=error.allowed, remedy=error.remedy)


def explained(
    error: ValidationError, model: type[BaseModel], further: tuple[str, ...], source: str
) -> list[InputError]:
    """Pydantic's errors in plain words.
    Unknown keys come first, because a misspelt key is also missing. Inherited keys count once.
    """
    own = [e["loc"][1:] for e in error.errors() if e["loc"][0] == "recording"]
    errors = [e for e in error.errors() if e["loc"][0] not in further or e["loc"][2:] not in own]
    errors.sort(key=lambda e: e["type"] != "extra_forbidden")
    return [_explained(one, model, source) for one in errors]


def _explained(error: ErrorDetails, model: type[BaseModel], source: str) -> InputError:
    location, kind, found, context = error["loc"], error["type"], error["input"], error.get("ctx", {})
    key, above = _dotted(location), f"[{_dotted(location[:-1])}]" if location[:-1] else ""
    noun = "section or key" if len(location) == 1 else "key"
    cause = context.get("error")
    if kind == "missing":
        found_error, key = InputError(f"{noun} {location[-1]!r} is missing"), above
    elif kind == "extra_forbidden":
        found_error, key = _unknown_key(location, model, noun), above
    elif isinstance(cause, InputError):
        found_error = InputError(cause.what, allowed=cause.allowed, remedy=cause.remedy)
    elif kind == "literal_error":
        allowed = context["expected"].replace(" or ", ", ").replace("'", "").split(", ")
        found_error = unknown_name(str(found), allowed, kind="value")
    else:
        allowed = _ALLOWED.get(kind, error["msg"]).format(**context)
        found_error = InputError(f"{found!r} was found", allowed=allowed)
    return placed(found_error, source, key)


def with_others(errors: list[InputError]) -> InputError:
    """The first of several errors; without a remedy of its own it tells the number of the others."""
    first = errors[0]
    if len(errors) == 1 or first.remedy:
        return first
    remedy = f"{len(errors) - 1} further keys are wrong"
    return InputError(first.what, where=first.where, allowed=first.allowed, remedy=remedy)


def _unknown_key(location: Location, model: type[BaseModel], noun: str) -> InputError:
    """Error for a key that its section does not know; another section may know it."""
    key, section, remedy = str(location[-1]), model, None
    for part in location[:-1]:  # names in a table of sections, and numbers in a list, are no keys
        if isinstance(part, str) and part in section.model_fields:
            section = nested(section.model_fields[part].annotation) or section
    homes = [
        f"[{name}]" for name, other in sections(model) if key in other.model_fields and other is not section
    ]
    if homes:
        remedy = f"{key!r} belongs to {' or '.join(homes)}"
    return unknown_name(key, section.model_fields, kind=noun, remedy=remedy)


def _dotted(location: Location) -> str:
    """Dotted key; further recordings count from 1."""
    parts = [f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in location]
    return "".join(parts).removeprefix(".")
