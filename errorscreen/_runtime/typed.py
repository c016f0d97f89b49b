"""Result objects as JSON: plain dataclasses, one serialiser, no second set of classes.

A number that does not exist (a failed simulation, a channel that was not measured) is NaN in Python and null in JSON.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, PlainSerializer, PlainValidator, TypeAdapter, WithJsonSchema

T = TypeVar("T")


def _number(value: Any) -> Any:
    return math.nan if value is None else value


_NUMBER = {"anyOf": [{"type": "number"}, {"type": "null"}]}
#: float, NaN and infinite numbers are null in JSON
Real = Annotated[float, BeforeValidator(_number), WithJsonSchema(_NUMBER)]
#: the same, but null is read as infinite
Limit = Annotated[
    float, BeforeValidator(lambda value: math.inf if value is None else value), WithJsonSchema(_NUMBER)
]
#: one-dimensional array of floats
Series = Annotated[
    NDArray[np.float64],
    PlainValidator(lambda value: np.asarray(value, dtype=float)),
    PlainSerializer(lambda array: np.asarray(array).tolist()),
    WithJsonSchema({"type": "array", "items": _NUMBER}),
]
#: field that is in memory only
InMemory = Annotated[T, PlainValidator(lambda value: value), Field(exclude=True)]


#: building the adapter of a class takes longer than using it
_adapter: Callable[[Any], TypeAdapter[Any]] = cache(TypeAdapter)


def to_json(value: Any) -> bytes:
    """JSON text of a result object."""
    return bytes(_adapter(type(value)).dump_json(value, indent=2))


def from_json(kind: type[T], text: bytes | str) -> T:
    """Result object of a class from its JSON text; `pydantic.ValidationError` if a value does not fit."""
    found: T = _adapter(kind).validate_json(text)
    return found


def json_schema(kind: type) -> dict[str, Any]:
    """JSON schema of what `to_json` writes for a class."""
    return _adapter(kind).json_schema(mode="serialization")
