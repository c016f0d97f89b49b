"""Case files: a recording, a model and what to do with them, in TOML."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel, Field, PrivateAttr, ValidationError

from errorscreen.cases.case_models import (
    CalibrationSection,
    DiscoverySection,
    RecordingSection,
    RunSection,
    ScreeningSection,
    SimulationSection,
)
from errorscreen.cases.model_sections import EVENTS, DeviceSection, GridSection
from errorscreen.cases.section import Section
from errorscreen.data.recordings import Recording
from errorscreen.exceptions import InputError, check_integer, unknown_name
from errorscreen.parameters import ParameterSpace

#: Lists of further recordings, in the order in which a study has them.
_FURTHER = ("together", "held_out")
#: Keys of [recording] that a further recording does not take over.
_OWN = ("path", "name", "event_time", "t_start", "t_end", "load_level", *EVENTS)
#: What pydantic's kinds of error allow, in words.
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


class Case(Section):
    """A case: `load_case` reads it.

    Examples
    --------
    >>> case = Case.model_validate({
    ...     "recording": {"path": "r.csv", "base_mva": 737.0, "f_nominal": 60.0, "columns": {"P": {"column": "P"}}},
    ...     "device": {"type": "synchronous_machine", "parameters": {"Xd": {"nominal": 0.95, "relative": 0.4}}},
    ... })
    >>> case.parameters()["Xd"].upper, case.simulation.step
    (1.33, 0.0025)
    """

    title: str = Field(default="", description="for the report")
    recording: RecordingSection
    together: list[RecordingSection] = Field(
        default=[],
        description="further recordings of the same unit that the search for causes fits together with [recording]; "
        "keys not given are those of [recording]",
    )
    held_out: list[RecordingSection] = Field(
        default=[], description="further recordings to judge on; keys not given are those of [recording]"
    )
    device: DeviceSection | None = None
    grid: GridSection | None = None
    simulation: SimulationSection = SimulationSection()
    screening: ScreeningSection = ScreeningSection()
    calibration: CalibrationSection = CalibrationSection()
    discovery: DiscoverySection = DiscoverySection()
    run: RunSection = RunSection()
    _folder: Path = PrivateAttr(default_factory=Path)
    _source: str = PrivateAttr(default="")

    @property
    def folder(self) -> Path:
        """Folder of the case file, which its paths are relative to."""
        return self._folder

    @property
    def source(self) -> str:
        """What a message calls the case file; empty for a case that was made in Python."""
        return self._source

    @property
    def recordings(self) -> dict[str, RecordingSection]:
        """All recordings by their key: ``"recording"``, those fitted together with it, those held out."""
        found = {"recording": self.recording}
        for key in _FURTHER:
            found |= {f"{key}[{n}]": section for n, section in enumerate(getattr(self, key), start=1)}
        return found

    def parameters(self) -> ParameterSpace:
        """Candidate parameters of the device or grid with this case's values and bounds.

        Raises
        ------
        InputError
            If there is neither device nor grid, or both, the device, a parameter or a constant is unknown, a range
            excludes its nominal value, or more parameters are to be selected than there are.
        """
        if (self.device is None) == (self.grid is None):
            found = (
                "neither [device] nor [grid] is" if self.device is None else "[device] and [grid] are both"
            )
            raise InputError(f"{found} given", allowed="one of the two")
        space = (self.device or self.grid).space()  # type: ignore[union-attr]
        if self.screening.top_k is not None:
            check_integer(self.screening.top_k, "screening.top_k", high=len(space))
        return space

    def check_events(self) -> None:
        """Refuse recordings of a grid that do not say what happened and when, and of a device that do.

        Raises
        ------
        InputError
            If a recording of a grid has no `event_time`, or not one of `EVENTS`, or one of a device has something of
            that.
        """
        for where, section in self.recordings.items():
            found = list(section.events)
            if self.grid is None:
                found += ["load_level"] * (section.load_level != 1.0)
                if found:
                    raise InputError(f"{found[0]} is given", where=where, allowed="only with [grid]")
            elif len(found) != 1:
                one_of = ", ".join(f"[{where}.{key}]" for key in EVENTS)
                raise InputError(
                    f"{' and '.join(found) or 'no event'} given", where=where, allowed=f"one of {one_of}"
                )
            elif section.event_time is None:
                raise InputError(
                    "event_time is not given",
                    where=where,
                    allowed="the instant of the event in s",
                    remedy="A detected start may be a sample late, which a simulated grid would show as an error",
                )

    def check_apart(self) -> None:
        """Refuse a recording that is given twice: what is fitted cannot confirm what was fitted.

        Raises
        ------
        InputError
            If two recordings are the same columns and window of the same file.
        """
        seen: dict[Any, str] = {}
        for where, section in self.recordings.items():
            window = (Path(section.path), section.t_start, section.t_end, str(section.columns))
            if window in seen:
                raise InputError(
                    f"{section.path!r} is the file of {seen[window]} too",
                    where=where,
                    allowed="each recording once: as [recording], in [[together]] or in [[held_out]]",
                    remedy="What is fitted cannot confirm what was fitted: leave one of them out",
                )
            seen[window] = where

    def load_recording(self) -> Recording:
        """Read the recording; for errors see `errorscreen.data.read_csv`."""
        return self.recording.load(self.folder, self.simulation.dt)

    def load_together(self) -> tuple[Recording, ...]:
        """Read the recordings that are fitted together with the first one."""
        return tuple(section.load(self.folder, self.simulation.dt) for section in self.together)

    def load_held_out(self) -> tuple[Recording, ...]:
        """Read the recordings to judge on."""
        return tuple(section.load(self.folder, self.simulation.dt) for section in self.held_out)


def load_case(path: str | os.PathLike[str]) -> Case:
    """Read and check a case file; the recordings themselves are read by `Case.load_recording`.

    Parameters
    ----------
    path : path-like
        TOML file; for its sections see `case_reference`.

    Raises
    ------
    InputError
        If something cannot be used; it says the file, the key, what was found and what is allowed.
    """
    path = Path(path)
    source = f"case file {path}"
    data = _parse(path, source)
    _inherit(data)
    try:
        case = Case.model_validate(data)
        case._folder, case._source = path.parent, source
        case.parameters()
        case.check_events()
        case.check_apart()
    except ValidationError as error:
        raise _explain(error, source) from None
    except InputError as error:
        raise _placed(error, source) from None
    return case


def case_reference() -> str:
    """Table of all sections and keys in Markdown, for the documentation."""
    lines = []
    for title, model in _sections():
        lines += [f"### `{title}`", "", f"{(model.__doc__ or '').strip().splitlines()[0]}", ""]
        lines += ["| key | default | allowed | meaning |", "|---|---|---|---|"]
        schemas = model.model_json_schema()["properties"]
        for key, field in model.model_fields.items():
            if field.description and _nested(field.annotation) is None:
                default = "required" if field.is_required() else f"`{_toml(field.default)}`"
                lines.append(f"| `{key}` | {default} | {_allowed(schemas[key])} | {field.description} |")
        lines.append("")
    return "\n".join(lines)


def _parse(path: Path, source: str) -> dict[str, Any]:
    if path.is_dir() or not path.exists():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise InputError(what, where=source, allowed="a TOML file")
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"byte {error.start} is not UTF-8 text", where=source) from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            f"is not TOML: {error}",
            where=source,
            remedy="Texts need quotes, numbers a decimal point, sections [brackets]",
        ) from error
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", where=source) from error


def _inherit(data: dict[str, Any]) -> None:
    """Complete further recordings by the keys of the first one."""
    first = data.get("recording")
    common = {k: v for k, v in first.items() if k not in _OWN} if isinstance(first, dict) else {}
    for key in _FURTHER:
        if isinstance(data.get(key), list):
            data[key] = [{**common, **o} if isinstance(o, dict) else o for o in data[key]]


def _placed(error: InputError, source: str) -> InputError:
    where = f"{source}, {error.where}" if error.where else source
    return InputError(error.what, where=where, allowed=error.allowed, remedy=error.remedy)


def _explain(error: ValidationError, source: str) -> InputError:
    """One of pydantic's errors in the words of this package, with the number of the others.

    Unknown keys come first: a misspelt key is also missing. What further recordings take over is counted once.
    """
    own = [e for e in error.errors() if e["loc"][0] == "recording"]
    tails = [e["loc"][1:] for e in own]
    errors = [e for e in error.errors() if e["loc"][0] not in _FURTHER or e["loc"][2:] not in tails]
    first = min(errors, key=lambda e: e["type"] != "extra_forbidden")
    location, kind, found = first["loc"], first["type"], first["input"]
    remedy = f"{len(errors) - 1} further keys are wrong" if len(errors) > 1 else None
    where = f"{source}, {_key(location)}" if location else source
    if kind == "missing":
        above = f"{source}, [{_key(location[:-1])}]" if location[:-1] else source
        return InputError(f"{_noun(location)} {location[-1]!r} is missing", where=above, remedy=remedy)
    if kind == "extra_forbidden":
        return _unknown_key(location, source, remedy)
    context = first.get("ctx", {})
    cause = context.get("error")
    if isinstance(cause, InputError):
        return InputError(cause.what, where=where, allowed=cause.allowed, remedy=cause.remedy or remedy)
    if kind == "literal_error":
        allowed = context["expected"].replace(" or ", ", ").replace("'", "")
        return unknown_name(str(found), allowed.split(", "), kind="value", where=where, remedy=remedy)
    allowed = _ALLOWED.get(kind, first["msg"]).format(**context)
    return InputError(f"{found!r} was found", where=where, allowed=allowed, remedy=remedy)


def _unknown_key(location: tuple[int | str, ...], source: str, remedy: str | None) -> InputError:
    model = _model_at(location[:-1])
    key = str(location[-1])
    homes = [title for title, other in _sections() if key in other.model_fields and other is not model]
    if homes:
        remedy = f"{key!r} belongs to {' or '.join(homes)}"
    where = f"{source}, [{_key(location[:-1])}]" if location[:-1] else source
    return unknown_name(key, model.model_fields, kind=_noun(location), where=where, remedy=remedy)


def _noun(location: tuple[int | str, ...]) -> str:
    return "section or key" if len(location) == 1 else "key"


def _key(location: tuple[int | str, ...]) -> str:
    """Dotted key; further recordings count from 1."""
    parts = [f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in location]
    return "".join(parts).removeprefix(".")


def _model_at(location: tuple[int | str, ...]) -> type[BaseModel]:
    """Model of the section at a location; keys of a table of sections and numbers of a list are passed over."""
    model: type[BaseModel] = Case
    for part in location:
        if isinstance(part, str) and part in model.model_fields:
            model = _nested(model.model_fields[part].annotation) or model
    return model


def _nested(annotation: Any) -> type[BaseModel] | None:
    """Section that an annotation holds: itself, in a list, as the values of a table, or perhaps not at all."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (list, dict):
        return _nested(get_args(annotation)[-1])
    if get_origin(annotation) in (Union, UnionType):
        return _nested(get_args(annotation)[0])
    return None


def _sections(model: type[BaseModel] = Case, title: str = "") -> list[tuple[str, type[BaseModel]]]:
    """All sections with their TOML headings, without further recordings, whose keys are those of the first."""
    found = []
    for key, field in model.model_fields.items():
        inner = _nested(field.annotation)
        if inner is not None and key not in _FURTHER:
            heading = f"{title}{key}" + (".NAME" if get_origin(field.annotation) is dict else "")
            found += [(f"[{heading}]", inner), *_sections(inner, f"{heading}.")]
    return found


def _allowed(schema: dict[str, Any]) -> str:
    """Choices or range of a key, from its JSON schema; nothing where its type says all."""
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
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(v)}" for key, v in value.items()) + "}"
    return f'"{value}"' if isinstance(value, str) else f"{value}"
