"""Base of all sections of a case file, and types of their values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field
from pydantic_core import core_schema

from errorscreen._runtime.registry import Registry
from errorscreen.exceptions import InputError

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Count = Annotated[int, Field(ge=1)]


class Section(BaseModel):
    """Base of all sections: no unknown keys, no silent conversion of types."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def setting(default: Any, description: str, **limits: Any) -> Any:
    """Key of a section: default (`...` where it is required), meaning, and limits of `pydantic.Field`."""
    return Field(default=default, description=description, **limits)


def each_once(names: list[str]) -> list[str]:
    """Refuse a name that is given twice."""
    twice = sorted({repr(name) for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"{', '.join(twice)} was found twice", allowed="each name once")
    return names


@dataclass(frozen=True, eq=False)
class NameIn:
    """Mark of a text that must be a name in a registry."""

    registry: Registry[Any]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return core_schema.no_info_after_validator_function(self._known, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> Any:
        return {**handler(schema), "enum": list(self.registry)}

    def _known(self, name: str) -> str:
        self.registry.find(name)
        return name
