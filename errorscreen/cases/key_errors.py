"""Errors of a case file in the words of this package: file, key, found, allowed."""

from __future__ import annotations

from pydantic import BaseModel, ValidationError

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
) -> InputError:
    """One of pydantic's errors in plain words, and the number of the others.
    An unknown key comes first, because a misspelt key is also missing. Inherited keys count once.
    """
    own = [e["loc"][1:] for e in error.errors() if e["loc"][0] == "recording"]
    errors = [e for e in error.errors() if e["loc"][0] not in further or e["loc"][2:] not in own]
    first = min(errors, key=lambda e: e["type"] != "extra_forbidden")
    location, kind, found, context = first["loc"], first["type"], first["input"], first.get("ctx", {})
    remedy = f"{len(errors) - 1} further keys are wrong" if len(errors) > 1 else None
    key, above = _dotted(location), f"[{_dotted(location[:-1])}]" if location[:-1] else ""
    noun = "section or key" if len(location) == 1 else "key"
    cause = context.get("error")
    if kind == "missing":
        found_error, key = InputError(f"{noun} {location[-1]!r} is missing", remedy=remedy), above
    elif kind == "extra_forbidden":
        found_error, key = _unknown_key(location, model, noun, remedy), above
    elif isinstance(cause, InputError):
        found_error = InputError(cause.what, allowed=cause.allowed, remedy=cause.remedy or remedy)
    elif kind == "literal_error":
        allowed = context["expected"].replace(" or ", ", ").replace("'", "").split(", ")
        found_error = unknown_name(str(found), allowed, kind="value", remedy=remedy)
    else:
        allowed = _ALLOWED.get(kind, first["msg"]).format(**context)
        found_error = InputError(f"{found!r} was found", allowed=allowed, remedy=remedy)
    return placed(found_error, source, key)


def _unknown_key(location: Location, model: type[BaseModel], noun: str, remedy: str | None) -> InputError:
    """Error for a key that its section does not know; another section may know it."""
    key, section = str(location[-1]), model
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
