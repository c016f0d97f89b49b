"""The key tables of a case file, from its sections."""

from __future__ import annotations

from collections.abc import Iterator
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel

from errorscreen.exceptions import unknown_name


def key_tables(model: type[BaseModel], section: str | None = None) -> str:
    """Tables of all sections below a model, or of one and those below it, see `case_reference`."""
    found = list(sections(model))
    if section is not None:
        names = [name for name, _ in found]
        found = [(name, part) for name, part in found if f"{name}.".startswith(f"{section}.")]
        if not found:
            raise unknown_name(section, names, kind="section of a case file")
    lines = []
    for name, part in found:
        lines += [f"### `[{name}]`", "", (part.__doc__ or "").strip().splitlines()[0], ""]
        lines += ["| key | default | allowed | meaning |", "|---|---|---|---|"]
        schemas = part.model_json_schema()["properties"]
        for key, field in part.model_fields.items():
            if nested(field.annotation) is None:
                default = "required" if field.is_required() else f"`{_toml(field.default)}`"
                lines.append(f"| `{key}` | {default} | {_allowed(schemas[key])} | {field.description} |")
        lines.append("")
    return "\n".join(lines)


def sections(model: type[BaseModel], above: str = "") -> Iterator[tuple[str, type[BaseModel]]]:
    """Sections below a model by dotted name; a list of sections that stand alone as well is left out."""
    alone = [
        nested(f.annotation) for f in model.model_fields.values() if get_origin(f.annotation) is not list
    ]
    for key, field in model.model_fields.items():
        inner = nested(field.annotation)
        if inner is not None and (get_origin(field.annotation) is not list or inner not in alone):
            name = f"{above}{key}" + (".NAME" if get_origin(field.annotation) is dict else "")
            yield name, inner
            yield from sections(inner, f"{name}.")


def nested(annotation: Any) -> type[BaseModel] | None:
    """Section that a key holds, alone, in a list or in a table; None for a value."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (list, dict):
        return nested(get_args(annotation)[-1])
    if get_origin(annotation) in (Annotated, Union, UnionType):
        return nested(get_args(annotation)[0])
    return None


def _allowed(schema: dict[str, Any]) -> str:
    """Choices or range of a key, from its JSON schema; empty where its type says all."""
    signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    for part in (schema, schema.get("items", {}), *schema.get("anyOf", ())):
        if "enum" in part:
            return ", ".join(f"`{_toml(value)}`" for value in part["enum"])
        limits = [f"{sign} {part[key]:g}" for key, sign in signs.items() if key in part]
        if limits:
            return " and ".join(limits)
    return ""


def _toml(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return f'"{value}"' if isinstance(value, str) else str(value)
