"""What all parts of ``result.json`` share."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from errorscreen._runtime.persistence import to_jsonable

#: What a recording is for: fitted, fitted together with it in the search for causes only, or only judged on.
Role = Literal["fit", "together", "held_out"]


def _finite(value: Any) -> Any:
    value = to_jsonable(value)  # NumPy numbers too
    return None if isinstance(value, float) and not math.isfinite(value) else value


#: A number, or null where there is none (a failed simulation, a channel that was not measured).
Number = Annotated[float | None, BeforeValidator(_finite)]


class Part(BaseModel):
    """Base of all parts: no unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Fit(Part):
    """How well a channel is reproduced."""

    rms: Number = Field(description="root mean square of the error, in the channel's unit")
    E: Number = Field(description="relative squared error, equation (23)")
    chi2_per_sample: Number = Field(description="mean square of the error in multiples of the noise")


class ParameterResult(Part):
    """One calibrated parameter."""

    name: str
    symbol: str = ""
    unit: str = ""
    description: str = ""
    nominal: Number
    lower: Number
    upper: Number
    scale: Number = None
    value: Number
    truth: Number = Field(default=None, description="true value, where the recording was simulated")
    low: Number = Field(default=None, description="lower end of the interval")
    high: Number = Field(default=None, description="upper end of the interval")
    at_bound: bool | None = None
    identifiable: bool | None = Field(
        default=None, description="whether the recording determines the value; null if that was not computed"
    )
